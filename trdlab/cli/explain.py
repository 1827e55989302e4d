"""`trdlab explain`: what an agent expects, and how far that can be trusted."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from trdlab.cli import common


def explain(
    agent: Annotated[
        str,
        typer.Argument(metavar="AGENT", help=common.AGENT),
    ],
    what: Annotated[
        str | None,
        typer.Option(
            "--what",
            metavar="PART,...",
            help="forecast, contrast, episode, calibration, saliency.",
            show_default="what matters most",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the episode to explain.")] = 0,
    step: Annotated[int, typer.Option("--step", min=0, help="Of that episode.")] = 0,
    action: Annotated[
        str | None,
        typer.Option(
            "--action", metavar="NAME|NUMBER", help="To explain.", show_default="what it does"
        ),
    ] = None,
    foil: Annotated[
        str | None,
        typer.Option(
            "--foil",
            metavar="NAME|NUMBER",
            help="The action to contrast it with.",
            show_default="the next best",
        ),
    ] = None,
    components: Annotated[
        str | None,
        typer.Option(
            "--component",
            metavar="K|A-B,...",
            help="Of saliency: of which, two against each other, later, or all.",
            show_default="near and far",
        ),
    ] = None,
    layer: Annotated[
        int, typer.Option("--layer", min=0, help="Of saliency: of which convolution.")
    ] = 0,
    maps: Annotated[
        Literal["gradcam", "hirescam"],
        typer.Option("--maps", help="Of saliency: how they are made."),
    ] = "gradcam",
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
            show_default="50, of an exact table 300",
        ),
    ] = None,
    max_steps: common.MaxSteps = None,
    modules: common.Import = None,
    details: common.Details = False,
    as_json: common.AsJson = False,
    out: Annotated[Path | None, common.pictures_option("without --what and --json")] = None,
    verbose: common.Verbose = False,
) -> None:
    """Say what an agent expects, when, and how far that can be trusted.

    It plays an episode as the agent would, and explains one step of it.
    How far such forecasts can be trusted is judged by other episodes.
    """
    from trdlab.cli.progress import EpisodeProgress
    from trdlab.explanations.explanation import explain as explain_agent
    from trdlab.explanations.explanation import parse_parts

    parts = parse_parts(what)
    axis = {"gamma": gamma, "horizon": horizon, "width": width}
    found = common.find(agent, env, env_arguments, action_names, **axis)
    named = Path("explanations"), found.name
    is_named = out is None and not parts and not as_json
    if is_named:
        from trdlab.files import free_name, new_folder

        out = free_name(*named)
    if out is not None:
        from trdlab.show.plots.figures import part_figure, picture_paths
        from trdlab.show.plots.style import check_pictures

        paths = picture_paths(out, parts, seed=seed, step=step)
        check_pictures(paths.values())
    with EpisodeProgress(common.errors(), "Getting ready") as progress:
        explained = explain_agent(
            found,
            parts,
            seed=seed,
            step=step,
            action=action,
            foil=foil,
            episodes=episodes,
            max_steps=max_steps,
            components=components,
            layer=layer,
            maps=maps,
            watch=progress.on_progress,
        )
    if as_json:
        common.print_json(explained.to_dict())
    else:
        common.print_page(explained, details=details)
    if out is not None:
        out = new_folder(*named) if is_named else out
        for part, path in paths.items():
            if (figure := part_figure(explained, part)) is not None:
                common.save_picture(figure, out / path.name)
    if not parts and not as_json:
        told = {"--seed": seed or None, "--step": step or None}
        words = (agent,) if found.origin is None else found.origin.words
        hint = common.command(["report", *words], told)
        common.say(common.errors(), f"To go through the episode in a browser: {hint}")
