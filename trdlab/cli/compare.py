"""`trdlab compare`: what two agents expect at the same states."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from trdlab.cli import common

if TYPE_CHECKING:
    from trdlab.explanations.comparison.comparison import Comparison


def compare(
    first: Annotated[str, typer.Argument(metavar="A", help=common.AGENT)],
    second: Annotated[str, typer.Argument(metavar="B", help="Another one.")],
    env: Annotated[
        str | None,
        typer.Option("--env", help="Where both act.", show_default="where A was made for"),
    ] = None,
    env_arguments: common.EnvArguments = None,
    action_names: common.ActionNames = None,
    gamma: Annotated[
        float | None,
        typer.Option(
            "--gamma", help="Of exact tables: discount factor.", show_default="that of a run, 0.95"
        ),
    ] = None,
    horizon: Annotated[
        int | None,
        typer.Option(
            "--N", help="Of exact tables: explicit components.", show_default="that of a run, 4"
        ),
    ] = None,
    width: Annotated[
        int | None,
        typer.Option(
            "--w", help="Of exact tables: steps in each.", show_default="that of a run, 1"
        ),
    ] = None,
    episodes: Annotated[
        int | None,
        typer.Option(
            "--episodes",
            min=1,
            help="That each plays, and as many again to judge its forecasts by.",
            show_default="20 and 50, of exact tables 50 and 300",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the first episode.")] = 0,
    max_steps: common.MaxSteps = None,
    modules: common.Import = None,
    details: common.Details = False,
    as_json: common.AsJson = False,
    out: Annotated[Path | None, common.pictures_option("without --json")] = None,
    verbose: common.Verbose = False,
) -> None:
    """Compare what two agents expect at the same states, when, and how far each can be trusted.

    Both play episodes, and both are asked about the states of them all.
    """
    from trdlab.agents.naming import find_pair
    from trdlab.cli.progress import EpisodeProgress
    from trdlab.explanations.comparison import comparison as two

    pair = find_pair(
        (first, second),
        gamma=gamma,
        horizon=horizon,
        width=width,
        env=env,
        env_arguments=env_arguments or (),
    )
    agents = [common.named(agent, action_names) for agent in pair]
    named = Path("explanations"), f"{agents[0].name}-against-{agents[1].name}"
    is_named = out is None and not as_json
    if is_named:
        from trdlab.files import free_name, new_folder

        out = free_name(*named)
    if out is not None:
        from trdlab.show.plots.comparison import NAME
        from trdlab.show.plots.style import check_pictures

        check_pictures([out / NAME])
    with EpisodeProgress(common.errors(), "Getting ready") as progress:
        found = two.compare(
            *agents, episodes=episodes, max_steps=max_steps, seed=seed, watch=progress.on_progress
        )
    if as_json:
        common.print_json(found.to_dict())
    else:
        common.print_page(found, details=details)
        if hint := _further(found):
            common.print_line(f"Try: {hint}", "dim")
    if out is not None:
        out = new_folder(*named) if is_named else out
        common.save_picture(found.plot(), out / NAME)


def _further(found: "Comparison") -> str:
    """Returns the command that explains the moment at which the two are furthest apart, if any."""
    visits = found.visits
    for m in visits.furthest(1):
        if (origin := found.agents[visits.player[m]].origin) is not None:
            where = {"--seed": str(visits.seed[m]), "--step": str(visits.step[m])}
            return common.command(["explain", *origin.words], where)
    return ""
