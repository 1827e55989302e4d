"""The reward gallery as a picture: a row for each group of rewards that look alike."""

from collections.abc import Sequence
from textwrap import fill

from matplotlib.figure import Figure

from trdlab.explanations.gallery.claims import group_claims
from trdlab.explanations.gallery.gallery import Came, Gallery
from trdlab.rollouts.reel import Reel
from trdlab.show.plots import style

AROUND = (-2, 0, 1, 3)
"""The pictures of a reward: how many steps from the one at which it was earned."""
_MOST_GROUPS = 4
_ROW = 1.9  # inches


@style.settings()
def gallery_figure(
    gallery: Gallery, reel: Reel, title: str = "", *, groups: int = _MOST_GROUPS
) -> Figure:
    """Returns the picture of rewards that came: an example of each group, before and after.

    Where there is nothing to see, each row is a sentence.

    Args:
        gallery: the rewards.
        reel: the pictures of its episodes.
        title: of the picture.
        groups: how many are drawn, of the commonest.
    """
    told = [claim.sentence for claim in group_claims(gallery)][:groups]
    figure = style.new_figure(_ROW * len(told) + 0.4, title)
    parts = figure.subfigures(len(told), 1, squeeze=False)[:, 0]
    for number, (part, sentence) in enumerate(zip(parts, told, strict=True)):
        part.suptitle(fill(sentence, style.LETTERS), fontsize=style.TEXT)
        if gallery.groups:
            came = gallery.came[gallery.groups[number].members[0]]
            _draw(part.subplots(1, len(AROUND)), came, gallery, reel)
    return figure


def _draw(axes: Sequence[object], came: Came, gallery: Gallery, reel: Reel) -> None:
    pictures = gallery.recorded[came.episode].pictures
    for ax, k in zip(axes, AROUND, strict=True):
        ax.set_axis_off()  # type: ignore[attr-defined]
        if 0 <= came.step + k < len(pictures):
            ax.imshow(reel[pictures[came.step + k]])  # type: ignore[attr-defined]
            words = f"{1 - k} before" if k < 1 else "reward" if k == 1 else f"{k - 1} after"
            ax.set_title(words, fontsize=style.TEXT)  # type: ignore[attr-defined]
