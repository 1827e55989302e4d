"""Making agents: name one, solve a model, or train a network."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trdlab.errors import InputError, closest

if TYPE_CHECKING:
    from trdlab.agents.agent import Agent
    from trdlab.agents.places import Where
    from trdlab.deep.settings import Kind
    from trdlab.deep.trainer import TrainMetrics
    from trdlab.policies import Who


def agent(
    what: Any,
    env: "Where | None" = None,
    *,
    env_arguments: Mapping[str, Any] | None = None,
    gamma: float | None = None,
    horizon: int | None = None,
    width: int | None = None,
    policy: "Who | None" = None,
    name: str | None = None,
    action_names: Sequence[str] | None = None,
) -> "Agent":
    """Returns an agent: who acts, where, and what it expects.

    Args:
        what: a run's folder, `RUN@STEP` or `RUN@best` for another checkpoint; that of a fit;
            `gridworld:drone`, a map file or `tabular:FrozenLake-v1`, for the exact table of a
            model; a gridworld or another model; a table that is solved already; any `Estimator`,
            such as one of your own; or an agent. Of others, who know nothing of their future until
            they are fitted: a file of an agent that others trained, a loaded model, a `Policy`, or
            a function from an observation to an action's number, or from observations to
            probabilities.
        env: where it acts, if that is not where it was made for: a Gymnasium id, an environment, a
            function that makes one, or a model or its name. An estimator of your own needs it, and
            so does an agent of others; that can also act in an Atari game.
        env_arguments: what to make the environment of an id with.
        gamma: γ of a model's table, by default 0.95. Whatever else has its own, as it has N and w.
        horizon: N of a model's table, by default 4.
        width: w of a model's table, by default 1.
        policy: who acts, where that is not the estimator's greedy policy: a `Policy`, or a function
            from observations `[B, ...]` to action probabilities `[B, A]`.
        name: what to call it.
        action_names: A names, in place of those that the environment tells.

    Raises:
        InputError: there is no such agent, something does not fit it, or this is none; the message
            says what is missing.

    >>> agent("gridworld:drone").action_names
    ('up', 'down', 'left', 'right')
    """
    from trdlab.agents.given import agent_of
    from trdlab.agents.models import model_of
    from trdlab.agents.naming import find_agent
    from trdlab.agents.places import AXIS, changed
    from trdlab.environments.arguments import say_arguments
    from trdlab.policies import acting

    axis, given = (gamma, horizon, width), env_arguments or {}
    words = tuple(say_arguments({key: value}) for key, value in given.items())
    if isinstance(what, str | Path):
        made = find_agent(
            str(what), gamma=gamma, horizon=horizon, width=width, env=env, env_arguments=words
        )
    elif axis != (None, None, None) and model_of(what) is None:
        raise InputError(
            f"This {type(what).__name__} has its own γ, N and w.",
            "Leave out `gamma`, `horizon` and `width`.",
        )
    else:
        made = agent_of(what, env, words, changed(AXIS, *axis))
    if policy is not None:
        made = replace(made, policy=acting(policy), origin=None)  # its name is not of this one
    if action_names is not None:
        made = made.named(action_names)
    return replace(made, name=name or made.name)


def solve(what: Any, gamma: float = 0.95, horizon: int = 4, width: int = 1) -> "Agent":
    """Solves a model exactly, and returns the agent that acts optimally in it.

    Its `estimator` is the exact table: what every action of every state is worth, and when that
    comes. No network is needed, and nothing is sampled.

    Args:
        what: the name of a built-in map, a map file, a gridworld or another model; or the id of an
            environment with a transition table, such as `FrozenLake-v1`, or the environment.
        gamma: γ, the discount factor, in [0, 1).
        horizon: N, the number of explicit components.
        width: w, the steps in each.

    Raises:
        InputError: there is no such model, or the environment has no transition table.

    >>> print(solve("drone", horizon=2, width=2).estimator.decomposition[0, 1].components.round(2))
    [0.95 1.76 0.81]
    """
    import gymnasium as gym

    from trdlab.agents.given import model_agent
    from trdlab.agents.models import TABULAR, is_model, model_of
    from trdlab.agents.naming import gridworld_agent, tabular_agent
    from trdlab.gridworld import map_names
    from trdlab.tabular import from_environment
    from trdlab.tabular.toytext import toy_text_ids
    from trdlab.time_axis import TimeAxis

    axis = TimeAxis(gamma, horizon, width)
    if isinstance(what, str | Path):
        named, called = str(what), str(what).partition(",")[0]
        if called in map_names() or (is_model(named) and not named.startswith(TABULAR)):
            return gridworld_agent(named, axis)
        if called in gym.registry or ":" in called or "/" in called:
            return tabular_agent(named, axis)
        known = closest(called, [*map_names(), *toy_text_ids()])
        raise InputError(f"There is no map and no environment '{called}'.", known)
    model = model_of(what)
    if model is None and isinstance(what, gym.Env):
        from_environment(what)  # says why there is no model of it
    if model is None:
        raise InputError(
            f"This {type(what).__name__} is no model: it has no mdp and no table P.",
            "Give a map, a gridworld, a model, or an environment that carries one.",
        )
    return model_agent(model, axis)


def train(
    env: str,
    *,
    kind: "Kind | None" = None,
    preset: str | None = None,
    from_scratch: bool = False,
    out: str | Path | None = None,
    on_metrics: "Callable[[TrainMetrics], None]" = lambda metrics: None,
    **settings: Any,
) -> "Agent":
    """Trains a network that decomposes, in a new run's folder, and returns the run's agent.

    Args:
        env: a Gymnasium id with discrete actions, such as `CartPole-v1`, or an Atari game.
        kind: `gym` or `atari`; by default whatever `env` names.
        preset: the settings to begin from, such as `smoke`; by default the environment's own, or
            for a game what suits the machine.
        from_scratch: learn from nobody, unless a `teacher` is given.
        out: the run's folder; by default a new one in `runs`.
        on_metrics: told of the score and the loss, now and then.
        settings: single ones in place of the preset's, by the names that `trdlab train` gives them,
            such as `agent_steps=20_000`, `horizon=10`, `hidden=[64]`, or `teacher="ppo.zip"`.

    Raises:
        InputError: there is no such environment, preset or setting, a value cannot be used, or the
            teacher is not clearly better than random actions.
        OutputError: the folder exists, or cannot be written.
    """
    from trdlab.agents.naming import find_agent
    from trdlab.agents.teachers import find_teacher
    from trdlab.training.run import begin, carry_on
    from trdlab.training.setup import read_settings
    from trdlab.verbs.fitting import fit_run

    if not isinstance(env, str):
        raise InputError(
            f"A run makes its environment again when it goes on, and a {type(env).__name__} has no "
            "name.",
            "Give a Gymnasium id; gymnasium.register names your own, as MODULE:ENV_ID.",
        )
    keys = {"horizon": "N", "width": "w"}
    given = {keys.get(key, key): value for key, value in settings.items()}
    chosen = read_settings(
        kind or _kind_of(env), env, preset, None, given, from_scratch=from_scratch
    )
    with begin(chosen, None if out is None else Path(out), find=find_teacher) as run:
        carry_on(run, on_metrics=on_metrics)
        path = run.folder.path
    return fit_run(path) if chosen.fit else find_agent(str(path))


def _kind_of(env: str) -> "Kind":
    from trdlab.atari.names import find_game

    try:
        find_game(env)
    except InputError:
        return "gym"
    return "atari"
