"""The `trdlab` command and what all its commands share."""

from typing import Annotated

import typer

from trdlab import __version__
from trdlab.cli.gridworld import gridworld
from trdlab.cli.tabular import tabular
from trdlab.cli.train import evaluate, resume, runs, train

app = typer.Typer(
    name="trdlab",
    help="When does an agent expect which reward, and how far can that be trusted?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(gridworld)
app.command()(tabular)
app.add_typer(train, name="train")
app.command()(resume)
app.command()(evaluate)
app.command()(runs)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"trdlab {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """When does an agent expect which reward, and how far can that be trusted?"""
