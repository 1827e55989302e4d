"""Making agents: solve a model, train a network, name an agent or fit one."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from trdlab.errors import InputError, closest

OWN = "the agent's own policy"
"""Whose future a fitted decomposition tells."""
_SHARE = 0.1  # of actions that are forced
_LEAST_UPDATES, _MOST_UPDATES = 1_000, 20_000  # of the fit of a run, by how much it has played

if TYPE_CHECKING:
    from trdlab.agents.agent import Agent
    from trdlab.agents.places import Where
    from trdlab.deep.fit_settings import Layers
    from trdlab.deep.settings import Kind
    from trdlab.deep.trainer import TrainMetrics
    from trdlab.environments.outcomes import Outcome
    from trdlab.policies import Who
    from trdlab.runs import RunFolder


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
    out: str | Path | None = None,
    on_metrics: "Callable[[TrainMetrics], None]" = lambda metrics: None,
    **settings: Any,
) -> "Agent":
    """Trains a network that decomposes, in a new run's folder, and returns the run's agent.

    Args:
        env: a Gymnasium id with discrete actions, such as `CartPole-v1`, or an Atari game.
        kind: `gym` or `atari`; by default whatever `env` names.
        preset: the settings to begin from, such as `smoke`; by default the environment's own.
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

    if not isinstance(env, str):
        raise InputError(
            f"A run makes its environment again when it goes on, and a {type(env).__name__} has no "
            "name.",
            "Give a Gymnasium id; gymnasium.register names your own, as MODULE:ENV_ID.",
        )
    keys = {"horizon": "N", "width": "w"}
    given = {keys.get(key, key): value for key, value in settings.items()}
    chosen = read_settings(kind or _kind_of(env), env, preset, None, given)
    with begin(chosen, None if out is None else Path(out), find=find_teacher) as run:
        carry_on(run, on_metrics=on_metrics)
        path = run.folder.path
    return fit_run(path) if chosen.fit else find_agent(str(path))


