"""Two agents compared, in English sentences that can be read back, and as a page."""

import math
import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table

from trdlab.arrays import FloatArray
from trdlab.explanations.claims import Claim
from trdlab.explanations.comparison import background, differences
from trdlab.explanations.comparison.differences import ComparisonFinding
from trdlab.explanations.comparison.findings import comparison_findings
from trdlab.explanations.comparison.report import SIDES, Comparison
from trdlab.explanations.slots import Form, Language, forms_of
from trdlab.formatting import decimals_for, number
from trdlab.show.page import fit, paragraph, vector
from trdlab.statistics import Estimate
from trdlab.time_axis import axis_title

FURTHEST = 3
"""How many of the largest disagreements are shown."""

_MOST_ROWS = 12

TEMPLATES: dict[type[Claim], str] = {
    differences.NothingDiffers: (
        "They expect the same of every action at every state they were compared at."
    ),
    differences.ExpectsMore: (
        "{more:side} expects more in all than {less:side}: {more_value:value} against "
        "{less_value:value} on average."
    ),
    differences.NeitherSurelyMore: (
        "In all A expects {first_value:value} on average and B {second_value:value}; other "
        "episodes could turn that round."
    ),
    differences.SameInAll: "In all both expect {value:value} on average.",
    differences.LargestAt: (
        "The largest difference is at {component:when}: there {more:side} expects {by:value} more "
        "than {less:side} on average."
    ),
    differences.MostAt: "Of what they differ by, {share:percent} lies at {component:label}.",
    differences.MostBetween: (
        "Of what they differ by, {share:percent} lies from {begin:begin} to {last_step:step}."
    ),
    differences.MostFrom: "Of what they differ by, {share:percent} lies from {begin:begin} on.",
    differences.LaterRewards: (
        "{later:side} expects its rewards later than {sooner:side}: by {last_step:step}, "
        "{later_share:percent} of those of {later:side} have come, and {sooner_share:percent} of "
        "those of {sooner:side}, counted as they are worth now."
    ),
    differences.LaterCosts: (
        "{later:side} expects its costs later than {sooner:side}: by {last_step:step}, "
        "{later_share:percent} of those of {later:side} have come, and {sooner_share:percent} of "
        "those of {sooner:side}, counted as they are worth now."
    ),
    differences.ComeBy: (
        "By {last_step:step}, {first_share:percent} of what A expects has come, and "
        "{second_share:percent} of what B expects, counted as it is worth now."
    ),
    differences.Agreement: (
        "They would take the same action at {share:percent} of the states they were compared at."
    ),
    differences.FurthestApart: (
        "They are furthest apart, by {distance:value} over all components, at step {step:number} "
        "of the episode that {side:side} plays with seed {seed:number}: there A expects "
        "{first_value:value} of {first_action} and B {second_value:value} of {second_action}."
    ),
    differences.OfAnyAction: (
        "Asked about one and the same action they differ by {distance:value} on average, over all "
        "components."
    ),
    background.TrustedUpTo: "The forecasts of {side:side} can be trusted to {step:until}.",
    background.TrustedAllAlong: (
        "The forecasts of {side:side} can be trusted over their whole horizon, to {step:until}."
    ),
    background.TrustedNowhere: "The forecasts of {side:side} cannot be trusted at any step.",
    background.TooFewToJudge: (
        "Too few different episodes tell how far to trust the forecasts of {side:side}: "
        "{episodes:count}."
    ),
    background.NeverTested: (
        "There was nothing to predict in the episodes of {side:side}: the reward was always the "
        "same."
    ),
    background.EachTells: (
        "Each tells of its own future, that of {policy:text}; it counts the {reward:text} and ends "
        "at {ending:text}."
    ),
    background.OneTells: (
        "{side:side} tells of the future of {policy:text}; it counts the {reward:text} and ends at "
        "{ending:text}."
    ),
    background.ComparedAt: (
        "They were compared at {states:count} states: one half from {episodes:episodes} that A "
        "played, one half from as many that B played."
    ),
    background.SomeCutOff: "Cut off after {steps:steps} each: {episodes:episodes}.",
    background.AllAlike: (
        "Different episodes among these: {different:count}, too few to tell of others."
    ),
}


def _forms(comparison: Comparison) -> dict[str, Form]:
    usual = forms_of(comparison.time_axis, comparison.action_names, comparison.seconds_per_step)
    return usual | {
        "side": Form(lambda side, _: str(side), "|".join(SIDES), str),
        "number": Form(lambda count, _: str(count), r"\d+", int),
    }


LANGUAGE = Language[Comparison](TEMPLATES, _forms, about="this comparison")


def comparison_sentences(comparison: Comparison) -> list[str]:
    """Returns the findings of a comparison as sentences, what matters most first."""
    return [LANGUAGE.say(finding, comparison) for finding in comparison_findings(comparison)]


