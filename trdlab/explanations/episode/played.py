"""An episode that was played, what each of its steps changed, and how what is said of it looks."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.bellman import target
from trdlab.explanations.rules import Form, Language
from trdlab.explanations.words import forms_of
from trdlab.formatting import said
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import windows


@dataclass(frozen=True, eq=False)
class Revision:
    """What was expected at T′ steps of an episode, and what the next w steps made of it.

    All of it is in discounted reward as of the step itself, and component 0 after is the reward
    that came.

    Args:
        steps: `[T′]`, in order.
        last: `[T′]`, the last of the steps that component 0 covers: w − 1 later, or the end.
        ended: `[T′]`, whether the future ended with it.
        before: `[T′, N+1]`, what was predicted of the action taken.
        after: `[T′, N+1]`, what the law makes of the reward that came and of what is expected then.
    """

    steps: IntArray
    last: IntArray
    ended: BoolArray
    before: FloatArray
    after: FloatArray

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def change(self) -> FloatArray:
        """`[T′, N+1]`: after − before; the sum of a row is the TD error of its step."""
        return self.after - self.before


def revise(episode: Episode) -> Revision:
    """Returns what each step changed in what was expected.

    With r the discounted reward of the next w steps and n what is expected at t + w, before is the
    prediction p(t) of the action taken, and after is `target(r, γ^w·g, n)`; g = 0 where an end came
    in between, else 1. After − before is zero on average if p(t) is right. So is every single one
    where there is no chance. `windows` says
    which steps are left out.
    """
    axis, within = episode.time_axis, np.arange(episode.time_axis.width)
    steps, last, ended = windows(episode)  # [T′] each
    ahead = steps[:, None] + within  # [T′, w]
    padded = np.append(episode.rewards, np.zeros(axis.width - 1))
    rewards = np.where(ahead <= last[:, None], padded[ahead], 0.0)
    discounts = float(axis.gamma) ** within
    after = target(
        rewards @ discounts,
        np.where(ended, 0.0, float(axis.gamma) ** axis.width),
        episode.expected[last + 1].astype(np.float64),
    )
    before = episode.predicted[steps].astype(np.float64)
    return Revision(steps, last, ended, before, after)


@dataclass(frozen=True, eq=False)
class Played:
    """An episode with all that a story of it is held against.

    Args:
        episode: what was predicted and what happened.
        action_names: A names.
        seconds_per_step: how long a step takes as people play, if that is known.
    """

    episode: Episode
    action_names: tuple[str, ...]
    seconds_per_step: float | None = None

    @cached_property
    def revision(self) -> Revision:
        """What each step changed."""
        return revise(self.episode)

    @cached_property
    def draws(self) -> FloatArray:
        """`[T]`: how much more was expected of the action drawn than of the draws on average.

        It is 0 where nothing was drawn: the policy was sure, or a random action came before it.
        """
        episode, total = self.episode, len(self.episode)
        if episode.probabilities is None:
            return np.zeros(total)
        worth = (of.sum(axis=1, dtype=np.float64) for of in (episode.predicted, episode.expected))
        ahead = np.subtract(*(of[:total] for of in worth))
        is_drawn = (episode.probabilities.max(axis=1) < 1.0) & ~episode.random[:total]
        return np.where(is_drawn, ahead, 0.0)

    @cached_property
    def unlikely(self) -> IntArray:
        """`[D]`: the steps at which a likelier action was not drawn, and that mattered."""
        likely, steps = self.episode.probabilities, np.flatnonzero(self.draws)
        if likely is None:
            return steps
        taken = likely[steps, self.episode.actions[steps]]
        return np.asarray(steps[taken < likely[steps].max(axis=1)])

    @property
    def scale(self) -> float:
        """The largest reward that came, or value that was expected, whatever its sign."""
        episode = self.episode
        values = (episode.predicted.sum(axis=1), episode.expected.sum(axis=1), episode.rewards)
        return float(max(np.abs(of).max() for of in values))

    def action(self, step: int) -> str:
        """Returns the name of the action taken at a step."""
        return self.action_names[int(self.episode.actions[step])]


def _forms(played: Played) -> dict[str, Form]:
    axis = played.episode.time_axis
    plural = axis.width > 1

    def at(place: tuple[int, int]) -> str:
        step, component = place
        ahead = axis.steps(component)
        if ahead is None:
            return f"after step {step + axis.start(component) - 1:,}"
        first, last = step + ahead[0], step + ahead[-1]
        return f"at step {first:,}" if first == last else f"at steps {first:,} to {last:,}"

    return forms_of(axis, played.seconds_per_step) | {
        "at": Form(lambda place, _: at(place)),
        "rewards": Form(lambda worth, digits: _named(worth, digits, plural=True), abs),
        "paid": Form(lambda paid, digits: _named(paid, digits, plural=plural), abs),
        "bound": Form(lambda most, _: said(_rounded_up(most))),
    }


def _named(value: float, digits: int, *, plural: bool) -> str:
    """Returns a reward or a cost, or the worth of several."""
    kind, size = "reward" if value >= 0.0 else "cost", said(abs(value), digits)
    return f"{kind}s worth {size}" if plural else f"a {kind} of {size}"


def _rounded_up(value: float) -> float:
    """Returns a number of three digits that is no smaller."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.ceil(value / unit - 1e-9) * unit


EPISODES = Language[Played]("this episode", _forms)
