"""What came of two actions that were tried, as sentences, and sentences read back."""

from trdlab.explanations.claims import Claim
from trdlab.explanations.moment import outcome
from trdlab.explanations.moment.outcome import Trial, TrialClaim, trial_findings
from trdlab.explanations.slots import Language, forms_of

TEMPLATES: dict[type[Claim], str] = {
    outcome.TriedOften: (
        "{action} and {foil} were each tried {copies:count} times from copies of this state."
    ),
    outcome.AlwaysTheSame: (
        "{action} and {foil} were each tried {copies:count} times from copies of this state, and "
        "what each brought {scope:text} was the same every time."
    ),
    outcome.NotSeen: (
        "{action} and {foil} were each tried {copies:count} times from copies of this state, but "
        "cut off before it was seen what came."
    ),
    outcome.CameInAll: (
        "As forecast, {more} paid more than {less} {scope:text}: by {came:estimate}, where "
        "{said:value} was forecast."
    ),
    outcome.MissedInAll: (
        "Against the forecast, {more} did not pay more than {less} {scope:text}: {more} − {less} "
        "was {came:estimate}, where {said:value} was forecast."
    ),
    outcome.OpenInAll: (
        "Whether {more} pays more than {less} {scope:text}, as forecast, stayed open: {more} − "
        "{less} was {came:estimate}, where {said:value} was forecast."
    ),
    outcome.CameAt: (
        "At {component:when} {more} paid more than {less}, as forecast: by {came:estimate}, where "
        "{said:value} was forecast."
    ),
    outcome.MissedAt: (
        "At {component:when} {more} did not pay more than {less}, against the forecast: "
        "{more} − {less} was {came:estimate}, where {said:value} was forecast."
    ),
    outcome.OpenAt: (
        "Whether {more} pays more than {less} at {component:when}, as forecast, stayed open: "
        "{more} − {less} was {came:estimate}, where {said:value} was forecast."
    ),
}

TRIALS = Language[Trial](
    TEMPLATES,
    lambda trial: forms_of(trial.found.time_axis, trial.action_names, trial.seconds_per_step),
    about="this trial",
)


def trial_sentences(trial: Trial) -> list[str]:
    """Returns what came of two actions that were tried, as sentences."""
    return [trial_sentence(finding, trial) for finding in trial_findings(trial)]


def trial_sentence(finding: TrialClaim, trial: Trial) -> str:
    """Returns one finding as a sentence."""
    return TRIALS.say(finding, trial)


def check_trial(text: str, trial: Trial) -> list[Claim]:
    """Reads a rendered text back, tests each claim against a trial, and returns the claims.

    Args:
        text: sentences as `trial_sentences` renders them, separated by white space.
        trial: what they speak of.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    return TRIALS.check(text, trial)
