"""`trdlab gridworld`: the exact decomposition of a gridworld, explained."""

from typing import Annotated

import typer

from trdlab.cli import common
from trdlab.cli.common import Ties
from trdlab.gridworld import map_names


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
    gamma: common.Gamma = 0.95,
    horizon: common.Horizon = 4,
    width: common.Width = 1,
    slip: Annotated[
        float | None, typer.Option("--slip", help="Probability of moving sideways instead.")
    ] = None,
    treasure: Annotated[
        float | None, typer.Option("--treasure", help="What treasures pay.")
    ] = None,
    state: Annotated[
        str, typer.Option("--state", metavar="NUMBER|ROW,COLUMN", help="The state to explain.")
    ] = "0",
    action: common.Action = None,
    foil: common.Foil = None,
    ties: common.WhoseTies = Ties.LOWEST,
    plot: common.Plot = None,
    overwrite: common.Overwrite = False,
    as_json: common.AsJson = False,
    list_maps: Annotated[bool, typer.Option("--list", help="List the built-in maps.")] = False,
    verbose: common.Verbose = False,
) -> None:
    """Solve a gridworld exactly and say when each action expects which reward.

    Component 0 is the reward of the action taken now; the last component, the residual, holds all
    that comes after N*w steps.
    """
    from trdlab.show import gridworld as show

    if list_maps and as_json:
        common.print_json(show.map_entries())
        return
    if list_maps:
        console, ascii_only = common.new_console()
        console.print(show.map_list(ascii_only=ascii_only))
        return
    common.publish(
        lambda: show.report(
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
        ),
        plot=plot,
        overwrite=overwrite,
        as_json=as_json,
    )
