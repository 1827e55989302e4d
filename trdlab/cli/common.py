"""What the commands that explain a solved model share: their options, and how they print."""

import json
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

if TYPE_CHECKING:
    from rich.text import Text

    from trdlab.agents.agent import Agent

_GUIDE = "Every word is explained in “How to read the output” (docs/output.md)."


def max_steps_option(default: str) -> Any:
    """Returns the option of how long episodes last at most; `default` says what else ends them."""
    about = "After which an episode is cut off, if not before."
    return typer.Option("--max-steps", min=1, help=about, show_default=default)


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
    "A run's folder, RUN@STEP or RUN@best for another checkpoint of it; pretrained:GAME, which "
    "comes with trdlab; the folder of a fit; an "
    "exact table: gridworld:NAME, a map file, or tabular:ENV_ID, with arguments after commas, such "
    "as gridworld:ledge,slip=0.2; or an agent of another library, as trdlab agent reads it."
)
Env = Annotated[
    str | None, typer.Option("--env", help="Where it acts.", show_default="where it was made for")
]
EnvArguments = Annotated[
    list[str] | None,
    typer.Option("--env-arg", metavar="KEY=VALUE", help="What to make --env with."),
]
ActionNames = Annotated[
    str | None,
    typer.Option(
        "--action-names",
        metavar="NAME,NAME",
        help="What to call the actions.",
        show_default="as the environment does",
    ),
]
TableGamma = Annotated[
    float | None,
    typer.Option("--gamma", help="Of an exact table: discount factor.", show_default="0.95"),
]
TableHorizon = Annotated[
    int | None,
    typer.Option("--N", help="Of an exact table: explicit components.", show_default="4"),
]
TableWidth = Annotated[
    int | None,
    typer.Option("--w", help="Of an exact table: steps in each.", show_default="1"),
]
MaxSteps = Annotated[int | None, max_steps_option("1000, or four horizons")]
EpisodesSeed = Annotated[int, typer.Option("--seed", min=0, help="Of the episodes.")]
Details = Annotated[bool, typer.Option("--details", help="Tell all there is to tell.")]


def _import(modules: list[str] | None) -> list[str]:
    from trdlab.environments.making import import_named
    from trdlab.errors import InputError

    for module in modules or ():
        try:
            import_named(module)
        except Exception as error:
            raise InputError(
                f"'{module}' cannot be imported: {error}.", "Check its name, or correct it."
            ) from error
    return modules or []  # typer 0.19 converts once more what a callback gives, and wants a list


Import = Annotated[
    list[str] | None,
    typer.Option(
        "--import",
        metavar="MODULE",
        callback=_import,
        help="Import it first: a run's own environment may need it.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="Show tracebacks.")]


def pictures_option(drawn: str) -> Any:
    """Returns the option of a folder to draw into; `drawn` says when there is one by default."""
    default = f"{drawn} a new folder in explanations"
    return typer.Option("--out", metavar="DIR", help="Write pictures there.", show_default=default)


def find(
    agent: str,
    env: str | None,
    env_arguments: list[str] | None,
    action_names: str | None,
    **axis: Any,
) -> "Agent":
    """Returns the agent of a name, with its actions called as the option says.

    Args:
        agent: the name.
        env: where it acts, if it is not its own environment.
        env_arguments: what that is made with.
        action_names: what to call its actions.
        axis: γ, N and w of an exact table.
    """
    from trdlab.agents.naming import find_agent

    found = find_agent(agent, env=env, env_arguments=env_arguments or (), **axis)
    return named(found, action_names)


def named(found: "Agent", action_names: str | None) -> "Agent":
    """Returns an agent with its actions called as the option `--action-names` says."""
    words = None if action_names is None else [word.strip() for word in action_names.split(",")]
    return found if words is None else found.named(words)


def new_console() -> tuple[Console, bool]:
    """Returns a console on stdout, and whether it can only print ASCII."""
    console = Console(highlight=False)
    return console, not console.encoding.lower().startswith("utf")


def errors() -> Console:
    """Returns a console on stderr, for all that is no answer."""
    return Console(stderr=True, highlight=False)


def print_json(data: object) -> None:
    """Prints plain data as JSON, never through rich."""
    json.dump(data, sys.stdout, indent=2, allow_nan=False)
    print()


def publish(
    make: Callable[[], Any],
    *,
    plot: Path | None,
    overwrite: bool,
    as_json: bool,
    details: bool,
    further: Callable[[Any], str] = lambda _: "",
) -> None:
    """Prints a noun of trdlab as a page or as JSON, and writes its picture.

    Args:
        make: makes it; called once the picture is known to be writable.
        plot: where the picture goes.
        overwrite: whether it may replace a file.
        as_json: whether to print JSON.
        details: whether to print all there is to tell.
        further: returns a command that shows more; it is told after the page.
    """
    if plot is not None:
        from trdlab.show.plots.style import check_picture

        check_picture(plot, overwrite=overwrite)
    thing = make()
    if as_json:
        print_json(thing.to_dict())
    else:
        print_page(thing, details=details)
        if hint := further(thing):
            print_line(f"Try: {hint}", "dim")
    if plot is not None:
        save_picture(thing.plot(), plot)


def save_picture(figure: Any, path: Path) -> None:
    """Writes a picture, and says where it is."""
    from trdlab.show.plots.style import save

    save(figure, path)
    errors().print(f"Picture: {path}", soft_wrap=True, markup=False)


def command(words: Sequence[str | float], options: Mapping[str, str | float | None]) -> str:
    """Returns a command of trdlab as it is typed, with those of some options that were given.

    Args:
        words: what stands behind `trdlab`; a command made here may be the first of them.
        options: their values, None where they were not given.
    """
    from trdlab.formatting import plain

    told = [word for name, value in options.items() if value is not None for word in (name, value)]
    typed = [word if isinstance(word, str) else plain(word) for word in [*words, *told]]
    if typed[0].startswith("trdlab "):
        return f"{typed[0]} {shlex.join(typed[1:])}"
    return shlex.join(["trdlab", *typed])


def print_page(thing: Any, *, details: bool) -> None:
    """Prints a noun of trdlab as people read it; below all there is to tell, where words stand."""
    from trdlab.show.text import text

    print_text(text(thing, details=details))
    if details:
        print_line(_GUIDE, "dim")


def say(console: Console, text: str) -> None:
    """Prints a line as it is, to be copied whole."""
    console.print(text, soft_wrap=True, markup=False)


def print_line(line: str, style: str = "") -> None:
    """Prints a line, wrapped to the terminal."""
    from trdlab.show.text import columns, wrapped

    for part in wrapped(line, columns(), style):
        print_text(part)


def print_text(shown: "Text") -> None:
    """Prints a text as it is, in letters that the terminal has."""
    from trdlab.show.text import columns, plain_ascii

    console, ascii_only = new_console()
    console.width = columns()  # where a terminal says it has none, rich prints nothing
    console.print(plain_ascii(shown) if ascii_only else shown, soft_wrap=True)
