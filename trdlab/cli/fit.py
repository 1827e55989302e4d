"""`trdlab fit`: learns what a frozen agent can expect, and says how far that can be trusted."""

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from trdlab.cli import common
from trdlab.errors import InputError

if TYPE_CHECKING:
    from trdlab.deep.fit import FitProgress

_UNITS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}
_LINE_SECONDS = 10.0


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
    verbose: common.Verbose = False,
) -> None:
    """Learn what a frozen agent can expect: the decomposition of its own policy.

    The agent plays and stays as it is. A network learns the rewards that really came.
    """
    import trdlab
    from trdlab.explanations.calibration import claims
    from trdlab.files import free_name

    seconds = _seconds(limit)
    found = trdlab.agent(agent, env=env, env_arguments=_given(env_arguments))
    out = out or free_name(Path("fits"), f"{found.name}-N{horizon}-w{width}")
    errors, watch = common.errors(), _Watch(steps)
    began = time.monotonic()
    fitted = trdlab.fit(
        found,
        horizon=horizon,
        width=width,
        gamma=gamma,
        steps=steps,
        share=share,
        seed=seed,
        seconds=seconds,
        out=out,
        method=method,
        tell=lambda now: watch.tell(errors, now),
    )
    errors.print(f"Kept: {out}", soft_wrap=True, markup=False)
    report = trdlab.calibrate(fitted)
    for claim in claims.in_brief(report):
        common.print_line(claim.sentence)
    common.print_line(f"It took {time.monotonic() - began:.0f} s. Try: trdlab explain {out}", "dim")


def _given(env_arguments: list[str] | None) -> dict[str, Any]:
    from trdlab.environments.arguments import parse_arguments

    return dict(parse_arguments(env_arguments or []))


class _Watch:
    """Tells how far it is, now and then."""

    def __init__(self, steps: int) -> None:
        self._steps, self._shown = steps, time.monotonic()

    def tell(self, console: Console, now: "int | FitProgress") -> None:
        if time.monotonic() - self._shown < _LINE_SECONDS:
            return
        self._shown = time.monotonic()
        line = (
            f"{now:,} of {self._steps:,} steps played"
            if isinstance(now, int)
            else f"{now.updates:,} updates, held-out error {now.error:.3g} of a constant guess's"
        )
        console.print(line, soft_wrap=True, markup=False)
