"""Whether the real application takes a command, without running it."""

from typing import Any

import typer

from pages import words_of
from trdlab.cli.app import new_app

USAGE_ERROR: Any = typer.BadParameter.__base__  # it has no public name in all versions


def refusal(command: str) -> str | None:
    """Returns why the real application does not take a command, without running it."""
    from typer.main import get_command

    words = words_of(command)[1:]
    group: Any = get_command(new_app(words))
    try:
        context = group.make_context("trdlab", words)
        while hasattr(group, "resolve_command"):
            rest = [*context._protected_args, *context.args]
            name, group, rest = group.resolve_command(context, rest)
            context = group.make_context(name, rest, parent=context)
    except typer.Exit:  # of --help and --version
        return None
    except USAGE_ERROR as error:
        return str(error)
    return None
