"""The moment that is explained: every action's decomposition, and what is known about it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from trdlab.arrays import FloatArray, same
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, closest
from trdlab.estimator import Estimator, Future

if TYPE_CHECKING:
    from trdlab.explanations.calibration.trust import Trust


@dataclass(frozen=True, eq=False)
class WhatIf:
    """One quantity of the world that can be varied: γ, or what a source of reward pays.

    Args:
        name: `γ`, or the source, for example `the treasure`.
        current: its present value.
        low: the least value to consider.
        high: the largest value to consider.
        q_values: maps a value to the Q-values `[A]` of the moment, the policy re-optimised.
    """

    name: str
    current: float
    low: float
    high: float
    q_values: Callable[[float], FloatArray]

    def gap(self, action: int, foil: int, value: float) -> float:
        """Returns Q(action) − Q(foil) at a value, 0 where they differ only by rounding."""
        q_values = self.q_values(value)
        a, b = float(q_values[action]), float(q_values[foil])
        return 0.0 if same(a, b) else a - b


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """What is known of a moment beyond its means.

    Args:
        deviation: `[A, N+1]`, the standard deviation of each component.
        return_deviation: `[A]`, that of all of an action's discounted reward.
        survival: `[A, N+1]`, the probability that the episode still runs when a component begins.
        outcomes: for each action and each explicit step, the probability of each reward; empty
            for w > 1.
    """

    deviation: FloatArray
    return_deviation: FloatArray
    survival: FloatArray
    outcomes: tuple[tuple[dict[float, float], ...], ...] = ()


@dataclass(frozen=True, eq=False)
class Moment:
    """What an agent expects of each action, here and now.

    Args:
        decomposition: `[A, N+1]`.
        action_names: A names.
        future: whose future it is, in which reward, and what ends it.
        policy: `[A]`, the probability of each action under the policy; None if not known.
        totals: `[A]`, undiscounted totals of the same policy, NaN where none exists; None where
            they cannot be known (no exact model).
        changes_state: `[A]`, whether an action can lead to another state; None if not known.
        tied: the names of the optimal actions here, if several tie and their futures differ.
        tied_later: the number of later states where that is so.
        what_ifs: the quantities that can be varied, where there is a model to solve again.
        uncertainty: spread and survival, where they are known.
        trust: how far such forecasts can be trusted, if that has been judged.
        foil_trust: the same of first actions that the policy does not take.
        error: `[N+1]`, what such forecasts are off by, in discounted reward: the root mean square
            of predicted − observed, NaN where it is not known; None if it has not been judged.
        foil_error: the same of first actions that the policy does not take.
        only_reward: the one reward that was ever observed besides 0; None where there were several,
            and where that is not known.
        seconds_per_step: how long a step takes as people play, if that is known.
    """

    decomposition: RewardDecomposition
    action_names: tuple[str, ...]
    future: Future
    policy: FloatArray | None = None
    totals: FloatArray | None = None
    changes_state: tuple[bool, ...] | None = None
    tied: tuple[str, ...] = ()
    tied_later: int = 0
    what_ifs: tuple[WhatIf, ...] = ()
    uncertainty: Uncertainty | None = None
    trust: "Trust | None" = None
    foil_trust: "Trust | None" = None
    error: FloatArray | None = None
    foil_error: FloatArray | None = None
    only_reward: float | None = None
    seconds_per_step: float | None = None

    def __post_init__(self) -> None:
        if self.decomposition.shape != (len(self.action_names),):
            raise InputError(
                f"The decomposition has shape {self.decomposition.shape}, there are "
                f"{len(self.action_names)} action names.",
                "A moment is [A, N+1], with a name for each action.",
            )

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.decomposition.time_axis

    @property
    def is_exact(self) -> bool:
        """Whether a solved model is spoken of: what is expected then carries no noise."""
        return self.totals is not None

    def index(self, action: str) -> int:
        """Returns the number of an action.

        Raises:
            InputError: there is no such action; the message suggests one.
        """
        if action not in self.action_names:
            raise InputError(f"There is no action '{action}'.", closest(action, self.action_names))
        return self.action_names.index(action)

    def components(self, action: str) -> FloatArray:
        """`[N+1]`: the components of one action."""
        return np.asarray(self.decomposition.components[self.index(action)])

    @cached_property
    def q_values(self) -> FloatArray:
        """`[A]`."""
        return self.decomposition.value

    def q_value(self, action: str) -> float:
        """Returns the Q-value of one action."""
        return float(self.q_values[self.index(action)])

    def trust_of(self, action: str) -> "Trust | None":
        """Returns how far forecasts of such an action can be trusted, if that has been judged."""
        return self.foil_trust if self._is_judged_foil(action) else self.trust

    def error_of(self, action: str) -> FloatArray | None:
        """`[N+1]`: what forecasts of such an action are off by, if that has been judged."""
        return self.foil_error if self._is_judged_foil(action) else self.error

    def _is_judged_foil(self, action: str) -> bool:
        chance = 1.0 if self.policy is None else self.policy[self.index(action)]
        return bool(chance == 0.0) and self.foil_trust is not None

    def total(self, action: str) -> float:
        """Returns the undiscounted total of one action, NaN where none exists or is known."""
        return float("nan") if self.totals is None else float(self.totals[self.index(action)])

    def ordered(self, action: str, foil: str) -> tuple[str, str]:
        """Returns the better of two actions, then the other."""
        return (action, foil) if self.q_value(action) > self.q_value(foil) else (foil, action)

    def pair(self, action: str | None, foil: str | None) -> tuple[str, str | None]:
        """Returns the action to explain and its foil, filling in what was not asked for.

        By default these are what the policy does and the best other action. Neither is an action
        that surely leaves the state as it is: a bump into a wall is worth γ times the best
        action, often more than any real alternative, and contrasts with nothing. Where no second
        action changes the state there is no foil.

        Raises:
            InputError: there is no such action, or action and foil are the same.
        """
        for name in (action, foil):
            if name is not None:
                self.index(name)
        if action is not None and action == foil:
            raise InputError(f"Action and foil are both '{action}'.", "Name two different actions.")
        moving = self.changes_state or (True,) * len(self.action_names)
        likely = np.zeros(len(self.action_names)) if self.policy is None else self.policy
        order = np.lexsort((-self.q_values, -likely))  # by probability, then by value
        options = [self.action_names[a] for a in order if moving[a]]
        best = self.action_names[order[0]]
        action = action or next((name for name in options if name != foil), best)
        return action, foil or next((name for name in options if name != action), None)


def moment_of(estimator: Estimator, observation: Any, action_names: Sequence[str]) -> Moment:
    """Returns what any estimator expects at one observation, and nothing that it cannot know.

    Args:
        estimator: an exact table, a learned one, a network.
        observation: one observation, without a batch axis.
        action_names: A names.

    Raises:
        InputError: the number of names is not that of the actions.

    >>> from trdlab.tabular import MDP, exact
    >>> coin = MDP.from_transitions([[[(1.0, 0, 1.0, True)], [(1.0, 0, 0.0, False)]]])
    >>> moment_of(exact(coin, TimeAxis(0.5, 1)), 0, ["take", "wait"]).q_value("wait")
    0.5
    """
    batch = np.asarray(observation)[None]  # [1, ...]
    told = estimator.decompose(batch)[0].components  # [A, N+1]
    exactly = told.astype(np.float64)  # findings compare sums, and float32 sums differ in order
    decomposition = RewardDecomposition(exactly, estimator.time_axis)
    return Moment(decomposition, tuple(action_names), estimator.future)
