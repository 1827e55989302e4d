"""Playing: what an agent decides, step by step, and where that leads."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import Environments, Step
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError
from trdlab.estimator import Estimator

Policy = Callable[[Any], FloatArray]
"""From observations `[B, ...]` to action probabilities `[B, A]`."""

LONGEST = 1_000
"""Steps after which an episode is no longer played, where nothing else is said."""


@dataclass(frozen=True)
class Progress:
    """How far some episodes have been played.

    Args:
        what: what they are played for.
        finished: how many have ended, or were cut off.
        episodes: how many there are.
        steps: how many have been taken in each that goes on.
    """

    what: str
    finished: int
    episodes: int
    steps: int


Watch = Callable[[Progress], None]
"""Is told how far things are, now and then."""


def unwatched(progress: Progress) -> None:
    """Tells nobody."""


def usual_limit(axis: TimeAxis) -> int:
    """Returns after how many steps an episode is cut off, where nothing else is said.

    That is `LONGEST`, or four horizons if they are longer: an agent that gets stuck would else play
    on until the environment stops it, in an Atari game after half an hour of play.
    """
    return max(LONGEST, 4 * axis.num_steps)


@dataclass(frozen=True, eq=False)
class Decision:
    """What an agent expects at B observations, and how likely it takes each action.

    Args:
        decomposition: `[B, A, N+1]`.
        probabilities: `[B, A]`.
    """

    decomposition: RewardDecomposition
    probabilities: FloatArray

    @property
    def expected(self) -> FloatArray:
        """`[B, N+1]`: the mean over the policy's actions."""
        weights = self.probabilities[:, None]  # [B, 1, A]
        return np.asarray((weights @ self.decomposition.components)[:, 0])

    def draw(self, rng: np.random.Generator) -> IntArray:
        """Returns `[B]`: an action of the policy each."""
        cumulative = self.probabilities.cumsum(axis=1)
        level = rng.random(len(cumulative)) * cumulative[:, -1]  # the last may not be quite 1
        return np.asarray((cumulative <= level[:, None]).sum(axis=1))


def decide(estimator: Estimator, observations: Any, policy: Policy | None = None) -> Decision:
    """Returns what an estimator expects, and what the policy it describes does.

    Args:
        estimator: whatever decomposes.
        observations: `[B, ...]`.
        policy: the given policy that the estimator describes; without one, the action of largest
            Σ components, of equals the first.
    """
    decomposition = estimator.decompose(observations)  # [B, A, N+1]
    if policy is not None:
        return Decision(decomposition, policy(observations))
    value = decomposition.value  # [B, A]
    greedy = value.argmax(axis=1)[:, None] == np.arange(value.shape[1])
    return Decision(decomposition, greedy.astype(value.dtype))


class Playing:
    """B episodes that a policy plays side by side, one each; who plays asks, and takes, each step.

    A lone episode is the same with the same seeds, whatever it is played for.

    Args:
        estimator: whose expectations are told.
        environments: B of them.
        rng: of the policy's draws.
        policy: what the estimator describes, where that is not its own greedy policy.
        max_steps: after which an episode is cut off, if not before.
        stack: what is seen in the midst of episodes that have begun; without it they are reset.

    Attributes:
        running: `[B]`, which episodes go on.
        finished: `[B]`, which ones the last step has brought to an end.
        steps: how many have been taken.

    Raises:
        InputError: there are fewer than no steps.
    """

    def __init__(
        self,
        estimator: Estimator,
        environments: Environments,
        rng: np.random.Generator,
        *,
        policy: Policy | None = None,
        max_steps: int | None = None,
        stack: FrameStack | None = None,
    ) -> None:
        if max_steps is not None and max_steps < 0:
            raise InputError(f"An episode has {max_steps} steps.", "Ask for at least 1.")
        self.environments, self.max_steps, self.steps = environments, max_steps, 0
        if stack is None:
            stack = FrameStack(environments.reset(), environments.stack, environments.padding)
        self.stack = stack
        self.running: BoolArray = np.full(environments.num_envs, max_steps != 0)
        self.finished: BoolArray = ~self.running
        self._estimator, self._policy, self._rng = estimator, policy, rng
        self._last: Any = None

    def decide(self) -> tuple[Decision, IntArray]:
        """Returns what is expected where episodes go on `[≤ B]`, and the actions drawn `[B]`."""
        decision = decide(self._estimator, self.stack.observations[self.running], self._policy)
        actions = np.zeros(len(self.running), dtype=np.int64)
        actions[self.running] = decision.draw(self._rng)
        return decision, actions

    def take(self, actions: IntArray) -> Step:
        """Takes a step with these actions `[B]`; where an episode has ended they do not count."""
        step = self.environments.step(actions)
        self.steps += 1
        over = step.ended | (self.steps == self.max_steps)  # [B]
        self.finished, self.running = self.running & over, self.running & ~over
        self._last = _last_observations(self.stack, step, self.finished)
        self.stack.push(step.following, step.ended)
        return step

    def at_last(self) -> Decision:
        """Returns what is expected at the true last observations of the finished episodes."""
        return decide(self._estimator, self._last, self._policy)


def play_to(
    estimator: Estimator,
    environments: Environments,
    steps: int,
    *,
    policy: Policy | None = None,
    seed: int = 0,
) -> FrameStack:
    """Plays the first environment for some steps, and returns what the agent then sees.

    Args:
        estimator: whose policy is followed.
        environments: they are reset.
        steps: how many steps to take.
        policy: what the estimator describes, where that is not its own greedy policy.
        seed: of the policy's draws.

    Raises:
        InputError: the episode is over by then.
    """
    playing = Playing(estimator, environments, np.random.default_rng(seed), policy=policy)
    while playing.steps < steps:
        step = playing.take(playing.decide()[1])
        if step.ended[0]:
            raise InputError(
                f"There is no step {steps}: the episode is over after {playing.steps} steps.",
                f"Choose a step from 0 to {playing.steps - 1}.",
            )
    return playing.stack


def _last_observations(stack: FrameStack, step: Step, where: BoolArray) -> Any:
    """Returns `[≤ B, ...]`: the true last observations of the episodes that end `where [B]`.

    Args:
        stack: what was seen before the step.
        step: what it led to.
        where: `[B]`.
    """
    frames = step.frames[where]
    if stack.size is None:
        return frames
    return np.concatenate([stack.frames[where, 1:], frames[:, None]], axis=1)
