"""`trdlab report`: one page about an agent, to be sent to others."""

from pathlib import Path
from typing import Annotated

import typer

from trdlab.cli import common


def report(
    agent: Annotated[
        str,
        typer.Argument(metavar="AGENT", help=common.AGENT),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            metavar="FILE",
            help="Where the page goes.",
            show_default="a new file in reports",
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file.")] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the episode to show.")] = 0,
    step: Annotated[
        int | None,
        typer.Option(
            "--step",
            min=0,
            help="Of that episode, to begin with.",
            show_default="one before a reward that was foreseen",
        ),
    ] = None,
    env: common.Env = None,
    env_arguments: common.EnvArguments = None,
    action_names: common.ActionNames = None,
    gamma: common.TableGamma = None,
    horizon: common.TableHorizon = None,
    width: common.TableWidth = None,
    episodes: Annotated[
        int | None,
        typer.Option(
            "--episodes",
            min=0,
            help="To judge it by; 0 for not at all.",
            show_default="50, of an exact table 300, of a game 16",
        ),
    ] = None,
    others: Annotated[
        int, typer.Option("--others", min=0, help="More episodes to take pictures of reward from.")
    ] = 3,
    max_steps: common.MaxSteps = None,
    modules: common.Import = None,
    verbose: common.Verbose = False,
) -> None:
    """Write one page about an agent: what it expects, when, and what such rewards look like.

    It is a single file, which any browser shows without a network, to go through an episode step by
    step. How far the forecasts can be trusted is judged by other episodes.
    """
    from trdlab.cli.progress import EpisodeProgress
    from trdlab.files import free_file
    from trdlab.show.report.report import check_report, report_agent

    if out is not None:
        check_report(out, overwrite=overwrite)
    axis = {"gamma": gamma, "horizon": horizon, "width": width}
    found = common.find(agent, env, env_arguments, action_names, **axis)
    path = free_file(Path("reports"), found.name, ".html") if out is None else out
    with EpisodeProgress(common.errors(), "Getting ready") as progress:
        report_agent(
            found,
            path,
            seed=seed,
            step=step,
            episodes=episodes,
            others=others,
            max_steps=max_steps,
            overwrite=overwrite,
            watch=progress.on_progress,
        )
    common.say(common.errors(), f"Report: {path}")
