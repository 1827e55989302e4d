"""Playing: what an agent decides, step by step, and where that leads."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import Environments, NotCopyable, Step
from trdlab.environments.faults import blamed
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.policies import Policy, ask, greedy, rows
from trdlab.policies.adapted import sees_screens


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


def part_of(watch: Watch, before: int, episodes: int) -> Watch:
    """Returns who is told of episodes as a part of more, some of which were played before."""
    return lambda now: watch(replace(now, finished=before + now.finished, episodes=episodes))


def usual_limit(axis: TimeAxis) -> int:
    """Returns after how many steps an episode is cut off, where nothing else is said.

    That is 1,000, or four horizons if they are longer: an agent that gets stuck would else play on
    until the environment stops it, in an Atari game after half an hour of play.
    """
    return max(1_000, 4 * axis.num_steps)


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
        """`[B, N+1]`: the mean over the policy's actions, v^TRD."""
        return self.decomposition.under(self.probabilities).components


@dataclass(frozen=True, eq=False)
class Turn:
    """What B episodes do at a step; where one has ended, 0 and nothing random.

    Args:
        probabilities: `[R, A]`, how likely the policy takes each action where episodes go on.
        own: `[B]`, the actions drawn from the policy.
        random: `[B]`, whether a random action is taken in place of it.
        actions: `[B]`, what is taken.
    """

    probabilities: FloatArray
    own: IntArray
    random: BoolArray
    actions: IntArray


class Playing:
    """B episodes that a policy plays side by side, one each: the one loop of all who play.

    Whoever plays goes on while episodes are `running`: asks what is expected (`decide`) or only
    what is done (`turn`), and then takes the step (`take`). The policy is asked once a step. A lone
    episode is the same with the same seeds, whatever it is played for, and what happens in one
    episode does not depend on when others end. Whoever wants more of them plays on where they end.

    Args:
        estimator: whose expectations are told; None where nobody asks for them.
        environments: B of them.
        rng: of the policy's draws.
        policy: who acts, where that is not the estimator's greedy policy.
        epsilon: the chance of a random action in place of the policy's.
        chance: of the random actions.
        max_steps: after which an episode is cut off, if not before.

    Attributes:
        stack: what is seen.
        running: `[B]`, which episodes go on; whoever plays may leave off some.
        finished: `[B]`, which ones the last step has brought to an end.
        steps: how many have been taken.
        ages: `[B]`, how many of them in the episode that each plays now.

    Raises:
        InputError: there is not a single step.
    """

    def __init__(
        self,
        estimator: Estimator | None,
        environments: Environments,
        rng: np.random.Generator,
        *,
        policy: Policy | None = None,
        epsilon: float = 0.0,
        chance: np.random.Generator | None = None,
        max_steps: int | None = None,
    ) -> None:
        if max_steps is not None and max_steps < 1:
            raise InputError(f"Episodes have {max_steps} steps.", "Ask for at least 1.")
        self.environments, self.max_steps, self.steps = environments, max_steps, 0
        with blamed("when it was reset"):
            frames = environments.reset()
        self.stack = FrameStack(frames, environments.stack, environments.padding)
        self.running: BoolArray = np.ones(environments.num_envs, dtype=np.bool_)
        self.finished: BoolArray = ~self.running
        self.ages: IntArray = np.zeros(environments.num_envs, dtype=np.int64)
        self._estimator, self._policy, self._rng = estimator, policy, rng
        self._epsilon, self._chance = epsilon, chance or rng
        self._memory: Any = None
        self._asked = np.arange(environments.num_envs)  # [R], whose memory it is
        self._decision: Decision | None = None
        self._turn: Turn | None = None
        self._last: Any = None
        self._last_shown: Any = None
        self._last_allowed: BoolArray | None = None

    @property
    def allowed(self) -> BoolArray | None:
        """`[B, A]`, which actions can be taken at this step; None where all can always be."""
        allowed: BoolArray | None = getattr(self.environments, "allowed", None)
        return allowed

    def shown(self, policy: Policy) -> Any:
        """Returns what a policy looks at where R episodes go on `[R, ...]`.

        That is what is seen; or whole screens, if it says so (see `About`).

        Raises:
            InputError: the environments do not show whole screens.
        """
        return shown(policy, self.environments, self.stack)[self.running]

    def decide(self) -> Decision:
        """Returns what is expected where R episodes go on, and how likely each action is."""
        if self._decision is None:
            told = self._told(self.stack.observations[self.running])
            likely = (
                greedy(told.value, _of(self.allowed, self.running))
                if self._policy is None
                else self._ask(self._policy)
            )
            self._decision = Decision(told, likely)
        return self._decision

    def turn(self) -> Turn:
        """Returns what is done at this step."""
        if self._turn is None:
            if self._estimator is None and self._policy is not None:
                likely = self._ask(self._policy)
            else:
                likely = self.decide().probabilities  # [R, A]
            count = len(self.running)
            own = np.zeros(count, dtype=np.int64)
            own[self.running] = drawn(likely, self._rng.random(count)[self.running])
            random, actions = np.zeros(count, dtype=np.bool_), own
            if self._epsilon:
                random = self.running & (self._chance.random(count) < self._epsilon)
                any_action = any_actions(
                    self._chance, count, self.environments.num_actions, self.allowed
                )
                actions = np.where(random, any_action, own)
            self._turn = Turn(likely, own, random, actions)
        return self._turn

    def take(self, actions: IntArray, *, play_on: bool = False) -> Step:
        """Takes a step with these actions `[B]`; where an episode has ended they do not count.

        Args:
            actions: `[B]`.
            play_on: whether the next episode is played where the environment has ended one, and so
                has begun another. Where one is cut off, after `max_steps`, none follows.
        """
        with blamed(f"at step {self.steps + 1}" + " of an episode" * (not play_on)):
            step = self.environments.step(actions, active=self.running)
        self.steps += 1
        ages, ended = self.ages + self.running, step.ended
        over = ended if self.max_steps is None else ended | (ages == self.max_steps)  # [B]
        self.finished = self.running & over
        if play_on:
            begun = self.running & ended
            self.running, self.ages = self.running & ~over | begun, np.where(begun, 0, ages)
        else:
            self.running, self.ages = self.running & ~over, ages
        self.stack.push(step.frames)  # where episodes end, their last ones
        self._last = self._last_shown = self.stack.observations[self.finished]
        if sees_screens(self._policy) and step.screens is not None:
            self._last_shown = step.screens[self.finished]
        self._last_allowed = _of(step.allowed, self.finished)
        self.stack.begin(step.following, ended)
        self._decision, self._turn = None, None
        return step

    def progress(self, what: str) -> Progress:
        """Returns how far the episodes are, and what they are played for."""
        count = len(self.running)
        return Progress(what, count - int(self.running.sum()), count, self.steps)

    def at_last(self) -> Decision:
        """Returns what is expected at the true last observations of the finished episodes."""
        told = self._told(self._last)
        own = greedy(told.value, self._last_allowed)
        return Decision(told, self.last_seen()[1] if self._policy else own)

    def last_seen(self) -> tuple[Any, FloatArray]:
        """Returns the true last observations, and how likely the policy takes each action there.

        Raises:
            TypeError: nobody was given who acts.
        """
        if self._policy is None:
            raise TypeError("Nobody was given who acts.")
        memory = rows(self._memory, self.finished[self._asked])
        nowhere = np.zeros(len(self._last), dtype=np.bool_)
        shown, allowed = self._last_shown, self._last_allowed
        return self._last, ask(self._policy, shown, memory, nowhere, allowed)[0]

    def branch(self, which: IntArray, *, rng: np.random.Generator, max_steps: int) -> "Playing":
        """Returns copies of episodes at this step, with what their policy remembers of it.

        The policy has been asked about this step: the first thing to do with copies is to `take`.

        Args:
            which: `[B′]`, the number of the running episode that each is a copy of.
            rng: of the copies' own chance, and of the policy's draws.
            max_steps: after which a copy is followed no further.

        Raises:
            NotCopyable: the environments cannot be copied.
        """
        if not hasattr(self.environments, "branch"):
            raise NotCopyable("The environments cannot be copied.", "Give them a method branch.")
        self.turn()
        other = copy(self)
        other.environments = self.environments.branch(which, int(rng.integers(2**31)))
        other.max_steps, other.steps, other._rng, other._epsilon = max_steps, 0, rng, 0.0
        other.ages = np.zeros(len(which), dtype=np.int64)
        other.stack = copy(self.stack)
        other.stack.frames = self.stack.frames[which]
        other.running = np.full(len(which), max_steps > 0)
        other.finished = np.zeros(len(which), dtype=np.bool_)
        other._memory = rows(self._memory, np.searchsorted(self._asked, which))
        other._asked = np.arange(len(which))
        other._decision, other._turn = None, None
        return other

    def _told(self, observations: Any) -> RewardDecomposition:
        if self._estimator is None:
            raise TypeError("Nobody was given who expects anything.")
        return self._estimator.decompose(observations)

    def _ask(self, policy: Policy) -> FloatArray:
        """Returns how likely the policy takes each action `[R, A]`, and lets it remember."""
        memory = rows(self._memory, self.running[self._asked])
        self._asked = np.flatnonzero(self.running)
        begins = self.ages[self._asked] == 0
        allowed = _of(self.allowed, self.running)
        likely, self._memory = ask(policy, self.shown(policy), memory, begins, allowed)
        return likely


