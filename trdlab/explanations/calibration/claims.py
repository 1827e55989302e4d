"""What there is to say of a calibration: how the agent does, how far to trust it, what is wrong."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from typing import Any

from trdlab.explanations.calibration import critic, faults
from trdlab.explanations.calibration.calibration import Calibration, Status, Trust
from trdlab.explanations.calibration.faults import REPORTS
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.calibration.residual import SHARE
from trdlab.explanations.rules import Claim, Fields, every, plain_data
from trdlab.explanations.sections import Section
from trdlab.formatting import percent

SCHEMA = "trdlab.trust/2"
MOST_VERDICTS = 4
"""Of more than so many, only the first and the last are told."""
LITTLE = 0.1
"""A ceiling below this leaves little to know."""
WORTH_SAYING = 0.005
"""A smaller share is not said."""

OWN, OTHERS = "the agent's forecasts", "forecasts for actions it would not choose"

Found = Iterator[tuple[str, Fields]]

# ---- how the agent does --------------------------------------------------------------------------


@REPORTS.kinds(
    {
        "scored-once": "The agent scored {returns:number} in one episode.",
        "scored-the-same": "The agent scored {returns:number}: its episodes are all the same.",
        "scored-always": "The agent scored {returns:number} in each of {episodes:episodes}.",
        "scored-few": (
            "Over {episodes:episodes} the agent scored {returns:number} each, on average."
        ),
        "scored": (
            "Over {episodes:episodes} the agent scored {returns:number} each, on average; the true "
            "average is likely {low:number} to {high:number}."
        ),
    }
)
def scores(report: CalibrationReport) -> Found:
    score, mean = report.score, report.score.returns
    scored = {"returns": mean.value, "episodes": score.episodes, "different": score.different}
    if score.episodes == 1:
        yield "scored-once", scored
    elif score.different == 1:
        yield "scored-the-same", scored
    elif mean.low == mean.high:
        yield "scored-always", scored
    elif mean.low < mean.high:
        yield "scored", scored | {"low": mean.low, "high": mean.high}
    else:
        yield "scored-few", scored


@REPORTS.rule("{ended:text} of these episodes ended before the limit of {limit:steps}.")
def some_ended(report: CalibrationReport) -> Iterator[Fields]:
    score = report.score
    if score.truncated and score.time_limit is not None:
        yield {"ended": str(score.terminated or "none"), "limit": score.time_limit}


# ---- how far to trust it -------------------------------------------------------------------------

_FEW = "For {span:comes}, {whose:text} were tested in {few:text}"


@REPORTS.kinds(
    {
        "better": "For {span:comes}, {whose:text} are better than a guess.",
        "right": "For {span:comes}, {whose:text} are right (to a tenth): what came never varied.",
        "no-better": "For {span:comes}, {whose:text} are no better than a guess.",
        "wrong": (
            "For {span:comes}, {whose:text} are wrong: {said:number} on average, but "
            "{came:number} came every time."
        ),
        "unsure": f"{_FEW}; about {{enough:count}} are needed.",
        "undecided": f"{_FEW}: too few to tell.",
        "silent": "For {span:comes}, {whose:text} were not tested: no reward came then.",
        "unseen": "For {span:comes}, {whose:text} were not tested: {unseen:text}.",
    }
)
def judged(report: CalibrationReport) -> Found:
    cut = "episodes were cut off before" if report.judged.truncated else "no episode shows it"
    unseen = (
        "by then, each test episode had a random action" if report.judged.epsilon > 0.0 else cut
    )
    yield from _verdicts(OWN, report.calibration, unseen)
    if report.foils is not None:
        yield from _verdicts(OTHERS, report.foils, "no copy was played that long")


def _verdicts(whose: str, told: Calibration, unseen: str) -> Found:
    """Yields components in a row of which the same is to be said, with their numbers."""
    same = told.constant.tolist()
    kinds = [_KINDS[own][i] for own, i in zip(told.status, same, strict=True)]
    for kind, run in groupby(range(len(kinds)), key=kinds.__getitem__):
        first, *_, last = (*run,) * 2
        here = slice(first, last + 1)
        fields: Fields = {"whose": whose, "span": (first, last)}
        if kind in ("right", "wrong"):
            came = float(told.mean[here].sum())
            fields |= {"said": came + float(told.bias.value[here].sum()), "came": came}
        elif kind == "unsure":
            needed = [count for count in told.enough[here] if count is not None]
            count = int(told.num_episodes[here].min())
            few = "1 episode" if count == 1 else f"{count:,} different episodes"
            fields |= {"episodes": count, "few": few}
            if len(needed) > last - first:
                fields |= {"enough": max(needed)}
            else:
                kind = "undecided"
        elif kind == "unseen":
            fields |= {"unseen": unseen}
        yield kind, fields


_KINDS: dict[Status, tuple[str, str]] = {
    "good": ("better", "right"),
    "bad": ("no-better", "wrong"),
    "open": ("unsure", "unsure"),
    "not tested": ("unseen", "silent"),
}
"""Of each status what is said, where rewards differed and where it was the same every time."""


def verdicts(report: CalibrationReport, whose: str = OWN) -> list[Claim]:
    """Returns all that is to be said of `OWN` forecasts, or those of `OTHERS`, by when it comes."""
    found = [claim for claim in every(report, *judged) if claim.whose == whose]
    return sorted(found, key=lambda claim: claim.span)


def _in_short(claims: list[Claim]) -> list[Claim]:
    """Returns verdicts up to the first that is no good news."""
    bad = (i for i, claim in enumerate(claims) if claim.kind not in ("better", "right"))
    return claims[: next(bad, len(claims)) + 1]


# ---- what can be known ---------------------------------------------------------------------------


@REPORTS.kinds(
    {
        "no-chance": (
            "When a state was played again, the same always followed, so all that comes can be "
            "known."
        ),
        "shared-chance": (
            "When a state was played again, the same always followed; but states that look alike "
            "went on differently, so the replays may share their luck."
        ),
        "cannot-be-known": (
            "Chance decides what comes {component:when}: even a perfect forecast would beat a "
            "guess by at most {at_most:percent}."
        ),
        "is-not-known": (
            "More can be known of what comes {component:when}: a perfect forecast would beat a "
            "guess by {ceiling:percent}, this one by {margin:text}."
        ),
        "as-good-as-can-be": (
            "For what comes {component:when}, its forecasts beat a guess by {skill:percent}, "
            "about as much as can be."
        ),
    }
)
def limits(report: CalibrationReport) -> Found:
    """What copies of states tell: of all that comes, and of each explicit component."""
    if report.ceiling is None:
        return
    if report.ceiling.deterministic:
        yield "shared-chance" if report.chance else "no-chance", {}
    for at in range(report.time_axis.horizon):
        limit, skill = report.ceiling.skill[at], report.calibration.skill[at]
        about = {"component": at, "ceiling": limit.value, "skill": skill.value}
        if limit.high < LITTLE:
            yield "cannot-be-known", {"component": at, "at_most": max(limit.high, 0.0)}
        elif skill.high < limit.low:
            margin = f"{percent(skill.value)} %" if skill.value > 0.0 else "nothing"
            yield "is-not-known", about | {"margin": margin}
        elif limit.low > 0.0 and skill.low > 0.0:
            yield "as-good-as-can-be", about


def _known(report: CalibrationReport) -> list[Claim]:
    """Returns what can be known: of all, or of the first component not good, or the last."""
    at = min(report.trust.components, report.time_axis.horizon - 1)
    return [of for of in every(report, *limits) if of.fields.get("component", at) == at][:1]


# ---- what comes later than it tells --------------------------------------------------------------


@REPORTS.kinds(
    {
        "expects-later": (
            "Over all steps played, {share:percent} of what the agent expects comes "
            "{component:when}, in one sum without a date."
        ),
        "differs-later": (
            "Over all steps played, {share:percent} of the difference between its best and its "
            "second best action comes {component:when}."
        ),
    }
)
def later(report: CalibrationReport) -> Found:
    residual, horizon = report.residual, report.time_axis.horizon
    shares = {"expects-later": residual.value.value, "differs-later": residual.gap.value}
    for kind, share in shares.items():
        if horizon and share >= WORTH_SAYING:
            yield kind, {"component": horizon, "share": share}


@REPORTS.rule(
    "With N = {horizon:count}, at least {share:percent} of the rewards that came would be told "
    "step by step."
)
def would_suffice(report: CalibrationReport) -> Iterator[Fields]:
    least = report.residual.sufficient
    if least is not None and least > report.time_axis.horizon:
        yield {"horizon": least, "share": 1.0 - SHARE}


# ---- what it rests on ----------------------------------------------------------------------------


@REPORTS.kinds(
    {
        "judged-by": "The forecasts were checked on {episodes:episodes}, {steps:steps} altogether.",
        "cut-off": "{cut:count} of these episodes {were:text} cut off.",
        "lives": "Lives were lost {count:times} in them; for its forecasts {ends:text}.",
        "some-random": (
            "{share:percent} of the actions in them were random; what followed one is not held "
            "against earlier forecasts."
        ),
    }
)
def basis(report: CalibrationReport) -> Found:
    of = report.judged
    yield "judged-by", {"episodes": of.episodes, "steps": of.steps}
    if of.truncated:
        yield "cut-off", {"cut": of.truncated, "were": "was" if of.truncated == 1 else "were"}
    if of.life_losses:
        ends = "that is an end" if of.life_loss_ends else "the episode goes on"
        yield "lives", {"count": of.life_losses, "ends": ends}
    if of.epsilon > 0.0:
        yield "some-random", {"share": of.epsilon}


# ---- what is told --------------------------------------------------------------------------------


def sections(report: CalibrationReport) -> tuple[Section, ...]:
    """Returns all that there is to say of a report, under the questions that it answers."""
    wrong = every(report, *faults.beyond, faults.off_from, faults.amount_off, faults.smeared)
    hidden = report.residual.value.value > SHARE
    late = every(report, *later, *([would_suffice] if hidden else []))
    found = {
        ("score", "How it does"): every(report, *scores, some_ended),
        ("trust", "How far to trust it"): [*_trust(report), *_known(report)],
        ("faults", "What is wrong"): [*faults.faults(report), *wrong],
        ("later", "What comes later than it tells"): late,
        ("others", "Other actions"): _in_short(verdicts(report, OTHERS)),
        ("critic", "Its own critic"): critic.claims(report),
        ("judged", "What this rests on"): every(report, *basis),
    }
    return tuple(Section(*title, tuple(claims)) for title, claims in found.items() if claims)


def in_brief(report: CalibrationReport) -> list[Claim]:
    """Returns how the agent does, how far to trust it, the worst that is wrong, and its critic."""
    told = {section.name: section.claims for section in sections(report)}
    trust, worst = told["trust"], told.get("faults") or told["trust"][1:]
    return [*told["score"][:1], *trust[:1], *worst[:1], *critic.wrong(report)]


def _trust(report: CalibrationReport) -> list[Claim]:
    """Returns the verdicts, of many those in short and that on the residual."""
    found = verdicts(report)
    if len(found) <= MOST_VERDICTS:
        return found
    return list(dict.fromkeys([*_in_short(found), found[-1]]))


# ---- as data -------------------------------------------------------------------------------------


def to_dict(report: CalibrationReport) -> dict[str, Any]:
    """Returns a report as plain data at full precision.

    The schema is `trdlab.trust/2`: lists run over components (`N+1`, or `N` explicit ones), an
    estimate is `value` with `low` and `high`. What does not exist, and an end of an interval that
    is infinite, is `null`.
    """
    foils = report.foils
    data: dict[str, Any] = plain_data(replace(report, agent=None))
    del data["future"], data["agent"]
    return {
        "schema": SCHEMA,
        **data,
        "trusted": _trusted(report.trust),
        "foils_trusted": None if foils is None else _trusted(foils.trust),
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
