"""Fitting: what a frozen policy can expect, learned from what it does."""

from collections.abc import Callable, Mapping
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from trdlab.errors import InputError, closest
from trdlab.verbs.making import agent as find

OWN = "the agent's own policy"
"""Whose future a fitted decomposition tells."""
_SHARE = 0.1  # of actions that are forced
_LEAST_UPDATES, _MOST_UPDATES = 1_000, 20_000  # of the fit of a run, by how much it has played

if TYPE_CHECKING:
    from trdlab.agents.agent import Agent
    from trdlab.agents.places import Where
    from trdlab.deep.fit_settings import Layers
    from trdlab.environments.outcomes import Outcome
    from trdlab.runs import RunFolder


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
    from trdlab.runs.fits import fit_path
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


def _frozen(agent: Any, env: "Where | None") -> "Agent":
    """Returns who is fitted: of a run the network alone, without the ε of the fit that it has."""
    if not isinstance(agent, str | Path):
        return find(agent, env)
    from trdlab.agents.naming import find_agent

    return find_agent(str(agent), env=env, joint=True)


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

    frozen, chosen = _frozen(agent, env), FitSettings(**{"seed": seed} | settings)
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
