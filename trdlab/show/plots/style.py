"""The one style of all pictures: what colours mean, sizes, axes of steps, legends, and saving.

A colour means one thing everywhere: an action has its own whatever part it plays, agents are
violet, what really came is ink, evidence is green, red or grey. Where colour-blind eyes could mix
two up, a marker, a hatch or a line tells them apart too. All pictures are `WIDTH` wide, so that
their text can be read on a phone; they need no pyplot, and no backend of the user's.
"""

import io
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from trdlab.arrays import FloatArray
from trdlab.errors import OutputError
from trdlab.files import check_output, write_whole
from trdlab.formatting import number
from trdlab.time_axis import TimeAxis

Point = tuple[float, float]

INK = "#16202c"  # what really came (rewards, routes, trials), whiskers, and text
MUTED = "#5b6470"  # what explains: axes, notes, a policy on a map, the chance to be still running
EXPECTED, COST = "#1d3557", "#b3224a"  # rewards and costs that are expected
AGENTS = ("#4b2e83", "#b9a7dc")  # two that are compared, the dark one first
EVIDENCE = {"good": "#dcecd8", "bad": "#f8d3cf", "open": "#ececec", "not tested": "#ececec"}
"""The ground that forecasts stand on: proved, disproved, and neither."""
_MEANINGS = ("better than a guess", "no better than a guess", "open, or not tested")
_ACTIONS = (  # those of Okabe and Ito come first, and go to the directions
    *("#0072b2", "#e69f00", "#009e73", "#cc79a7"),
    *("#d55e00", "#56b4e9", "#8c6d1f", "#7f7f7f"),
)
_DIRECTIONS = (("up", "north"), ("down", "south"), ("left", "west"), ("right", "east"))

WIDTH = 6.0  # inches: where it is shown 360 pixels wide, `TEXT` is 8 pixels high
TEXT, TITLE = 10.0, 11.0  # points; nothing is smaller
LETTERS = 72  # of `TEXT` that fit beside each other
STEPS = "steps from now (t: the action taken now)"
PICTURE_SUFFIXES = (".png", ".pdf", ".svg")

_DPI = 160
_GAP = 0.6  # between the explicit components and the residual, in bars
_MOST_LETTERS = 40  # beneath one axis
_SETTINGS: Any = {
    "font.size": TEXT,
    "text.color": INK,
    "text.hinting": "none",  # with so many dots letters need none, and take half the time
    "axes.edgecolor": MUTED,
    "axes.titley": 1.0,  # there are no ticks above axes that a title would have to clear
    "hatch.linewidth": 0.8,
    "svg.hashsalt": "trdlab",  # the same bytes each time
}


class Picture(Figure):
    """A figure that looks the same whatever the user's settings say, and that notebooks show."""

    def draw(self, renderer: Any) -> None:
        with settings():
            super().draw(renderer)

    def savefig(self, *args: Any, **options: Any) -> None:
        """Saves it as any figure is, but laid out first: matplotlib draws twice for that."""
        engine = self.get_layout_engine()
        with settings():
            if engine is not None:
                engine.execute(self)
            self.set_layout_engine(None)
            try:
                super().savefig(*args, **options)
            finally:
                self.set_layout_engine(engine)

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


@contextmanager
def settings() -> Iterator[None]:
    """Lets matplotlib draw in the style of trdlab, whatever the user's settings say."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_SETTINGS)
        yield


def new_figure(height: float, title: str = "") -> Picture:
    """Returns an empty picture of a height in inches; what is drawn in it is laid out by itself."""
    figure = Picture(figsize=(WIDTH, height), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    if title:
        lines = -(-len(title) // 62)
        figure.suptitle(fill(title, len(title) // lines + 6), fontsize=TITLE)
    return figure


def check_picture(path: Path, *, overwrite: bool = False) -> None:
    """Checks that a picture can be written to a path.

    Raises:
        OutputError: unknown ending, no such folder, not writable, or the file exists.
    """
    check_output(path, PICTURE_SUFFIXES, overwrite=overwrite)


def check_pictures(paths: Iterable[Path]) -> None:
    """Checks that pictures can be written, in folders that are made if there are none.

    Raises:
        OutputError: one of them exists, or cannot be written.
    """
    for path in paths:
        if path.parent.exists() and not path.parent.is_dir():
            raise OutputError(f"'{path.parent}' is a file.", "Name a folder for the pictures.")
        if path.exists():
            raise OutputError(f"The picture '{path}' exists.", "Choose another folder.")
        if path.parent.is_dir():
            check_picture(path)


def save(figure: Figure, path: Path) -> None:
    """Writes a picture whole or not at all, in the format that the ending of its path names.

    Raises:
        OutputError: it, or its folder, cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        cause = f"Cannot make the folder '{path.parent}': {error.strerror or error}."
        raise OutputError(cause, "Choose another folder.") from error
    how: Any = {"pil_kwargs": {"compress_level": 1}} if path.suffix.lower() == ".png" else {}
    write_whole(path, lambda at: figure.savefig(at, **how))


