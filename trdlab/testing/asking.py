"""Asking an estimator about an environment's observations, with every answer checked."""

from collections.abc import Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector.utils import concatenate, create_empty_array

from trdlab.arrays import BoolArray, FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import TrdlabError
from trdlab.estimator import Estimator
from trdlab.policies import Who, acting
from trdlab.tabular.mdp import as_policy

SAME = 1e-9
"""Of the largest component; what is closer is equal up to rounding."""


class ContractError(TrdlabError):
    """An estimator breaks the contract, or an implementation misses the right answer."""


@dataclass(frozen=True, eq=False)
class Asking:
    """An estimator and the observations it is asked about.

    Args:
        estimator: who is asked.
        space: of one observation.
        num_actions: A, of the environment.
        time_axis: what the estimator says its components mean.
    """

    estimator: Estimator
    space: gym.Space[Any]
    num_actions: int
    time_axis: TimeAxis

    def batch(self, observations: Sequence[Any]) -> Any:
        """Returns observations as a batch `[B, ...]`, or a dict or tuple of those."""
        empty: Any = create_empty_array(self.space, len(observations))
        return concatenate(self.space, observations, empty) if len(observations) else empty

    def components(self, observations: Sequence[Any]) -> FloatArray:
        """Returns the components `[B, A, N+1]` of B observations.

        Raises:
            ContractError: the answer, or the way it is given, breaks the contract.
        """
        batch = self.batch(observations)
        before = deepcopy(batch)
        try:
            answer = self.estimator.decompose(batch)
        except Exception as error:
            raise ContractError(
                f"decompose raised {type(error).__name__} for {len(observations)} observations of "
                f"{self.space}: {error}",
                "It must take a batch [B, ...] of what the environment shows.",
            ) from error
        if _bytes(batch) != _bytes(before):
            raise ContractError(
                "decompose has changed the observations that it was given.",
                "Copy them before changing anything.",
            )
        self._check(answer, len(observations))
        return answer.components

    def answer(self, batch: Any) -> FloatArray | None:
        """Returns what is said to something that may be no batch; None where it is refused."""
        with suppress(Exception):  # however it is refused
            return self.estimator.decompose(batch).components
        return None

    def _check(self, answer: RewardDecomposition, count: int) -> None:
        if not isinstance(answer, RewardDecomposition):
            raise ContractError(
                f"decompose returned a {type(answer).__name__}.",
                "Return a trdlab.RewardDecomposition.",
            )
        if answer.time_axis != self.time_axis:
            raise ContractError(
                f"decompose answered on {answer.time_axis}, and the estimator's time_axis is "
                f"{self.time_axis}.",
                "They must be equal, and stay so.",
            )
        components = answer.components
        expected = (count, self.num_actions, self.time_axis.num_components)
        if components.shape != expected:
            raise ContractError(
                f"decompose answered {count} observations with shape {components.shape}.",
                f"The environment has {self.num_actions} actions, and N = "
                f"{self.time_axis.horizon}: it must be [B, A, N+1] = {expected}.",
            )
        if components.dtype.kind != "f" or components.flags.writeable:
            state = "can be written to" if components.flags.writeable else "are read-only"
            raise ContractError(
                f"The components have type {components.dtype} and {state}.",
                "They must be read-only floating-point numbers, as RewardDecomposition makes them.",
            )
        if not np.isfinite(components).all():
            row, action, i = np.argwhere(~np.isfinite(components))[0]
            raise ContractError(
                f"Component {i} of action {action} at observation {row} of {count} is "
                f"{components[row, action, i]}.",
                "Every component must be a finite number.",
            )


def difference(one: FloatArray, other: FloatArray) -> float:
    """Returns the largest difference of two arrays, relative to the largest entry of both."""
    if not one.size:
        return 0.0
    scale = max(float(np.abs(one).max()), float(np.abs(other).max()))
    return float(np.abs(one - other).max()) / scale if scale else 0.0


def probabilities(policy: Who | None, batch: Any, components: FloatArray) -> FloatArray:
    """Returns `[B, A]`: how likely each action is.

    Args:
        policy: None for the greedy one, which takes the first of the actions that tie.
        batch: `[B, ...]`, the observations.
        components: `[B, A, N+1]`, what was said of them.

    Raises:
        InputError: the policy gives something else.
    """
    if policy is not None:
        begins = np.ones(len(components), dtype=np.bool_)
        told, _ = acting(policy).act(batch, None, begins)
        return as_policy(told, components.shape[:-1])
    chosen = np.argmax(near_best(components), axis=1)  # [B]
    return np.asarray(np.eye(components.shape[1])[chosen])


def near_best(components: FloatArray) -> BoolArray:
    """Returns `[B, A]`: whether an action's value is the largest, up to rounding."""
    values = components.astype(np.float64).sum(axis=-1)  # [B, A]
    rounding = max(SAME, 32 * float(np.finfo(components.dtype).eps))
    slack = rounding * float(np.abs(components).max(initial=0.0))
    return np.asarray(values >= values.max(axis=1, keepdims=True) - slack)


def _bytes(batch: Any) -> list[bytes]:
    """Returns the content of a batch of any space, to compare."""
    if isinstance(batch, dict):
        return [part for key in sorted(batch) for part in _bytes(batch[key])]
    if isinstance(batch, tuple | list):
        return [part for item in batch for part in _bytes(item)]
    return [np.asarray(batch).tobytes()]
