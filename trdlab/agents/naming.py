"""What a word names: a run, a checkpoint of it, or the exact table of a model."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from trdlab.agents.agent import Agent
from trdlab.agents.exact import exact_agent
from trdlab.agents.models import GRIDWORLD, TABULAR, is_model
from trdlab.agents.outside import file_agent
from trdlab.agents.places import AXIS, Origin, Where, changed
from trdlab.errors import InputError
from trdlab.gridworld import map_names
from trdlab.policies import acting
from trdlab.policies.functions import PYTHON, from_python
from trdlab.tabular.toytext import toy_text_ids
from trdlab.time_axis import TimeAxis
from trdlab.training.fitted import is_fit, load_fit

_OWN_AXIS = "is a run with its own γ, N and w."
_UNKNOWN_AXIS = "gets γ, N and w when it is fitted."
_LEAVE_OUT = "Leave out `gamma`, `horizon` and `width`."


def find_agent(
    name: str,
    *,
    gamma: float | None = None,
    horizon: int | None = None,
    width: int | None = None,
    env: Where | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns an agent by its name.

    That is a run's folder, or `RUN@STEP` or `RUN@best` for another checkpoint of it; the folder of
    a fit; for the exact table of a model, `gridworld:NAME`, a map file, or `tabular:ENV_ID`, each
    with what to make it with after commas, such as `gridworld:ledge,slip=0.2`; a file of an agent
    that another library trained, or `python:FILE.py:FUNCTION`, whose function makes one.

    Args:
        name: of the agent.
        gamma: of an exact table, by default 0.95; a run has its own, and its own N and w.
        horizon: N of an exact table, by default 4.
        width: w of an exact table, by default 1.
        env: an environment to act in instead of its own (see `find_place`).
        env_arguments: what to make that one with, as `KEY=VALUE`.

    Raises:
        InputError: there is no such agent, or something does not fit it.
        TrdlabError: a run is torn.
    """
    where: dict[str, Any] = {"env": env, "env_arguments": env_arguments}
    if name.startswith(PYTHON):
        return _made(name, env, env_arguments, changed(AXIS, gamma, horizon, width))
    if is_model(name):
        called = name if name.startswith((GRIDWORLD, TABULAR)) else f"{GRIDWORLD}{name}"
        axis = changed(AXIS, gamma, horizon, width)
        return exact_agent(called, axis, **where)
    _refuse_model(name)
    is_file = Path(name.partition(",")[0]).is_file()
    if (gamma, horizon, width) != (None, None, None):
        own = _UNKNOWN_AXIS if is_file else _OWN_AXIS
        raise InputError(f"'{name}' {own}", _LEAVE_OUT)
    if is_file:
        return file_agent(name, **where)
    if is_fit(Path(name)):
        return _fitted(name, env, env_arguments)
    from trdlab.agents.runs import run_agent
    from trdlab.runs import find_checkpoint

    path, step = find_checkpoint(name)
    return run_agent(path, step=step, **where)


def _fitted(name: str, env: Where | None, env_arguments: Sequence[str]) -> Agent:
    """Returns the agent of a fit, in a folder: who was fitted, with what was learned of it."""
    estimator, interface, whose = load_fit(Path(name))
    if whose is None:
        raise InputError(
            f"'{name}' was fitted to an agent without a name.",
            "Give it in Python: trdlab.agent(trdlab.load(folder), env=…, policy=…).",
        )
    if env is None:
        env, env_arguments = whose.env, whose.env_arguments
    of = find_agent(whose.agent, env=env, env_arguments=env_arguments)
    interface.check_fits(of.interface, str(env or whose.agent))
    policy = acting(of.policy or of.estimator)
    origin = of.origin and replace(of.origin, name=name, time_axis=None)
    return replace(of, name=Path(name).name, estimator=estimator, policy=policy, origin=origin)


def _made(name: str, env: Where | None, env_arguments: Sequence[str], axis: TimeAxis) -> Agent:
    """Returns the agent that a function in a file of Python makes."""
    from trdlab.agents.given import agent_of

    made = agent_of(from_python(name.removeprefix(PYTHON)), env, env_arguments, axis)
    if not isinstance(env, str):
        return made
    return replace(made, origin=Origin(name, env, tuple(env_arguments), None, away=True))


def _refuse_model(name: str) -> None:
    """Refuses the name of a model without its kind, where no run is called that."""
    called = name.partition(",")[0]
    if Path(name).exists():
        return
    if called in map_names():
        raise InputError(f"There is no run '{name}'.", f"For the map: {GRIDWORLD}{name}")
    if called in toy_text_ids():
        raise InputError(f"There is no run '{name}'.", f"For the exact table: {TABULAR}{name}")


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
