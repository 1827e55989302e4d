"""What a word names: a run, a fit, a file of another library, or the exact table of a model."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trdlab.agents.agent import Agent
from trdlab.agents.given import acting_agent, agent_of, model_agent
from trdlab.agents.models import GRIDWORLD, TABULAR, find_model, is_model
from trdlab.agents.places import (
    AXIS,
    Origin,
    Where,
    changed,
    find_place,
    look,
    place_of,
    refuse_arguments,
)
from trdlab.environments.arguments import parse_name
from trdlab.environments.making import check_imported
from trdlab.environments.naming import are_own, is_numbered
from trdlab.errors import InputError
from trdlab.gridworld import map_names
from trdlab.policies import EpsilonGreedy, Policy, acting
from trdlab.policies.adapted import About, games_for
from trdlab.policies.files import Options
from trdlab.policies.functions import PYTHON, from_python
from trdlab.policies.hub import HUB, from_hub
from trdlab.policies.registry import read_policy
from trdlab.runs import RunFolder, find_checkpoint
from trdlab.runs.fits import run_of
from trdlab.runs.folder import is_fit
from trdlab.runs.pretrained import is_shipped
from trdlab.tabular.toytext import toy_text_ids
from trdlab.time_axis import TimeAxis
from trdlab.training.fitted import Plan, load_fit

if TYPE_CHECKING:
    from trdlab.deep.estimator import NetworkEstimator

_OWN_AXIS = "is a run with its own γ, N and w."
_UNKNOWN_AXIS = "has γ, N and w of its own, or gets them when it is fitted."
_LEAVE_OUT = "Leave out `gamma`, `horizon` and `width`."


def find_agent(
    name: str,
    *,
    gamma: float | None = None,
    horizon: int | None = None,
    width: int | None = None,
    env: Where | None = None,
    env_arguments: Sequence[str] = (),
    joint: bool = False,
) -> Agent:
    """Returns an agent by its name.

    That is a run's folder, or `RUN@STEP` or `RUN@best` for another checkpoint of it; a run that
    comes with trdlab, such as `pretrained:Breakout`; the folder of a fit; for the exact table of a
    model, `gridworld:NAME`, a map file, or `tabular:ENV_ID`, each with what to make it with after
    commas, such as `gridworld:ledge,slip=0.2`; a file of an agent that another library trained,
    likewise with what it does not say, such as `ppo.zip,activation=relu,greedy=true` (see
    `Options`), or such a file on the Hugging Face hub, `hf:OWNER/REPO@REVISION`; or
    `python:FILE.py:FUNCTION`, whose function makes one.

    Args:
        name: of the agent.
        gamma: of an exact table, by default 0.95; a run has its own, and its own N and w.
        horizon: N of an exact table, by default 4.
        width: w of an exact table, by default 1.
        env: an environment to act in instead of its own (see `find_place`).
        env_arguments: what to make that one with, as `KEY=VALUE`.
        joint: of a run, the components as they were learned with the policy, though it was fitted
            when its training was over.

    Raises:
        InputError: there is no such agent, or something does not fit it.
        TrdlabError: a run is torn.
    """
    if name.startswith(PYTHON) or is_model(name):
        made = _made if name.startswith(PYTHON) else _exact
        return made(name, env, env_arguments, changed(AXIS, gamma, horizon, width))
    _refuse_model(name)
    is_file = name.startswith(HUB) or Path(name.partition(",")[0]).is_file()
    if (gamma, horizon, width) != (None, None, None):
        own = _UNKNOWN_AXIS if is_file else _OWN_AXIS
        raise InputError(f"'{name}' {own}", _LEAVE_OUT)
    if is_file:
        return _read(name, env, env_arguments)
    if is_fit(Path(name)):
        return _fitted(name, env, env_arguments)
    return _run(name, env, env_arguments, joint=joint)


def gridworld_agent(map_name: str, time_axis: TimeAxis, **where: Any) -> Agent:
    """Returns `find_agent` of `map_name`, a built-in map or a map file, on a time axis."""
    return find_agent(GRIDWORLD + map_name.removeprefix(GRIDWORLD), **asdict(time_axis), **where)


def tabular_agent(env_id: str, time_axis: TimeAxis, **where: Any) -> Agent:
    """Returns `find_agent` of a Gymnasium environment with a transition table, on a time axis."""
    return find_agent(TABULAR + env_id.removeprefix(TABULAR), **asdict(time_axis), **where)


def _exact(name: str, env: Where | None, env_arguments: Sequence[str], axis: TimeAxis) -> Agent:
    """Returns the exact table of a model with a name as an agent that acts optimally in it."""
    called = name if name.startswith((GRIDWORLD, TABULAR)) else f"{GRIDWORLD}{name}"
    model = find_model(called)
    if env is None:
        refuse_arguments(called, env_arguments)
        return replace(model_agent(model, axis), origin=Origin(called, called, (), axis))
    place = find_place(env, env_arguments, axis)
    agent = model_agent(model, axis, place=place)
    return replace(agent, origin=place.origin(called, axis, away=True))


def _run(name: str, env: Where | None, env_arguments: Sequence[str], *, joint: bool) -> Agent:
    """Returns the agent of a run, or of a checkpoint of it, in its own environments or others."""
    from trdlab.training.loading import interface_of, load, own_fit, run_settings
    from trdlab.training.machine import use_threads

    path, step = find_checkpoint(name)
    folder = RunFolder.open(path)
    settings = run_settings(folder)
    if env_arguments and env is None:
        raise InputError("The run says what its environment is made with.", "Give `env` too.")
    use_threads(settings)
    estimator = load(path, step, joint=True)
    if env is None:
        check_imported(settings.env)
        place = place_of(settings)
    else:
        games = settings.kind == "atari"
        place = find_place(env, env_arguments, settings.time_axis, games=games)
    found, known = look(place.make), interface_of(folder)
    known.check_fits(found, place.name)
    at = "" if step is None else f"@{step}"
    module = settings.env.rpartition(":")[0]
    called = name if is_shipped(path) else f"{path}{at}"
    agent = Agent(
        name=f"{folder.path.name}{at}",
        estimator=estimator,
        action_names=(known if is_numbered(found.action_names) else found).action_names,
        make=place.make,
        policy=estimator if isinstance(estimator, Policy) else None,
        seconds_per_step=found.seconds_per_step,
        origin=place.origin(called, None, away=env is not None, module=module),
        effort=place.effort,
    )
    own = None if joint else own_fit(path, step)
    return agent if own is None else _with_fit(agent, *load_fit(own)[::2])


def _fitted(name: str, env: Where | None, env_arguments: Sequence[str]) -> Agent:
    """Returns the agent of a fit, in a folder: who was fitted, with what was learned of it."""
    estimator, interface, whose = load_fit(Path(name))
    of_run, told = run_of(Path(name)), dict[str, Any](joint=True)  # a fit counts its own ε
    if of_run is not None:  # it goes wherever the run goes
        told |= {"env": env, "env_arguments": env_arguments}
        agent = find_agent(f"{of_run[0]}@{of_run[1]}", **told)
        return _with_fit(agent, estimator, whose)
    if whose.agent is None:
        raise InputError(
            f"'{name}' was fitted to an agent without a name.",
            "Give it in Python: trdlab.agent(trdlab.load(folder), env=…, policy=…).",
        )
    is_own = env is None
    if env is None:
        env, env_arguments = whose.env, whose.env_arguments
    told |= {"env": env, "env_arguments": env_arguments}
    of = find_agent(whose.agent, gamma=whose.solved_for, **told)
    names = interface.action_names
    is_renamed = are_own(names) and {*names} != {*of.action_names}  # and not in another order
    if is_own and is_renamed and len(names) == len(of.action_names):
        of = of.named(names)
    interface.check_fits(of.interface, str(env or whose.agent))
    origin = of.origin and replace(of.origin, name=name, time_axis=None)
    return replace(_with_fit(of, estimator, whose), name=Path(name).name, origin=origin)


def _with_fit(of: Agent, estimator: "NetworkEstimator", whose: Plan) -> Agent:
    """Returns an agent whose future a fit tells, as `load_fit` has read it."""
    policy = acting(of.policy or of.estimator)
    if whose.layers == "frozen":
        from trdlab.deep.features import trunk_of, upon

        estimator = upon(trunk_of(policy), estimator)
    acts = EpsilonGreedy(policy, whose.epsilon) if whose.epsilon else policy
    return replace(of, estimator=estimator, policy=acts)


def _made(name: str, env: Where | None, env_arguments: Sequence[str], axis: TimeAxis) -> Agent:
    """Returns the agent that a function in a file of Python makes."""
    made = agent_of(from_python(name.removeprefix(PYTHON)), env, env_arguments, axis)
    if not isinstance(env, str):
        return made
    return replace(made, origin=Origin(name, env, tuple(env_arguments), None, away=True))


def _read(name: str, env: Where | None, env_arguments: Sequence[str]) -> Agent:
    """Returns the agent in a file of another library, named with what that does not say."""
    file, arguments = parse_name(name)
    path = from_hub(file) if file.startswith(HUB) else Path(file)

    def num_actions() -> int | None:
        if env is None:
            return None
        return len(look(find_place(env, env_arguments, AXIS).make).action_names)

    who = read_policy(path, Options.of(arguments), num_actions)
    if env is None:
        about: About = getattr(who, "about")  # noqa: B009  which every adapter gives
        raise InputError(
            f"Nothing says where '{file}' acts: it is a {about.title}.",
            f"Give its `env`: it needs {about.needs}.",
        )
    place = find_place(env, env_arguments, AXIS, wanted=games_for(who))
    agent = acting_agent(who, place, path.stem)
    return replace(agent, origin=place.origin(name, None, away=True))


def _refuse_model(name: str) -> None:
    """Refuses the name of a model without its kind, where no run is called that."""
    kinds = (("map", GRIDWORLD, map_names()), ("exact table", TABULAR, toy_text_ids()))
    for what, kind, known in kinds:
        if name.partition(",")[0] in known and not Path(name).exists():
            raise InputError(f"There is no run '{name}'.", f"For the {what}: {kind}{name}")


def find_pair(
    names: tuple[str, str],
    *,
    gamma: float | None = None,
    horizon: int | None = None,
    width: int | None = None,
    **where: Any,
) -> tuple[Agent, Agent]:
    """Returns two agents by their names; an exact table takes γ, N and w of a run beside it.

    Args:
        names: as `find_agent` reads them.
        gamma: of exact tables, by default that of the run, or 0.95.
        horizon: N of exact tables, by default that of the run, or 4.
        width: w of exact tables, by default that of the run, or 1.
        where: both act, as for `find_agent`.

    Raises:
        InputError: there is no such agent, or something does not fit it.
    """
    given = (gamma, horizon, width)
    if given != (None, None, None) and not any(map(is_model, names)):
        raise InputError(f"Each of the two {_OWN_AXIS}", _LEAVE_OUT)
    found, axis = {}, changed(AXIS, *given)
    for name in sorted(names, key=is_model):  # runs first
        own = asdict(axis) if is_model(name) else {}
        found[name] = find_agent(name, **own, **where)
        axis = changed(found[name].estimator.time_axis, *given)
    return found[names[0]], found[names[1]]
