"""`trdlab tabular`: the exact decomposition of an environment's transition table, explained."""

from typing import Annotated

import typer

from trdlab.cli import common
from trdlab.cli.common import Ties

_VARIANTS = ("is_slippery", "is_rainy")


def _complete(incomplete: str) -> list[str]:
    from trdlab.tabular.toytext import toy_text_ids

    return [name for name in toy_text_ids() if name.startswith(incomplete)]


def tabular(
    env_id: Annotated[
        str,
        typer.Argument(
            metavar="ENV_ID",
            help="A Gymnasium environment with a transition table, such as FrozenLake-v1, "
            "CliffWalking-v1 or Taxi-v4; or MODULE:ENV_ID, to import a module first.",
            autocompletion=_complete,
        ),
    ],
    gamma: common.Gamma = 0.95,
    horizon: common.Horizon = 4,
    width: common.Width = 1,
    env_arguments: Annotated[
        list[str] | None,
        typer.Option(
            "--env-arg",
            metavar="KEY=VALUE",
            help="What to make it with, such as is_slippery=false; can be repeated.",
        ),
    ] = None,
    state: Annotated[
        str | None,
        typer.Option(
            "--state",
            metavar="NUMBER|COORDINATES",
            help="The state to explain, such as 6 or 1,2 (row,column; in Taxi also "
            "passenger,destination, such as 2,0,taxi,G).",
            show_default="the likeliest start",
        ),
    ] = None,
    action: common.Action = None,
    foil: common.Foil = None,
    ties: common.WhoseTies = Ties.LOWEST,
    plot: common.Plot = None,
    overwrite: common.Overwrite = False,
    details: common.Details = False,
    as_json: common.AsJson = False,
    verbose: common.Verbose = False,
) -> None:
    """Solve an environment exactly and say when each action expects which reward.

    It needs an exact model: the table P that toy-text environments carry.

    Component 0 is the reward of the action taken now; the last component,
    the residual, holds all that comes after N*w steps.
    """
    from trdlab.environments.arguments import parse_arguments, say_arguments
    from trdlab.explanations.solved import SolvedState, solve_state
    from trdlab.tabular.named import TabularWorld
    from trdlab.tabular.toytext import make_world
    from trdlab.time_axis import TimeAxis

    axis, arguments = TimeAxis(gamma, horizon, width), parse_arguments(env_arguments or [])
    given = {
        "--state": state,
        "--action": action,
        "--foil": foil,
        "--ties": None if ties is Ties.LOWEST else ties.value,
    }

    def further(solved: SolvedState) -> str:
        """Returns a command that shows something new about this very environment."""
        if solved.choice.moment.is_over:
            return ""
        assert isinstance(solved.world, TabularWorld)
        varied = dict(arguments)
        new = [name for name in _VARIANTS if name in solved.world.arguments and name not in varied]
        if axis.width == 1 and new and state is None:
            varied[new[0]] = not solved.world.arguments[new[0]]
        words: list[str | float] = ["tabular", env_id]
        for name, value in varied.items():
            words += ["--env-arg", say_arguments({name: value})]
        base = common.command([*words, "--gamma", gamma], given)
        if axis.width > 1:
            return f"{base} --N {axis.num_steps} --w 1 (the same steps one by one)"
        if varied != arguments:
            return f"{base} --N {axis.horizon}"
        return f"{base} --N {2 * axis.horizon + 2} (a longer horizon)"

    common.publish(
        lambda: solve_state(
            make_world(env_id, arguments),
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
