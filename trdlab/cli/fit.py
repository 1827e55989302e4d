"""`trdlab fit`: learns what a frozen agent can expect, and says how far that can be trusted."""

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from trdlab.cli import common
from trdlab.errors import InputError

if TYPE_CHECKING:
    from trdlab.agents.agent import Agent

_UNITS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}


def _seconds(text: str | None) -> float | None:
    """Returns a time such as 90, 90s, 10m or 1.5h in seconds."""
    if text is None:
        return None
    found = re.fullmatch(r"(\d+(?:\.\d+)?)([smh]?)", text.strip())
    if not found or not float(found[1]):
        raise InputError(f"The time is '{text}'.", "Write it as 90s, 10m or 1h.")
    return float(found[1]) * _UNITS[found[2]]


def fit(
    agent: Annotated[str, typer.Argument(metavar="AGENT", help=common.AGENT)],
    env: common.Env = None,
    env_arguments: common.EnvArguments = None,
    action_names: common.ActionNames = None,
    horizon: Annotated[int, typer.Option("--N", help="Number of explicit components.")] = 40,
    width: Annotated[int, typer.Option("--w", help="Steps in each component.")] = 1,
    gamma: Annotated[
        float | None,
        typer.Option("--gamma", help="Discount factor.", show_default="the agent's own, or 0.99"),
    ] = None,
    steps: Annotated[int, typer.Option("--steps", min=1, help="That it plays.")] = 100_000,
    share: Annotated[
        float, typer.Option("--share", help="Of its actions that are forced.", min=0, max=1)
    ] = 0.1,
    epsilon: Annotated[
        float,
        typer.Option(
            "--epsilon", help="Chance of any action at random, as a part of it.", min=0, max=1
        ),
    ] = 0.0,
    layers: Annotated[
        str,
        typer.Option(
            "--layers",
            help="What the network begins with: new weights; those copied from the agent's own "
            "network, of trdlab's runs; or those, frozen, which is quicker and less exact.",
        ),
    ] = "new",
    method: Annotated[
        str, typer.Option("--method", help="mixed, regression or td (see the guide).")
    ] = "mixed",
    limit: Annotated[
        str | None,
        typer.Option("--time", metavar="10m", help="Stop learning after so long."),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of everything.")] = 1,
    modules: common.Import = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Keep it there.", show_default="a new one in fits"
        ),
    ] = None,
    outcome: Annotated[
        list[str] | None,
        typer.Option(
            "--outcome",
            metavar="NAME=info.KEY",
            help="Forecast that number, too: an event where it is always 0 or 1.",
        ),
    ] = None,
    part: Annotated[
        list[str] | None,
        typer.Option(
            "--part", metavar="NAME=info.KEY", help="The same, and all parts add up to the reward."
        ),
    ] = None,
    verbose: common.Verbose = False,
) -> None:
    """Learn what a frozen agent can expect: the decomposition of its own policy.

    The agent plays and stays as it is. A network learns the rewards that really came, how much they
    vary, and whether the episode was still running.
    """
    from trdlab.files import free_name

    limit_seconds, parts, outcomes = _seconds(limit), _places(part), _places(outcome)
    found = common.named(_agent(agent, env, env_arguments), action_names)
    out = out or free_name(Path("fits"), f"{found.name}-N{horizon}-w{width}")
    _fit(
        found,
        out,
        horizon=horizon,
        width=width,
        gamma=gamma,
        steps=steps,
        share=share,
        epsilon=epsilon,
        layers=layers,
        seed=seed,
        seconds=limit_seconds,
        method=method,
        outcomes=outcomes,
        parts=parts,
    )


def go_on(path: Path) -> None:
    """Goes on with a fit that was stopped."""
    from trdlab.runs import RunFolder
    from trdlab.runs.fits import run_of
    from trdlab.training.fitted import Plan

    if (of_run := run_of(path)) is not None:
        fit_run(of_run[0])
        return
    plan = Plan.from_config(RunFolder.open(path).config)
    if plan.agent is None or plan.has_functions:
        what = "agent" if plan.agent is None else "outcomes"
        raise InputError(
            f"The {what} of '{path}' {'was' if plan.agent is None else 'were'} given in Python.",
            f"Go on there: trdlab.fit(…, out='{path}') with all that it was begun with.",
        )
    found = _agent(plan.agent, plan.env, list(plan.env_arguments), gamma=plan.solved_for)
    _fit(found, path, **plan.arguments)


def fit_run(path: Path) -> None:
    """Fits the agent of a run, in its folder, and says how far that can be trusted."""
    from trdlab.runs import RunFolder
    from trdlab.runs.fits import fit_path
    from trdlab.training.loading import chosen_step
    from trdlab.verbs.fitting import fit_run as fit_in_folder

    out = fit_path(path, chosen_step(RunFolder.open(path)))
    _told(lambda **watched: fit_in_folder(path, **watched), out, path)


def _fit(found: "Agent", out: Path, **how: Any) -> None:
    """Fits, and says how far that can be trusted."""
    import trdlab

    _told(lambda **watched: trdlab.fit(found, out=out, **watched, **how), out, out)


def _told(fitted_by: Callable[..., "Agent"], out: Path, name: Path) -> None:
    """Fits, and says how far that can be trusted.

    Args:
        fitted_by: does it, and shows how far it is.
        out: where it is kept.
        name: by which the agent is explained.
    """
    import trdlab
    from trdlab.cli.progress import stopping
    from trdlab.explanations.calibration import claims
    from trdlab.runs import RunFolder
    from trdlab.runs.folder import is_fit
    from trdlab.training.fitted import Stopped

    errors, began = common.errors(), time.monotonic()
    with stopping() as stop:
        try:
            fitted = fitted_by(progress=True, should_stop=stop)
        except Stopped as stopped:
            kept = is_fit(out)
            again = "Begin again." if name == out else f"Go on: trdlab resume {name}"
            told = f"Saved. Go on: {RunFolder.open(out).resume_command}" if kept else again
            errors.print(f"{stopped.cause} {told}", soft_wrap=True, markup=False)
            raise typer.Exit(stop.code or 0) from stopped
    errors.print(f"Kept: {out}", soft_wrap=True, markup=False)
    report = trdlab.calibrate(fitted)
    for claim in claims.in_brief(report):
        common.print_line(claim.sentence)
    took = f"It took {time.monotonic() - began:.0f} s."
    common.print_line(f"{took} Try: trdlab explain {name}", "dim")


def _agent(agent: str, env: str | None, env_arguments: list[str] | None, **how: Any) -> "Agent":
    import trdlab
    from trdlab.environments.arguments import parse_arguments

    given = dict(parse_arguments(env_arguments or []))
    return trdlab.agent(agent, env=env, env_arguments=given, **how)


def _places(given: list[str] | None) -> dict[str, str]:
    """Returns where numbers stand in `info`, by name, from NAME=info.KEY."""
    places = {}
    for text in given or ():
        name, equals, place = text.partition("=")
        if not (name and equals and place):
            raise InputError(f"The outcome is '{text}'.", "Write it as NAME=info.KEY.")
        places[name] = place
    return places
