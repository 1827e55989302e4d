"""`trdlab gridworld`: the exact decomposition of a gridworld, explained."""

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from trdlab.gridworld import map_names


class Ties(StrEnum):
    """Whose future is told where optimal actions tie."""

    LOWEST = "lowest"
    MIXED = "mixed"


def gridworld(
    map_name: Annotated[
        str,
        typer.Option(
            "--map",
            metavar="NAME|FILE",
            help="A built-in map, or a text file.",
            autocompletion=lambda incomplete: [n for n in map_names() if n.startswith(incomplete)],
        ),
    ] = "drone",
    gamma: Annotated[float, typer.Option("--gamma", help="Discount factor, in [0, 1).")] = 0.95,
    horizon: Annotated[int, typer.Option("--N", help="Number of explicit components.")] = 4,
    width: Annotated[int, typer.Option("--w", help="Steps in each component.")] = 1,
    slip: Annotated[
        float | None, typer.Option("--slip", help="Probability of moving sideways instead.")
    ] = None,
    treasure: Annotated[
        float | None, typer.Option("--treasure", help="What treasures pay.")
    ] = None,
    state: Annotated[
        str, typer.Option("--state", metavar="NUMBER|ROW,COLUMN", help="The state to explain.")
    ] = "0",
    action: Annotated[
        str | None, typer.Option("--action", help="The action to explain.", show_default="the best")
    ] = None,
    foil: Annotated[
        str | None,
        typer.Option(
            "--foil", help="The action to contrast it with.", show_default="the next best"
        ),
    ] = None,
    ties: Annotated[
        Ties, typer.Option("--ties", help="Whose future, where optimal actions tie.")
    ] = Ties.LOWEST,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Write a picture: .png, .pdf or .svg.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the picture.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    list_maps: Annotated[bool, typer.Option("--list", help="List the built-in maps.")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Show tracebacks.")] = False,
) -> None:
    """Solve a gridworld exactly and say when each action expects which reward.

    Component 0 is the reward of the action taken now; the last component, the residual, holds all
    that comes after N*w steps.
    """
    from trdlab.show import gridworld as show

    console = Console(highlight=False)
    ascii_only = not console.encoding.lower().startswith("utf")
    if list_maps:
        console.print(show.map_list(ascii_only=ascii_only))
        return
    if plot is not None:
        from trdlab.show.plots import check_picture

        check_picture(plot, overwrite=overwrite)
    report = show.report(
        map_name,
        gamma=gamma,
        horizon=horizon,
        width=width,
        slip=slip,
        treasure=treasure,
        state=state,
        action=action,
        foil=foil,
        ties=ties.value,
    )
    if as_json:
        json.dump(show.to_dict(report), sys.stdout, indent=2, allow_nan=False)
        print()
    else:
        console.print(show.page(report, ascii_only=ascii_only))
    if plot is not None:
        from trdlab.show.plots import save_report

        save_report(report, plot)
        Console(stderr=True, highlight=False).print(
            f"Picture: {plot}", soft_wrap=True, markup=False
        )
