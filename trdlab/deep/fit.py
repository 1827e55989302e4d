"""Fit: the decomposition of a frozen policy, from what it did.

For a fixed policy component k is the reward that really came k steps later, on average: no maximum
compounds, and far components are learned as near ones are. What is not known of a step, because an
episode was cut off, or another action was forced meanwhile, is expected by the network itself.
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from torch.optim.swa_utils import AveragedModel

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.deep.channels import channels_of, groups_of, sizes_of
from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.experience import FAR, Ahead, Experience
from trdlab.deep.fit_settings import FitProgress, FitSettings
from trdlab.deep.loss import finite_loss
from trdlab.deep.networks import DecompositionNetwork, build_network
from trdlab.deep.update import arrays_of, load_moments, load_weights, moments_of
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.rollouts.realised import Samples
from trdlab.time_axis import TimeAxis

_BETWEEN = 10  # updates between two networks of which the mean is taken
_FALLS = 3  # times that the learning rate falls before learning stops
_FALL = 0.3  # what is left of it each time
_NOTHING = 1e-3  # of what came: where it varies by less, there is nothing to predict
_SEEN = 2_000  # observations of which the mean and the deviation are taken
_CHUNK = 4096  # rows that a network is asked about at once
_LAG = 1e-2  # of what is expected: so much the target network may lag behind before it counts


class Fit:
    """A network that learns what a frozen policy can expect.

    Args:
        experience: what the policy did.
        space: of its observations.
        axis: γ, N and w.
        settings: how.
        names: of the outcomes in the experience.
        parts: the names of those that add up to the reward.
        alike: whether all numbers that are seen are of one unit, as features are.
        copied: a network whose layers it begins with, all but the last; by default it has new ones.

    Attributes:
        channels: what is forecast, C of them.
        network: it tells the components of all channels as shares of `scale`, action by action.
        scale: `[C, N+1]`, the size of each component.
        possible: `[2, C, N+1]`, what components would be if every group paid the least, or the
            most, that one did.

    Raises:
        InputError: there is no network for such observations, there are fewer than two episodes, or
            the parts do not add up.
    """

    def __init__(
        self,
        experience: Experience,
        space: gym.Space[Any],
        axis: TimeAxis,
        settings: FitSettings | None = None,
        *,
        names: Sequence[str] = (),
        parts: Sequence[str] = (),
        alike: bool = False,
        copied: DecompositionNetwork | None = None,
    ) -> None:
        self.experience, self.axis = experience, axis
        self.settings = settings or FitSettings()
        self.rng = np.random.default_rng(self.settings.seed)
        self.channels = channels_of(experience, names, parts, axis)
        self._groups = groups_of(experience, self.channels, names, axis).astype(
            np.float32
        )  # [M, C]
        self.num_actions = experience.probabilities.shape[1]
        is_table = isinstance(space, gym.spaces.Discrete)
        usual = () if is_table else (256, 256)
        hidden = usual if self.settings.hidden is None else self.settings.hidden
        self._learning_rate = self.settings.learning_rate or (1e-2 if is_table else 1e-3)
        outputs = self.num_actions * len(self.channels)
        if copied is None:
            new = build_network(space, outputs, axis, seed=self.settings.seed, hidden=hidden)
        else:
            new = copied.with_outputs(outputs, axis.num_components, seed=self.settings.seed)
        self.network = new
        self._learned, self._kept = self._split()
        rows = self.rng.choice(self._learned, min(len(self._learned), 20_000), replace=False)
        middle, self.scale = sizes_of(experience, rows, self._groups, axis)
        with torch.no_grad():  # learning begins near the best constant
            bias = torch.from_numpy(middle / self.scale).flatten()  # [C·(N+1)]
            self.network.head.bias.copy_(bias.repeat(self.num_actions))
        paid = self._groups[experience.steps]
        ends = np.array([np.minimum(paid.min(axis=0), 0.0), np.maximum(paid.max(axis=0), 0.0)])
        most = np.append(np.ones(axis.horizon), 1.0 / (1.0 - axis.gamma**axis.width))
        self.possible = ends[..., None] * (axis.discounts * most)  # [2, C, N+1]
        if copied is None:
            some = self._learned[:: max(1, len(self._learned) // _SEEN)]
            new.standardise(experience.seen(some), alike=alike)
        self.target_network = deepcopy(self.network)
        self._mean = AveragedModel(self.network)  # of the networks since learning became slower
        self.optimizer = torch.optim.Adam(
            self.network.parameters(), lr=self._learning_rate, fused=True
        )
        self.num_updates = 0
        self.best = np.inf  # the least error on the held-out episodes
        self._best_weights = deepcopy(self.network.state_dict())
        self._waited = self._falls = 0
        self._known = self._held_out()
        once = len(self._learned) // self.settings.batch_size  # updates until all has been drawn
        settled = max(self._syncs() * self.settings.sync_every, once)
        self._settled = min(settled, self.settings.most_updates // 2)

    @property
    def done(self) -> bool:
        """Whether held-out error has stopped falling, or there are to be no more updates."""
        return self._falls > _FALLS or self.num_updates >= self.settings.most_updates

    def learn(self) -> FitProgress:
        """Learns until the next look at the held-out error, and remembers the best network.

        That is a mean of many networks, in which the noise of their batches evens out. Where it has
        not become better for long, learning goes on from it, slower, and so does the mean. First
        every step has to be drawn once: what is done seldom hardly counts in that error. And what
        is expected of what is not known has to settle: it is no part of it.
        """
        is_settling = self.num_updates < self._settled
        between = min(_BETWEEN, self.settings.check_every)
        if is_settling:
            self._mean.n_averaged.zero_()
        for _ in range(self.settings.check_every):
            self.update()
            if self.num_updates % between == 0:
                self._mean.update_parameters(self.network)
        error = self.error()
        self._waited += 1
        if error < self.best or is_settling:
            self.best, self._best_weights = error, deepcopy(self._steady.state_dict())
            self._waited = 0
        if self._waited > self.settings.patience:
            self.network.load_state_dict(self._best_weights)
            self._waited, self._falls = 0, self._falls + 1
            self._mean.n_averaged.zero_()
            self._set_learning_rate()
        share = max(self._falls / (_FALLS + 1), self.num_updates / self.settings.most_updates)
        return FitProgress(self.num_updates, error, self.best, min(share, 1.0))

    def _set_learning_rate(self) -> None:
        for group in self.optimizer.param_groups:
            group["lr"] = self._learning_rate * _FALL**self._falls

    def state_dict(self) -> dict[str, Any]:
        """Returns all that learning on depends on beside experience and settings.

        It is taken between two calls of `learn`.
        """
        return {
            "num_updates": self.num_updates,
            "best": self.best,
            "waited": self._waited,
            "falls": self._falls,
            "rng": self.rng.bit_generator.state,
            "network": arrays_of(self.network.state_dict()),
            "best_weights": arrays_of(self._best_weights),
            "mean": arrays_of(self._steady.state_dict()),
            "averaged": int(self._mean.n_averaged),
            "optimizer": moments_of(self.optimizer, self.network),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes on where `state_dict` was taken, to the bit.

        Raises:
            InputError: it is of another network.
        """
        self.num_updates, self.best = state["num_updates"], state["best"]
        self._waited, self._falls = state["waited"], state["falls"]
        self.rng.bit_generator.state = state["rng"]
        load_weights(self._steady, state["best_weights"])
        self._best_weights = deepcopy(self._steady.state_dict())
        load_weights(self._steady, state["mean"])
        self._mean.n_averaged.fill_(state["averaged"])
        load_weights(self.network, state["network"])
        load_moments(self.optimizer, self.network, state["optimizer"])
        self._set_learning_rate()

    def update(self) -> float:
        """Learns from a batch once; returns the loss."""
        at = self.num_updates % self.settings.sync_every
        if at == 0:
            self.target_network.load_state_dict(self.network.state_dict())
            self._ahead = self._drawn(self.settings.sync_every)
        rows, target, weight = (part[at] for part in self._ahead)  # [K], [K, C, N+1], [K, 1, N+1]
        told = self._components(self.network, rows)[range(len(rows)), self._actions(rows)]
        loss = ((told - torch.from_numpy(target)).square() * torch.from_numpy(weight)).sum() / len(
            rows
        )
        number = finite_loss(loss, self.num_updates + 1)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        self.num_updates += 1
        return number

    def error(self) -> float:
        """Returns the held-out error (see `FitProgress`)."""
        rows, came, known, constant = self._known
        apart = np.where(known, self._told(self._steady, rows) - came, 0.0)
        size = np.where(known, came - constant, 0.0)
        least = _NOTHING * (np.where(known, came, 0.0) ** 2).sum()
        return float((apart**2).sum() / max((size**2).sum(), least, 1e-30))

    def samples(self) -> tuple[Samples, ...]:
        """Returns for each channel what was predicted of held-out steps, and what came."""
        rows, came, known, _ = self._known
        order = np.argsort(rows)
        numbers = np.unique(self.experience.last[rows[order]], return_inverse=True)[1]
        told = np.clip(self._told(self._best(), rows) * self.scale, *self.possible)  # [K, C, N+1]
        flags = np.broadcast_to(known[:, 0], told[:, 0].shape)[order]  # [K, N+1]
        return tuple(
            Samples(
                self.axis,
                predicted=told[order, at].astype(np.float64),
                observed=np.where(flags, (came * self.scale)[order, at], 0.0),
                known=flags,
                episode=numbers,
                num_episodes=int(numbers.max()) + 1,
            )
            for at in range(len(self.channels))
        )

    def estimator(self, future: Future) -> NetworkEstimator:
        """Returns the best network as an Estimator, its outputs in discounted reward."""
        network = self._best()
        scale = torch.as_tensor(self.scale, dtype=torch.float32).flatten()  # [C·(N+1)]
        rows = scale.repeat(self.num_actions)  # [A·C·(N+1)]
        with torch.no_grad():
            network.head.weight.mul_(rows[:, None])
            network.head.bias.mul_(rows)
        return NetworkEstimator(
            network, self.axis, future, channels=self.channels, possible=self.possible
        )

    @property
    def _steady(self) -> DecompositionNetwork:
        return cast(DecompositionNetwork, self._mean.module)

    def _best(self) -> DecompositionNetwork:
        network = deepcopy(self.network)
        network.load_state_dict(self._best_weights)
        return network

    def _told(self, network: DecompositionNetwork, rows: IntArray) -> FloatArray:
        """Returns `[K, C, N+1]` of the actions taken, as shares of the scale."""
        parts = []
        with torch.inference_mode():
            for part in np.array_split(rows, -(-len(rows) // _CHUNK)):
                told = self._components(network, part)  # [K, A, C, N+1]
                parts.append(told[range(len(part)), self._actions(part)].numpy())
        return np.concatenate(parts)

    def _components(self, network: DecompositionNetwork, rows: IntArray) -> torch.Tensor:
        told: torch.Tensor = network(torch.from_numpy(self.experience.seen(rows)))
        shape = (len(rows), self.num_actions, len(self.channels), self.axis.num_components)
        return told.reshape(shape)  # [K, A, C, N+1]

    def _actions(self, rows: IntArray) -> torch.Tensor:
        return torch.from_numpy(self.experience.actions[rows])  # [K]

    def _drawn(self, count: int) -> tuple[IntArray, FloatArray, FloatArray]:
        """Returns the steps of some batches, what they teach, and what of it counts.

        Their targets hang on the target network alone, so they are worked out together: many steps
        are followed by the same one, at which the next action was forced.

        Returns:
            `[count, K]`, `[count, K, C, N+1]` as shares of the scale, and `[count, K, 1, N+1]`.
        """
        size, method = self.settings.batch_size, self.settings.method
        rows = self.rng.choice(self._learned, count * size)
        most = 1 if method == "td" else None
        ahead = self.experience.ahead(rows, self.axis, self._groups, most)
        target = ahead.target(self.axis, *self._expected(ahead)) / self.scale.astype(np.float32)
        own = np.minimum(ahead.span, ahead.own)  # [count·K]
        counts = np.broadcast_to((own > 0)[:, None], (len(rows), self.axis.num_components))
        if method == "regression":  # the residual is expected where all before it is known
            counts = np.column_stack([ahead.known(self.axis), own >= ahead.came.shape[-1]])
        whole = (rows, target, counts[:, None].astype(np.float32))
        return tuple(part.reshape(count, size, *part.shape[1:]) for part in whole)  # type: ignore[return-value]

    def _expected(self, ahead: Ahead) -> tuple[FloatArray, IntArray]:
        """Returns `[U, C, N+1]`, what is expected in rows that follow, and which one follows each.

        It is asked for only where something is still to come; for all others there is one more row.
        """
        rows, which = np.unique(np.where(ahead.over, FAR, ahead.follows), return_inverse=True)
        needed = rows[rows < FAR]
        expected = np.zeros((len(rows), *self.scale.shape), dtype=np.float32)
        with torch.inference_mode():
            for at in range(0, len(needed), _CHUNK):
                part = needed[at : at + _CHUNK]
                told = self._components(self.target_network, part)  # [K, A, C, N+1]
                likely = torch.from_numpy(self.experience.probabilities[part]).float()
                mean = torch.einsum("ka,kacn->kcn", likely, told).numpy()
                expected[at : at + len(part)] = mean
        expected *= self.scale
        return np.clip(expected, *self.possible.astype(np.float32), out=expected), which

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

    def _syncs(self) -> int:
        """Returns how often the target network is copied until what is expected has settled."""
        most = 1 if self.settings.method == "td" else None
        rows = self.rng.choice(self._learned, min(len(self._learned), 10_000))
        ahead = self.experience.ahead(rows, self.axis, self._groups, most)
        left = np.where(ahead.over, 0.0, self.axis.gamma ** (self.axis.width * ahead.span)).mean()
        return int(np.ceil(np.log(_LAG) / np.log(left))) if 0.0 < left < 1.0 else 1

    def _held_out(self) -> tuple[IntArray, FloatArray, BoolArray, FloatArray]:
        """Returns held-out steps, what came of them, where that is known, and its mean.

        What came is `[K, C, N+1]`, as shares of the scale, and known `[K, 1, N+1]`.
        """
        rows = np.unique(self.rng.choice(self._kept, 20_000))
        ahead = self.experience.ahead(rows, self.axis, self._groups)
        nothing = np.zeros((1, *self.scale.shape)), np.zeros(len(rows), dtype=np.int64)
        came = ahead.target(self.axis, *nothing) / self.scale
        rest = ahead.over if self.axis.horizon == 0 else np.zeros(len(rows), dtype=np.bool_)
        known = np.column_stack([ahead.known(self.axis), rest])[:, None]
        constant = (came * known).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        return rows, came, known, constant
