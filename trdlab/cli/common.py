"""What the commands that explain a solved model share: their options, and how they print."""

import json
import sys
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

if TYPE_CHECKING:
    from trdlab.show.report import Report


class Ties(StrEnum):
    """Whose future is told where optimal actions tie."""

    LOWEST = "lowest"
    MIXED = "mixed"


Gamma = Annotated[float, typer.Option("--gamma", help="Discount factor, in [0, 1).")]
Horizon = Annotated[int, typer.Option("--N", help="Number of explicit components.")]
Width = Annotated[int, typer.Option("--w", help="Steps in each component.")]
Action = Annotated[
    str | None, typer.Option("--action", help="The action to explain.", show_default="the best")
]
Foil = Annotated[
    str | None,
    typer.Option("--foil", help="The action to contrast it with.", show_default="the next best"),
]
WhoseTies = Annotated[Ties, typer.Option("--ties", help="Whose future, where optimal actions tie.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Write a picture: .png, .pdf or .svg.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the picture.")]
AGENT = (
    "A run's folder, or RUN@STEP for an older checkpoint; or an exact table: gridworld:NAME, a map "
    "file, or tabular:ENV_ID, with arguments after commas, such as gridworld:ledge,slip=0.2."
)
EnvArguments = Annotated[
    list[str] | None,
    typer.Option("--env-arg", metavar="KEY=VALUE", help="What to make --env with."),
]
MaxSteps = Annotated[
    int | None,
    typer.Option(
        "--max-steps",
        min=1,
        help="After which an episode is cut off, if not before.",
        show_default="1000, or four horizons",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="Show tracebacks.")]


def pictures_option(drawn: str) -> Any:
    """Returns the option of a folder to draw into; `drawn` says when there is one by default."""
    default = f"{drawn} a new folder in explanations"
    return typer.Option("--out", metavar="DIR", help="Write pictures there.", show_default=default)


def new_console() -> tuple[Console, bool]:
    """Returns a console on stdout, and whether it can only print ASCII."""
    console = Console(highlight=False)
    return console, not console.encoding.lower().startswith("utf")


def print_json(data: object) -> None:
    """Prints plain data as JSON, never through rich."""
    json.dump(data, sys.stdout, indent=2, allow_nan=False)
    print()


def publish(
    solve: Callable[[], "Report"], *, plot: Path | None, overwrite: bool, as_json: bool
) -> None:
    """Prints a report as a page or as JSON, and writes its picture.

    Args:
        solve: makes the report; called once the picture is known to be writable.
        plot: where the picture goes.
        overwrite: whether it may replace a file.
        as_json: whether to print JSON.
    """
    from trdlab.show import report as show

    if plot is not None:
        from trdlab.show.plots.style import check_picture

        check_picture(plot, overwrite=overwrite)
    report = solve()
    if as_json:
        print_json(show.to_dict(report))
    else:
        console, ascii_only = new_console()
        console.print(show.page(report, ascii_only=ascii_only))
    if plot is not None:
        from trdlab.show.plots.map import report_figure
        from trdlab.show.plots.style import save

        save(report_figure(report), plot)
        Console(stderr=True, highlight=False).print(
            f"Picture: {plot}", soft_wrap=True, markup=False
        )
