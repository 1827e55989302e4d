"""`trdlab gridworld`: the exact decomposition of a gridworld, explained."""

from typing import Annotated

import typer

from trdlab.cli import common
from trdlab.cli.common import Ties
from trdlab.gridworld import Gridworld, load_map, map_names


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
        str,
        typer.Option(
            "--state",
            metavar="NUMBER|ROW,COLUMN",
            help="The state to explain; 2,3,1 is row 2, column 3 with 1 collected.",
        ),
    ] = "0",
    action: common.Action = None,
    foil: common.Foil = None,
    ties: common.WhoseTies = Ties.LOWEST,
    plot: common.Plot = None,
    overwrite: common.Overwrite = False,
    details: common.Details = False,
    as_json: common.AsJson = False,
    list_maps: Annotated[bool, typer.Option("--list", help="List the built-in maps.")] = False,
    verbose: common.Verbose = False,
) -> None:
    """Solve a gridworld exactly and say when each action expects which reward.

    Component 0 is the reward of the action taken now; the last component, the residual, holds all
    that comes after N*w steps.
    """
    if list_maps:
        _list_maps(as_json=as_json)
        return
    from trdlab.explanations.solved import SolvedState, solve_state
    from trdlab.time_axis import TimeAxis

    axis = TimeAxis(gamma, horizon, width)
    given = {
        "--slip": slip,
        "--treasure": treasure,
        "--state": None if state == "0" else state,
        "--action": action,
        "--foil": foil,
        "--ties": None if ties is Ties.LOWEST else ties.value,
    }

    def further(solved: SolvedState) -> str:
        """Returns a command that shows something new about this very map, all else being equal."""
        if solved.choice.moment.is_over:
            return ""
        base = common.command(["gridworld", "--map", map_name, "--gamma", gamma], given)
        if axis.width > 1:
            return f"{base} --N {axis.num_steps} --w 1 (the same steps one by one)"
        assert isinstance(solved.world, Gridworld)
        treasures = [source.value for source in solved.world.sources if source.kind == "treasure"]
        if treasures and treasure is None and state == "0":
            richer = common.command([base], {"--treasure": 1.25 * treasures[0] or 1.0})
            return f"{richer} --N {axis.horizon} (a larger treasure)"
        return f"{base} --N {2 * axis.horizon + 2} (a longer horizon)"

    common.publish(
        lambda: solve_state(
            Gridworld(load_map(map_name).changed(slip=slip, treasure=treasure)),
            axis,
            state=state,
            action=action,
            foil=foil,
            ties=ties.value,
        ),
        plot=plot,
        overwrite=overwrite,
        as_json=as_json,
        details=details,
        further=further,
    )


def _list_maps(*, as_json: bool) -> None:
    """Prints the built-in maps and what they teach."""
    entries = []
    for name in map_names():
        grid = load_map(name)
        rows, columns = grid.shape
        states = len(Gridworld(grid).states)
        entries.append(
            {"name": name, "rows": rows, "columns": columns, "states": states, "title": grid.title}
        )
    if as_json:
        common.print_json(entries)
        return
    for entry in entries:
        size = f"{entry['rows']} x {entry['columns']}"
        common.print_line(f"{entry['name']:10}{size:9}{entry['title']}")
