"""Faults: what is wrong with a forecast, where the data tell it from the alternatives."""

from collections.abc import Iterator

import numpy as np

from trdlab.explanations.calibration.consistency import Consistency
from trdlab.explanations.calibration.errors import LEAST_SMEAR, is_off
from trdlab.explanations.calibration.errors import SLACK as AMOUNT
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.rules import Claim, Fields, Form, Language, every
from trdlab.explanations.words import forms_of
from trdlab.statistics import FEWEST_EPISODES

EXPLAINED = 0.95
"""The share of what is wrong between components that a fault must account for, to be named."""

_ROUNDING = 1e-6  # relative to the largest component; networks have seven digits


def _forms(report: CalibrationReport) -> dict[str, Form]:
    axis = report.time_axis
    forms = forms_of(axis, report.seconds_per_step)

    def comes(span: tuple[int, int], digits: int) -> str:
        is_all = axis.start(span[0]) == 0 and axis.steps(span[1]) is None
        return (
            "everything that comes" if is_all else f"what comes {forms['span'].show(span, digits)}"
        )

    return forms | {"comes": Form(comes)}


REPORTS = Language[CalibrationReport]("this report", _forms)

# ---- timing and amount ---------------------------------------------------------------------------


@REPORTS.rule("The agent expects rewards {steps:steps} too {late:text}.")
def mistimed(report: CalibrationReport) -> Iterator[Fields]:
    if report.errors is not None and (shift := report.errors.shift):
        late = "late" if shift > 0 else "early"
        yield {"steps": abs(shift) * report.time_axis.width, "late": late}


@REPORTS.rule("{span:span} the agent expects {share:number} times what comes.")
def amount_off(report: CalibrationReport) -> Iterator[Fields]:
    if report.errors is not None and is_off(report.errors.amount):
        yield {"span": (0, report.time_axis.horizon - 1), "share": report.errors.amount.value}


@REPORTS.rule(
    "The agent expects {amount:text} of {span:comes}: {said:number} on average, where "
    "{came:number} came."
)
def off_from(report: CalibrationReport) -> Iterator[Fields]:
    """Near components are not surely off by a tenth; all others are, to the same side."""
    if report.errors is None or report.errors.shift or not is_off(report.errors.amount):
        return
    told, explicit = report.calibration, report.time_axis.horizon
    tested = np.flatnonzero(~told.is_("not tested")[:explicit])
    bias, much = told.bias, np.abs(told.bias.value) > AMOUNT * np.abs(told.mean)
    sides = much * ((bias.low > 0.0) * 1 - (bias.high < 0.0))
    end = int(tested[-1]) + 1 if tested.size else 0
    begin = end - int(np.append(sides[:end][::-1] != sides[end - 1], True).argmax())
    if 0 < begin < end and sides[end - 1] and not sides[:begin].any():
        came = float(told.mean[begin:end].sum())
        said = came + float(told.bias.value[begin:end].sum())
        amount = "too much" if abs(said) > abs(came) else "too little"
        yield {"span": (begin, end - 1), "said": said, "came": came, "amount": amount}


@REPORTS.rule(
    "The agent spreads rewards over the steps before and after, more than their timing is "
    "uncertain."
)
def smeared(report: CalibrationReport) -> Iterator[Fields]:
    if report.errors is not None and report.errors.smear.low > LEAST_SMEAR and not faults(report):
        yield {"smear": report.errors.smear}


@REPORTS.kinds(
    {
        "overestimates": (
            "The agent expects up to {said:number}: too much, for at most {most:number} can come "
            "if no step pays more than {reward:number}, the most seen."
        ),
        "underestimates": (
            "The agent expects as little as {said:number}: too little, for at least {least:number} "
            "comes if no step pays less than {reward:number}, the least seen."
        ),
    }
)
def beyond(report: CalibrationReport) -> Iterator[tuple[str, Fields]]:
    """Expectations of more, or less, than if every step paid the most, or the least, that one did.

    Few episodes without any reward, or without any cost, do not tell that none can come.
    """
    (least, most), paid = report.calibration.predicted_range[:, -1].tolist(), report.judged
    whole, slack = 1.0 / (1.0 - report.time_axis.gamma), _ROUNDING * report.scale
    is_few = paid.different < FEWEST_EPISODES
    if most > (limit := max(paid.most, 0.0) * whole) + slack and not (is_few and not limit):
        yield "overestimates", {"said": most, "most": limit, "reward": paid.most}
    if least < (limit := min(paid.least, 0.0) * whole) - slack and not (is_few and not limit):
        yield "underestimates", {"said": least, "least": limit, "reward": paid.least}


# ---- between one step and the next ---------------------------------------------------------------


@REPORTS.rule(
    "For the agent a reward {width:steps} later counts {measured:number} times as much; it "
    "should be {right:number}."
)
def discount_off(report: CalibrationReport) -> Iterator[Fields]:
    axis = report.time_axis
    if report.consistency is not None and is_discount_wrong(report.consistency):
        measured, right = report.consistency.discount.value, axis.gamma**axis.width
        yield {"width": axis.width, "measured": measured, "right": right}


@REPORTS.rule(
    "The agent ignores where episodes end: it counts in {share:percent} of what {what:text}."
)
def end_ignored(report: CalibrationReport) -> Iterator[Fields]:
    found = report.consistency
    if found is not None and is_end_ignored(found):
        is_next = found.past_reset.low > 0.5
        what = "the start of the next one promises" if is_next else "it expects after that"
        yield {"share": found.past_end.value, "what": what, "is_next": is_next}


def faults(report: CalibrationReport) -> list[Claim]:
    """Returns what an implementation got wrong; nothing where there is doubt.

    - Rewards are expected too early, or too late, if other components fit surely better.
    - The discount is wrong if γ^x is between one component and the next, and x is surely nearest to
      a whole number up to 2w, but not to w. At w = 2, a forgotten power gives 1.
    - An end is ignored if what is expected after it surely counts once, rather than never or twice.

    The last two are named only if they may be nearly all that is wrong between components: they are
    the same in all, of which a discount needs two (N = 3), and what is not learned yet is not.
    """
    return every(report, mistimed, discount_off, end_ignored)


def is_discount_wrong(found: Consistency) -> bool:
    """Returns whether the discount is surely wrong (see `faults`)."""
    axis, measured = found.time_axis, found.discount
    powers = [axis.gamma**x for x in range(2 * axis.width + 1) if x != axis.width]
    half = axis.gamma**0.5
    is_other = any(half * of < measured.low and half * measured.high < of for of in powers)
    return is_other and axis.horizon > 2 and found.discount_explains.high >= EXPLAINED


def is_end_ignored(found: Consistency) -> bool:
    """Returns whether ends are surely ignored (see `faults`)."""
    is_once = found.past_end.low > 0.5 and found.past_end.high < 1.5
    return is_once and found.end_explains.high >= EXPLAINED
