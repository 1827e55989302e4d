"""`trdlab video`: an episode beside its forecast, as a video."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from trdlab.cli import common


class What(StrEnum):
    """What a video shows."""

    EPISODE = "episode"
    SALIENCY = "saliency"
    COMPONENTS = "components"


def video(
    agent: Annotated[str, typer.Argument(metavar="AGENT", help=common.AGENT)],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="FILE", help="Where to: .mp4, .webp or .gif."),
    ],
    what: Annotated[
        What,
        typer.Option(
            "--what",
            help="The forecast beside the episode; where on the screen near and far reward is "
            "decided, step by step; or the same for each component of one step.",
        ),
    ] = What.EPISODE,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the episode.")] = 0,
    step: Annotated[
        int, typer.Option("--step", min=0, help="Of that episode, for --what components.")
    ] = 0,
    action: Annotated[
        str | None,
        typer.Option(
            "--action",
            metavar="NAME|NUMBER",
            help="At that step, for --what components.",
            show_default="what it does",
        ),
    ] = None,
    env: common.Env = None,
    env_arguments: common.EnvArguments = None,
    action_names: common.ActionNames = None,
    gamma: common.TableGamma = None,
    horizon: common.TableHorizon = None,
    width: common.TableWidth = None,
    episodes: Annotated[
        int,
        typer.Option("--episodes", min=0, help="To judge it by; what fails is pale."),
    ] = 0,
    rate: Annotated[
        float | None,
        typer.Option("--rate", help="Frames in a second.", show_default="as people play, or 4"),
    ] = None,
    max_steps: common.MaxSteps = None,
    modules: common.Import = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the video.")] = False,
    verbose: common.Verbose = False,
) -> None:
    """Make a video of an episode: the forecast beside it, or where rewards are decided.

    The key moments are told in words, and what was expected is held against what came.
    """
    from trdlab.cli.progress import EpisodeProgress, VideoProgress
    from trdlab.explanations.explanation import explain
    from trdlab.show.video.films import check

    check(out, what.value, rate=rate, overwrite=overwrite)
    axis = {"gamma": gamma, "horizon": horizon, "width": width}
    found = common.find(agent, env, env_arguments, action_names, **axis)
    with EpisodeProgress(common.errors(), "Getting ready") as progress:
        explained = explain(
            found,
            ("forecast", "episode") if what is What.COMPONENTS else ("episode",),
            seed=seed,
            step=step if what is What.COMPONENTS else 0,
            action=action,
            episodes=episodes,
            max_steps=max_steps,
            watch=progress.on_progress,
        )
    with VideoProgress(common.errors()) as drawing:
        explained.to_video(out, what.value, rate=rate, overwrite=overwrite, watch=drawing.on_frame)
    common.say(common.errors(), f"Video: {out}")
