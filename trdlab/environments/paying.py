"""Rewards of one's own: what a step pays, as a sum of what it led to, each with its weight."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.environments.arguments import parse_arguments
from trdlab.environments.outcomes import INFO, LIFE_LOST, Outcomes, Transition
from trdlab.environments.protocol import CopyableEnvironments, Environments, Step
from trdlab.environments.screens import screened
from trdlab.errors import InputError, closest

PAYS = "pays"
"""The argument of environments that says what pays, beside those that they take themselves."""
_OF_A_STEP: dict[str, Callable[[Transition], float]] = {
    "reward": lambda step: step.reward,
    "step": lambda step: 1.0,
    "terminated": lambda step: step.terminated,
}
_ENOUGH = 20  # episodes, in one of which what pays should have been told


class Paying:
    """Environments whose steps pay something else; all else about them is as it was.

    The reward of a step is Σ weight · number, of: `reward`, what the environment itself pays;
    `step`, 1 for each; `terminated` and `life_lost`, 1 where that is so; and `info.KEY`, a number
    that the environment tells. What is not named pays nothing.

    Args:
        environments: which ones.
        weights: by name.

    Raises:
        InputError: nothing pays, a name is none of these, or a weight is no finite number; at a
            step, likewise what `Outcomes` says of it, or that a number was in no step of 20
            episodes.
    """

    def __init__(self, environments: Environments, weights: Mapping[str, float]) -> None:
        self._of, self._weights = environments, checked_weights(weights)
        self._outcomes = Outcomes({name: _OF_A_STEP.get(name, name) for name in self._weights})
        self._ended = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._of, name)

    def step(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        """Takes actions `[B]`, and pays by the weights."""
        step = self._of.step(actions, active)
        which = np.flatnonzero(np.ones(len(actions), bool) if active is None else active)
        rewards = np.zeros(len(actions))
        weights = np.array(list(self._weights.values()))  # [Q]
        rewards[which] = self._outcomes.read(actions, step, which) @ weights
        if self._ended < _ENOUGH:
            self._ended += int(step.ended.sum())
            if self._ended >= _ENOUGH:
                self._outcomes.check_seen()
        return replace(step, rewards=rewards)

    def screened(self) -> Environments:
        """Returns others that pay the same, and show what people see (see `screened`)."""
        return cast(Environments, Paying(screened(self._of), self._weights))

    def branch(self, which: IntArray, seed: int) -> CopyableEnvironments:
        """Returns copies that pay the same."""
        copies = cast(CopyableEnvironments, self._of).branch(which, seed)
        return cast(CopyableEnvironments, Paying(copies, self._weights))


def paying(environments: Environments, weights: Mapping[str, float] | None) -> Environments:
    """Returns environments that pay by these weights; the same ones where there are none."""
    return environments if weights is None else cast(Environments, Paying(environments, weights))


def has_own_reward(env_arguments: Sequence[str]) -> bool:
    """Returns whether environments made with these arguments pay something else.

    >>> has_own_reward(['pays={"step":-1}'])
    True
    """
    return split_pays(parse_arguments(env_arguments))[1] is not None


def split_pays(arguments: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, float] | None]:
    """Returns the arguments that an environment takes itself, and what pays, if that is said.

    Only names with weights say it: an environment may have an argument of that name, too.

    >>> split_pays({"slip": 0.1, "pays": {"step": -1}})
    ({'slip': 0.1}, {'step': -1})
    >>> split_pays({"pays": 3})
    ({'pays': 3}, None)
    """
    pays = arguments.get(PAYS)
    if not isinstance(pays, dict):
        return dict(arguments), None
    return {name: value for name, value in arguments.items() if name != PAYS}, pays


def checked_weights(weights: Any) -> dict[str, float]:
    """Returns what pays, by name.

    Raises:
        InputError: see `Paying`.

    >>> checked_weights({"life_lost": -1})
    {'life_lost': -1.0}
    """
    example = f"For example: {PAYS}=" + '{"reward":1,"life_lost":-5}.'
    if not isinstance(weights, Mapping) or not weights:
        raise InputError(f"What pays is {weights!r}.", example)
    known = [*_OF_A_STEP, LIFE_LOST]
    for name, weight in weights.items():
        place = isinstance(name, str) and name.startswith(INFO) and name != INFO
        if name not in known and not place:
            raise InputError(f"Nothing called '{name}' can pay.", closest(str(name), known))
        number = isinstance(weight, int | float) and not isinstance(weight, bool)
        if not number or not np.isfinite(weight):
            raise InputError(f"'{name}' pays {weight!r}.", f"Give a number. {example}")
    return {name: float(weight) for name, weight in weights.items()}
