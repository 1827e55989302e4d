"""The command line as pages show it."""

import shlex
from typing import Any


def parse(command: str) -> None:
    """Parses a command such as `trdlab explain gridworld:ledge`, and raises if it is none."""
    from typer.main import get_command

    from trdlab.cli.app import new_app

    words = shlex.split(command, comments=True)[1:]
    group: Any = get_command(new_app(words))
    context = group.make_context("trdlab", words)
    while hasattr(group, "resolve_command"):
        rest = [*context._protected_args, *context.args]
        name, group, rest = group.resolve_command(context, rest)
        context = group.make_context(name, rest, parent=context)  # raises for an unknown option
