"""Branches: what else could have followed, from copies of the states that an agent came to."""

from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.environments import Environments
from trdlab.errors import InputError
from trdlab.estimator import Estimator, Future
from trdlab.policies import Policy
from trdlab.rollouts.playing import Playing, Watch, any_actions, unwatched
from trdlab.rollouts.realised import Samples, on_axis


class TooFewMoments(InputError):  # noqa: N818  it says what episodes are, not what failed
    """Episodes that are over before there is a moment to copy, or a second one."""


@dataclass(frozen=True, eq=False)
class Branches(Samples):
    """What followed each moment of some episodes n times, from copies of its state.

    The samples of a moment stand together, and what is known is known of all n.

    Args:
        actions: `[M]`, the first action of every copy.
        copies: n.
        shared_chance: whether copies were seen to know chance that is not their own.
    """

    actions: IntArray
    copies: int
    shared_chance: bool


@dataclass(frozen=True)
class Effort:
    """How much is played and copied to judge an agent, where nothing else is said.

    Args:
        judged: by how many episodes its forecasts are judged.
        episodes: how many are played for the ceiling.
        moments: how many states of each are copied, about.
        copies: how often each is.
        tries: how often each of two actions is tried at a state.
        unasked: whether an explanation copies to judge forecasts where nobody has asked for that.
    """

    judged: int = 50
    episodes: int = 20
    moments: int = 5
    copies: int = 8
    tries: int = 50
    unasked: bool = True


