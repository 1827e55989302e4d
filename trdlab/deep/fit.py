"""Fit: the decomposition of a frozen policy, from what it did.

For a fixed policy component k is the reward that really came k steps later, on average: no maximum
compounds, and far components are learned as near ones are. What is not known of a step, because an
episode was cut off, or another action was forced meanwhile, is expected by the network itself.
"""

import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Literal, get_args

import gymnasium as gym
import numpy as np
import torch

from trdlab.arrays import FloatArray, IntArray
from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.experience import Experience
from trdlab.deep.loss import finite_loss, of_actions
from trdlab.deep.networks import DecompositionNetwork, VectorNetwork, build_network
from trdlab.errors import InputError, closest
from trdlab.estimator import Future
from trdlab.time_axis import TimeAxis

Method = Literal["mixed", "regression", "td"]

_LEAST_SCALE = 1e-6  # of the largest: a component that hardly pays is not blown up to its size
_FALLS = 5  # times that the learning rate falls before learning stops
_FALL = 0.3  # what is left of it each time
_NOTHING = 1e-3  # of what came: where it varies by less, there is nothing to predict
_LAG = 1e-2  # of what is expected: so much the target network may lag behind before it counts


@dataclass(frozen=True)
class FitSettings:
    """How a decomposition is fitted.

    Args:
        method: `regression` on what really came, where that is known, with the residual by
            bootstrapping; `td`, the law from one component to the next; or `mixed`: what came as
            far as it is known, and from there on what is expected.
        hidden: the sizes of the hidden layers, for vectors; by default none for numbered states,
            of which each has a row of its own then, and two of 256 for others.
        learning_rate: of Adam, at first; it falls where held-out error stops falling.
        batch_size: the steps in each update.
        check_every: the updates between two looks at the held-out error.
        patience: the looks without a gain after which the learning rate falls.
        most_updates: after which it stops anyway.
        sync_every: the updates between two copies to the target network.
        held_out: the share of the episodes that is not learned from.
        seed: of the weights and of the batches.

    Raises:
        InputError: there is no such method, or a share is outside (0, 1).
    """

    method: Method = "mixed"
    hidden: tuple[int, ...] | None = None
    learning_rate: float = 1e-3
    batch_size: int = 256
    check_every: int = 200
    patience: int = 3
    most_updates: int = 20_000
    sync_every: int = 50
    held_out: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise InputError(
                f"There is no method '{self.method}'.", closest(self.method, get_args(Method))
            )
        if not 0.0 < self.held_out < 1.0:
            raise InputError(
                f"A share of {self.held_out} is held out.", "Choose one between 0 and 1."
            )


@dataclass(frozen=True)
class FitProgress:
    """How far a fit is.

    Args:
        updates: made so far.
        error: on held-out episodes: the mean squared error of all that is known of them, as a share
            of that of the best constant; 1 if nothing was learned.
        best: the least so far.
    """

    updates: int
    error: float
    best: float


