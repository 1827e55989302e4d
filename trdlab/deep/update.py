"""One update: a batch of windows in, a better network out."""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from trdlab.deep.loss import acted, distillation_loss, finite_loss, of_actions, td_loss, trd_target
from trdlab.deep.networks import DecompositionNetwork, NatureNetwork
from trdlab.deep.update_settings import UpdateSettings
from trdlab.errors import InputError


class Windows(Protocol):
    """What an update reads of a batch of B windows of w steps, numpy arrays or tensors."""

    @property
    def observations(self) -> Any:
        """`[B, ...]`: s_t."""

    @property
    def actions(self) -> Any:
        """`[B]`: a_t, whole numbers from 0 to A−1."""

    @property
    def rewards(self) -> Any:
        """`[B]`: Σ_(i<w) γ^i R_(t+i)."""

    @property
    def discounts(self) -> Any:
        """`[B]`: γ^w, or 0 where the episode terminated within the window."""

    @property
    def next_observations(self) -> Any:
        """`[B, ...]`: s_(t+w), or anything where the episode terminated."""


class Batch(NamedTuple):
    """The plainest `Windows`."""

    observations: Any
    actions: Any
    rewards: Any
    discounts: Any
    next_observations: Any


class Metrics(NamedTuple):
    """What an update tells of itself.

    Args:
        loss: all that was learned from: see `td_loss`, and what a teacher adds.
        mean_value: the mean Q-value of the actions taken.
        distance: see `distillation_loss`; 0 without a teacher.
    """

    loss: float
    mean_value: float
    distance: float = 0.0


