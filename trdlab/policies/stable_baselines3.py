"""Agents in the archives of Stable-Baselines3 and sb3-contrib; neither has to be installed.

Only tensors and plain JSON are read: what an archive holds as pickles stays unread. Layers and
their sizes follow from the tensors. The formats are those of versions 1.0 to 2.9. The masks of
MaskablePPO are the environment's, and are no part of the archive.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np
from torch import nn

from trdlab.arrays import BoolArray, FloatArray
from trdlab.environments.actions import MOST
from trdlab.errors import InputError
from trdlab.policies import archived
from trdlab.policies.adapted import (
    NEAREST,
    About,
    Drawing,
    Scores,
    StateValues,
    Valuing,
    combined,
    critic_of,
)
from trdlab.policies.files import AgentFile, Options
from trdlab.policies.networks import (
    Combined,
    Network,
    Recurrent,
    Weights,
    activation,
    convolutions,
    dense,
    flow,
    lstm,
    numbered,
    plain,
    sizes,
)

LIBRARY = "Stable-Baselines3"
_KNOWN = ("DQN", "PPO", "A2C", "QR-DQN", "MaskablePPO", "RecurrentPPO", "TRPO")
_GIVE_MODEL = "Load it with its library, and give the model to trdlab.agent."
_STRIDES = (4, 2, 1)  # of its NatureCNN
_BYTES = 255.0

# What does not act: critics, targets, and the twins of a shared extractor.
_IDLE = re.compile(
    r"(q_net_target|quantile_net_target|value_net|vf_features_extractor|pi_features_extractor"
    r"|mlp_extractor\.value_net|lstm_critic|critic)\."
)
_EXTRACTOR = r"features_extractor\.(extractors\.[^.]+\.)?(cnn\.\d+|linear\.0)\.(weight|bias)"
_VALUES = re.compile(
    rf"(q_net|quantile_net)\.({_EXTRACTOR}|(q_net|quantile_net)\.\d+\.(weight|bias))"
)
_ACTOR = re.compile(
    rf"{_EXTRACTOR}|mlp_extractor\.policy_net\.\d+\.(weight|bias)|action_net\.(weight|bias)"
    r"|lstm_actor\.(weight|bias)_(ih|hh)_l\d+"
)


def adapt(file: AgentFile, options: Options) -> Drawing | Valuing | None:
    """Returns the agent in an archive; None where the file is none.

    Args:
        file: what was read of it.
        options: the activation is by default what the file says, or that of the algorithm.

    Raises:
        InputError: the algorithm, or a part of its network, cannot be read.
    """
    if file.data is None:
        return None
    saved = _Saved.of(file, file.data)
    return _valuing(saved, options) if saved.values else _drawing(saved, options)


@dataclass(frozen=True, eq=False)
class _Saved:
    """An archive, as far as it matters how its agent acts.

    Args:
        algorithm: its name.
        weights: those that act, by name.
        values: the name of its network of values, if it has one.
        file: the archive.
        data: what it says of itself.
        kwargs: how its policy was made.
    """

    algorithm: str
    weights: Weights
    values: str
    file: AgentFile
    data: Mapping[str, Any]
    kwargs: Mapping[str, Any]

    @classmethod
    def of(cls, file: AgentFile, data: Mapping[str, Any]) -> "_Saved":
        weights = {name: of for name, of in file.weights.items() if not _IDLE.match(name)}
        values = next(
            (of for of in ("q_net", "quantile_net") if f"{of}.{of}.0.weight" in weights), ""
        )
        said = data.get("policy_kwargs")
        kwargs = said if isinstance(said, dict) else {}
        saved = cls(archived.algorithm(weights, data, values), weights, values, file, data, kwargs)
        saved.check()
        return saved

    def check(self) -> None:
        """Refuses a network that is not the library's own."""
        path, known = self.file.path, _VALUES if self.values else _ACTOR
        made = str(self.kwargs.get("features_extractor_class", ""))
        homes = {"policy": archived.module(self.data), "extractor": made.removeprefix("<class '")}
        for part, home in homes.items():
            if home and home.partition(".")[0] not in ("stable_baselines3", "sb3_contrib"):
                raise InputError(
                    f"The {part} in '{path}' is of a class of its own, in the module "
                    f"{home.partition('.')[0]!r}.",
                    _GIVE_MODEL,
                )
        if self.algorithm not in _KNOWN:
            raise InputError(
                f"'{path}' holds an agent of {self.algorithm}.",
                f"Those of {', '.join(_KNOWN)} can be read; give trdlab.agent the loaded model.",
            )
        seen = self.data.get("observation_space")
        if (kind := archived.kind(seen, "Dict", "Tuple")) and not self.parts:
            raise InputError(
                f"The agent in '{path}' sees a {kind} of observations, and their parts are not "
                "said.",
                _GIVE_MODEL,
            )
        done = self.data.get("action_space")
        if kind := archived.kind(done, "Box", "MultiBinary"):
            raise InputError(f"The actions of the agent in '{path}' are a {kind}.", NEAREST)
        if prod(archived.choices(done)) > MOST:
            raise InputError(
                f"The actions of the agent in '{path}' have {prod(archived.choices(done)):,} "
                "combinations.",
                f"{NEAREST} There may be {MOST} of them.",
            )
        if strange := [name for name in self.weights if not known.fullmatch(name)]:
            raise InputError(
                f"'{path}' has '{strange[0]}', which {self.algorithm} of {LIBRARY} does not have "
                "of itself.",
                _GIVE_MODEL,
            )

    def about(self, seen: tuple[int, ...], num_actions: int, **more: Any) -> About:
        """Returns what is known."""
        gamma = self.data.get("gamma")
        return About(
            self.algorithm,
            LIBRARY,
            self.file.version,
            seen,
            num_actions,
            gamma=gamma if isinstance(gamma, float | int) and 0.0 <= gamma <= 1.0 else None,
            parts=self.parts,
            **more,
        )

    def activation(self, options: Options) -> type[nn.Module]:
        """Returns what stands between its dense layers."""
        said = re.search(r"\.(\w+)'>$", str(self.kwargs.get("activation_fn", "")))
        usual = "ReLU" if self.values else "Tanh"
        return activation(options.activation or (said[1] if said else usual))

    def features(self, prefix: str) -> tuple[list[nn.Module], tuple[int, ...], float]:
        """Returns what stands before the dense layers, what is seen, and what divides it."""
        space = self.data.get("observation_space")
        raw = str(self.kwargs.get("normalize_images", True)) == "False"
        if parts := self.parts:
            images = {
                number: self.of_image(f"{prefix}extractors.{name}.")
                for number, name in enumerate(parts)
                if numbered(self.weights, f"{prefix}extractors.{name}.cnn.")
            }
            combined = Combined(list(parts.values()), images, 1.0 if raw else _BYTES)
            return [combined], (sum(map(prod, parts.values())),), 1.0
        shape, size = archived.shape(space), archived.states(space)
        is_image = (
            len(shape) == 3 and isinstance(space, dict) and "uint8" in str(space.get("dtype"))
        )
        divisor = 1.0 if raw or not is_image else _BYTES
        if not numbered(self.weights, f"{prefix}cnn."):
            return [nn.Flatten()], shape or ((size,) if size else ()), divisor
        return [self.of_image(prefix)], shape, divisor

    def of_image(self, prefix: str) -> nn.Module:
        """Returns the layers that an image goes through first."""
        names = numbered(self.weights, f"{prefix}cnn.")
        linear = dense(self.weights, [f"{prefix}linear.0"], nn.ReLU, ends=True)
        return nn.Sequential(convolutions(self.weights, names, _STRIDES), linear)

    @property
    def parts(self) -> dict[str, tuple[int, ...]]:
        """The shapes of what is seen by name, where that is a Dict."""
        return archived.parts(self.data.get("observation_space"))

    @property
    def choices(self) -> tuple[int, ...]:
        """How many choices each part of an action has, if that is said."""
        return archived.choices(self.data.get("action_space"))


