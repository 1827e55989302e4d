"""`trdlab study`: a blind reading of explanations, to be run with a class."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from trdlab.cli import common

study = typer.Typer(help="Let readers find out which agent a text is about.", no_args_is_help=True)


@study.command()
def make(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the kit goes.")],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the trials.")] = 0,
    trials: Annotated[
        int, typer.Option("--trials", help="How many: a multiple of three, up to 30.")
    ] = 12,
    verbose: common.Verbose = False,
) -> None:
    """Make a kit: a page to answer in, the same questions to print, and the answers.

    Three agents act on one map, and are rewarded for different things. Each trial shows what is
    printed about one of them, without the map and without names: which one is it?
    """
    from trdlab.study.kit import kit_paths, write_kit
    from trdlab.study.trials import draw_trials

    kit_paths(out)  # fails before what takes long
    drawn = draw_trials(seed, trials)
    errors = Console(stderr=True, highlight=False)
    for path in write_kit(out, drawn, seed):
        errors.print(f"Written: {path}", soft_wrap=True, markup=False)


@study.command()
def score(
    answers: Annotated[
        Path, typer.Argument(metavar="ANSWERS", help="The answers.json of the kit.")
    ],
    given: Annotated[
        Path | None,
        typer.Argument(
            metavar="GIVEN",
            help='What readers answered, in a JSON file: {"Ada": "ABC...", "Ben": "AB-..."}.',
        ),
    ] = None,
    letters: Annotated[
        list[str] | None,
        typer.Option("--answers", metavar="LETTERS", help="Of one more reader, such as ABC-BA."),
    ] = None,
    as_json: common.AsJson = False,
    verbose: common.Verbose = False,
) -> None:
    """Score what readers answered, each and all together, against guessing."""
    from trdlab.study import scoring

    readers = {} if given is None else scoring.read_given(given)
    scores = scoring.score(
        scoring.read_answers(answers), readers | scoring.unnamed(letters or (), readers)
    )
    if as_json:
        common.print_json(scoring.to_dict(scores))
    else:
        console, ascii_only = common.new_console()
        console.print(scoring.page(scores, ascii_only=ascii_only))
