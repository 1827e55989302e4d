"""Pictures for the readers of a goal study: moments with their bars or saliency, and clips."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from trdlab.rollouts.reel import Picture
from trdlab.show.plots import bars, style
from trdlab.study.goals.known import Glance, Strip

RAISES, LOWERS = style.EXPECTED, style.COST
"""The colours of what raises and what lowers that which is expected, as of rewards and costs."""
_OVER = 0.55  # of a place is hidden by its colour, at most
_PANEL, _MARGIN, _MOST_HEIGHT = 1.45, 0.45, 3.4  # inches
_MIDDLE: Any = {"ha": "center", "va": "center", "fontsize": style.TEXT}
_FRAMES = ("just before", "the reward comes", "just after")


@style.settings()
def glance_figure(glance: Glance, *, with_bars: bool, with_saliency: bool) -> Figure:
    """Returns a moment: what is seen, what that which is expected depends on, and bars of it.

    Args:
        glance: the moment.
        with_bars: whether it is shown what is expected step by step.
        with_saliency: whether it is shown what that depends on.
    """
    names = [of for of in (glance.choice.action, glance.choice.foil) if of] * with_bars
    views = ["seen", "on"] if with_saliency else ["seen", "seen"]
    top = _height(glance.picture, style.WIDTH / (2 if with_saliency else 1.6))
    heights = [top, *[_PANEL] * len(names)]
    figure = style.new_figure(sum(heights) + _MARGIN * (1 + with_bars + with_saliency))
    rows: list[Any] = [views, *([of, of] for of in names)]
    axes = figure.subplot_mosaic(rows, height_ratios=heights)
    _show(axes["seen"], glance.picture, f"step {glance.step}: here it chooses")
    if with_saliency:
        faded = 255 - (255 - glance.picture) // 2  # so that colours are seen on black, too
        _show(axes["on"], faded, "what it depends on")
        _lay_over(axes["on"], glance)
        handles = [Patch(color=RAISES, label="raises it"), Patch(color=LOWERS, label="lowers it")]
        style.add_legend(figure, handles)
    if names:
        _draw_bars([axes[name] for name in names], glance, names)
    return figure


@style.settings()
def strip_figure(strips: tuple[Strip, ...]) -> Figure:
    """Returns what a kind of reward has looked like, an example in each row."""
    height = _height(strips[0][0], style.WIDTH / len(_FRAMES))
    figure = style.new_figure(height * len(strips) + _MARGIN)
    rows = figure.subplots(len(strips), len(_FRAMES), squeeze=False)
    for i, (axes, strip) in enumerate(zip(rows, strips, strict=True)):
        for ax, frame, title in zip(axes, strip, _FRAMES, strict=True):
            blank = np.full_like(strip[0], 255)
            _show(ax, blank if frame is None else frame, "" if i else title)
            if frame is None:
                ax.text(0.5, 0.5, "the episode\nis over", transform=ax.transAxes, **_MIDDLE)
    return figure


def _height(picture: Picture, width: float) -> float:
    """Returns how many inches high a picture of a width is, but not too many."""
    height, across, _ = picture.shape
    return min(_MOST_HEIGHT, float(width * height / across))


def _show(ax: Axes, picture: Picture, title: str) -> None:
    ax.set_axis_off()
    ax.set_title(title, fontsize=style.TEXT)
    ax.imshow(picture)


def _lay_over(ax: Axes, glance: Glance) -> None:
    assert glance.saliency is not None
    height, width, _ = glance.picture.shape
    veil = np.zeros((*glance.saliency.shape, 4))
    for sign, colour in ((1.0, RAISES), (-1.0, LOWERS)):
        of = sign * glance.saliency > 0.0
        veil[of, :3] = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    veil[..., 3] = _OVER * np.abs(glance.saliency)
    ax.imshow(veil, extent=(-0.5, width - 0.5, height - 0.5, -0.5), interpolation="nearest")


def _draw_bars(axes: list[Axes], glance: Glance, names: list[str]) -> None:
    """Draws what is expected of the action and of its foil, on one scale."""
    moment, axis = glance.choice.moment, glance.choice.time_axis
    scale = bars.scale_of(np.stack([moment.components(name) for name in names]))
    told = ("which it takes", "the next best")
    for ax, name, role in zip(axes, names, told, strict=False):
        bars.plot_components(
            ax, moment.components(name), axis, colour=(RAISES, LOWERS), scale=scale
        )
        ax.set_title(f"{name}, {role}", fontsize=style.TITLE, loc="left")
        ax.tick_params(labelbottom=ax is axes[-1])
    axes[-1].set_xlabel(style.STEPS)
    axes[0].set_ylabel("expected reward", loc="top")
