"""`trdlab study`: a blind reading of explanations, to be run with a class."""

from pathlib import Path
from typing import Annotated, Literal

import typer

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
    """Make a kit: pages to answer in, the same questions to print, and the answers.

    Three agents differ in when reward comes to them, and in what they risk for it. Each trial shows
    what is printed about one of them, without names: which one is it? A second page asks a control
    group, which sees the Q-values alone.
    """
    from trdlab.study.kit import kit_paths, write_kit
    from trdlab.study.trials import draw_trials

    kit_paths(out)  # fails before what takes long
    drawn = draw_trials(seed, trials)
    errors = common.errors()
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
            help='What readers answered, in a JSON file: {"Ada": "ABC...", "Ben": "AB-..."}, or '
            'both groups: {"text": {"Ada": "ABC..."}, "q": {"Cleo": "BCA..."}}.',
        ),
    ] = None,
    letters: Annotated[
        list[str] | None,
        typer.Option("--answers", metavar="LETTERS", help="Of one more reader, such as ABC-BA."),
    ] = None,
    control: Annotated[
        list[str] | None,
        typer.Option("--q-answers", metavar="LETTERS", help="Of one more reader of Q alone."),
    ] = None,
    group: Annotated[
        Literal["text", "q"] | None,
        typer.Option(
            "--group",
            help="Score one group: readers of the text, or of Q alone. Answers whose group is not "
            "said are its own.",
            show_default="both; answers are of readers of the text",
        ),
    ] = None,
    as_json: common.AsJson = False,
    verbose: common.Verbose = False,
) -> None:
    """Score what readers answered, each and all together, against guessing and the other group."""
    from trdlab.show.text import columns
    from trdlab.study import report, scoring

    readers = {} if given is None else scoring.read_given(given, group)
    for of, more in ((group or "text", letters), ("q", control)):
        named = readers.get(of, {})
        if more and group in (None, of):
            readers[of] = {**named, **scoring.unnamed(more, named)}
    scores = scoring.score(scoring.read_key(answers), readers)
    if as_json:
        common.print_json(report.to_dict(scores))
    else:
        console, ascii_only = common.new_console()
        console.print(report.page(scores, width=columns(), ascii_only=ascii_only))
