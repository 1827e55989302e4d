"""`trdlab study`: tests of explanations by readers, to be run with a class."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from trdlab.cli import common

study = typer.Typer(help="Let readers find out whom an explanation is about.", no_args_is_help=True)


@study.command()
def make(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the kit goes.")],
    kind: Annotated[
        Literal["text", "goals"],
        typer.Option("--kind", help="What is asked: whose text it is, or which goal an agent has."),
    ] = "text",
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the trials.")] = 0,
    trials: Annotated[
        int | None,
        typer.Option(
            "--trials",
            help="How many: a multiple of three, up to 30; of goals a multiple of four, up to 16.",
            show_default="12, of goals 4",
        ),
    ] = None,
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agents",
            metavar="GOAL=AGENT",
            help="Of goals, four times: agents of your own, each after its goal in words, such as "
            '"spares its lives=runs/careful".',
            show_default="the game of the kit",
        ),
    ] = None,
    max_steps: Annotated[int | None, common.max_steps_option("1000, or four horizons")] = None,
    modules: common.Import = None,
    verbose: common.Verbose = False,
) -> None:
    """Make a kit: pages to answer in, the same questions as files, and the answers.

    With the kind `text`, three agents differ in when reward comes to them, and in what they risk
    for it. Each trial shows what is printed about one of them, without names: which one is it? A
    second page asks a control group, which sees the Q-values alone.

    With `goals`, four agents play one game for different rewards. Each trial shows the report of
    one of them: which goal does it have? Other pages show bars, saliency or clips alone.
    """
    from trdlab.errors import InputError

    if kind == "text" and agents:
        raise InputError("The readers of a text get no agents of yours.", "Add --kind goals.")
    errors = common.errors()
    if kind == "text":
        paths = _text_kit(out, seed, 12 if trials is None else trials)
    else:
        paths = _goal_kit(out, seed, trials, agents, max_steps)
    for path in paths:
        errors.print(f"Written: {path}", soft_wrap=True, markup=False)


def _text_kit(out: Path, seed: int, trials: int) -> tuple[Path, ...]:
    from trdlab.study.kit import kit_paths, write_kit
    from trdlab.study.trials import draw_trials

    kit_paths(out)  # fails before what takes long
    return write_kit(out, draw_trials(seed, trials), seed)


def _goal_kit(
    out: Path, seed: int, trials: int | None, agents: list[str] | None, max_steps: int | None
) -> tuple[Path, ...]:
    from trdlab.errors import InputError
    from trdlab.study.goals.kit import kit_of, kit_paths, own_kit, write_kit

    kit_paths(out)
    if not agents:
        return write_kit(out, own_kit(seed, 4 if trials is None else trials))
    if trials is not None:
        raise InputError("Of four agents there are four trials.", "Leave out --trials.")
    return write_kit(out, kit_of(agents, seed, max_steps))


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
            'several groups: {"text": {"Ada": "ABC..."}, "q": {"Cleo": "BCA..."}}.',
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
        str | None,
        typer.Option(
            "--group",
            help="Score one group: text or q; of goals report, bars, saliency or clips. Answers "
            "whose group is not said are its own.",
            show_default="all; answers are of readers of the text, or of the report",
        ),
    ] = None,
    as_json: common.AsJson = False,
    verbose: common.Verbose = False,
) -> None:
    """Score what readers answered, each and all together, against guessing and the other groups."""
    from trdlab.show.text import columns
    from trdlab.study import report, scoring

    key = scoring.read_key(answers)
    if group is not None:
        scoring.check_group(group, key.design.groups)
    readers = {} if given is None else scoring.read_given(given, group, key.design)
    for of, more in ((group or key.design.tested, letters), ("q", control)):
        named = readers.get(of, {})
        if more and group in (None, of):
            readers[of] = {**named, **scoring.unnamed(more, named)}
    scores = scoring.score(key, readers)
    if as_json:
        common.print_json(report.to_dict(scores))
    else:
        console, ascii_only = common.new_console()
        console.print(report.page(scores, width=columns(), ascii_only=ascii_only))
