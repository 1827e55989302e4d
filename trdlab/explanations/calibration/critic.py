"""What there is to say of a policy's own critic: whether it is wrong, where, and what it lacks.

It is judged by what came, and so are the forecasts: that tells who of the two is wrong.
"""

from collections.abc import Iterator
from math import isnan, sqrt

from trdlab.explanations.calibration.faults import REPORTS
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.rules import Claim, Fields, every
from trdlab.rollouts.critique import SLACK

CRITIC, FORECASTS = "its own critic", "the sum of its forecasts"
Found = Iterator[tuple[str, Fields]]


@REPORTS.kinds(
    {
        "value-off": (
            "{whose:text} is wrong: it says {said:number} on average, where {came:number} came."
        ),
        "value-uneven": "{whose:text} is wrong: where it says 1 more, {slope:number} more came.",
        "value-right": (
            "{whose:text} is right on average, to a tenth: it says {said:number}, where "
            "{came:number} came."
        ),
        "value-open": (
            "{whose:text} says {said:number} on average, where {came:number} came: too few "
            "episodes to tell."
        ),
        "value-untested": (
            "{whose:text} says {said:number} on average; how much came is not known of any step."
        ),
    }
)
def values(report: CalibrationReport) -> Found:
    if (told := report.critique) is None:
        return
    for of, whose in enumerate((CRITIC, FORECASTS)):
        fields = {"whose": whose, "said": float(told.said[of]), "came": float(told.came[of])}
        bias, slack = told.bias[of], SLACK * told.size[of]
        if isnan(told.came[of]):
            yield "value-untested", fields
        elif told.is_off(of):
            yield "value-off", fields
        elif told.is_uneven(of):
            yield "value-uneven", fields | {"slope": told.slope[of].value}
        else:
            is_right = -slack <= bias.low and bias.high <= slack
            yield "value-right" if is_right else "value-open", fields


@REPORTS.kinds(
    {
        "critic-gamma": (
            "Its own critic was trained with γ = {gamma:given}, the forecasts are made with "
            "{right:given}."
        ),
        "critic-unit": (
            "Its own critic counts in another unit, {unit:number} for each 1 that comes; its "
            "values were divided by that."
        ),
        "critic-sum": (
            "With {by:number} {more:text} in every state, its own critic would be about right."
        ),
        "critic-discount": (
            "Its own critic counts what comes later as with γ = {measured:number}, and not "
            "{gamma:number}."
        ),
    }
)
def causes(report: CalibrationReport) -> Found:
    if (told := report.critique) is None:
        return
    add, _, measured = told.repair.tolist()
    fields = {"gamma": told.gamma, "right": report.time_axis.gamma}
    if not told.is_same:
        yield "critic-gamma", fields
    if told.factor != 1.0:
        yield "critic-unit", {"unit": told.factor}
    if told.cause == "sum":
        yield "critic-sum", {"by": abs(add), "more": "more" if add > 0.0 else "less"}
    elif told.cause == "discount":
        yield "critic-discount", fields | {"measured": measured}


@REPORTS.kinds(
    {
        "critic-where": (
            "In the third of the steps where its own critic says {most:text}, it says "
            "{said:number} on average, where {came:number} came."
        ),
        "critic-when": (
            "For each 1 that comes {near:span} its own critic counts {one:number}, for each 1 "
            "{far:span} {other:number}."
        ),
        "critic-reached": (
            "On average, as much as its own critic says in all is forecast {span:span} alone."
        ),
        "critic-against": (
            "From what came, its own critic is typically {one:number} away, and the sum of its "
            "forecasts {other:number}."
        ),
    }
)
def details(report: CalibrationReport) -> Found:
    if (told := report.critique) is None:
        return
    for row, most in enumerate(("least", "most")):
        said, came, _ = told.thirds.value[row].tolist()
        low, high = told.thirds.low[row, 2], told.thirds.high[row, 2]
        if told.cause is None and max(low, -high) > SLACK * told.size[0]:
            yield "critic-where", {"most": most, "said": said, "came": came}
    parts, last = told.counts, told.time_axis.horizon
    if last and told.is_same and not told.is_wrong(1) and max(parts.low[2], -parts.high[2]) > SLACK:
        near, far, _ = parts.value.tolist()
        spans = {"near": (0, told.split - 1), "far": (told.split, last)}
        yield "critic-when", spans | {"one": near, "other": far}
    if told.is_same and told.is_off(0) and not told.is_wrong(1) and told.reached is not None:
        yield "critic-reached", {"span": (0, told.reached)}
    if told.is_same and max(told.error.low[2], -told.error.high[2]) > 0.0:
        one, other, _ = told.error.value.tolist()
        yield "critic-against", {"one": sqrt(one), "other": sqrt(other)}


def claims(report: CalibrationReport) -> list[Claim]:
    """Returns all that is to be said of its own critic."""
    return every(report, *causes[:2], *values, *causes[2:], *details)


def wrong(report: CalibrationReport) -> list[Claim]:
    """Returns what is said where its own critic surely is wrong."""
    return [claim for claim in every(report, *values[:2]) if claim.whose == CRITIC]
