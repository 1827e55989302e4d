"""The adapters: whose agents can be read, from files and from memory."""

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from trdlab.errors import InputError
from trdlab.policies.adapted import Drawing, Found, Student
from trdlab.policies.files import Options, open_agent
from trdlab.policies.normalisation import read_normalisation, reward_unit
from trdlab.policies.protocol import Policy
from trdlab.policies.ready import Likeliest

_FILES = (
    "stable_baselines3",
    "cleanrl",
    "cleanrl_jax",
    "baby_a3c",
    "acktr",
    "a3c_lstm",
    "linear",
)
"""Modules here with an `adapt(file, options)`; the first that knows a file has it."""

_OBJECTS = ("live",)
"""Likewise with an `adapt(object)`."""

_LARGEST = 10_000_000  # numbers in an observation


def read_policy(
    path: Path, options: Options, num_actions: Callable[[], int | None] = lambda: None
) -> Policy:
    """Returns the agent in a file of another library; what it is follows from what it holds.

    Args:
        path: of the file.
        options: what it does not say.
        num_actions: tells how many actions there are where it acts, if that is known.

    Raises:
        InputError: it is torn, holds code, or is of nobody who is known here.
    """
    file = replace(open_agent(path), num_actions=num_actions)
    for name in _FILES:
        found: Found | None = _adapter(name)(file, options)
        if found is not None:
            return _acting(found, options, path)
    raise InputError(f"'{path}' is no agent that is known.", "Give trdlab.agent a function.")


def policy_of(what: Any) -> Policy | None:
    """Returns an object of another library as a policy, or a policy as it is; None elsewhere.

    Raises:
        InputError: it is one of theirs, and cannot act here.
    """
    if isinstance(what, Policy):
        return what
    if hasattr(what, "predict") and hasattr(what, "policy"):
        adapted = (_adapter(name)(what) for name in _OBJECTS)
        return next((found for found in adapted if found is not None), None)
    return None


def _adapter(name: str) -> Any:
    return import_module(f"trdlab.policies.{name}").adapt  # by name: they import PyTorch


def _acting(found: Found, options: Options, path: Path) -> Policy:
    """Returns an agent as it should act, once it has acted."""
    seen = found.about.seen or ()
    try:
        if prod(seen) > _LARGEST:
            raise RuntimeError(f"it sees {prod(seen):,} numbers")  # noqa: TRY301
        blank = np.zeros((1, *seen), dtype=np.float32), None, np.ones(1, dtype=np.bool_)
        likely, _ = found.act(*blank)
        if (critic := getattr(found, "state_values", None)) is not None:
            critic(*blank, likely)
    except RuntimeError as error:  # how PyTorch says that layers do not follow each other
        reason = str(error).splitlines()[0]
        raise InputError(
            f"The network in '{path}' cannot be shown what it says to see, {seen}: {reason}.",
            "Save the agent again.",
        ) from error
    if options.greedy is False and not isinstance(found, Drawing):
        raise InputError(
            f"'{path}' holds the values of actions, and no probabilities to draw from.",
            "Leave out greedy.",
        )
    if options.normalize is not None and isinstance(found, Student):
        raise InputError(f"'{path}' sees frames as they are.", "Leave out normalize.")
    if options.normalize is not None and not isinstance(found, Student):
        change = read_normalisation(Path(options.normalize), found.about.seen, found.about.parts)
        found = found if change is None else found.seeing(change)
        found = found.paid(reward_unit(Path(options.normalize)))
    greedy = not found.about.draws if options.greedy is None else options.greedy
    return Likeliest(found) if greedy and isinstance(found, Drawing) else found