def _valuing(saved: _Saved, options: Options) -> Valuing:
    """Returns the agent of DQN or QR-DQN."""
    between, of = saved.activation(options), saved.values
    before, seen, divisor = saved.features(f"{of}.features_extractor.")
    head = dense(saved.weights, numbered(saved.weights, f"{of}.{of}."), between)
    (_, outputs), actions = flow(head), sum(saved.choices)
    quantiles = outputs // actions if of == "quantile_net" and actions else 1
    count = outputs // quantiles
    _check_actions(saved, count)
    network = Network(nn.Sequential(*before, head), _seen(saved, seen, before, head), divisor)
    about = saved.about(
        network.seen,
        count,
        layers=sizes(network.layers),
        activation=_named(between, head),
        draws=False,
    )

    def values(observations: Any) -> FloatArray:
        told = network(observations)
        return np.asarray(told.reshape(len(told), quantiles, count).mean(axis=1))

    return Valuing(about, values)


def _drawing(saved: _Saved, options: Options) -> Drawing:
    """Returns the agent of an algorithm with an actor."""
    between, weights = saved.activation(options), saved.weights
    before, seen, divisor = saved.features("features_extractor.")
    after = _after(weights, "policy_net", "action_net", between)
    _, outputs = flow(after)
    _check_actions(saved, outputs)
    count = prod(saved.choices) if saved.choices else outputs
    told: dict[str, Any] = {"activation": _named(between, after)}
    if saved.algorithm != "RecurrentPPO":
        network = Network(nn.Sequential(*before, after), _seen(saved, seen, before, after), divisor)
        about = saved.about(network.seen, count, layers=sizes(network.layers), **told)
        return Drawing(
            about, _combining(saved, plain(network)), _critic(saved, between, network.seen)
        )
    memory = lstm(weights, "lstm_actor.")
    network = Network(nn.Sequential(*before), _seen(saved, seen, before, memory), divisor)
    about = saved.about(
        network.seen,
        count,
        layers=sizes(network.layers, memory, after),
        memory=2 * memory.num_layers * memory.hidden_size,
        **told,
    )
    scores = _combining(saved, Recurrent(network, memory, after))
    return Drawing(about, scores, _critic(saved, between, network.seen))


