"""Explanations as text for a terminal, in rich renderables."""

from collections.abc import Collection, Iterable

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from trdlab.decomposition import TimeAxis
from trdlab.explanations.moment.explanation import Explanation
from trdlab.explanations.moment.leads import difference
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.sentences import sentence
from trdlab.formatting import amount, decimals_for, number

_MOST_COMPONENTS = 16
_SECTIONS = (
    ("contrast", "{action} against {foil}"),
    ("flips", "What would change that"),
    ("forecast", "What {action} promises"),
    ("limits", "How far to trust it"),
    ("context", "Whose future"),
)
_ASCII = str.maketrans({"…": "..", "∞": "inf", "γ": "gamma", "·": "-", "−": "-", "✓": "OK:"})


def fit(text: str, *, ascii_only: bool) -> str:
    """Returns a text that any terminal can print, if it has to be."""
    return text.translate(_ASCII).encode("ascii", "replace").decode() if ascii_only else text


def paragraph(text: str, style: str = "", indent: int = 0, *, ascii_only: bool) -> RenderableType:
    """Returns a text of which every line is indented."""
    return Padding(Text(fit(text, ascii_only=ascii_only), style=style), (0, 0, 0, indent))


def action_table(
    moment: Moment, action: str, foil: str | None = None, *, ascii_only: bool = False
) -> Table:
    """Returns a row per action: components, Q, undiscounted total; and the contrast below them.

    There are no totals where none are known.

    Args:
        moment: what is shown.
        action: the name of the explained action.
        foil: the name of the action it is contrasted with.
        ascii_only: for terminals without UTF-8.
    """
    decimals = decimals_for(moment.decomposition.components.ravel())
    header = f"components: {axis_labels(moment.time_axis)}"
    table = Table(box=None, padding=(0, 3, 0, 0), header_style="bold", pad_edge=False)
    table.add_column("action", no_wrap=True)
    table.add_column(fit(header, ascii_only=ascii_only))
    table.add_column("Q", justify="right", no_wrap=True)
    if moment.totals is not None:
        table.add_column("total", justify="right", no_wrap=True)
    table.add_column("")

    def add(name: str, row: Iterable[float], q: float, total: float, note: str, style: str) -> None:
        totals = [] if moment.totals is None else [amount(total)]
        cells = [name, vector(row, decimals), number(q, decimals), *totals, note]
        table.add_row(*(Text(fit(cell, ascii_only=ascii_only)) for cell in cells), style=style)

    for i, name in enumerate(moment.action_names):
        style = "" if name in (action, foil) else "dim"
        row = moment.components(name)
        add(name, row, moment.q_value(name), moment.total(name), _note(moment, i), style)
    if foil is not None:
        gap = moment.q_value(action) - moment.q_value(foil)
        total = moment.total(action) - moment.total(foil)
        add(f"{action} − {foil}", difference(moment, action, foil), gap, total, "", "italic")
    return table


def story(
    explanation: Explanation,
    *,
    sections: Collection[str] | None = None,
    ascii_only: bool = False,
) -> RenderableType:
    """Returns the findings as paragraphs under short headings.

    Args:
        explanation: what is told.
        sections: the fields of it that are; by default all.
        ascii_only: for terminals without UTF-8.
    """
    parts: list[RenderableType] = []
    for field, heading in _SECTIONS:
        findings = getattr(explanation, field)
        if not findings or (sections is not None and field not in sections):
            continue
        title = heading.format(action=explanation.action, foil=explanation.foil)
        parts.append(Text(title[0].upper() + title[1:], style="bold"))
        for finding in findings:
            text = sentence(finding, explanation)
            parts.append(paragraph(text, indent=2, ascii_only=ascii_only))
    return Group(*parts)


def axis_labels(axis: TimeAxis) -> str:
    """Returns what the components cover, shortened where there are many.

    >>> axis_labels(TimeAxis(0.95, 2, 2)), axis_labels(TimeAxis(0.95, 40))
    ('t…t+1, t+2…t+3, t+4…∞', 't, t+1, …, t+39, t+40…∞')
    """
    names = axis.labels
    return ", ".join(names if len(names) <= 6 else (*names[:2], "…", *names[-2:]))


def vector(components: Iterable[float], decimals: int) -> str:
    """Returns components as the paper prints them, the middle of a long vector left out."""
    shown = [number(float(c), decimals) for c in components]
    if len(shown) > _MOST_COMPONENTS:
        shown = [*shown[: _MOST_COMPONENTS - 2], "…", shown[-1]]
    return f"[{', '.join(shown)}]"


def _note(moment: Moment, action: int) -> str:
    chance = 0.0 if moment.policy is None else float(moment.policy[action])
    if chance > 0.0:
        return "chosen" if chance > 0.9995 else f"chosen {100 * chance:.0f} %"
    stays = moment.changes_state is not None and not moment.changes_state[action]
    return "stays here" if stays else ""
