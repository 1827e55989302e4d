"""Branches: what else could have followed, from copies of the states that an agent came to."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.environments import CopyableEnvironments
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.rollouts.episodes import AS_PAID, Counting
from trdlab.rollouts.playing import Playing, Policy, Progress, Watch, decide, unwatched
from trdlab.rollouts.realised import Samples, all_or_none


class TooFewMoments(InputError):  # noqa: N818  it says what episodes are, not what failed
    """Episodes that are over before there is a moment to copy, or a second one."""


@dataclass(frozen=True, eq=False)
class Branches:
    """M moments of E episodes, and what followed each of them n times, from copies of its state.

    Args:
        time_axis: what the components mean.
        actions: `[M]`, the first action of every copy.
        predicted: `[M, N+1]`, what was predicted of it, in discounted reward.
        observed: `[M, n, N+1]`, what followed, in discounted reward.
        known: `[M, N+1]`, whether that is known of all n.
        episode: `[M]`, the number of the episode of each, in order.
        num_episodes: E.
    """

    time_axis: TimeAxis
    actions: IntArray
    predicted: FloatArray
    observed: FloatArray
    known: BoolArray
    episode: IntArray
    num_episodes: int

    @property
    def copies(self) -> int:
        """How often each moment was continued."""
        return int(self.observed.shape[1])

    @property
    def samples(self) -> Samples:
        """The same as M·n samples, for `calibrate`: of foils, this is their calibration."""
        n = self.copies
        known = np.repeat(self.known, n, axis=0)
        return Samples(
            time_axis=self.time_axis,
            predicted=np.repeat(self.predicted, n, axis=0),
            observed=np.where(known, self.observed.reshape(known.shape), 0.0),
            known=known,
            episode=np.repeat(self.episode, n),
            num_episodes=self.num_episodes,
        )


@dataclass(frozen=True)
class Copying:
    """How much is copied of the states of an agent.

    Args:
        episodes: how many are played for the ceiling.
        moments: how many states of each are copied, about.
        copies: how often each is.
        tries: how often each of two actions is tried at a state.
    """

    episodes: int = 20
    moments: int = 5
    copies: int = 8
    tries: int = 50


@dataclass(frozen=True)
class Branching:
    """How moments are copied and continued.

    Args:
        estimator: whose policy is followed, and whose predictions are kept.
        policy: what the estimator describes, where that is not its own greedy policy.
        counting: which rewards it counts, and what ends its future.
        copies: n, how often each moment is continued.
        steps: how many steps a copy is followed; by default those of the explicit components.
            The residual is known only of moments whose copies have all ended by then.

    Raises:
        InputError: there is less than one copy, or the steps do not reach the residual.
    """

    estimator: Estimator
    policy: Policy | None = None
    counting: Counting = AS_PAID
    copies: int = 8
    steps: int | None = None

    def __post_init__(self) -> None:
        least = self.estimator.time_axis.num_steps
        if self.copies < 1:
            raise InputError(f"There are {self.copies} copies.", "Ask for at least 1.")
        if self.steps is not None and self.steps < least:
            raise InputError(
                f"The copies are followed for {self.steps} steps.",
                f"The explicit components reach {least} steps.",
            )

    def along(
        self,
        environments: CopyableEnvironments,
        *,
        every: int,
        epsilon: float = 0.0,
        max_steps: int | None = None,
        seed: int = 0,
        foils: bool = False,
        watch: Watch = unwatched,
    ) -> Branches:
        """Plays one episode in each environment, and continues every so manieth moment n times.

        The first of them is drawn evenly from the first `every`, so that each step of an episode
        is as likely as any other.

        Args:
            environments: E of them; they are reset.
            every: the steps from one moment to the next.
            epsilon: the chance of a random action in the episodes, as in `collect`; after its first
                action a copy follows the policy alone.
            max_steps: after which an episode is cut off; its copies go on.
            seed: of the actions, the moments and the copies.
            foils: whether each copy begins with an action other than the policy's, drawn evenly.
            watch: told how far the episodes are, after every step.

        Raises:
            TooFewMoments: there are fewer than two.
        """
        rng, count = np.random.default_rng(seed), environments.num_envs
        phase, found = rng.integers(every, size=count), []
        playing = self._playing(environments, rng, max_steps=max_steps)
        what = "episodes with copies of first actions" if foils else "episodes with copies"
        while playing.running.any():
            running, age = playing.running, playing.steps
            decision, actions = playing.decide()
            own = actions.copy()
            random = running & (rng.random(count) < epsilon)
            actions[random] = rng.integers(environments.num_actions, size=int(random.sum()))
            due = running & (age % every == phase)
            if due.any():
                here = decision.decomposition.components[due[running]]  # [M′, A, N+1]
                first = _others(own[due], environments.num_actions, rng) if foils else actions[due]
                moments, stack = np.flatnonzero(due), playing.stack
                found.append(self._continued(environments, stack, moments, first, age, here, rng))
            playing.take(actions)
            watch(Progress(what, int(count - playing.running.sum()), count, playing.steps))
        copied = sum(len(part.actions) for part in found)
        if copied < 2:
            raise TooFewMoments(
                f"The episodes are so short that there are moments in them: {copied}.",
                "Copy moments more often, or play more episodes.",
            )
        return self._joined(found, count)

    def at(
        self,
        environments: CopyableEnvironments,
        stack: FrameStack,
        action: int,
        *,
        age: int = 0,
        seed: int = 0,
    ) -> Branches:
        """Continues the present moment of the first environment n times, beginning with an action.

        Args:
            environments: where the moment is; they are left as they are.
            stack: what the agent sees there.
            action: the first one of every copy.
            age: the steps since its episode began.
            seed: of the copies.
        """
        here = decide(self.estimator, stack.observations[:1], self.policy)
        components, rng = here.decomposition.components, np.random.default_rng(seed)
        if not 0 <= action < components.shape[1]:
            raise InputError(
                f"There is no action {action}.", f"They run from 0 to {components.shape[1] - 1}."
            )
        first, moment = np.array([action]), np.array([0])
        found = self._continued(environments, stack, moment, first, age, components, rng)
        return self._joined([found], 1)

    def _continued(
        self,
        environments: CopyableEnvironments,
        stack: FrameStack,
        moments: IntArray,
        first: IntArray,
        age: int,
        components: FloatArray,
        rng: np.random.Generator,
    ) -> Branches:
        """Continues the `moments [M]` with the actions `first [M]`; `components [M, A, N+1]`."""
        axis, copies = self.estimator.time_axis, self.copies
        which = np.repeat(moments, copies)  # [M·n]
        branch = environments.branch(which, int(rng.integers(2**31)))
        seen = FrameStack(stack.newest[which], stack.size, stack.padding)
        seen.frames[:] = stack.frames[which]
        rewards, ended = self._followed(branch, seen, np.repeat(first, copies), rng)
        branch_observed, known = _on_axis(axis, rewards, ended, environments.time_limit, age)
        shape = (len(moments), copies, axis.num_components)
        return Branches(
            time_axis=axis,
            actions=first,
            predicted=components[np.arange(len(first)), first].astype(np.float64),
            observed=branch_observed.reshape(shape),
            known=np.asarray(known.reshape(shape).all(axis=1)),
            episode=moments,
            num_episodes=environments.num_envs,
        )

    def _followed(
        self,
        branch: CopyableEnvironments,
        stack: FrameStack,
        actions: IntArray,
        rng: np.random.Generator,
    ) -> tuple[FloatArray, IntArray]:
        """Returns the counted rewards `[B, steps]`, NaN from a truncation on, and `[B]`, the ends.

        An end is the number of steps until nothing is left to come; −1 where none was seen.
        """
        count = branch.num_envs
        length = self.steps or self.estimator.time_axis.num_steps
        rewards, ended = np.zeros((count, length)), np.full(count, -1)
        playing = self._playing(branch, rng, max_steps=length, stack=stack)
        while playing.running.any():
            running, t = playing.running, playing.steps
            if t > 0:
                _, actions = playing.decide()
            step = playing.take(actions)
            rewards[running, t] = self.counting.count(step.rewards)[running]
            end = running & self.counting.ends(step)
            ended[end] = t + 1
            rewards[running & step.truncated & ~end, t + 1 :] = np.nan
            playing.running &= ~end
        return rewards, ended

    def _playing(
        self, environments: CopyableEnvironments, rng: np.random.Generator, **how: Any
    ) -> Playing:
        return Playing(self.estimator, environments, rng, policy=self.policy, **how)

    def _joined(self, found: list[Branches], num_episodes: int) -> Branches:
        """Returns the moments of all times, in the order of their episodes."""
        order = np.argsort(np.concatenate([part.episode for part in found]), kind="stable")
        names = ("actions", "predicted", "observed", "known", "episode")
        arrays: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in found])[order] for name in names
        }
        arrays["known"] = all_or_none(arrays["known"])
        return replace(found[0], **arrays, num_episodes=num_episodes)


def _others(actions: IntArray, num_actions: int, rng: np.random.Generator) -> IntArray:
    """Returns `[M]`: another action in place of each, drawn evenly."""
    if num_actions < 2:
        raise InputError("There is one action only.", "A foil is another one.")
    return np.asarray((actions + rng.integers(1, num_actions, size=len(actions))) % num_actions)


def _on_axis(
    axis: TimeAxis, rewards: FloatArray, ended: IntArray, time_limit: int | None, age: int
) -> tuple[FloatArray, BoolArray]:
    """Returns `[B, N+1]` twice: the components of `rewards [B, steps]`, and where they are known.

    As in `what_followed`, nothing beyond a `time_limit` is known, wherever the episode ended.
    """
    count, length = rewards.shape
    discounted = rewards * axis.gamma ** np.arange(length)
    explicit = discounted[:, : axis.num_steps].reshape(count, axis.horizon, axis.width)
    residual = discounted[:, axis.num_steps :].sum(axis=1)
    observed = np.column_stack([explicit.sum(axis=2), residual])  # [B, N+1]
    known = ~np.isnan(observed)
    known[:, -1] &= ended >= 0
    if time_limit is not None:
        beyond = age + axis.width * np.arange(1, axis.num_components)
        known[:, :-1] &= beyond <= time_limit
    return np.where(known, observed, 0.0), known
