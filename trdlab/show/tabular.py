"""A solved environment with a transition table, explained."""

import math
import shlex
from collections.abc import Mapping
from typing import Any

from trdlab.decomposition import TimeAxis
from trdlab.environments.arguments import say_arguments
from trdlab.explanations.moment.exact import gamma_what_ifs, tabular_moment
from trdlab.explanations.moment.explanation import explain
from trdlab.explanations.moment.leads import difference
from trdlab.explanations.moment.moment import Moment
from trdlab.formatting import plain
from trdlab.show.report import Report, Scene
from trdlab.tabular import Ties, exact
from trdlab.tabular.named import TabularWorld
from trdlab.tabular.toytext import make_world

SCHEMA = "trdlab.tabular/1"
_VARIANTS = ("is_slippery", "is_rainy")
_OVER = "Episodes are over in this state, or never come to it."
_LIMIT = "The environment cuts episodes off after {} steps; the model does not."


def report(
    env_id: str,
    arguments: Mapping[str, Any] | None = None,
    *,
    gamma: float,
    horizon: int,
    width: int = 1,
    state: str | None = None,
    action: str | None = None,
    foil: str | None = None,
    ties: Ties = "lowest",
) -> Report:
    """Makes an environment, solves its model, and explains one of its states.

    Args:
        env_id: the id of a Gymnasium environment that has a transition table.
        arguments: what to make it with.
        gamma: the discount factor.
        horizon: N.
        width: w.
        state: the number of a state, or its coordinates; by default the likeliest first state.
        action: the action to explain, by default what the policy does.
        foil: the action to contrast it with, by default the best other one.
        ties: whose future is told where optimal actions tie.

    Raises:
        InputError: any of these cannot be used.
    """
    axis, given = TimeAxis(gamma, horizon, width), dict(arguments or {})
    world = make_world(env_id, given)
    index = world.mdp.start if state is None else world.find_state(state)
    table = exact(world.mdp, axis, ties=ties)
    moment = tabular_moment(table, index, world.action_names, gamma_what_ifs(table, index))
    scene = _scene(world, index, _next_step(env_id, world, given, axis), given)
    if foil is None:
        foil = _other(moment, action)
    return Report(scene, table, index, explain(moment, action, foil))


def _other(moment: Moment, action: str | None) -> str | None:
    """Returns the foil; where each other action stays here, the best that pays differently.

    To stay can be the very point, as on the cliff, from which one falls back to the start.
    """
    action, foil = moment.pair(action, None)
    names = sorted(moment.action_names, key=moment.q_value, reverse=True)
    others = (n for n in names if n != action and difference(moment, action, n).any())
    return foil or next(others, None)


def _scene(world: TabularWorld, state: int, next_step: str, given: Mapping[str, Any]) -> Scene:
    mdp = world.mdp
    size = f"{mdp.num_states} states, {mdp.num_actions} actions"
    told = {k: v for k, v in world.arguments.items() if k in given or isinstance(v, bool | str)}
    notes = [_OVER] * (not world.visited[state])
    notes += [_LIMIT.format(world.time_limit)] * (world.time_limit is not None)
    return Scene(
        schema=SCHEMA,
        kind="model",
        heading=f"{world.name} · {size}",
        caption=" · ".join(filter(None, (world.name, say_arguments(told)))),
        place=world.describe(state),
        rules=tuple(say_arguments({name: value}) for name, value in told.items()),
        drawing=world.draw(state),
        legend=world.legend,
        notes=tuple(notes),
        next_step=next_step,
        world={
            "environment": {
                "id": world.name,
                "arguments": {k: v for k, v in world.arguments.items() if _is_plain(v)},
                "num_states": mdp.num_states,
                "time_limit": world.time_limit,
            }
        },
        state={
            "coordinates": dict(
                zip((c.name for c in world.coordinates), world.place(state), strict=True)
            ),
            "description": world.describe(state),
            "visited": bool(world.visited[state]),
        },
    )


def _next_step(env_id: str, world: TabularWorld, given: Mapping[str, Any], axis: TimeAxis) -> str:
    """Returns a command that shows something new about this very environment."""

    def command(arguments: Mapping[str, Any]) -> str:
        words = ["trdlab", "tabular", env_id]
        for name, value in arguments.items():
            words += ["--env-arg", say_arguments({name: value})]
        return f"{shlex.join(words)} --gamma {plain(axis.gamma)}"

    if axis.width > 1:
        return f"{command(given)} --N {axis.num_steps} --w 1 (the same steps one by one)"
    for name in _VARIANTS:
        if name in world.arguments and name not in given:
            varied = {**given, name: not world.arguments[name]}
            return f"{command(varied)} --N {axis.horizon}"
    return f"{command(given)} --N {2 * axis.horizon + 2} (a longer horizon)"


def _is_plain(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, bool | int | str)
