"""Small files of agents, written as their libraries write them, without the libraries."""

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

Weights = Mapping[str, np.ndarray]

PICKLED = "gASVOwAAAAAAAACMIXN0YWJsZV9iYXNlbGluZXMzLmNvbW1vbi5wb2xpY2llc5Q="  # never to be read


def drawn(shapes: Mapping[str, tuple[int, ...]], seed: int = 0) -> dict[str, np.ndarray]:
    """Returns weights of these shapes, large enough for a network to have opinions."""
    rng = np.random.default_rng(seed)
    return {
        name: rng.normal(size=shape, scale=2.0 / np.sqrt(shape[-1])).astype(np.float32)
        for name, shape in shapes.items()
    }


def layers(prefix: str, *sizes: int, step: int = 2) -> dict[str, tuple[int, ...]]:
    """Returns the shapes of linear layers, numbered as modules of a sequence are."""
    shapes: dict[str, tuple[int, ...]] = {}
    for i in range(len(sizes) - 1):
        shapes[f"{prefix}{i * step}.weight"] = (sizes[i + 1], sizes[i])
        shapes[f"{prefix}{i * step}.bias"] = (sizes[i + 1],)
    return shapes


def box(*shape: int, dtype: str = "float32") -> dict[str, Any]:
    """Returns a Box, as version 1.0 wrote it."""
    return {
        ":type:": "<class 'gym.spaces.box.Box'>",
        ":serialized:": PICKLED,
        "dtype": dtype,
        "shape": str(list(shape)),
    }


def discrete(n: int) -> dict[str, Any]:
    """Returns a Discrete space, as today's version writes it."""
    return {
        ":type:": "<class 'gymnasium.spaces.discrete.Discrete'>",
        ":serialized:": PICKLED,
        "n": str(n),
        "start": "0",
        "_shape": "[]",
    }


def several(spaces: str) -> dict[str, Any]:
    """Returns a Dict of spaces, which are said as Python prints them."""
    kind = "<class 'gymnasium.spaces.dict.Dict'>"
    return {":type:": kind, ":serialized:": PICKLED, "spaces": spaces}


def data(module: str, seen: Any, actions: int = 2, **more: Any) -> dict[str, Any]:
    """Returns what stands beside the weights."""
    policy = {":type:": "<class 'abc.ABCMeta'>", ":serialized:": PICKLED, "__module__": module}
    spaces = {"observation_space": seen, "action_space": discrete(actions)}
    return {"policy_class": policy, **spaces, "policy_kwargs": {}, "gamma": 0.9, **more}


def torch_bytes(held: Any) -> bytes:
    """Returns what `torch.save` writes."""
    file = io.BytesIO()
    torch.save(held, file)
    return file.getvalue()


def tensors(weights: Weights) -> dict[str, torch.Tensor]:
    return {name: torch.from_numpy(weight) for name, weight in weights.items()}


def save_archive(
    path: Path, weights: Weights, beside: Any, *, version: str | None = "2.3.0", **parts: bytes
) -> Path:
    """Writes an archive; `parts` replace its own, by their names before a dot."""
    held = {
        "data": json.dumps(beside).encode(),
        "pytorch_variables.pth": torch_bytes(None),
        "policy.pth": torch_bytes(tensors(weights)),
        "policy.optimizer.pth": torch_bytes({"state": {}}),
    }
    if version is not None:
        held["_stable_baselines3_version"] = version.encode()
    for name, part in parts.items():
        held[next(known for known in held if known.partition(".")[0] == name)] = part
    with zipfile.ZipFile(path, "w") as archive:
        for name, part in held.items():
            archive.writestr(name, part)
    return path


def cartpole_dqn(path: Path, **how: Any) -> Path:
    """Writes a DQN with 4 numbers to see, 2 actions, and a hidden layer of 5."""
    shapes = layers("q_net.q_net.", 4, 5, 2) | layers("q_net_target.q_net.", 4, 5, 2)
    beside = data("stable_baselines3.dqn.policies", box(4))
    return save_archive(path, drawn(shapes), beside, **how)


def ppo_shapes(inputs: int = 4, actions: int = 2) -> dict[str, tuple[int, ...]]:
    """Returns the shapes of the weights of a PPO with a hidden layer of 5."""
    return {
        **layers("mlp_extractor.policy_net.", inputs, 5),
        **layers("mlp_extractor.value_net.", inputs, 5),
        "action_net.weight": (actions, 5),
        "action_net.bias": (actions,),
        "value_net.weight": (1, 5),
        "value_net.bias": (1,),
    }


def cartpole_ppo(path: Path, **how: Any) -> Path:
    """Writes a PPO with 4 numbers to see, 2 actions, and a hidden layer of 5."""
    beside = data("stable_baselines3.common.policies", box(4), clip_range=PICKLED)
    return save_archive(path, drawn(ppo_shapes()), beside, **how)
