"""What matters for near and for far reward: maps over the screen, and bars of entries."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from trdlab.arrays import FloatArray
from trdlab.explanations.saliency.belief import caption
from trdlab.explanations.saliency.groups import Group
from trdlab.explanations.saliency.maps import SaliencyMap, SaliencyMaps, enlarged
from trdlab.explanations.saliency.saliency import Entries, Places, Saliency
from trdlab.show.plots import style
from trdlab.time_axis import axis_title

RAISES, LOWERS = "#ffb000", "#3fb7ff"
"""On a darkened screen: what is seen there raises what is expected, or lowers it."""
NEAR, FAR = style.EXPECTED, "#e69f00"
"""Bars of near and of far reward."""

_LIGHT, _GREY = 0.55, 0.5  # of the screen below a map: how light, and how grey
_FADED = 0.3  # of a map that is not trusted
_COLUMNS = 7  # of a grid of all components
_MOST_BARS = 12
_DOUBT = "not trusted"


@style.settings()
def saliency_figure(saliency: Saliency) -> Figure:
    """Returns the picture of what matters.

    Of images that is the screen with maps: near, far and their difference, by GradCAM and by
    hiding; one map by both; or all components in a grid. Of vectors it is a bar for each entry.
    """
    if isinstance(saliency.of, Entries):
        return _entries(saliency, saliency.of)
    if len(saliency.groups) > 2:
        return _grid(saliency, saliency.of)
    return _screens(saliency, saliency.of)


def overlay(screen: NDArray[np.uint8], scaled: FloatArray, *, faded: bool = False) -> FloatArray:
    """Returns a darkened screen with a map over it: `[H, W, 3]`, from 0 to 1.

    Args:
        screen: `[H, W, 3]`.
        scaled: `[h, w]`, from −1 to 1; it is enlarged.
        faded: whether the map is not trusted.
    """
    colours = screen.astype(np.float64) / 255.0
    grey = colours.mean(axis=2, keepdims=True)
    below = _LIGHT * (_GREY * grey + (1.0 - _GREY) * colours)
    found = enlarged(scaled, *screen.shape[:2])[..., None]  # [H, W, 1]
    strength = np.abs(found) * (_FADED if faded else 1.0)
    hue = np.where(found > 0.0, to_rgb(RAISES), to_rgb(LOWERS))
    return np.asarray(np.clip(below * (1.0 - strength) + hue * strength, 0.0, 1.0))


def plot_saliency(
    ax: Axes, of: SaliencyMap, screen: NDArray[np.uint8], note: str = "", *, faded: bool = False
) -> Axes:
    """Draws a map over a screen on `ax`, which is returned.

    Args:
        ax: the axes.
        of: the map; it is drawn as shares of its largest strength.
        screen: `[H, W, 3]`.
        note: what stands below it.
        faded: whether it is not trusted.
    """
    ax.imshow(overlay(screen, of.scaled, faded=faded), interpolation="nearest")
    ax.set(xticks=(), yticks=())
    ax.spines[:].set_visible(False)
    ax.set_title(f"{of.label}, {_DOUBT}" if faded else of.label, fontsize=style.TEXT, pad=3)
    ax.set_xlabel(note, fontsize=style.TEXT, color=style.COST if "failed" in note else style.MUTED)
    return ax


def plot_entries(ax: Axes, saliency: Saliency) -> Axes:
    """Draws what each entry adds to near and far reward as bars on `ax`, which is returned.

    Raises:
        TypeError: the agent sees images, which have no entries.
    """
    of, groups = saliency.of, saliency.told
    if not isinstance(of, Entries):
        raise TypeError("images have maps")
    added = np.stack([of.of(group) for group in groups], axis=1)  # [F, 1 or 2]
    scaled = added / np.maximum(np.abs(added).sum(axis=0), np.finfo(np.float64).tiny)
    most = np.sort(np.argsort(-np.abs(scaled).max(axis=1), kind="stable")[:_MOST_BARS])
    places, height = np.arange(len(most)), 0.8 / len(groups)
    for g, group in enumerate(groups):
        doubt = f" ({_DOUBT})" if saliency.is_doubtful(group) else ""
        at = places + (g - 0.5 * (len(groups) - 1)) * height
        label = f"{group.label(saliency.time_axis)}{doubt}"
        colour, alpha = (NEAR, FAR)[g], 0.4 if doubt else 1.0
        ax.barh(at, 100.0 * scaled[most, g], height, label=label, color=colour, alpha=alpha)
    ax.set_yticks(places, [f"{of.names[i]} = {of.values[i]}" for i in most])
    ax.invert_yaxis()
    ax.axvline(0.0, color=style.MUTED, linewidth=0.8)
    ax.set_xlabel("share of all that the entries add (right) or take (left), in %")
    return style.tidy(ax)


def _entries(saliency: Saliency, of: Entries) -> Figure:
    shown = min(_MOST_BARS, len(of.names))
    figure = style.new_figure(1.9 + 0.42 * shown, _title(saliency))
    handles, _ = plot_entries(figure.subplots(), saliency).get_legend_handles_labels()
    style.add_legend(figure, handles, axis_title(saliency.time_axis), *_captions(saliency))
    return figure


def _screens(saliency: Saliency, of: Places) -> Figure:
    """Returns maps by GradCAM and by hiding: a row each, or one beside the other."""
    screen, pair = screen_of(of), saliency.pair
    tall = screen.shape[0] / screen.shape[1]
    if pair is None:
        figure = style.new_figure(1.5 + 2.7 * tall, _title(saliency))
        axes = np.atleast_2d(figure.subplots(1, 2)).T  # [2, 1]
    else:
        figure = style.new_figure(1.5 + 2.0 * (0.45 + 1.75 * tall), _title(saliency))
        axes = figure.subplots(2, 3)
    both = (of.maps, f"{of.made}, convolution {of.layer}"), (of.hidden, "hiding patches")
    for row, (maps, method) in enumerate(both):
        for ax, group in zip(axes[row], saliency.groups, strict=False):
            note = caption(saliency, group).replace(", ", "\n") if row == 0 else ""
            faded = saliency.is_doubtful(group)
            plot_saliency(ax, maps.of(group), screen, note, faded=faded)
        if pair is not None:
            faded = any(map(saliency.is_doubtful, pair))
            plot_saliency(axes[row, 2], _difference(maps, pair), screen, faded=faded)
            if row:  # the titles stand above the first row
                for ax in axes[row]:
                    ax.set_title("")
        axes[row, 0].set_ylabel(method, fontsize=style.TEXT, color=style.MUTED)
    _explain(figure, saliency, pair is not None)
    return figure


def _difference(maps: SaliencyMaps, pair: tuple[Group, Group]) -> SaliencyMap:
    found = maps.paper_difference(*pair)
    return SaliencyMap(found.signed, "far − near")


def _grid(saliency: Saliency, of: Places) -> Figure:
    """Returns all components, each with its label; what is not trusted is faded."""
    screen, rows = screen_of(of), -(-len(saliency.groups) // _COLUMNS)
    tall = screen.shape[0] / screen.shape[1]
    figure = style.new_figure(1.3 + rows * (0.25 + 0.82 * tall), _title(saliency))
    axes = figure.subplots(rows, _COLUMNS, squeeze=False).ravel().tolist()
    for ax in axes[len(saliency.groups) :]:
        ax.axis("off")
    for ax, group in zip(axes, saliency.groups, strict=False):
        faded = saliency.is_doubtful(group)
        plot_saliency(ax, of.maps.of(group), screen, faded=faded)
        ax.set_title(group.label(saliency.time_axis), fontsize=style.TEXT, pad=2)
    _explain(figure, saliency, False)
    return figure


def _explain(figure: Figure, saliency: Saliency, has_difference: bool) -> None:
    """Says below a picture what colours mean, and whether to believe them."""
    more = ("; more for far reward", "; more for near reward") if has_difference else ("", "")
    handles = [
        Patch(color=RAISES, label=f"raises it{more[0]}"),
        Patch(color=LOWERS, label=f"lowers it{more[1]}"),
    ]
    lines = [axis_title(saliency.time_axis)]
    if has_difference:
        lines.append("far − near, as in the paper: what raises, as shares of its largest")
    if len(saliency.groups) > 2:
        lines += _captions(saliency)
    style.add_legend(figure, handles, *lines)


def _captions(saliency: Saliency) -> list[str]:
    """Returns of each group that is told of whether to believe it; nothing where all is certain."""
    axis, of = saliency.time_axis, saliency.of
    if isinstance(of, Entries) and of.method != "gradients":
        return []
    return [f"{group.label(axis)}: {caption(saliency, group)}" for group in saliency.told]


def _title(saliency: Saliency) -> str:
    moment = f"step {saliency.step} of the episode with seed {saliency.seed}"
    return f"{saliency.agent.name}, {moment}: what matters for {saliency.about}"


def screen_of(of: Places) -> NDArray[np.uint8]:
    """Returns what people see of what an agent sees: the screen, or else the newest frame."""
    if of.screen is not None:
        return of.screen
    newest = of.seen if len(of.seen) == 3 else of.seen[-1:].repeat(3, axis=0)
    return np.ascontiguousarray(np.moveaxis(newest, 0, -1))
