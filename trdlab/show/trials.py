"""What came of two actions that were tried, as sentences, and sentences read back."""

from trdlab.explain import tried
from trdlab.explain.finding import Claim
from trdlab.explain.tried import Trial, TrialClaim, trial_findings
from trdlab.show.templates import Language, forms_of

TEMPLATES: dict[type[Claim], str] = {
    tried.TriedOften: (
        "{action} and {foil} were each tried {copies:count} times from copies of this state."
    ),
    tried.AlwaysTheSame: (
        "{action} and {foil} were each tried {copies:count} times from copies of this state, and "
        "what each brought {scope:text} was the same every time."
    ),
    tried.NotSeen: (
        "{action} and {foil} were each tried {copies:count} times from copies of this state, but "
        "cut off before it was seen what came."
    ),
    tried.CameInAll: (
        "As forecast, {more} paid more than {less} {scope:text}: by {came:estimate}, where "
        "{said:value} was forecast."
    ),
    tried.MissedInAll: (
        "Against the forecast, {more} did not pay more than {less} {scope:text}: {more} − {less} "
        "was {came:estimate}, where {said:value} was forecast."
    ),
    tried.OpenInAll: (
        "Whether {more} pays more than {less} {scope:text}, as forecast, stayed open: {more} − "
        "{less} was {came:estimate}, where {said:value} was forecast."
    ),
    tried.CameAt: (
        "At {component:when} {more} paid more than {less}, as forecast: by {came:estimate}, where "
        "{said:value} was forecast."
    ),
    tried.MissedAt: (
        "At {component:when} {more} did not pay more than {less}, against the forecast: "
        "{more} − {less} was {came:estimate}, where {said:value} was forecast."
    ),
    tried.OpenAt: (
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