def check_comparison(text: str, comparison: Comparison) -> list[Claim]:
    """Reads a rendered text back, tests each claim against a comparison, and returns the claims.

    Args:
        text: sentences as `comparison_sentences` renders them, separated by white space.
        comparison: what they speak of; only its numbers are consulted.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    return LANGUAGE.check(text, comparison)


# ---- for people ---------------------------------------------------------------------------------

_BENEATH = (
    "each-tells",
    "one-tells",
    "compared-at",
    "some-cut-off",
    "all-alike",
)  # what the rest stands on
_IN_DETAIL = ("furthest-apart",)  # told below


def page(comparison: Comparison, *, ascii_only: bool = False) -> RenderableType:
    """Returns a comparison as text: what matters most, the components, the largest disagreements.

    Args:
        comparison: what is told.
        ascii_only: for terminals without UTF-8.
    """
    lines: list[RenderableType] = []

    def add(text: str, style: str = "", indent: int = 0) -> None:
        lines.append(paragraph(text, style, indent, ascii_only=ascii_only))

    def tell(findings: Sequence[ComparisonFinding]) -> None:
        for finding in findings:
            add(LANGUAGE.say(finding, comparison))

    found = comparison_findings(comparison)
    add(" · ".join(titles(comparison)), "bold")
    add(_setting(comparison), "dim")
    add("")
    tell([finding for finding in found if finding.kind() not in (*_BENEATH, *_IN_DETAIL)])
    if comparison.visits.apart.any():
        count = comparison.time_axis.num_components
        few = f" (the {_MOST_ROWS} of {count} components that differ most)"
        add("")
        add(f"What each expects of what it would do{few if count > _MOST_ROWS else ''}", "bold")
        lines.append(_table(comparison, ascii_only=ascii_only))
        add("")
        add("Where they are furthest apart", "bold")
    for m in comparison.visits.furthest(FURTHEST):
        for text, indent in _moment(comparison, m):
            add(text, indent=indent)
    add("")
    tell([finding for finding in found if finding.kind() in _BENEATH])
    return Group(*lines)


def titles(comparison: Comparison) -> list[str]:
    """Returns who A and who B is; in full where their names do not tell."""
    names: Sequence[str] = comparison.names
    if names[0] == names[1] and all(comparison.words):
        names = [words[0] for words in comparison.words]
    return [f"{side}: {name}" for side, name in zip(SIDES, names, strict=True)]


def explain_command(comparison: Comparison, m: int) -> str:
    """Returns the command that explains a state, empty where the agents have no such names.

    Args:
        comparison: of two agents.
        m: the number of the state.
    """
    visits = comparison.visits
    words = comparison.words[visits.player[m]]
    where = ("--seed", str(visits.seed[m]), "--step", str(visits.step[m]))
    return shlex.join(("trdlab", "explain", *words, *where)) if words else ""


def _setting(comparison: Comparison) -> str:
    words = [axis_title(comparison.time_axis)]
    if comparison.place:
        env, *arguments = comparison.place[1::2]
        made = f" with {', '.join(arguments)}" if arguments else ""
        words.append(f"both act in {env}{made}")
    if comparison.seconds_per_step is not None:
        words.append(f"a step is {comparison.seconds_per_step:.2g} s of play")
    return " · ".join(words)


def _table(comparison: Comparison, *, ascii_only: bool) -> Table:
    means, difference, axis = comparison.means.value, comparison.difference, comparison.time_axis
    decimals = decimals_for([*means.ravel(), *difference.value])
    has_intervals = not math.isnan(comparison.gap.low)
    table = Table(box=None, padding=(0, 3, 0, 0), header_style="bold", pad_edge=False)
    for heading in ("steps", *SIDES, "B − A", *(["95 % interval"] if has_intervals else [])):
        justify: Any = "left" if heading == "steps" else "right"
        table.add_column(fit(heading, ascii_only=ascii_only), justify=justify, no_wrap=True)

    def add(label: str, values: FloatArray, estimate: Estimate, style: str = "") -> None:
        cells = [label, *(number(float(x), decimals) for x in (*values, estimate.value))]
        if has_intervals:
            ends = (number(end, decimals) for end in (estimate.low, estimate.high))
            cells.append(" to ".join(ends))
        table.add_row(*(fit(cell, ascii_only=ascii_only) for cell in cells), style=style)

    for c in _rows(comparison) if axis.horizon else ():
        add(axis.label(c), means[:, c], difference[c])
    add("in all", means.sum(axis=1), comparison.gap, "bold")
    return table


def _rows(comparison: Comparison) -> list[int]:
    """Returns the components that are shown: all, or of many those that differ most."""
    order = np.argsort(-comparison.apart.value, kind="stable")
    return sorted(order[:_MOST_ROWS].tolist())


def _moment(comparison: Comparison, m: int) -> list[tuple[str, int]]:
    """Returns the lines about a state, with their indents."""
    visits = comparison.visits
    side, names = SIDES[visits.player[m]], comparison.action_names
    decimals = decimals_for(visits.expected[:, m].ravel())
    width = max(len(names[a]) for a in visits.actions[:, m])
    where = f"Step {visits.step[m]} of the episode that {side} plays with seed {visits.seed[m]}"
    lines = [(where, 2)]
    for i, own in enumerate(SIDES):
        row = visits.expected[i, m]
        action = names[visits.actions[i, m]].ljust(width)
        worth = number(float(row.sum()), decimals)
        lines.append((f"{own}  {action}  {vector(row, decimals)}  {worth} in all", 4))
    command = explain_command(comparison, m)
    return [*lines, *([(command, 4)] if command else [])]