def fit_run(path: Path, **watched: Any) -> "Agent":
    """Fits the agent of a run as it acts in an evaluation, and keeps that in the run's folder.

    Of a game with lives it is forecast, too, that one is lost.

    Args:
        path: the run's folder.
        watched: `progress` and `should_stop`, as for `fit`.

    Raises:
        InputError: there is no run, or no checkpoint.
        OutputError: its folder cannot be written.
        Stopped: it should stop.
    """
    from trdlab.agents.naming import find_agent
    from trdlab.environments.outcomes import LIFE_LOST
    from trdlab.runs import RunFolder
    from trdlab.training.fitted import fit_path
    from trdlab.training.loading import chosen_step, run_settings

    folder = RunFolder.open(path)
    settings, step = run_settings(folder), chosen_step(folder)
    agent = find_agent(f"{path}@{step}", joint=True)
    with closing(agent.make(1, settings.seed)) as environments:
        environments.reset()
        has_lives = getattr(environments, "has_lives", False)
    origin = agent.origin and replace(agent.origin, name=f"{path.absolute().name}@{step}")
    fit(
        replace(agent, origin=origin),
        horizon=settings.horizon,
        width=settings.width,
        steps=settings.fit_steps,
        epsilon=settings.evaluate_epsilon,
        layers="frozen",
        share=min(_SHARE, 1.0 / max(settings.time_axis.num_steps, 1)),  # it acts as far as it tells
        seed=settings.seed,
        outcomes={"life lost": LIFE_LOST} if has_lives else {},
        most_updates=max(_LEAST_UPDATES, min(_MOST_UPDATES, settings.fit_steps // 5)),
        out=fit_path(path, step),
        **watched,
    )
    return find_agent(str(path))


def fit(
    agent: Any,
    env: "Where | None" = None,
    *,
    horizon: int = 40,
    width: int = 1,
    gamma: float | None = None,
    steps: int = 100_000,
    share: float = _SHARE,
    epsilon: float = 0.0,
    layers: "Layers" = "new",
    seed: int = 1,
    outcomes: "Mapping[str, Outcome | str] | None" = None,
    parts: "Mapping[str, Outcome | str] | None" = None,
    seconds: float | None = None,
    out: str | Path | None = None,
    progress: bool = False,
    should_stop: Callable[[], bool] = lambda: False,
    **settings: Any,
) -> "Agent":
    """Learns what a frozen policy can expect, and returns the same agent that knows it.

    The policy plays, with some of its actions forced, so that those it would not take are covered,
    too. Then a network learns the reward that really came at each step, how much that varies, and
    whether the episode was still running. The policy stays as it is.

    Args:
        agent: whatever `trdlab.agent` takes.
        env: where it acts, if that is not where it was made for.
        horizon: N, the number of explicit components.
        width: w, the steps in each.
        gamma: γ; by default the agent's own, or 0.99.
        steps: how many it plays, at least.
        share: the chance that an action is forced.
        epsilon: the chance of any action at random, as a part of the policy itself. Games that go
            the same way each time then do not.
        layers: what the network begins with, all but its last layer: `new` weights; weights
            `copied` from the network by which the agent acts, which must be one of trdlab's; or
            those, `frozen`: that is quicker by far where it sees images, and less exact.
        seed: of everything.
        outcomes: what else to forecast, by name: a function of a step (see `Transition`), where
            a number stands in `info`, such as `"info.fuel"`, or `"life_lost"`. What is always 0 or
            1 is an event.
        parts: likewise, what adds up to the reward.
        seconds: after which learning stops, if not before; then the seed is not all it depends on.
        out: a folder to keep it in, which names the agent from then on. Where the same fit was
            begun and stopped, it goes on.
        progress: whether to show on stderr how far it is.
        should_stop: asked now and then; if it says so, what was learned is saved.
        settings: else, as of `FitSettings`: `method`, `hidden`, `learning_rate`, …

    Raises:
        InputError: this is no agent, a setting cannot be used, the parts do not add up, or another
            fit was begun in `out`.
        OutputError: the folder exists, or cannot be written.
        Stopped: it should stop.
    """
    from trdlab.deep.experience import Experience, gather
    from trdlab.deep.features import features_space, trunk_of, upon
    from trdlab.deep.fit import Fit
    from trdlab.deep.fit_settings import FitSettings, Layers
    from trdlab.environments.outcomes import Outcomes
    from trdlab.estimator import Future
    from trdlab.explanations.calibration.calibration import calibrate
    from trdlab.policies import EpsilonGreedy, acting
    from trdlab.rollouts.playing import usual_limit
    from trdlab.time_axis import TimeAxis
    from trdlab.training import fitted
    from trdlab.verbs.watching import FitWatch

    frozen, chosen = _agent(agent, env), FitSettings(**{"seed": seed} | settings)
    policy = acting(frozen.policy or frozen.estimator)
    own = getattr(policy, "gamma", None)
    if own is None:
        own = frozen.estimator.time_axis.gamma if frozen.is_fitted else 0.99
    if epsilon:
        policy = EpsilonGreedy(policy, epsilon)
    if layers not in get_args(Layers):
        raise InputError(f"There are no '{layers}' layers.", closest(layers, get_args(Layers)))
    trunk = None if layers == "new" else trunk_of(policy)
    at_random = f" (ε = {epsilon:g})" if epsilon else ""
    axis = TimeAxis(own if gamma is None else gamma, horizon, width)
    future = Future(f"{OWN}{at_random}")
    made_of, beside = dict(parts or {}), dict(outcomes or {})
    if twice := sorted(made_of.keys() & beside.keys()):
        raise InputError(
            f"'{twice[0]}' is the name of a part and of an outcome.", "Give each a name of its own."
        )
    read = Outcomes(made_of | beside)
    found, of = None, frozen.origin
    plan = fitted.Plan(
        agent=None if of is None else of.name,
        env=of.env if of is not None and of.away else None,
        env_arguments=of.env_arguments if of is not None and of.away else (),
        solved_for=of.time_axis.gamma if of is not None and of.time_axis else None,
        axis=axis,
        steps=steps,
        share=share,
        epsilon=epsilon,
        layers=layers,
        outcomes=read.places,
        parts=tuple(made_of),
        settings=chosen,
    )
    if out is not None:
        found = fitted.find_fit(Path(out), plan)
    watch = FitWatch(steps)

    def taken(count: int) -> None:
        if should_stop():
            raise fitted.Stopped(f"Stopped after {count:,} steps, before anything was learned.")
        if progress:
            watch.tell(count)

    def played() -> Experience:
        return gather(
            frozen.make,
            policy,
            future,
            steps=steps,
            share=share,
            pause=axis.num_steps if chosen.method == "regression" else 0,
            num_envs=None if frozen.world is None else 1_000,  # of a model they are cheap
            max_steps=usual_limit(axis),
            seed=seed,
            outcomes=read,
            look=trunk.features if trunk and layers == "frozen" else None,
            tell=taken,
        )

    def begun(experience: Experience) -> Fit:
        space = frozen.interface.space
        told: dict[str, Any] = {"names": read.names, "parts": tuple(made_of)}
        if layers == "frozen":
            space, told["alike"] = features_space(experience.frames.shape[1]), True
        elif trunk is not None:
            told["copied"] = trunk.network
        return Fit(experience, space, axis, chosen, **told)

    def kept() -> "RunFolder":
        return fitted.new_fit(Path(str(out)), plan, frozen.interface, future)

    def judge(fitting: Fit) -> tuple[int, ...]:
        return tuple(calibrate(of, seed=seed).trust.components for of in fitting.samples())

    with watch if progress else nullcontext():
        estimator = fitted.learn(
            played,
            begun,
            future,
            found=found,
            new=None if out is None else kept,
            seconds=seconds,
            judge=judge,
            tell=watch.tell if progress else lambda now: None,
            should_stop=should_stop,
        )
    if trunk is not None and layers == "frozen":
        estimator = upon(trunk, estimator)
    called = frozen.name if out is None else Path(out).name
    return replace(frozen, name=called, estimator=estimator, policy=policy)


_agent = agent  # which a parameter is called, too


def _kind_of(env: str) -> "Kind":
    from trdlab.atari.names import find_game

    try:
        find_game(env)
    except InputError:
        return "gym"
    return "atari"
