"""What there is to say of a calibration: how the agent does, how far to trust it, what is wrong."""

from collections.abc import Iterator
from typing import Any

from trdlab.explanations.calibration import faults
from trdlab.explanations.calibration.faults import REPORTS, rule
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.calibration.residual import SHARE
from trdlab.explanations.calibration.score import Score
from trdlab.explanations.calibration.trust import Trust
from trdlab.explanations.calibration.verdicts import Judged, add_verdicts
from trdlab.explanations.rules import Claim, Fields, every, first, plain_data
from trdlab.explanations.sections import Section
from trdlab.formatting import percent
from trdlab.statistics import Estimate

SCHEMA = "trdlab.trust/2"
MOST_VERDICTS = 4
"""Of more than so many, only the first and the last are told."""
LITTLE = 0.1
"""A ceiling below this leaves little to know."""
WORTH_SAYING = 0.005
"""A smaller share is not said."""

OWN, OTHERS = "its forecasts", "its forecasts for other actions"

# ---- how the agent does --------------------------------------------------------------------------


@rule("It scored {returns:number} in its one episode, which is the same every time.")
def scored_once(report: CalibrationReport) -> Iterator[Fields]:
    if report.score.different == 1:
        yield _scored(report.score)


@rule("It scored {returns:number} in each of {episodes:episodes}.")
def scored_always(report: CalibrationReport) -> Iterator[Fields]:
    returns = report.score.returns
    if report.score.different > 1 and returns.low == returns.high:
        yield _scored(report.score)


@rule("It scored {returns:estimate} an episode, on average over {episodes:episodes}.")
def scored(report: CalibrationReport) -> Iterator[Fields]:
    returns = report.score.returns
    if report.score.different > 1 and returns.low != returns.high:
        yield _scored(report.score) | {"returns": returns}


@rule("{ended:text} of them ended before the limit of {limit:steps}.")
def some_ended(report: CalibrationReport) -> Iterator[Fields]:
    score = report.score
    if score.truncated and score.time_limit is not None:
        yield {"ended": str(score.terminated or "none"), "limit": score.time_limit}


def _scored(score: Score) -> Fields:
    of = {"episodes": score.episodes, "different": score.different}
    return {"returns": score.returns.value} | of


# ---- how far to trust it -------------------------------------------------------------------------


def _judged(report: CalibrationReport) -> Iterator[Judged]:
    cut = "episodes were cut off before" if report.judged.truncated else "no episode shows it"
    unseen = "random actions came in between" if report.judged.epsilon > 0.0 else cut
    yield Judged(OWN, report.calibration, unseen)
    if report.foils is not None:
        yield Judged(OTHERS, report.foils, "no copy was followed so far")


VERDICTS = add_verdicts(REPORTS, _judged)


def verdicts(report: CalibrationReport, whose: str = OWN) -> list[Claim]:
    """Returns all that is to be said of some forecasts, by when it comes.

    Args:
        report: that has judged them.
        whose: `OWN` or `OTHERS`.
    """
    found = [claim for claim in every(report, *VERDICTS) if claim.whose == whose]
    return sorted(found, key=lambda claim: claim.span)


def _in_short(claims: list[Claim]) -> list[Claim]:
    """Returns verdicts up to the first that is no good news."""
    good = next((i for i, claim in enumerate(claims) if claim.kind not in _GOOD), len(claims))
    return claims[: good + 1]


_GOOD = ("better", "right")

# ---- what can be known ---------------------------------------------------------------------------


@rule("Copies of a state never went differently, so all that comes can be known.")
def no_chance(report: CalibrationReport) -> Iterator[Fields]:
    if report.ceiling is not None and report.ceiling.deterministic and not report.chance:
        yield {}


@rule(
    "Copies of a state never went differently, yet states that look alike did: the copies may "
    "share their chance."
)
def shared_chance(report: CalibrationReport) -> Iterator[Fields]:
    if report.ceiling is not None and report.ceiling.deterministic and report.chance:
        yield {}


@rule(
    "Chance decides what comes {component:when}: even a perfect forecast has at most "
    "{at_most:percent} less error than a guess."
)
def cannot_be_known(report: CalibrationReport) -> Iterator[Fields]:
    for at, limit, _ in _limits(report):
        if limit.high < LITTLE:
            yield {"component": at, "at_most": max(limit.high, 0.0)}


@rule(
    "More can be known of what comes {component:when}: a perfect forecast removes "
    "{ceiling:percent} of a guess's error, this one {removes:text}."
)
def is_not_known(report: CalibrationReport) -> Iterator[Fields]:
    for at, limit, skill in _limits(report):
        if limit.high >= LITTLE and skill.high < limit.low:
            removes = f"{percent(skill.value)} %" if skill.value > 0.0 else "nothing"
            numbers = {"ceiling": limit.value, "skill": skill.value}
            yield {"component": at, "removes": removes} | numbers


@rule(
    "Of a guess's error about what comes {component:when} it removes {skill:percent}, about as "
    "much as a perfect forecast."
)
def as_good_as_can_be(report: CalibrationReport) -> Iterator[Fields]:
    for at, limit, skill in _limits(report):
        if limit.high >= LITTLE and skill.high >= limit.low > 0.0 and skill.low > 0.0:
            yield {"component": at, "ceiling": limit.value, "skill": skill.value}


def _limits(report: CalibrationReport) -> Iterator[tuple[int, Estimate, Estimate]]:
    """Yields each explicit component, with its ceiling and its skill."""
    if report.ceiling is not None:
        for at in range(report.time_axis.horizon):
            yield at, report.ceiling.skill[at], report.calibration.skill[at]


