"""Gymnasium's environments with a transition table, made by id and put into words."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from trdlab.formatting import amount
from trdlab.tabular.environments import environment_name, from_environment, start_distribution
from trdlab.tabular.mdp import MDP
from trdlab.tabular.named import AGENT, Coordinate, TabularWorld


def tabular_world(env: Any) -> TabularWorld:
    """Returns the model of an environment, and the words for what is known of it.

    FrozenLake, CliffWalking and Taxi are known; of others states and actions have numbers.

    Args:
        env: a Gymnasium environment (see `from_environment`).

    Raises:
        InputError: it has no transition table, or a bad one.

    >>> import gymnasium
    >>> world = tabular_world(gymnasium.make("FrozenLake-v1"))
    >>> world.describe(6), world.find_state("1,2"), world.action_names
    ('row 1, column 2', 6, ('left', 'down', 'right', 'up'))
    >>> print(world.draw(6))
    SFFF
    FH@H
    FFFH
    HFFG
    """
    mdp, base, spec = from_environment(env), env.unwrapped, env.spec
    own = tuple(map(str, getattr(base, "action_names", ())))
    words: dict[str, Any] = {"action_names": own}
    for kind in type(base).__mro__:
        if kind.__name__ in _KNOWN:
            words = _KNOWN[kind.__name__](base, mdp)
            break
    sizes = [coordinate.size for coordinate in words.get("coordinates", ())]
    if len(words["action_names"]) != mdp.num_actions or int(np.prod(sizes or mdp.num_states)) != (
        mdp.num_states
    ):
        words = {"action_names": tuple(f"action {i}" for i in range(mdp.num_actions))}
    arguments = _defaults(type(base)) | dict(spec.kwargs if spec else {})
    if arguments.get("desc") is not None:
        arguments.pop("map_name", None)  # a map of one's own takes the place of a named one
    return TabularWorld(
        mdp,
        environment_name(env),
        **words,
        arguments=arguments,
        starts=start_distribution(env),
        time_limit=spec.max_episode_steps if spec else None,
    )


def make_world(env_id: str, arguments: Mapping[str, Any] | None = None) -> TabularWorld:
    """Makes an environment by its Gymnasium id, and returns its model in words.

    Args:
        env_id: such as `FrozenLake-v1`, or `module:id` to import a module first.
        arguments: what to make it with, such as `{"is_slippery": False}`.

    Raises:
        InputError: there is no such environment, it does not take the arguments, or it has no
            transition table.
    """
    from trdlab.environments.making import make_environment

    env = make_environment(env_id, arguments, known=toy_text_ids())
    world = tabular_world(env)
    env.close()
    return world


def toy_text_ids() -> list[str]:
    """Returns the ids of the environments with a transition table that come with Gymnasium."""
    import gymnasium

    specs = [spec for spec in gymnasium.registry.values() if ".toy_text." in str(spec.entry_point)]
    return [spec.id for spec in specs if not spec.name.startswith("Blackjack")]


def _defaults(kind: type) -> dict[str, Any]:
    """Returns what an environment is made with when nothing is said; without the rendering."""
    parameters = inspect.signature(kind).parameters.values()
    return {
        p.name: p.default
        for p in parameters
        if p.default is not p.empty and p.default is not None and p.name != "render_mode"
    }


# ---- the environments whose states have names ----------------------------------------------------


def _frozen_lake(env: Any, mdp: MDP) -> dict[str, Any]:
    grid = tuple(b"".join(row).decode() for row in env.desc)
    tiles = "".join(grid)
    words = {"S": "start", "F": "frozen", "H": "hole", "G": "goal"}
    legend = [
        f"{symbol} {word}{_effect(mdp, [i for i, tile in enumerate(tiles) if tile == symbol])}"
        for symbol, word in words.items()
        if symbol in tiles
    ]
    return {
        "action_names": ("left", "down", "right", "up"),
        "coordinates": (Coordinate("row", len(grid)), Coordinate("column", len(grid[0]))),
        "grid": grid,
        "legend": (f"{AGENT} the agent", *legend),
    }


def _cliff_walking(env: Any, mdp: MDP) -> dict[str, Any]:
    rows, columns = map(int, env.shape)
    cliff, step = amount(mdp.rewards.min()), amount(mdp.rewards.max())
    return {
        "action_names": ("up", "right", "down", "left"),
        "coordinates": (Coordinate("row", rows), Coordinate("column", columns)),
        "grid": (*["." * columns] * (rows - 1), f"S{'C' * (columns - 2)}G"),
        "legend": (
            f"{AGENT} the agent",
            "S start",
            f"C cliff {cliff}, back to S",
            "G goal (ends)",
            f"each step {step}",
        ),
    }


def _taxi(env: Any, mdp: MDP) -> dict[str, Any]:
    stands = ("at R", "at G", "at Y", "at B")
    return {
        "action_names": ("south", "north", "east", "west", "pickup", "dropoff"),
        "coordinates": (
            Coordinate("row", 5),
            Coordinate("column", 5),
            Coordinate("passenger", 5, (*stands, "in the taxi")),
            Coordinate("destination", 4, stands),
        ),
        "grid": tuple(b"".join(row).decode() for row in env.desc),
        "origin": (1, 1),
        "stride": (1, 2),
        "legend": (
            f"{AGENT} the taxi",
            "| wall, : way through",
            f"delivery {amount(mdp.rewards.max())} (ends)",
            f"wrong pickup or dropoff {amount(mdp.rewards.min())}",
            "each other step -1",
        ),
    }


_KNOWN: dict[str, Callable[[Any, MDP], dict[str, Any]]] = {
    "FrozenLakeEnv": _frozen_lake,
    "CliffWalkingEnv": _cliff_walking,
    "TaxiEnv": _taxi,
}


def _effect(mdp: MDP, states: list[int]) -> str:
    """Returns what entering some states pays, where that is always the same, and if it ends."""
    entered = np.isin(mdp.next_states, states) & (mdp.next_states != mdp.transition_states)
    pays = np.unique(mdp.rewards[entered])
    reward = f" {amount(pays[0])}" if len(pays) == 1 and pays[0] else ""
    return reward + " (ends)" * bool(entered.any() and mdp.terminated[entered].all())
