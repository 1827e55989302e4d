"""A fitted decomposition on disk: its weights, and what they are of."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trdlab.environments.interface import Interface
from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.estimator import Future
from trdlab.files import read_json, write_whole
from trdlab.runs.folder import new_manifest
from trdlab.time_axis import TimeAxis

if TYPE_CHECKING:
    from trdlab.deep.estimator import NetworkEstimator

FIT, WEIGHTS = "fit.json", "weights.safetensors"
SCHEMA = "trdlab.fit/1"


@dataclass(frozen=True)
class Whose:
    """Whose decomposition it is, as a user names it.

    Args:
        agent: a file, a run, a model.
        env: where it acts; None where it was made for.
        env_arguments: what that is made with, as `KEY=VALUE`.
    """

    agent: str
    env: str | None = None
    env_arguments: tuple[str, ...] = ()


def is_fit(path: Path) -> bool:
    """Returns whether this is the folder of a fit."""
    return (path / FIT).is_file()


def check_free_for_fit(path: Path) -> None:
    """Checks that a fit can be kept here.

    Raises:
        OutputError: there is something already.
    """
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise OutputError(f"'{path}' exists.", "Choose another `out`.")


def save_fit(
    path: Path,
    estimator: "NetworkEstimator",
    interface: Interface,
    whose: Whose | None,
    how: dict[str, Any],
) -> None:
    """Keeps a fitted decomposition in a new folder, all of it or nothing.

    Args:
        path: the folder.
        estimator: what was fitted.
        interface: what its agent sees and does.
        whose: the agent, if it has a name by which it can be found again.
        how: what it was fitted with, as plain data.

    Raises:
        OutputError: there is something already, or it cannot be written.
    """
    import json

    from safetensors.torch import save_file

    check_free_for_fit(path)
    axis, network = estimator.time_axis, estimator.network
    possible = estimator.possible
    told = {
        "schema": SCHEMA,
        "agent": None if whose is None else vars(whose),
        "time_axis": {"gamma": axis.gamma, "horizon": axis.horizon, "width": axis.width},
        "future": estimator.future.to_dict(),
        "interface": interface.to_dict(),
        "hidden": [getattr(layer, "out_features", 0) for layer in network.body.children()],
        "possible": None if possible is None else possible.tolist(),
        "how": how,
        "made": new_manifest(),
    }

    def write(folder: Path) -> None:
        folder.mkdir()
        save_file(network.state_dict(), folder / WEIGHTS)
        text = json.dumps(told, indent=1, allow_nan=False)
        (folder / FIT).write_text(text + "\n", encoding="utf-8")

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        cause = f"Cannot make '{path}': {error.strerror or error}."
        raise OutputError(cause, "Choose another `out`.") from error
    write_whole(path, write)


def load_fit(path: Path) -> tuple["NetworkEstimator", Interface, Whose | None]:
    """Returns what was fitted, what its agent sees and does, and who that is, if it has a name.

    Raises:
        TrdlabError: something is torn.
    """
    import numpy as np

    from trdlab.deep.estimator import NetworkEstimator
    from trdlab.deep.networks import build_network
    from trdlab.deep.update import load_weights
    from trdlab.policies.weights import read_weights

    told = read_json(path / FIT)
    if isinstance(told, dict) and told.get("schema", SCHEMA) != SCHEMA:
        raise TrdlabError(
            f"'{path / FIT}' has the schema '{told['schema']}', and this version reads '{SCHEMA}'.",
            "Fit the agent again, or use the version that wrote it.",
        )
    try:
        axis, whose = TimeAxis(**told["time_axis"]), told["agent"]
        interface, hidden = (
            Interface.from_dict(told["interface"]),
            tuple(size for size in told["hidden"] if size),
        )
        future = Future.from_dict(told["future"])
        possible = None if told["possible"] is None else np.array(told["possible"])
        named = whose and Whose(whose["agent"], whose["env"], tuple(whose["env_arguments"]))
    except (LookupError, TypeError, ValueError) as error:
        raise TrdlabError(
            f"'{path / FIT}' does not say what was fitted: it is torn.", "Fit the agent again."
        ) from error
    count = len(interface.action_names)
    network = build_network(interface.space, count, axis, seed=0, hidden=hidden)
    try:
        load_weights(network, read_weights(path / WEIGHTS))
    except InputError as error:
        raise TrdlabError(f"'{path}' is torn: {error.cause}", "Fit the agent again.") from error
    return NetworkEstimator(network, axis, future, possible=possible), interface, named or None
