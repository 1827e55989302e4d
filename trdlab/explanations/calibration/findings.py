"""Findings of a trust report: each a claim about how far a forecast can be trusted, and why."""

from trdlab.explanations.calibration.errors import is_off
from trdlab.explanations.calibration.faults import IgnoredEnd, WrongDiscount
from trdlab.explanations.calibration.report import TrustReport
from trdlab.explanations.calibration.residual import SHARE
from trdlab.explanations.calibration.shortcomings import (
    AmountOff,
    DiscountOff,
    GoesOnAfterEnd,
    GoesOnInNext,
    HiddenGap,
    HiddenValue,
    JudgedOn,
    LivesEnd,
    LivesGoOn,
    ResidualCut,
    ResidualTrusted,
    ResidualUnjudged,
    ResidualUnsure,
    Smeared,
    SomeRandom,
    TooEarly,
    TooLate,
    WouldSuffice,
)
from trdlab.explanations.calibration.verdicts import (
    AsGoodAsCanBe,
    CannotBeKnown,
    ConstantTo,
    CouldReach,
    FoilsNotTrusted,
    FoilsTrustedThroughout,
    FoilsTrustedTo,
    FoilsUnjudged,
    IsNotKnown,
    NoChance,
    NoSkillAt,
    NoSkillFrom,
    NothingTested,
    NothingToPredict,
    NotTrusted,
    TooFewAt,
    TrustedThroughout,
    TrustedTo,
    TrustFinding,
    UnknownAt,
    UnsureAt,
    WrongAt,
)

Findings = tuple[TrustFinding, ...]


def trust_findings(report: TrustReport) -> Findings:
    """Returns what there is to say about a report: the verdict, its reason, and what is wrong."""
    return (
        *_verdict(report),
        *_ceiling(report),
        *_faults(report),
        *_residual(report),
        *_foils(report),
        *_sample(report),
    )


def _verdict(report: TrustReport) -> Findings:
    axis, found = report.time_axis, report.trust
    if axis.horizon == 0:
        return ()
    if found.components == axis.horizon:
        whole = (TrustedThroughout(axis.num_steps - 1),) if found.tested else (NothingTested(),)
        return (*whole, *_constant(report))
    last = found.components * axis.width - 1
    claims = (NotTrusted(), ConstantTo(last), TrustedTo(last))
    verdict = next(x for x in claims if x.holds(report))
    first, could = found.components, found.at_most * axis.width - 1
    few = int(report.calibration.num_episodes[first])
    reasons = (
        NoSkillFrom(first),
        NoSkillAt(first),
        WrongAt(first),
        TooFewAt(first, few),
        UnknownAt(first),
    )
    reason = next((x for x in reasons if x.holds(report)), UnsureAt(first))
    limit = (CouldReach(could),) if found.at_most > first else ()
    return (verdict, reason, *limit, *_constant(report))


def _constant(report: TrustReport) -> Findings:
    count = int(report.calibration.is_("nothing to predict")[:-1].sum())
    tested = report.time_axis.horizon - count
    return (NothingToPredict(count, count + tested),) if count and tested else ()


def _ceiling(report: TrustReport) -> Findings:
    if report.ceiling is None:
        return ()
    if report.ceiling.deterministic:
        return (NoChance(),)
    at = min(report.trust.components, report.time_axis.horizon - 1)
    if at < 0:
        return ()
    skill = float(report.calibration.skill.value[at])
    limit = report.ceiling.skill[at]
    claims = (
        CannotBeKnown(at, max(limit.high, 0.0)),
        IsNotKnown(at, limit.value, skill),
        AsGoodAsCanBe(at, skill),
    )
    return tuple(x for x in claims if x.holds(report))[:1]


def _faults(report: TrustReport) -> Findings:
    found: list[TrustFinding] = []
    if report.blame is not None:
        steps = report.blame.shift * report.time_axis.width
        if steps:
            found.append((TooLate if steps > 0 else TooEarly)(abs(steps)))
        if is_off(report.blame.amount):
            found.append(AmountOff(report.blame.amount.value))
        if report.blame.smear.low > 0.0 and not report.blame.shift:
            found.append(Smeared())
    for fault in report.faults:
        if isinstance(fault, WrongDiscount):
            found.append(DiscountOff(fault.measured.value, fault.expected))
        if isinstance(fault, IgnoredEnd):
            found.append((GoesOnInNext if fault.resets else GoesOnAfterEnd)(fault.share.value))
    return tuple(found)


def _residual(report: TrustReport) -> Findings:
    value, gap = report.hidden.value.value, report.hidden.gap.value
    least = report.hidden.sufficient()
    residual = report.time_axis.horizon
    episodes = int(report.calibration.num_episodes[-1])
    claims: list[TrustFinding] = [
        HiddenValue(residual, value),
        HiddenGap(residual, gap),
        ResidualTrusted(residual),
        ResidualUnsure(residual),
        ResidualUnjudged(residual, episodes),
        ResidualCut(residual, report.endings.truncated),
    ]
    if value > SHARE and least is not None:
        claims.append(WouldSuffice(least, SHARE))
    return tuple(claim for claim in claims if claim.holds(report))


def _foils(report: TrustReport) -> Findings:
    found = report.foil_trust
    if found is None or found.time_axis.horizon == 0:
        return ()
    last = found.components * report.time_axis.width - 1
    claims: list[TrustFinding] = [
        FoilsNotTrusted(),
        FoilsUnjudged(),
        FoilsTrustedThroughout(last),
        FoilsTrustedTo(last),
    ]
    return tuple(claim for claim in claims if claim.holds(report))


def _sample(report: TrustReport) -> Findings:
    ends = report.endings
    sample: list[TrustFinding] = [
        JudgedOn(report.num_episodes, report.num_steps, ends.terminated, ends.truncated)
    ]
    if ends.life_losses:
        sample.append((LivesEnd if ends.life_loss_ends else LivesGoOn)(ends.life_losses))
    if report.epsilon > 0.0:
        sample.append(SomeRandom(report.epsilon))
    return tuple(sample)
