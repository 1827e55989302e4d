"""What an archive of Stable-Baselines3 says of itself: as text beside pickles left unread."""

import re
from ast import literal_eval
from collections.abc import Iterable, Mapping
from typing import Any

Shape = tuple[int, ...]

_PART = re.compile(  # such as 'key': Box(-1.0, 1.0, (4,), float32), or ('key', Box(…)) of old
    r"""(?P<key>'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*")\s*[:,]\s*(?P<kind>[A-Z]\w*)\((?P<rest>[^'"]*)"""
)
_SHAPE = re.compile(r"\(([\d, ]*)\), \w+\)")  # of a Box, before its type


def kind(space: Any, *kinds: str) -> str:
    """Returns which of some kinds a space is, if it is one of them."""
    said = str(space.get(":type:", "")) if isinstance(space, dict) else ""
    return next((name for name in kinds if said.endswith(f".{name}'>")), "")


def shape(space: Any) -> Shape:
    """Returns the shape of a Box; () where none is said."""
    if not isinstance(space, dict) or not kind(space, "Box"):
        return ()
    return _numbers(space.get("_shape", space.get("shape", "")))


def states(space: Any) -> int:
    """Returns the number of states of a Discrete space; 0 where none is said."""
    if not isinstance(space, dict) or not kind(space, "Discrete"):
        return 0
    said = str(space.get("n", ""))
    return int(said) if said.isdecimal() and len(said) < 10 else 0


def choices(space: Any) -> Shape:
    """Returns how many choices each part of an action has; () where none are said.

    >>> kind = {":type:": "<class 'gymnasium.spaces.multi_discrete.MultiDiscrete'>"}
    >>> choices(kind | {"nvec": "[2 3]"})
    (2, 3)
    """
    if isinstance(space, dict) and kind(space, "MultiDiscrete"):
        return _numbers(space.get("nvec", ""))
    return (states(space),) if states(space) else ()


def parts(space: Any) -> dict[str, Shape]:
    """Returns the shapes of the parts of a Dict by name, in order; of one of n numbers `(n,)`.

    >>> kind = {":type:": "<class 'gymnasium.spaces.dict.Dict'>"}
    >>> parts(kind | {"spaces": "{'at': Box(-1.0, 1.0, (2,), float32), 'key': Discrete(3)}"})
    {'at': (2,), 'key': (3,)}
    """
    if not isinstance(space, dict) or not kind(space, "Dict"):
        return {}
    found = _PART.finditer(str(space.get("spaces", "")))
    return {str(literal_eval(part["key"])): _part(part["kind"], part["rest"]) for part in found}


def algorithm(weights: Iterable[str], data: Mapping[str, Any], values: str) -> str:
    """Returns the algorithm that an archive is of; it does not say so itself."""
    home = module(data)
    if values:
        return "QR-DQN" if values == "quantile_net" else "DQN"
    if any(name.startswith("lstm_actor.") for name in weights):
        return "RecurrentPPO"
    if "action_net.weight" in weights:
        if "maskable" in home:
            return "MaskablePPO"
        if "clip_range" in data:
            return "PPO"
        return "TRPO" if "cg_max_steps" in data else "A2C"
    found = re.search(r"\.(\w+)\.policies$", home)
    return found[1].upper() if found else "an unknown algorithm"


def module(data: Mapping[str, Any]) -> str:
    """Returns the module of its policy's class, such as `stable_baselines3.dqn.policies`."""
    kind = data.get("policy_class")
    said = kind.get("__module__", "") if isinstance(kind, dict) else ""
    return re.sub(r"[^\w.]", "?", str(said))


def _part(kind: str, rest: str) -> Shape:
    """Returns the shape of a part of a Dict; () where it is of another kind."""
    if kind == "Box":
        said = _SHAPE.search(rest)
        return _numbers(said[1]) if said else ()
    numbers = _numbers(rest.partition(")")[0])
    if kind == "MultiDiscrete":
        return (sum(numbers),)
    return numbers[:1] if kind == "Discrete" else numbers if kind == "MultiBinary" else ()


def _numbers(said: Any) -> Shape:
    return tuple(map(int, re.findall(r"\d{1,9}", str(said))))
