"""The moment that is explained: every action's decomposition, and what is known about it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from trdlab.arrays import FloatArray, difference
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, closest
from trdlab.estimator import Estimator, Future, Outlook
from trdlab.explanations.rules import Language
from trdlab.explanations.words import forms_of
from trdlab.formatting import DOUBT

if TYPE_CHECKING:
    from trdlab.explanations.calibration.calibration import Calibration


class WhatIf(NamedTuple):
    """One quantity of the world that can be varied: γ, or what a source of reward pays.

    Args:
        name: `γ`, or the source of reward, for example `the treasure`.
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
        return float(difference(q_values[action], q_values[foil]))

    def verb(self, of_gamma: str, of_reward: str, of_cost: str) -> str:
        """Returns the word for what this quantity does: γ is, a source pays or costs."""
        return of_gamma if self.name == "γ" else of_reward if self.current > 0.0 else of_cost


class Uncertainty(NamedTuple):
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
        stays: `[A]`, how likely an action leaves the state as it is and pays no more nor less than
            others that do; None if not known.
        is_over: whether the episode is over here.
        tied: the names of the optimal actions here, if several tie and their futures differ.
        tied_later: the number of later states where that is so.
        what_ifs: the quantities that can be varied, where there is a model to solve again.
        uncertainty: spread and survival, where they are known.
        outlook: what else was learned to be expected, where that is so.
        calibration: how good such forecasts are, if that has been judged.
        foils: the same of first actions that the policy does not take, or hardly ever.
        seconds_per_step: how long a step takes as people play, if that is known.
        forbidden: the names of actions that cannot be taken here; they are none of the A.
        possible: the least and the most that a component can be, as far as known.
    """

    decomposition: RewardDecomposition
    action_names: tuple[str, ...]
    future: Future
    policy: FloatArray | None = None
    totals: FloatArray | None = None
    stays: tuple[float, ...] | None = None
    is_over: bool = False
    tied: tuple[str, ...] = ()
    tied_later: int = 0
    what_ifs: tuple[WhatIf, ...] = ()
    uncertainty: Uncertainty | None = None
    outlook: Outlook | None = None
    calibration: "Calibration | None" = None
    foils: "Calibration | None" = None
    seconds_per_step: float | None = None
    forbidden: tuple[str, ...] = ()
    possible: tuple[float, float] = (-math.inf, math.inf)

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
            InputError: there is no such action, and the message suggests one; or it is forbidden.
        """
        if action in self.forbidden:
            allowed = ", ".join(self.action_names)
            raise InputError(f"The environment forbids '{action}' here.", f"It allows {allowed}.")
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

    @property
    def only_reward(self) -> float | None:
        """The one reward that was ever observed besides 0; None if there are more, or unknown."""
        known = None if self.calibration is None else self.calibration.reliability
        return None if known is None else known.amount

    def judged(self, action: str) -> "Calibration | None":
        """Returns how good forecasts of such an action are, if that has been judged."""
        return self.calibration if self.is_own(action) or self.foils is None else self.foils

    def is_own(self, action: str) -> bool:
        """Returns whether the policy takes an action often enough to be judged by what it does.

        What comes of one that is only drawn at random is hardly ever among that.
        """
        return self.policy is None or bool(self.policy[self.index(action)] >= DOUBT)

    def total(self, action: str) -> float:
        """Returns the undiscounted total of one action, NaN where none exists or is known."""
        return float("nan") if self.totals is None else float(self.totals[self.index(action)])

    def is_sure(self, action: str, components: slice = slice(None)) -> bool:
        """Returns whether chance has no part in some components of an action, as far as known."""
        known = self.uncertainty
        return known is not None and not known.deviation[self.index(action), components].any()

    def survival(self, action: str) -> FloatArray:
        """Returns `[K]`: how likely the episode still runs when components begin, as far as told.

        It runs now; what was learned is told as far as it has proved better than a guess.
        """
        i, known, learned = self.index(action), self.uncertainty, self.outlook
        if known is not None or learned is None:
            return np.ones(1) if known is None else np.asarray(known.survival[i])
        return np.asarray(learned.survival[i, : learned.survival_reach + 1])

    def difference(self, action: str, foil: str) -> FloatArray:
        """Returns `[N+1]`: action minus foil, exactly 0 where they differ only by rounding."""
        return difference(self.components(action), self.components(foil))

    def lead(self, action: str, foil: str) -> FloatArray:
        """Returns `[N+1]`: how far the action is ahead, rewards summed up to each component."""
        return difference(self.components(action).cumsum(), self.components(foil).cumsum())

    def choice(self, action: str | None = None, foil: str | None = None) -> "Choice":
        """Returns an action to explain and another to hold it against, filling in what is not said.

        By default these are what the policy does and the best real alternative: another action that
        most likely leads to another state, and expects something else if there is such a one. A
        bump into a wall is worth γ times the best action, often more than any alternative, and
        contrasts with nothing. Where no other action moves there is no foil.

        Raises:
            InputError: there is no such action, or action and foil are the same.
        """
        for name in (action, foil):
            if name is not None:
                self.index(name)
        if action is not None and action == foil:
            raise InputError(f"Action and foil are both '{action}'.", "Name two different actions.")
        likely = np.zeros(len(self.action_names)) if self.policy is None else self.policy
        order = np.lexsort((-self.q_values, -likely))  # by probability, then by value
        names = [self.action_names[a] for a in order]
        stays = dict(zip(self.action_names, self.stays or [0.0] * len(names), strict=True))

        def alternative(given: str | None) -> str | None:
            others = [name for name in names if name != given and stays[name] <= 0.5]
            differ = (o for o in others if given is None or self.difference(given, o).any())
            return next(differ, next(iter(others), None))

        if action is None:
            is_free = names[0] != foil
            action = names[0] if is_free else alternative(foil) or names[1 % len(names)]
        return Choice(self, action, foil or alternative(action))


@dataclass(frozen=True, eq=False)
class Choice:
    """An action of a moment that is explained, and another one that it is held against.

    Args:
        moment: what is known of every action.
        action: the name of one.
        foil: the name of the other; None where there is none.
    """

    moment: Moment
    action: str
    foil: str | None

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.moment.time_axis

    @property
    def orders(self) -> tuple[tuple[str, str], ...]:
        """Action and foil, and foil and action; empty where there is no foil."""
        return () if self.foil is None else ((self.action, self.foil), (self.foil, self.action))


CHOICES = Language[Choice](
    "this moment", lambda choice: forms_of(choice.time_axis, choice.moment.seconds_per_step)
)


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
    told = estimator.decompose(np.asarray(observation)[None])[0].components  # [A, N+1]
    exactly = told.astype(np.float64)  # findings compare sums, and float32 sums differ in order
    decomposition = RewardDecomposition(exactly, estimator.time_axis)
    return Moment(decomposition, tuple(action_names), estimator.future)
