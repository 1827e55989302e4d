"""Models of environments that carry their transition table."""

from dataclasses import replace
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP, as_flags
from trdlab.tabular.models import check_finite


def from_environment(env: Any) -> MDP:
    """Builds the model of an environment from its `P` table, as Gymnasium's toy-text ones have it.

    It is the model of `env.unwrapped`: what wrappers change, and a time limit, are no part of it.
    Where several states can be the first, `start` is the likeliest, of equals the lowest.

    Args:
        env: a Gymnasium environment whose `unwrapped` has `P[s][a]`, a list of (probability, s′,
            reward, terminated), and perhaps `initial_state_distrib` (or `isd`); or has `mdp`, as
            the gridworlds do.

    Raises:
        InputError: there is no such table, it is no model, or it is not the whole one.

    >>> import gymnasium
    >>> lake = from_environment(gymnasium.make("FrozenLake-v1"))
    >>> lake.num_states, lake.num_actions, len(lake.probabilities)
    (16, 4, 152)
    """
    base, name = getattr(env, "unwrapped", env), environment_name(env)
    own, table = getattr(base, "mdp", None), getattr(base, "P", None)
    if isinstance(own, MDP):
        return own
    if table is None:
        raise InputError(
            f"{name} has no transition table 'P', so there is no exact model of it.",
            "Use an environment that has one, such as FrozenLake, CliffWalking or Taxi; or build "
            "the model with trdlab.tabular.from_arrays.",
        )
    if getattr(base, "fickle_passenger", False):
        raise InputError(
            f"The table 'P' of {name} leaves out that the passenger is fickle.",
            "Make it with fickle_passenger=False.",
        )
    _check_table(table, name)
    mdp = MDP.from_transitions(table)
    _check_spaces(base, name, mdp)
    starts = start_distribution(env)
    return mdp if starts is None else replace(mdp, start=_first_state(starts, mdp, name))


def start_distribution(env: Any) -> FloatArray | None:
    """Returns `[S]`: how likely an environment starts in each state, None if it does not say."""
    base = getattr(env, "unwrapped", env)
    given = getattr(base, "initial_state_distrib", getattr(base, "isd", None))
    return None if given is None else np.asarray(given, dtype=np.float64).ravel()


def environment_name(env: Any) -> str:
    """Returns the id an environment was made by, or else the name of its class."""
    spec = getattr(env, "spec", None)
    return str(spec.id) if spec is not None else type(getattr(env, "unwrapped", env)).__name__


def _check_table(table: Any, name: str) -> None:
    """Refuses a `P` table that cannot be read, or leads to a state that does not exist."""
    try:
        entries = [
            (state, action, float(probability), float(following), float(reward), float(ends))
            for state in range(len(table))
            for action in range(len(table[state]))
            for probability, following, reward, ends in table[state][action]
        ]
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"The table 'P' of {name} cannot be read ({type(error).__name__}: {error}).",
            "P[s][a] must be a list of (probability, next state, reward, terminated), with states "
            "and actions counted from 0.",
        ) from error
    columns = np.array(entries, dtype=np.float64).reshape(-1, 6).T
    check_finite(columns[2], columns[4], lambda k: entries[k][:2])
    as_flags(columns[5])
    following = columns[3]
    bad = ~((following >= 0) & (following < len(table)) & (following % 1 == 0))
    if bad.any():
        state, action, _, wrong, *_ = entries[int(np.argmax(bad))]
        raise InputError(
            f"State {state}, action {action} leads to a state {wrong:g} that does not exist.",
            f"States run from 0 to {len(table) - 1}.",
        )


def _check_spaces(base: Any, name: str, mdp: MDP) -> None:
    for space, count in (("observation_space", mdp.num_states), ("action_space", mdp.num_actions)):
        size = getattr(getattr(base, space, None), "n", count)
        if size != count:
            raise InputError(
                f"The table 'P' of {name} has {count} entries where its {space} has {size}.",
                "They must be the same states and actions.",
            )


def _first_state(starts: FloatArray, mdp: MDP, name: str) -> int:
    if len(starts) != mdp.num_states or not (starts >= 0.0).all() or not 0.0 < starts.sum() < 2.0:
        raise InputError(
            f"{name} does not say where its episodes start: its distribution over the states is "
            f"none.",
            f"It must hold {mdp.num_states} probabilities (a FrozenLake needs a tile 'S').",
        )
    return int(starts.argmax())
