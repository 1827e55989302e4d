"""Agents of Stable-Baselines3 and sb3-contrib that are loaded already, asked as they are."""

from importlib import import_module
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import torch

from trdlab.arrays import BoolArray, FloatArray
from trdlab.environments.actions import Actions
from trdlab.environments.flat import FlatSpace
from trdlab.environments.spaces import frame_space
from trdlab.errors import InputError
from trdlab.policies.adapted import NEAREST, About, Drawing, Valuing, combined, critic_of
from trdlab.policies.networks import sizes


def adapt(model: Any) -> Drawing | Valuing | None:
    """Returns a loaded model as a policy; None where it is none.

    What its environment normalises (`VecNormalize`) is normalised here too, if the model has it.

    Args:
        model: whatever has `predict` and `policy`, such as what `PPO.load` returns.

    Raises:
        InputError: it gives neither values nor a distribution over actions.
    """
    policy = getattr(model, "policy", None)
    if policy is None or not hasattr(model, "predict") or not hasattr(policy, "obs_to_tensor"):
        return None
    kind = type(model).__name__
    space = model.observation_space
    try:
        actions = Actions.of(model.action_space, f"this {kind}")
    except InputError as error:
        raise InputError(error.cause, NEAREST) from error
    values = next((of for of in ("q_net", "quantile_net") if hasattr(policy, of)), None)
    if values is None and not hasattr(policy, "get_distribution"):
        raise InputError(
            f"This {kind} has no values of actions, and no distribution over them.",
            "Give a function from observations to action probabilities.",
        )
    memory = getattr(policy, "lstm_actor", None)
    seen = frame_space(space, kind)
    library = type(model).__module__.partition(".")[0]
    about = About(
        kind,
        {"stable_baselines3": "Stable-Baselines3"}.get(library, library.replace("_", "-")),
        str(getattr(import_module(library), "__version__", "")),
        (int(seen.n),) if isinstance(seen, gym.spaces.Discrete) else tuple(seen.shape or ()),
        len(actions),
        layers=_layers(policy, values),
        activation=getattr(getattr(policy, "activation_fn", None), "__name__", ""),
        memory=2 * memory.num_layers * memory.hidden_size if memory else 0,
        gamma=float(model.gamma),
        draws=values is None,
        parts=getattr(seen, "parts", {}),
    )
    asked = _Asked(model, seen)
    if values is None:
        scores = asked.remembering if memory else asked.logits
        critic = asked.critic_remembering if memory else asked.critic
        return Drawing(about, scores, critic_of(critic)).paid(asked.unit)
    told = Valuing(about, asked.quantiles if values == "quantile_net" else asked.values)
    return told.paid(asked.unit)


def _layers(policy: Any, values: str | None) -> str:
    """Returns the sizes of what acts; the names of its parts are those of the library."""
    if values is not None:
        return sizes(getattr(policy, values))
    extractor = getattr(policy, "mlp_extractor", None)
    parts = (
        getattr(policy, "pi_features_extractor", None),
        getattr(policy, "lstm_actor", None),
        getattr(extractor, "policy_net", None),
        getattr(policy, "action_net", None),
    )
    return sizes(*filter(None, parts))


class _Asked:
    """A loaded model, and what it says of observations.

    Args:
        model: see `adapt`.
        space: of what is seen here.
    """

    def __init__(self, model: Any, space: gym.Space[Any]) -> None:
        self._policy, self._space = model.policy, space
        finder = getattr(model, "get_vec_normalize_env", lambda: None)
        self._normalise = finder()
        self._policy.set_training_mode(False)

    @property
    def unit(self) -> float:
        """What `VecNormalize` divides rewards by; 1 where it leaves them alone."""
        by = self._normalise
        if by is None or not getattr(by, "norm_reward", False):
            return 1.0
        return float(np.sqrt(by.ret_rms.var + by.epsilon))

    def values(self, observations: Any) -> FloatArray:
        """Returns the value of each action `[B, A]`."""
        with torch.no_grad():
            return _array(self._policy.q_net(self._seen(observations)))

    def quantiles(self, observations: Any) -> FloatArray:
        """Returns the mean of the quantiles of each action `[B, A]`."""
        with torch.no_grad():
            return _array(self._policy.quantile_net(self._seen(observations)).mean(dim=1))

    def logits(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns the logits of each action `[B, A]`, and nothing to remember."""
        with torch.no_grad():
            told = self._policy.get_distribution(self._seen(observations))
        return _logits(told), None

    def remembering(
        self, observations: Any, state: Any, begins: BoolArray
    ) -> tuple[FloatArray, Any]:
        """Returns the logits of each action `[B, A]`, and a pair `[B, layers, hidden]`."""
        now, starts = self._held(state, begins)
        with torch.no_grad():
            told, then = self._policy.get_distribution(self._seen(observations), now, starts)
        return _logits(told), _pair(then)

    def critic(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns the values of states `[B, 1]`, and nothing to remember."""
        with torch.no_grad():
            return _array(self._policy.predict_values(self._seen(observations))), None

    def critic_remembering(
        self, observations: Any, state: Any, begins: BoolArray
    ) -> tuple[FloatArray, Any]:
        """Returns the values of states `[B, 1]`, and a pair `[B, layers, hidden]`.

        The library's `predict_values` does not tell what is to be remembered, and its `forward`
        does.
        """
        now, starts = self._held(state, begins)
        both = SimpleNamespace(pi=now, vf=now)
        with torch.no_grad():
            told = self._policy.forward(self._seen(observations), both, starts, deterministic=True)
        _, values, _, then = told
        return _array(values), _pair(then.vf)

    def _held(self, state: Any, begins: BoolArray) -> tuple[Any, torch.Tensor]:
        """Returns what an LSTM remembers, and where episodes begin, as the policy takes them."""
        device, lstm = self._policy.device, self._policy.lstm_actor
        blank = np.zeros((len(begins), lstm.num_layers, lstm.hidden_size), dtype=np.float32)
        now = tuple(
            torch.as_tensor(part, device=device).transpose(0, 1).contiguous()
            for part in ((blank, blank) if state is None else state)
        )
        return now, torch.as_tensor(begins, dtype=torch.float32, device=device)

    def _seen(self, observations: Any) -> Any:
        """Returns observations as the policy takes them."""
        if isinstance(self._space, FlatSpace):
            observations = self._space.unflat(observations)
        if self._normalise is not None:
            observations = self._normalise.normalize_obs(observations)
        return self._policy.obs_to_tensor(observations)[0]


def _logits(told: Any) -> FloatArray:
    """Returns the logits of a distribution `[B, A]`; those of several parts are in a list."""
    of = getattr(told, "distributions", None) or told.distribution
    return combined([_array(part.logits) for part in (of if isinstance(of, list) else [of])])


def _pair(held: Any) -> tuple[FloatArray, ...]:
    """Returns what an LSTM remembers, `[B, layers, hidden]` each."""
    return tuple(_array(part.transpose(0, 1)) for part in held)


def _array(tensor: torch.Tensor) -> FloatArray:
    return np.ascontiguousarray(tensor.cpu().numpy())