def _known(report: CalibrationReport) -> list[Claim]:
    """Returns what can be known, of the first component that is not good, or the last one."""
    at = min(report.trust.components, report.time_axis.horizon - 1)
    found = every(report, cannot_be_known, is_not_known, as_good_as_can_be)
    return [
        *first(report, no_chance, shared_chance),
        *(claim for claim in found if claim.component == at),
    ][:1]


# ---- what comes later than it tells --------------------------------------------------------------


@rule("{share:percent} of what it expects comes {component:when}; it does not say when.")
def expects_later(report: CalibrationReport) -> Iterator[Fields]:
    if report.time_axis.horizon and report.residual.value.value >= WORTH_SAYING:
        yield _later(report) | {"share": report.residual.value.value}


@rule(
    "{share:percent} of what sets its best action apart from the next best comes {component:when}."
)
def differs_later(report: CalibrationReport) -> Iterator[Fields]:
    if report.time_axis.horizon and report.residual.gap.value >= WORTH_SAYING:
        yield _later(report) | {"share": report.residual.gap.value}


@rule("With N = {horizon:count}, at most {share:percent} of the rewards that came would be later.")
def would_suffice(report: CalibrationReport) -> Iterator[Fields]:
    least = report.residual.sufficient()
    if least is not None and least > report.time_axis.horizon:
        yield {"horizon": least, "share": SHARE}


def _later(report: CalibrationReport) -> Fields:
    return {"component": report.time_axis.horizon}


# ---- what it rests on ----------------------------------------------------------------------------


@rule("Its forecasts were judged by {episodes:episodes} of {steps:steps} in all.")
def judged_by(report: CalibrationReport) -> Iterator[Fields]:
    yield {"episodes": report.judged.episodes, "steps": report.judged.steps}


@rule("{cut:episodes} of these {were:text} cut off.")
def cut_off(report: CalibrationReport) -> Iterator[Fields]:
    if cut := report.judged.truncated:
        yield {"cut": cut, "were": "was" if cut == 1 else "were"}


@rule("Lives were lost {count:times} in them; for its forecasts {ends:text}.")
def lives(report: CalibrationReport) -> Iterator[Fields]:
    if report.judged.life_losses:
        ends = "that is an end" if report.judged.life_loss_ends else "the episode goes on"
        yield {"count": report.judged.life_losses, "ends": ends}


@rule(
    "{share:percent} of the actions in them were random; what followed one is not held against "
    "earlier forecasts."
)
def some_random(report: CalibrationReport) -> Iterator[Fields]:
    if report.judged.epsilon > 0.0:
        yield {"share": report.judged.epsilon}


# ---- what is told --------------------------------------------------------------------------------


def sections(report: CalibrationReport) -> tuple[Section, ...]:
    """Returns all that there is to say of a report, under the questions that it answers."""
    hidden = report.residual.value.value > SHARE
    wrong = (
        *faults.faults(report),
        *every(report, faults.overestimates, faults.underestimates),
        *every(report, faults.off_from, faults.amount_off, faults.smeared),
    )
    later = every(report, expects_later, differs_later, *([would_suffice] if hidden else []))
    found = (
        Section("score", "How it does", (*_score(report),)),
        Section("trust", "How far to trust it", (*_trust(report), *_known(report))),
        Section("faults", "What is wrong", wrong),
        Section("later", "What comes later than it tells", (*later,)),
        Section("others", "Other actions", (*_in_short(verdicts(report, OTHERS)),)),
        Section(
            "judged",
            "What this rests on",
            (*every(report, judged_by, cut_off, lives, some_random),),
        ),
    )
    return tuple(section for section in found if section)


def in_brief(report: CalibrationReport) -> list[Claim]:
    """Returns how the agent does, how far to trust it, and the worst that is wrong."""
    told = {section.name: section.claims for section in sections(report)}
    trust = told["trust"][:1]
    return [*told["score"][:1], *trust, *(told.get("faults") or told["trust"][1:])[:1]]


def _trust(report: CalibrationReport) -> list[Claim]:
    """Returns the verdicts, of many those in short and that on the residual."""
    found = verdicts(report)
    if len(found) <= MOST_VERDICTS:
        return found
    return list(dict.fromkeys([*_in_short(found), found[-1]]))


def _score(report: CalibrationReport) -> list[Claim]:
    return [
        *first(report, scored_once, scored_always, scored),
        *some_ended(report),
    ]


# ---- as data -------------------------------------------------------------------------------------


def to_dict(report: CalibrationReport) -> dict[str, Any]:
    """Returns a report as plain data at full precision.

    The schema is `trdlab.trust/2`: lists run over components (`N+1`, or `N` explicit ones), an
    estimate is `value` with `low` and `high`. What does not exist, and an end of an interval that
    is infinite, is `null`.
    """
    foils = report.foil_trust
    data: dict[str, Any] = plain_data(report)
    del data["future"]
    return {
        "schema": SCHEMA,
        **data,
        "trusted": _trusted(report.trust),
        "foils_trusted": None if foils is None else _trusted(foils),
        "faults": [claim.kind for claim in faults.faults(report)],
        "sections": [section.to_dict() for section in sections(report)],
    }


def _trusted(found: Trust) -> dict[str, Any]:
    return {
        "last_step": found.last_step,
        "components": found.components,
        "residual": found.residual,
        "whole": found.is_whole,
        "doubtful": found.doubtful.tolist(),
    }
