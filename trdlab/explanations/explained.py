"""An agent explained: what it expects at a moment, why nothing else, and how far to trust that."""

from dataclasses import dataclass
from typing import Literal, get_args

from trdlab.agents.agent import Agent
from trdlab.errors import InputError, closest
from trdlab.explanations.assessment import assess, moment_at, try_out
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.episode.played import play
from trdlab.explanations.episode.story import Story, tell
from trdlab.explanations.moment.explanation import Explanation, explain
from trdlab.explanations.moment.limits import judged
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.outcome import Trial
from trdlab.rollouts.playing import Watch, unwatched, usual_limit
from trdlab.time_axis import TimeAxis

Part = Literal["forecast", "contrast", "episode", "calibration"]
PARTS: tuple[Part, ...] = get_args(Part)
FIELDS: dict[Part, tuple[str, ...]] = {
    "forecast": ("forecast", "limits", "context"),
    "contrast": ("contrast", "flips", "limits", "context"),
    "episode": (),
    "calibration": (),
}
"""The fields of an `Explanation` that each part tells."""


@dataclass(frozen=True, eq=False)
class Explained:
    """An agent at one moment, and how far its forecasts can be trusted.

    Args:
        agent: whom it is about.
        parts: what was asked for; nothing, if only what matters most is told.
        seed: of the episode that the moment is in.
        step: of that episode.
        explanation: of the moment; None where no part that speaks of one was asked for.
        report: how far forecasts can be trusted; None where no episodes were played.
        trial: what came of action and foil where they were tried; None where they were not, or
            where states cannot be copied.
        story: of the whole episode; None where it was not asked for.
        max_steps: after which episodes were cut off, if not before; None for never.
    """

    agent: Agent
    parts: tuple[Part, ...]
    seed: int
    step: int
    explanation: Explanation | None
    report: CalibrationReport | None
    trial: Trial | None = None
    story: Story | None = None
    max_steps: int | None = None

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.agent.estimator.time_axis


def parse_parts(text: str | None) -> tuple[Part, ...]:
    """Returns the parts that are written with commas between them, in a fixed order.

    Raises:
        InputError: there is no such part.

    >>> parse_parts("calibration,forecast")
    ('forecast', 'calibration')
    """
    words = [] if text is None else [word.strip() for word in text.split(",")]
    for word in words:
        if word not in PARTS:
            raise InputError(f"There is no explanation '{word}'.", closest(word, PARTS))
    return tuple(part for part in PARTS if part in words)


def explain_agent(
    agent: Agent,
    parts: tuple[Part, ...] = (),
    *,
    seed: int = 0,
    step: int = 0,
    action: str | None = None,
    foil: str | None = None,
    episodes: int | None = None,
    max_steps: int | None = None,
    watch: Watch = unwatched,
) -> Explained:
    """Explains an agent at a step of an episode of its own, and judges it by other episodes.

    Args:
        agent: whom to explain.
        parts: what is asked for; without any, what matters most of all.
        seed: of the episode that the moment is in.
        step: of that episode.
        action: the name or number of the action to explain, by default what the policy does.
        foil: of the one to contrast it with, by default the best other one.
        episodes: by how many the forecasts are judged, 0 for not at all; by default 300 of an exact
            table and 50 of another agent.
        max_steps: after which an episode is cut off, if not before; by default as `usual_limit`
            says, and no sooner than the step that is explained.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: the episode has no such step, there is no such action, or no episode to judge
            by where calibration was asked for.
    """
    wanted = parts or PARTS
    limit = _limit(agent, step, max_steps)
    moment = None
    if any(FIELDS[part] for part in wanted):
        moment = moment_at(agent, seed=seed, step=step)
    pair = (None, None) if moment is None else _pair(agent, moment, action, foil)
    if "contrast" in parts and pair[1] is None:
        raise InputError("There is no other action to contrast it with.", "Ask for --what forecast")
    count = (50 if agent.world is None else 300) if episodes is None else episodes
    if "calibration" in parts and count == 0:
        raise InputError("A calibration needs episodes.", "Ask for --episodes 50.")
    report, trial = None, None
    if count:
        copying = agent.copying if {"calibration", "contrast"} & set(wanted) else None
        report = assess(agent, episodes=count, max_steps=limit, copying=copying, watch=watch)
    if moment is not None and report is not None:
        moment = judged(moment, report)
    if "contrast" in wanted and pair[0] is not None and pair[1] is not None:
        trial = try_out(agent, pair[0], pair[1], seed=seed, step=step, report=report)
    return Explained(
        agent=agent,
        parts=parts,
        seed=seed,
        step=step,
        explanation=None if moment is None else explain(moment, *pair),
        report=report,
        trial=trial,
        story=tell(play(agent, seed, max_steps=limit)) if "episode" in wanted else None,
        max_steps=limit,
    )


def _limit(agent: Agent, step: int, max_steps: int | None) -> int:
    """Returns the steps after which an episode is cut off."""
    if max_steps is None:
        return max(usual_limit(agent.estimator.time_axis), step + 1)
    if step >= max_steps:
        raise InputError(
            f"There is no step {step} in {max_steps} steps.", "Choose another --max-steps."
        )
    return max_steps


def _pair(
    agent: Agent, moment: Moment, action: str | None, foil: str | None
) -> tuple[str, str | None]:
    """Returns the names of the action to explain and of its foil, None where there is none."""
    names = (None if name is None else agent.action(name) for name in (action, foil))
    return moment.pair(*names)