class Learner:
    """A network that learns, its target network, the optimiser, and the agent that comes of it.

    With `averaging` the agent is the mean of all networks so far, which errs less than each of
    them: θ̄ ← b θ̄ + (1 − b) θ after every update, where b rises to `averaging` (Polyak & Juditsky,
    1992, with weights that fall as in most of today's practice).

    Args:
        q_network: what learns; moved to `device`.
        settings: how.
        device: where.

    Source: Mnih et al. (2015) with the paper's Eq. trd-loss.
    """

    def __init__(
        self,
        q_network: DecompositionNetwork,
        settings: UpdateSettings | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        self.settings = settings or UpdateSettings()
        self.device = torch.device(device)
        self.q_network = q_network.to(self.device)
        self.target_network = deepcopy(self.q_network).requires_grad_(False)
        self.optimizer = torch.optim.Adam(
            self.q_network.parameters(),
            lr=self.settings.learning_rate,
            fused=self.device.type in ("cpu", "cuda"),
        )
        self.agent = self.q_network
        if self.settings.averaging:
            self.agent = deepcopy(self.q_network).requires_grad_(False)
        self.num_updates = 0

    def update(self, batch: Windows, *, taught: Any = None, distillation: float = 0.0) -> Metrics:
        """Learns from a batch once, and copies the target network when it is due.

        Args:
            batch: of windows.
            taught: `[B, A]`, the probabilities of a teacher, where there is one.
            distillation: what they weigh: λ.

        Raises:
            TrdlabError: the loss is not finite; nothing has changed then.
            InputError: the shapes or types do not fit.
        """
        settings = self.settings
        actions = self._tensor(batch.actions)  # [B]
        target = self._target(batch)  # [B, N+1]
        components, logits = self._told(self.q_network, self._tensor(batch.observations))
        loss = td_loss(components, actions, target, settings.reduction, settings.loss)
        distance = torch.zeros_like(loss)
        if taught is not None:
            student = components.sum(dim=-1) if logits is None else logits  # [B, A]
            distance = distillation_loss(student / settings.temperature, self._tensor(taught))
            loss = loss + distillation * distance
        number = finite_loss(loss, self.num_updates + 1)

        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        if settings.max_grad_norm is not None:
            nn.utils.clip_grad_norm_(self.q_network.parameters(), settings.max_grad_norm)
        self.optimizer.step()

        self.num_updates += 1
        self._average()
        if self.num_updates % settings.target_sync_updates == 0:
            self.sync_target()
        values = of_actions(components.detach(), actions).sum(dim=1)  # [B]
        value, apart = torch.stack([values.mean(), distance.detach()]).tolist()
        return Metrics(number, value, apart)

    def _target(self, batch: Windows) -> Tensor:
        """Returns what the components `[B, N+1]` should have been."""
        settings, following = self.settings, self._tensor(batch.next_observations)  # [B, ...]
        with torch.no_grad():
            components, logits = self._told(self.target_network, following)  # [B, A, N+1], [B, A]
            chooser = policy = None
            if logits is not None:
                policy = acted(logits, draw=settings.draw)  # [B, A]
            elif settings.double:
                chooser = self._told(self.q_network, following)[0]  # [B, A, N+1]
        return trd_target(
            self._tensor(batch.rewards),
            self._tensor(batch.discounts),
            components,
            selected_by=chooser,
            policy=policy,
        )

    @torch.no_grad()
    def _average(self) -> None:
        if self.agent is not self.q_network:
            of, n = self.settings.averaging, self.num_updates
            past = min(of, n / (9 + n))  # the first networks are soon forgotten
            both = zip(self.agent.parameters(), self.q_network.parameters(), strict=True)
            for mean, newest in both:
                mean.lerp_(newest, 1.0 - past)

    def begin_with(self, weights: Mapping[str, Any]) -> None:
        """Gives all networks the same weights, arrays by name, before anything is learned.

        Raises:
            InputError: they are those of another network.
        """
        for network in (self.q_network, self.target_network, self.agent):
            load_weights(network, weights)

    def standardise(self, seen: Any) -> None:
        """Makes observations like these `[M, ...]` easy to learn from; before anything is."""
        seen = seen.cpu().numpy() if isinstance(seen, Tensor) else seen  # of a card's memory
        for network in (self.q_network, self.target_network, self.agent):
            network.standardise(seen)

    def sync_target(self) -> None:
        """Copies the network to the target network."""
        self.target_network.load_state_dict(self.q_network.state_dict())

    def set_learning_rate(self, learning_rate: float) -> None:
        """Sets Adam's learning rate for the updates to come."""
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate

    def state_dict(self) -> dict[str, Any]:
        """Returns everything that later updates depend on, as plain numbers and arrays."""
        averaged = self.agent is not self.q_network
        learning = {"learning": arrays_of(self.q_network.state_dict())} if averaged else {}
        return learning | {
            "settings": asdict(self.settings),
            "num_updates": self.num_updates,
            "q_network": arrays_of(self.agent.state_dict()),
            "target_network": arrays_of(self.target_network.state_dict()),
            "optimizer": moments_of(self.optimizer, self.q_network),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes on where `state_dict` was taken, to the bit.

        Raises:
            InputError: it was taken with other settings, or of another network.
        """
        then = asdict(UpdateSettings()) | state["settings"]  # older runs did not know all of them
        if then != asdict(self.settings):
            changed = [
                f"{name} {then.get(name)} there, {value} here"
                for name, value in asdict(self.settings).items()
                if then.get(name) != value
            ]
            raise InputError(f"The settings differ: {'; '.join(changed)}.", "Use the same ones.")
        self.num_updates = state["num_updates"]
        load_weights(self.agent, state["q_network"])
        load_weights(self.q_network, state.get("learning", state["q_network"]))
        load_weights(self.target_network, state["target_network"])
        load_moments(self.optimizer, self.q_network, state["optimizer"])

    def _told(
        self, network: DecompositionNetwork, observations: Tensor
    ) -> tuple[Tensor, Tensor | None]:
        """Returns components `[B, A, N+1]` and the logits of a policy head `[B, A]`, float32.

        A context of its own for each call: autocast caches the weights it has cast, and those of a
        call without gradients must not serve one with.
        """
        reduced = self.settings.precision == "bfloat16"
        with torch.autocast(self.device.type, torch.bfloat16, enabled=reduced):
            components, logits = network.told(observations)
        return components.float(), None if logits is None else logits.float()

    def _tensor(self, array: Any) -> Tensor:
        if isinstance(array, np.ndarray) and not array.flags.writeable:
            array = array.copy()  # PyTorch warns of memory it could write to
        return torch.as_tensor(array, device=self.device)


def load_weights(network: DecompositionNetwork, weights: Mapping[str, Any]) -> None:
    """Gives a network its weights, arrays by name.

    Raises:
        InputError: they are those of another network.
    """
    images = (
        {"middle": torch.zeros_like(network.middle)} if isinstance(network, NatureNetwork) else {}
    )
    weights = images | dict(weights)  # older files of images know no mean: it was not taken away
    own = {name: tuple(value.shape) for name, value in network.state_dict().items()}
    given = {name: tuple(value.shape) for name, value in weights.items()}
    if own != given:
        unlike = sorted(name for name in own | given if own.get(name) != given.get(name))
        raise InputError(
            f"The weights are of another network: '{unlike[0]}' has shape {given.get(unlike[0])}, "
            f"not {own.get(unlike[0])}.",
            "Build the network for the same observations, actions and N.",
        )
    network.load_state_dict({name: torch.as_tensor(value) for name, value in weights.items()})


def moments_of(optimizer: torch.optim.Adam, network: nn.Module) -> dict[str, npt.NDArray[Any]]:
    """Returns Adam's moments of a network, by the names of its weights."""
    return arrays_of(
        {
            f"{name}.{kind}": value
            for name, parameter in network.named_parameters()
            for kind, value in optimizer.state[parameter].items()
        }
    )


def load_moments(
    optimizer: torch.optim.Adam, network: nn.Module, moments: Mapping[str, Any]
) -> None:
    """Gives Adam the moments that `moments_of` returned."""
    optimizer.state.clear()
    parameters = dict(network.named_parameters())
    for key, array in moments.items():
        name, _, kind = key.rpartition(".")
        weights = parameters[name]
        like = weights if np.ndim(array) else torch.zeros((), device=weights.device)
        moment = torch.empty_like(like, requires_grad=False)  # laid out as Adam lays it out
        optimizer.state[weights][kind] = moment.copy_(torch.as_tensor(array))


def arrays_of(tensors: Mapping[str, Tensor]) -> dict[str, npt.NDArray[Any]]:
    """Returns copies, each with its numbers in the usual order."""
    return {
        name: np.array(value.detach().cpu().numpy(), order="C") for name, value in tensors.items()
    }