@dataclass(frozen=True)
class Branching:
    """How moments are copied and continued.

    Args:
        estimator: whose predictions are kept; its `future` says which rewards count, and what ends.
        policy: who acts, where that is not the estimator's greedy policy.
        copies: n, how often each moment is continued.
        steps: for which a copy is followed, by default those of the explicit components. The
            residual is known only of moments whose copies have all ended by then.

    Raises:
        InputError: there is less than one copy, or the steps do not reach the residual.
    """

    estimator: Estimator
    policy: Policy | None = None
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
        environments: Environments,
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
        is as likely as any other. After its first action a copy follows the policy alone.

        Args:
            environments: E of them; they are reset.
            every: the steps from one moment to the next.
            epsilon: the chance of a random action in the episodes, as in `collect`.
            max_steps: after which an episode is cut off; its copies go on.
            seed: of the actions, the moments and the copies.
            foils: whether each copy begins with an action other than the policy's, drawn evenly.
            watch: told how far the episodes are, after every step.

        Raises:
            TooFewMoments: there are fewer than two.
            NotCopyable: the environments cannot be copied.
        """
        rng, found = np.random.default_rng(seed), []
        phase = rng.integers(every, size=environments.num_envs)
        playing = Playing(
            self.estimator,
            environments,
            rng,
            policy=self.policy,
            epsilon=epsilon,
            max_steps=max_steps,
        )
        what = "episodes with copies of first actions" if foils else "episodes with copies"
        while playing.running.any():
            turn = playing.turn()
            due = np.flatnonzero(playing.running & (playing.steps % every == phase))  # [M′]
            if foils and playing.allowed is not None:  # there has to be another one
                due = due[playing.allowed[due].sum(axis=1) > 1]
            if len(due):
                first = turn.actions[due]
                if foils:
                    allowed = None if playing.allowed is None else playing.allowed[due]
                    first = _others(turn.own[due], environments.num_actions, rng, allowed)
                found.append(self._continued(playing, due, first, rng))
            playing.take(turn.actions)
            watch(playing.progress(what))
        copied = sum(map(len, found)) // self.copies
        if copied < 2:
            raise TooFewMoments(
                f"The episodes are so short that there are moments in them: {copied}.",
                "Copy moments more often, or play more episodes.",
            )
        return _joined(found)

    def at(self, playing: Playing, action: int, *, seed: int = 0) -> Branches:
        """Continues the first episode n times from where it stands, beginning with an action.

        Args:
            playing: where it stands; it is left as it is.
            action: the first one of every copy.
            seed: of the copies.

        Raises:
            InputError: there is no such action, or it cannot be taken here.
            NotCopyable: the environments cannot be copied.
        """
        num_actions = playing.environments.num_actions
        if not 0 <= action < num_actions:
            raise InputError(
                f"There is no action {action}.", f"They run from 0 to {num_actions - 1}."
            )
        if playing.allowed is not None and not playing.allowed[0, action]:
            allowed = np.flatnonzero(playing.allowed[0]).tolist()
            raise InputError(
                f"The environment forbids action {action} here.", f"It allows {allowed}."
            )
        rng = np.random.default_rng(seed)
        return _joined([self._continued(playing, np.array([0]), np.array([action]), rng)])

    def _continued(
        self, playing: Playing, moments: IntArray, first: IntArray, rng: np.random.Generator
    ) -> Branches:
        """Continues the `moments [M]` with the actions `first [M]`."""
        axis, future = self.estimator.time_axis, self.estimator.future
        which, actions = (np.repeat(of, self.copies) for of in (moments, first))  # [M·n]
        here = np.searchsorted(np.flatnonzero(playing.running), which)  # [M·n], of those asked
        predicted = playing.decide().decomposition.components[here, actions]  # [M·n, N+1]
        length = self.steps or axis.num_steps
        branch = playing.branch(which, rng=rng, max_steps=length)
        with closing(branch.environments):
            rewards, ended, until = _followed(branch, actions, length, future)
        if not future.time_limit_ends and (limit := playing.environments.time_limit) is not None:
            until = np.minimum(until, limit - playing.steps)  # as in `what_followed`
        later = (rewards * axis.gamma ** np.arange(length))[:, axis.num_steps :].sum(axis=1)
        observed, known = on_axis(axis, rewards[:, : axis.num_steps], later, until, ended)
        of_all = known.reshape(len(moments), self.copies, -1).all(axis=1)  # [M, N+1]
        return Branches(
            time_axis=axis,
            predicted=predicted.astype(np.float64),
            observed=observed,
            known=np.repeat(of_all, self.copies, axis=0),
            episode=which,
            num_episodes=playing.environments.num_envs,
            actions=actions,
            copies=self.copies,
            shared_chance=getattr(branch.environments, "shared_chance", False),
        )


def _followed(
    branch: Playing, actions: IntArray, length: int, future: Future
) -> tuple[FloatArray, BoolArray, IntArray]:
    """Returns counted rewards `[B, steps]`, and `[B]` what ended, and until when all is known."""
    rewards, ended = np.zeros((len(actions), length)), np.zeros(len(actions), dtype=np.bool_)
    until = np.full(len(actions), np.iinfo(np.int64).max)
    while branch.running.any():
        running, t = branch.running, branch.steps
        step = branch.take(branch.turn().actions if t else actions)
        rewards[running, t] = future.count(step.rewards)[running]
        end = running & future.ends(step.terminated, step.truncated, step.life_lost)
        ended |= end
        until[running & step.truncated & ~end] = t + 1
        branch.running = branch.running & ~end
    return rewards, ended, until


def _joined(found: list[Branches]) -> Branches:
    """Returns the moments of all times by episode; a residual is known of all of them or none."""
    order = np.argsort(np.concatenate([part.episode for part in found]), kind="stable")
    names = ("predicted", "observed", "known", "episode", "actions")
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in found])[order] for name in names
    }
    arrays["known"][:, -1] &= arrays["known"][:, -1].all()
    arrays["observed"] = np.where(arrays["known"], arrays["observed"], 0.0)
    return replace(found[0], **arrays)


def _others(
    actions: IntArray,
    num_actions: int,
    rng: np.random.Generator,
    allowed: BoolArray | None = None,
) -> IntArray:
    """Returns `[M]`: another action in place of each, drawn evenly, of those `allowed [M, A]`."""
    if num_actions < 2:
        raise InputError("There is one action only.", "A foil is another one.")
    if allowed is not None:
        others = allowed & (np.arange(num_actions) != actions[:, None])
        return any_actions(rng, len(actions), num_actions, others)
    return np.asarray((actions + rng.integers(1, num_actions, size=len(actions))) % num_actions)
