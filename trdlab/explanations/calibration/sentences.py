"""Findings of a trust report as English sentences, and sentences read back into findings."""

from trdlab.explanations.calibration import shortcomings, verdicts
from trdlab.explanations.calibration.findings import trust_findings
from trdlab.explanations.calibration.report import TrustReport
from trdlab.explanations.calibration.verdicts import TrustFinding
from trdlab.explanations.claims import Claim
from trdlab.explanations.slots import Language, forms_of

TEMPLATES: dict[type[Claim], str] = {
    verdicts.TrustedTo: "The forecast can be trusted to {step:until}.",
    verdicts.TrustedThroughout: (
        "The forecast can be trusted over its whole horizon, to {step:until}."
    ),
    verdicts.NotTrusted: "The forecast cannot be trusted at any step.",
    verdicts.ConstantTo: (
        "To {step:until} there was nothing to predict: the reward was always the same, and it "
        "expects that."
    ),
    verdicts.NothingTested: (
        "There was nothing to predict at any step: the reward was always the same."
    ),
    verdicts.NoSkillFrom: ("From {component:begin} on it is no better than a constant guess."),
    verdicts.NoSkillAt: "At {component:label} it is no better than a constant guess.",
    verdicts.UnsureAt: ("At {component:label} it may be no better than a constant guess."),
    verdicts.WrongAt: (
        "At {component:label} the reward was always the same, and it expects another."
    ),
    verdicts.TooFewAt: ("Too few different episodes tell of {component:label}: {episodes:count}."),
    verdicts.UnknownAt: "What came at {component:label} is not known of any step.",
    verdicts.CouldReach: (
        "With more episodes it could turn out to be good up to {step:step}, at most."
    ),
    verdicts.NothingToPredict: (
        "At {count:count} of {total:count} components there was nothing to predict: the reward "
        "was always the same."
    ),
    verdicts.NoChance: (
        "No two copies of a state ever went differently: everything could be known."
    ),
    verdicts.CannotBeKnown: (
        "What comes at {component:label} can hardly be known: even a perfect forecast would have "
        "a skill of at most {at_most:skill}."
    ),
    verdicts.IsNotKnown: (
        "More could be known of {component:label}: a perfect forecast would have a skill of "
        "{ceiling:skill}, this one has {skill:skill}."
    ),
    verdicts.AsGoodAsCanBe: (
        "At {component:label} its skill of {skill:skill} cannot be told from that of a perfect "
        "forecast."
    ),
    verdicts.FoilsTrustedTo: (
        "Forecasts of first actions that are not its own can be trusted to {step:until}."
    ),
    verdicts.FoilsTrustedThroughout: (
        "Forecasts of first actions that are not its own can be trusted over the whole horizon, to "
        "{step:until}."
    ),
    verdicts.FoilsNotTrusted: (
        "Forecasts of first actions that are not its own cannot be trusted at any step."
    ),
    verdicts.FoilsUnjudged: (
        "Too little was seen of first actions that are not its own to judge forecasts of them."
    ),
    shortcomings.TooLate: "It expects rewards {steps:steps} too late.",
    shortcomings.TooEarly: "It expects rewards {steps:steps} too early.",
    shortcomings.AmountOff: "It expects {times:value} times as much as comes.",
    shortcomings.Smeared: (
        "It smears rewards over neighbouring components, more than their timing is uncertain."
    ),
    shortcomings.DiscountOff: (
        "Its components are discounted by {measured:precise} from one to the next, and not by "
        "γ^w = {expected:precise}."
    ),
    shortcomings.GoesOnInNext: (
        "It ignores where episodes end: {share:percent} of what is expected at the start of the "
        "next one is counted in."
    ),
    shortcomings.GoesOnAfterEnd: (
        "It ignores where episodes end: {share:percent} of what is expected after that is "
        "counted in."
    ),
    shortcomings.HiddenValue: (
        "{share:percent} of what it expects lies at {component:label}, where it does not say when."
    ),
    shortcomings.HiddenGap: (
        "{share:percent} of the difference between the best action and the next best lies at "
        "{component:label}."
    ),
    shortcomings.ResidualTrusted: (
        "What lies at {component:label} is predicted better than by a constant guess."
    ),
    shortcomings.ResidualUnsure: (
        "What lies at {component:label} may be predicted no better than by a constant guess."
    ),
    shortcomings.ResidualUnjudged: (
        "What lies at {component:label} cannot be judged: {episodes:count} different episodes "
        "show it."
    ),
    shortcomings.ResidualCut: (
        "What lies at {component:label} cannot be judged, with {cut:episodes} cut off: only the "
        "short ones show it."
    ),
    shortcomings.WouldSuffice: (
        "N = {horizon:count} would leave no more than {share:percent} of the rewards beyond."
    ),
    shortcomings.JudgedOn: (
        "It was judged by {episodes:episodes} of {steps:steps} in all: {ended:count} "
        "ended, {cut:count} were cut off."
    ),
    shortcomings.LivesEnd: "Lives lost, which count as ends: {count:count}.",
    shortcomings.LivesGoOn: "Lives lost, which do not count as ends: {count:count}.",
    shortcomings.SomeRandom: (
        "{share:percent} of the actions were random; nothing that followed one was held against "
        "an earlier forecast."
    ),
}


REPORTS = Language[TrustReport](
    TEMPLATES,
    lambda report: forms_of(report.time_axis, seconds=report.seconds_per_step),
    about="this report",
)


def trust_sentences(report: TrustReport) -> list[str]:
    """Returns the findings of a report as sentences, in their order."""
    return [trust_sentence(finding, report) for finding in trust_findings(report)]


def trust_sentence(finding: TrustFinding, report: TrustReport) -> str:
    """Returns one finding as a sentence."""
    return REPORTS.say(finding, report)


def check_trust(text: str, report: TrustReport) -> list[Claim]:
    """Reads a rendered text back, tests each claim against a report, and returns the claims.

    Args:
        text: sentences as `trust_sentences` renders them, separated by white space.
        report: what they speak of; only its numbers are consulted.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    return REPORTS.check(text, report)