def action_colours(names: Sequence[str]) -> dict[str, str]:
    """Returns the colour of each action of an agent; directions have the same for every agent.

    >>> colours = action_colours(["left", "stay", "up"])
    >>> colours["up"] == action_colours(["north", "south"])["north"], len(set(colours.values()))
    (True, 3)
    """
    of = {word: c for c, words in zip(_ACTIONS, _DIRECTIONS, strict=False) for word in words}
    known = {name: of[name.lower()] for name in names if name.lower() in of}
    free = [colour for colour in _ACTIONS if colour not in known.values()]
    others = [name for name in names if name not in known]
    return known | {name: free[i % len(free)] for i, name in enumerate(others)}


def told(value: float, decimals: int) -> str:
    """Returns a number as pictures show it, with a minus sign that is one."""
    return number(value, decimals).replace("-", "−")


def tidy(ax: Axes) -> Axes:
    """Gives axes the lines and the sizes of all."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=TEXT, color=MUTED)
    for axis in (ax.xaxis, ax.yaxis):
        axis.label.set(size=TEXT, color=MUTED)
    return ax


def note(ax: Axes, text: str, at: Point, shift: Point, **how: Any) -> None:
    """Writes something some points beside a place."""
    look: dict[str, Any] = {"fontsize": TEXT, "color": INK, "zorder": 7}
    ax.annotate(text, at, shift, textcoords="offset points", **look | how)


def positions(axis: TimeAxis, gap: float = _GAP) -> FloatArray:
    """Returns `[N+1]`: where components stand, in a row and the residual set apart."""
    places = np.arange(axis.num_components, dtype=np.float64)
    places[-1] += gap if axis.horizon else 0.0
    return places


def label_steps(ax: Axes, axis: TimeAxis, places: FloatArray) -> None:
    """Writes below some of the components what steps they cover, the residual among them."""
    labels, last = axis.labels, axis.horizon
    every = -(-sum(len(label) + 1 for label in labels) // _MOST_LETTERS)
    letter = (places[-1] - places[0] + 1.2) / _MOST_LETTERS  # how wide one is, in components
    free = [places[-1] - letter * ((len(label) + len(labels[-1])) / 2 + 1) for label in labels]
    shown = [i for i in range(0, last, every) if places[i] <= free[i]]
    shown.append(last)
    ax.set_xticks(places[shown], [labels[i] for i in shown])
    ax.set_xlim(places[0] - 0.6, places[-1] + 0.6)


def draw_grounds(ax: Axes, places: FloatArray, status: Sequence[str | None]) -> None:
    """Colours the ground of components by the evidence for them, where it is not None."""
    for place, found in zip(places, status, strict=True):
        if found is not None:
            ax.axvspan(place - 0.5, place + 0.5, color=EVIDENCE[found], linewidth=0, zorder=0)


def ground_handles(status: Iterable[str | None]) -> list[Patch]:
    """Returns what a legend explains of grounds: only those that there are."""
    there = {EVIDENCE[found] for found in status if found is not None}
    meanings = zip(EVIDENCE.values(), _MEANINGS, strict=False)
    return [Patch(color=colour, label=meaning) for colour, meaning in meanings if colour in there]


def add_legend(figure: Figure, handles: Sequence[Artist], *lines: str) -> None:
    """Explains marks at the foot of a picture, below lines of text, which are wrapped."""
    widest = max([1, *(len(str(handle.get_label())) + 6 for handle in handles)])
    edge: Literal["left", "center"] = "left" if len(lines) > 2 else "center"
    look: Any = {"frameon": False, "borderaxespad": 0.2, "labelspacing": 0.35, "columnspacing": 1.2}
    legend = figure.legend(
        handles=list(handles),
        loc="outside lower center",
        ncols=max(1, min(len(handles), LETTERS // widest)),
        fontsize=TEXT,
        title="\n".join(fill(line, LETTERS) for line in lines if line),
        title_fontsize=TEXT,
        alignment=edge,
        **look,
    )
    legend.get_title().set(color=MUTED, linespacing=1.3, multialignment=edge)