def _critic(saved: _Saved, between: type[nn.Module], seen: tuple[int, ...]) -> StateValues | None:
    """Returns its critic, which has layers of its own, if it is kept in the archive."""
    whole = replace(saved, weights=saved.file.weights)
    parts = {name.partition(".")[0] for name in whole.weights}
    if "value_net" not in parts:
        return None
    own = "vf_features_extractor" if "vf_features_extractor" in parts else "features_extractor"
    before, _, divisor = whole.features(f"{own}.")
    after = _after(whole.weights, "value_net", "value_net", between)
    if saved.algorithm != "RecurrentPPO" or "critic" in parts:
        first = dense(whole.weights, ["critic"] * ("critic" in parts), between)
        return critic_of(plain(Network(nn.Sequential(*before, *first, after), seen, divisor)))
    memory = lstm(whole.weights, "lstm_critic." if "lstm_critic" in parts else "lstm_actor.")
    return critic_of(Recurrent(Network(nn.Sequential(*before), seen, divisor), memory, after))


def _after(weights: Weights, hidden: str, last: str, between: type[nn.Module]) -> nn.Sequential:
    """Returns the layers of an actor, or of a critic, after what both may share."""
    names = numbered(weights, f"mlp_extractor.{hidden}.")
    layers = dense(weights, names, between, ends=True)
    return nn.Sequential(*layers, *dense(weights, [last], between))


def _combining(saved: _Saved, scores: Scores) -> Scores:
    """Returns the scores of actions, where a network tells those of the choices of their parts."""
    if len(saved.choices) < 2:
        return scores
    ends = np.cumsum(saved.choices)[:-1]

    def told(observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        logits, state = scores(observations, state, begins)
        return combined(np.split(logits, ends, axis=1)), state

    return told


def _seen(
    saved: _Saved, said: tuple[int, ...], before: list[nn.Module], after: nn.Module
) -> tuple[int, ...]:
    """Returns the shape of an observation: what the archive says, if the first layer agrees."""
    if saved.parts:
        return said
    first = next(layer for part in (*before, after) for layer in part.modules() if _takes(layer))
    takes = _takes(first)
    if isinstance(first, nn.Conv2d):
        if len(said) == 3 and said[0] == takes:
            return said
        raise InputError(
            f"The network in '{saved.file.path}' takes {takes} channels, and the archive says that "
            f"observations have shape {said}.",
            _GIVE_MODEL,
        )
    return said if int(np.prod(said)) == takes and said else (takes,)


def _takes(layer: nn.Module) -> int:
    if isinstance(layer, nn.Conv2d):
        return layer.in_channels
    return int(getattr(layer, "in_features", 0) or getattr(layer, "input_size", 0))


def _named(between: type[nn.Module], layers: nn.Sequential) -> str:
    return between.__name__ if any(isinstance(layer, between) for layer in layers) else ""


def _check_actions(saved: _Saved, count: int) -> None:
    """Refuses a network that has more or fewer outputs than there are actions."""
    said = sum(saved.choices)
    if said and said != count:
        raise InputError(
            f"The network in '{saved.file.path}' has {count} outputs for {said} choices.",
            "Save the model again: model.save(…).",
        )
