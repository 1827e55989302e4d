"""The command line: parse, call, print."""

import os
import re
import sys
from collections.abc import Sequence
from typing import Any

from trdlab.errors import NotImported, TrdlabError

_OPTIONS = {
    "horizon": "--N",
    "width": "--w",
    "parts": "--what",
    "components": "--component",
    "env_arguments": "--env-arg",
}
"""Of arguments that are called otherwise on the command line."""
_HEAVY = {"torch": "PyTorch", "ale_py": "ale-py"}
"""What a light installation leaves out (light.txt), by the name of the import."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs `trdlab`; exits with 0, with 2 for wrong usage or input, or with 1 for a failure."""
    import typer

    from trdlab.cli.app import new_app

    if arguments is None:  # pictures need no backend of the user's, which may be that of a notebook
        os.environ["MPLBACKEND"] = "agg"
    words = sys.argv[1:] if arguments is None else list(arguments)
    usage_error: Any = typer.BadParameter.__base__  # it has no public name in all versions
    try:
        code = new_app(words)(words, prog_name="trdlab", standalone_mode=False)
    except TrdlabError as error:
        if {"-v", "--verbose"} & set(words):
            raise
        cure = error.cure
        if isinstance(error, NotImported):
            cure = f"If you trust it, add: --import {error.module}"
        _fail(as_options(f"{error.cause} {cure}".strip()), error.exit_code)
    except ModuleNotFoundError as error:
        package = _HEAVY.get(error.name or "")
        if package is None or {"-v", "--verbose"} & set(words):
            raise
        cause = f"This needs {package}, which a light installation leaves out."
        _fail(f"{cause} Run: pip install trdlab", 1)
    except usage_error as error:
        if not error.format_message():  # no command was given, and the help has been printed
            sys.exit(2)
        path = error.ctx.command_path if error.ctx else "trdlab"
        _fail(f"{error.format_message()} See: {path} --help", 2)
    except (typer.Abort, KeyboardInterrupt):
        _fail("Interrupted.", 130)
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
        sys.stderr.close()
        sys.exit(0)
    except OSError as error:  # such as a disk that is full, where stdout goes
        if {"-v", "--verbose"} & set(words):
            raise
        _fail(f"The output cannot be written: {error.strerror or error}.", 1)
    else:
        sys.exit(code or 0)


def as_options(message: str) -> str:
    """Returns a message of the library as the command line says it: with options for arguments.

    >>> as_options("Ask for `episodes=50`, or leave out `horizon` and `max_steps`.")
    'Ask for --episodes 50, or leave out --N and --max-steps.'
    """

    def option(found: re.Match[str]) -> str:
        name, value = found[1], found[2]
        flag = _OPTIONS.get(name, "--" + name.replace("_", "-"))
        return flag if value in (None, "True") else f"{flag} {value}"

    return re.sub(r"`([A-Za-z_]+)(?:=([^`]*))?`", option, message)


def _fail(message: str, code: int) -> None:
    line = " ".join(message.split())
    encoding = getattr(sys.stderr, "encoding", None) or "ascii"
    print("error:", line.encode(encoding, "backslashreplace").decode(encoding), file=sys.stderr)
    sys.exit(code)
