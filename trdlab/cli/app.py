"""The `trdlab` command, put together from the modules of its commands."""

from collections.abc import Sequence
from importlib import import_module
from typing import Annotated

import typer

from trdlab import __version__

HELP = "When does an agent expect which reward, and how far can that be trusted?"
COMMANDS = {
    "gridworld": "trdlab.cli.gridworld",
    "playground": "trdlab.cli.playground",
    "tabular": "trdlab.cli.tabular",
    "explain": "trdlab.cli.explain",
    "video": "trdlab.cli.video",
    "report": "trdlab.cli.report",
    "compare": "trdlab.cli.compare",
    "agent": "trdlab.cli.agent",
    "fit": "trdlab.cli.fit",
    "games": "trdlab.cli.games",
    "train": "trdlab.cli.train",
    "resume": "trdlab.cli.train",
    "evaluate": "trdlab.cli.evaluate",
    "runs": "trdlab.cli.runs",
    "study": "trdlab.cli.study",
}
"""The module of each command, where it is the function, or the group, of the same name."""


def new_app(words: Sequence[str]) -> typer.Typer:
    """Returns the command with those of its commands that these words can be for.

    A command that is named costs only its own imports: `trdlab gridworld` starts in half a second
    because it does not know of the others.

    Args:
        words: what stands behind `trdlab` on the command line.
    """
    app = typer.Typer(
        name="trdlab",
        help=HELP,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_options)
    for name in words[:1] if words[:1] and words[0] in COMMANDS else COMMANDS:
        command = getattr(import_module(COMMANDS[name]), name)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name)
        else:
            app.command(name)(command)
    return app


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"trdlab {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None: ...
