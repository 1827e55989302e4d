"""Tables of a page: what each action is worth, as the cells that text and HTML lay out."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from trdlab.arrays import FloatArray, difference
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.formatting import amount, decimals_for, decimals_to_tell, number

if TYPE_CHECKING:  # gridworlds do without it
    from trdlab.explanations.saliency.saliency import Saliency

Row = tuple[str, ...]
_MOST_ENTRIES = 12  # of a table of what they add


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
        return (name, *values, *[amount(total, of_totals)] * has_totals, note)

    notes = [_note(moment, i) for i in range(len(moment.action_names))]
    values = moment.decomposition.components.ravel()
    decimals = max(decimals_for(values), decimals_to_tell(moment.q_values))
    of_totals = decimals_to_tell(map(moment.total, moment.action_names))
    rows = [
        row(name, moment.components(name), moment.q_value(name), moment.total(name), note, decimals)
        for name, note in zip(moment.action_names, notes, strict=True)
    ]
    styles = {name: "dim" for name in moment.action_names if name not in (action, foil)}
    if foil is not None:
        gap = moment.difference(action, foil)
        q_gap, total = (
            float(difference(of(action), of(foil))) for of in (moment.q_value, moment.total)
        )
        decimals = max(decimals, decimals_for(gap), decimals_for([q_gap]))
        of_totals = max(of_totals, decimals_for([total]))
        name = f"{action} − {foil}"
        rows.append(row(name, gap, q_gap, total, "", decimals))
        styles[name] = "italic"
    heading = ("action", *axis.labels, "Q", *["total"] * has_totals, "")
    sides = "<" + ">" * len(heading[2:]) + "<"
    return Table(heading, tuple(rows), sides, styles, axis.num_components)


def entry_table(saliency: "Saliency") -> Table | None:
    """Returns a row for each entry that counts most: what it adds to near and to far reward.

    There is none of images.
    """
    from trdlab.explanations.saliency.saliency import Entries

    of, groups = saliency.of, saliency.told
    if not isinstance(of, Entries):
        return None
    added = np.stack([of.of(group) for group in groups], axis=1)  # [F, 1 or 2]
    most = np.argsort(-np.abs(added).max(axis=1), kind="stable")[:_MOST_ENTRIES]
    decimals = decimals_for(added[most].ravel())
    rows = [
        (of.names[i], of.values[i], *(number(float(value), decimals) for value in added[i]))
        for i in sorted(most.tolist())
    ]
    labels = (f"adds to {group.label(saliency.time_axis)}" for group in groups)
    return Table(("entry", "is", *labels), tuple(rows), "<>" + ">" * len(groups))


def _note(moment: Moment, i: int) -> str:
    """Returns what stands beside an action: how likely it is chosen, or that it goes nowhere."""
    chance = 0.0 if moment.policy is None else float(moment.policy[i])
    stays = moment.stays[i] if moment.stays else 0.0
    if chance > 0.0:
        return "chosen" if chance > 0.9995 else f"chosen {100 * chance:.0f} %"
    return "stays here" if stays >= 1.0 - 1e-9 else "mostly stays" if stays > 0.5 else ""
