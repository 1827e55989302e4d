"""Tables of a page: what each action is worth, as the cells that text and HTML lay out."""

from collections.abc import Mapping
from typing import NamedTuple

from trdlab.arrays import FloatArray, same
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.formatting import amount, decimals_for, decimals_to_tell, number

Row = tuple[str, ...]


class Table(NamedTuple):
    """Rows of cells; the first cell says what a row is about.

    Args:
        heading: of each column, empty where it needs none.
        rows: of as many cells.
        sides: of each column, as format strings have it: `<` is left, `>` is right.
        styles: of the rows that have one, by their first cells.
        components: how many columns, after the first, are components: a terminal shows them as one
            vector, and leaves those in the middle out where there is no room.
    """

    heading: Row
    rows: tuple[Row, ...]
    sides: str
    styles: Mapping[str, str] = {}
    components: int = 0


def action_table(choice: Choice) -> Table | None:
    """Returns a row per action: components, Q, undiscounted total; and the contrast below them.

    There are no totals where none are known, and no table where the episode is over.
    """
    if choice.moment.is_over:
        return None
    moment, action, foil = choice.moment, choice.action, choice.foil
    axis, has_totals = choice.time_axis, moment.totals is not None

    def row(name: str, components: FloatArray, q: float, total: float, note: str, of: int) -> Row:
        values = (number(float(value), of) for value in (*components, q))
        return (name, *values, *[amount(total)] * has_totals, note)

    values = moment.decomposition.components.ravel()
    decimals = max(decimals_for(values), decimals_to_tell(moment.q_values))
    rows = [
        row(name, moment.components(name), moment.q_value(name), moment.total(name), note, decimals)
        for name, note in zip(moment.action_names, _notes(moment), strict=True)
    ]
    styles = {name: "dim" for name in moment.action_names if name not in (action, foil)}
    if foil is not None:
        gap, q_gap = moment.difference(action, foil), _gap(moment, action, foil)
        total = moment.total(action) - moment.total(foil)
        decimals = max(decimals, decimals_for(gap), decimals_for([q_gap]))
        name = f"{action} − {foil}"
        rows.append(row(name, gap, q_gap, total, "", decimals))
        styles[name] = "italic"
    heading = ("action", *axis.labels, "Q", *["total"] * has_totals, "")
    sides = "<" + ">" * len(heading[2:]) + "<"
    return Table(heading, tuple(rows), sides, styles, axis.num_components)


def _gap(moment: Moment, action: str, foil: str) -> float:
    a, b = moment.q_value(action), moment.q_value(foil)
    return 0.0 if same(a, b) else a - b


def _notes(moment: Moment) -> list[str]:
    """Returns what stands beside each action: how likely it is chosen, or that it goes nowhere."""
    nothing = [0.0] * len(moment.action_names)
    chances = nothing if moment.policy is None else moment.policy.tolist()
    return [
        _note(chance, stays) for chance, stays in zip(chances, moment.stays or nothing, strict=True)
    ]


def _note(chance: float, stays: float) -> str:
    if chance > 0.0:
        return "chosen" if chance > 0.9995 else f"chosen {100 * chance:.0f} %"
    return "stays here" if stays >= 1.0 - 1e-9 else "mostly stays" if stays > 0.5 else ""