class Fit:
    """A network that learns what a frozen policy can expect.

    Args:
        experience: what the policy did.
        space: of its observations.
        axis: γ, N and w.
        settings: how.

    Attributes:
        network: it tells components as shares of `scale`.
        scale: `[N+1]`, the size of each component.
        possible: `[2, N+1]`, what components would be if every step paid the least, or the most,
            that one did.

    Raises:
        InputError: there is no network for such observations, or there are fewer than two episodes.
    """

    def __init__(
        self,
        experience: Experience,
        space: gym.Space[Any],
        axis: TimeAxis,
        settings: FitSettings | None = None,
    ) -> None:
        self.experience, self.axis = experience, axis
        self.settings = settings or FitSettings()
        self.rng = np.random.default_rng(self.settings.seed)
        num_actions = experience.probabilities.shape[1]
        usual = () if isinstance(space, gym.spaces.Discrete) else (256, 256)
        hidden = usual if self.settings.hidden is None else self.settings.hidden
        self.network = build_network(
            space, num_actions, axis, seed=self.settings.seed, hidden=hidden
        )
        self._learned, self._kept = self._split()
        self.scale = self._scale()
        ends = np.array([experience.rewards.min(), experience.rewards.max()])  # of one step
        most = np.append(np.ones(axis.horizon), 1.0 / (1.0 - axis.gamma**axis.width))
        group = (axis.gamma ** np.arange(axis.width)).sum() * axis.discounts * most  # [N+1]
        self.possible = np.outer([min(ends[0], 0.0), max(ends[1], 0.0)], group)
        _standardise(self.network, experience.observations[self._learned])
        self.target_network = deepcopy(self.network)
        self.optimizer = torch.optim.Adam(
            self.network.parameters(), lr=self.settings.learning_rate, fused=True
        )
        self.num_updates = 0
        self._known = self._held_out()
        self._settled = self._syncs() * self.settings.sync_every

    def run(
        self,
        tell: Callable[[FitProgress], None] = lambda progress: None,
        seconds: float | None = None,
    ) -> FitProgress:
        """Learns until held-out error stops falling, and keeps the best network.

        What is expected of what is not known has to settle first, and is no part of that error.

        Args:
            tell: told how far it is, now and then.
            seconds: after which it stops, if not before.
        """
        until = np.inf if seconds is None else time.monotonic() + seconds
        best, kept, waited, falls = np.inf, deepcopy(self.network.state_dict()), 0, 0
        most = self.settings.most_updates
        while self.num_updates < most and falls <= _FALLS and time.monotonic() < until:
            for _ in range(self.settings.check_every):
                self.update()
            error = self.error()
            if error < best or self.num_updates < self._settled:
                best, kept, waited = error, deepcopy(self.network.state_dict()), 0
            else:
                waited += 1
            if waited > self.settings.patience:
                self.network.load_state_dict(kept)
                waited, falls = 0, falls + 1
                for group in self.optimizer.param_groups:
                    group["lr"] *= _FALL
            tell(FitProgress(self.num_updates, error, best))
        self.network.load_state_dict(kept)
        return FitProgress(self.num_updates, best, best)

    def update(self) -> float:
        """Learns from a batch once; returns the loss."""
        rows = self.rng.choice(self._learned, self.settings.batch_size)  # [K]
        target, weight = self._target(rows)  # [K, N+1] each
        actions = torch.from_numpy(self.experience.actions[rows])  # [K]
        told = of_actions(self._components(self.network, rows), actions)  # [K, N+1]
        errors = (told - target).square() * weight  # [K, N+1]
        loss = errors.sum(dim=1).mean()
        number = finite_loss(loss, self.num_updates + 1)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        self.num_updates += 1
        if self.num_updates % self.settings.sync_every == 0:
            self.target_network.load_state_dict(self.network.state_dict())
        return number

    def error(self) -> float:
        """Returns the held-out error (see `FitProgress`)."""
        rows, came, known, constant = self._known
        with torch.inference_mode():
            parts = [
                of_actions(
                    self._components(self.network, part),
                    torch.from_numpy(self.experience.actions[part]),
                ).numpy()
                for part in np.array_split(rows, max(1, len(rows) // 4096))
            ]
        apart = np.where(known, np.concatenate(parts) * self.scale - came, 0.0)
        size = np.where(known, came - constant, 0.0)
        least = _NOTHING * (np.where(known, came, 0.0) ** 2 / self.scale**2).sum()
        constants = max((size**2 / self.scale**2).sum(), least, 1e-30)
        return float((apart**2 / self.scale**2).sum() / constants)

    def estimator(self, future: Future) -> NetworkEstimator:
        """Returns the network as an Estimator, its outputs in discounted reward."""
        network = deepcopy(self.network)
        scale = torch.as_tensor(self.scale, dtype=torch.float32)  # [N+1]
        rows = scale.repeat(network.num_actions)  # [A·(N+1)]
        with torch.no_grad():
            network.head.weight.mul_(rows[:, None])
            network.head.bias.mul_(rows)
        return NetworkEstimator(network, self.axis, future, possible=self.possible)

    def _components(self, network: DecompositionNetwork, rows: IntArray) -> torch.Tensor:
        told: torch.Tensor = network(torch.from_numpy(self.experience.observations[rows]))
        return told  # [K, A, N+1]

    def _target(self, rows: IntArray) -> tuple[torch.Tensor, torch.Tensor]:
        """Returns what the steps `[K]` teach, as shares of the scale, and what of it counts."""
        method = self.settings.method
        ahead = self.experience.ahead(rows, self.axis, 1 if method == "td" else None)
        with torch.inference_mode():
            following = self._components(self.target_network, ahead.follows).numpy()
        likely = self.experience.probabilities[ahead.follows][:, None]  # [K, 1, A]
        expected = np.clip((likely @ following)[:, 0] * self.scale, *self.possible)  # [K, N+1]
        target = ahead.target(self.axis, expected.astype(np.float64)) / self.scale
        counts = np.broadcast_to((np.minimum(ahead.span, ahead.own) > 0)[:, None], target.shape)
        if method == "regression":  # the residual is expected where all before it is known
            reach = ahead.rewards.shape[1]
            whole = np.minimum(ahead.span, ahead.own) >= reach
            counts = np.column_stack([ahead.known(self.axis), whole])
        return _tensor(target), _tensor(counts)

    def _split(self) -> tuple[IntArray, IntArray]:
        """Returns the steps of the episodes that are learned from, and of those that are not."""
        of = self.experience
        lasts = np.unique(of.last)
        count = max(1, round(self.settings.held_out * len(lasts)))
        if len(lasts) < 2:
            raise InputError("There is a single episode.", "Play more steps.")
        kept = self.rng.choice(lasts, count, replace=False)
        is_kept = np.isin(of.last[of.steps], kept)
        return of.steps[~is_kept], of.steps[is_kept]

    def _scale(self) -> FloatArray:
        """Returns `[N+1]`: the root mean square of what came, and what the residual could be."""
        rows = self.rng.choice(self._learned, min(len(self._learned), 20_000), replace=False)
        ahead = self.experience.ahead(rows, self.axis)
        known = ahead.known(self.axis)  # [K, N]
        came = ahead.rewards[:, : self.axis.horizon]
        size = np.sqrt((came**2 * known).sum(axis=0) / np.maximum(known.sum(axis=0), 1))
        paid = np.abs(self.experience.rewards[rows]).mean()
        whole = 1.0 / (1.0 - self.axis.gamma)
        length = np.mean(self.experience.last[rows] - rows)  # steps that were still to come
        residual = self.axis.discounts[-1] * paid * min(whole, max(length, 1.0))
        scale = np.append(size, residual)
        return np.asarray(np.maximum(scale, max(_LEAST_SCALE * scale.max(), 1e-30)))

    def _syncs(self) -> int:
        """Returns how often the target network is copied until what is expected has settled."""
        most = 1 if self.settings.method == "td" else None
        rows = self.rng.choice(self._learned, min(len(self._learned), 10_000))
        ahead = self.experience.ahead(rows, self.axis, most)
        left = np.where(ahead.over, 0.0, self.axis.gamma ** (self.axis.width * ahead.span)).mean()
        return int(np.ceil(np.log(_LAG) / np.log(left))) if 0.0 < left < 1.0 else 1

    def _held_out(self) -> tuple[IntArray, FloatArray, Any, FloatArray]:
        """Returns held-out steps, what came of them, where that is known, and its mean."""
        rows = self._kept
        if len(rows) > 20_000:
            rows = self.rng.choice(rows, 20_000, replace=False)
        ahead = self.experience.ahead(rows, self.axis)
        nothing = np.zeros((len(rows), self.axis.num_components))
        came = ahead.target(self.axis, nothing)
        rest = ahead.over if self.axis.horizon == 0 else np.zeros(len(rows), dtype=np.bool_)
        known = np.column_stack([ahead.known(self.axis), rest])
        constant = (came * known).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        return rows, came, known, constant


def _standardise(network: DecompositionNetwork, observations: Any) -> None:
    """Scales the inputs of a network for vectors as they were seen."""
    if isinstance(network, VectorNetwork) and network.num_states is None:
        seen = observations.reshape(len(observations), -1).astype(np.float64)  # [M, F]
        spread = seen.std(axis=0)
        network.middle.copy_(_tensor(seen.mean(axis=0)))
        network.scale.copy_(_tensor(1.0 / np.where(spread > 1e-8, spread, 1.0)))


def _tensor(array: Any) -> torch.Tensor:
    return torch.from_numpy(np.array(array, dtype=np.float32))