def shown(policy: Any, environments: Environments, stack: FrameStack) -> Any:
    """Returns what a policy looks at in environments `[B, ...]`.

    Args:
        policy: who looks.
        environments: where.
        stack: what is seen there.

    Raises:
        InputError: they do not show the whole screens that it looks at.
    """
    if not sees_screens(policy):
        return stack.observations
    if (screens := getattr(environments, "screens", None)) is None:
        raise InputError(
            "The policy looks at whole screens, and they are not shown here.",
            "Name an Atari game, and make it with screens=true.",
        )
    return screens


def any_actions(
    rng: np.random.Generator, count: int, num_actions: int, allowed: BoolArray | None = None
) -> IntArray:
    """Returns any action for each episode `[B]`, evenly among those that can be taken.

    Args:
        rng: what they are drawn from.
        count: B.
        num_actions: A.
        allowed: `[B, A]`, which can be taken; None where all can always be.
    """
    if allowed is None:
        return rng.integers(num_actions, size=count)
    return drawn(allowed / allowed.sum(axis=1, keepdims=True), rng.random(count))


def _of(allowed: BoolArray | None, which: BoolArray) -> BoolArray | None:
    return None if allowed is None else allowed[which]


def drawn(probabilities: FloatArray, level: FloatArray) -> IntArray:
    """Returns `[R]`: the action of each that a level in [0, 1) falls to."""
    cumulative = probabilities.cumsum(axis=1)
    level = level * cumulative[:, -1]  # which may not be quite 1
    return np.asarray((cumulative <= level[:, None]).sum(axis=1))
