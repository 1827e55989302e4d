"""Runs the commands and the Python of a page, and puts what they print in their place.

A code block runs if its first line says `exec="on"`, such as

    ```bash exec="on" source="above" result="{.text .output}"

- `source="above"`: the code itself is shown, above what it prints;
- `result="…"`: what it prints is shown as it is, in a code block with these classes;
- `html="on"`: what it prints is HTML; without this and `result`, it is Markdown;
- `session="…"`: blocks of Python on one page that share their names;
- `workdir="…"`: the folder in which it runs, from the root of the source.

A line of it that ends with `# hide` is run and not shown.

So a page becomes plain Markdown that anything can build. Each block is run in a process of its
own, with the rest of its session.
"""

import json
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from textwrap import dedent, indent

_BLOCK = re.compile(
    r'^(?P<margin> *)(?P<fence>`{3,})(?P<language>\w+) +(?P<options>[^\n]*\bexec="on"[^\n]*)\n'
    r"(?P<code>.*?)^(?P=margin)(?P=fence) *$",
    re.MULTILINE | re.DOTALL,
)
_HIDDEN = re.compile(r"^.*#[^\n]*\bhide\n", re.MULTILINE)
_OPTION = re.compile(r'(\w+)="([^"]*)"')
_OPTIONS = {"exec", "source", "result", "html", "session", "workdir"}
_LANGUAGES = {"bash", "python"}


@dataclass(frozen=True)
class Run:
    """What runs in one process: a command, or the Python blocks of one session in their order."""

    language: str
    codes: tuple[str, ...]
    workdir: str = "."


class BlockError(Exception):
    """A block cannot be read, or fails; the message says why."""


def executed(markdown: str, run: Callable[[Run], list[str]]) -> str:
    """Returns a page with what its blocks print.

    Args:
        markdown: the page.
        run: runs blocks, and returns what each of them prints.

    Raises:
        BlockError: an option or a language is unknown, or a block fails.
    """
    blocks = [(found, _options(found)) for found in _BLOCK.finditer(markdown)]
    printed: dict[int, str] = {}
    for first, (found, options) in enumerate(blocks):
        if first not in printed:
            together = [
                at
                for at, (other, told) in enumerate(blocks)
                if at == first or told.get("session", at) == options.get("session")
            ]
            codes = tuple(dedent(blocks[at][0]["code"]) for at in together)
            made = run(Run(found["language"], codes, options.get("workdir", ".")))
            printed |= zip(together, made, strict=True)
    texts = iter([_shown(*block, printed[at]) for at, block in enumerate(blocks)])
    return _BLOCK.sub(lambda _: next(texts), markdown)


def outputs(run: Run) -> list[str]:
    """Runs blocks, and returns what each of them prints; of commands, also to stderr.

    Raises:
        BlockError: a block fails; the message is all that it said.
    """
    if run.language == "bash":
        command, given, errors = ["bash", "-c", *run.codes], None, subprocess.STDOUT
    else:
        command, given = [sys.executable, "-P", __file__], json.dumps(run.codes)
        errors = subprocess.PIPE
    done = subprocess.run(
        command,
        input=given,
        stdout=subprocess.PIPE,
        stderr=errors,
        text=True,
        cwd=run.workdir,
        check=False,
    )
    if done.returncode:
        said = f"{done.stdout}{done.stderr or ''}"
        raise BlockError(f"exit code {done.returncode} of\n{run.codes[-1]}\n{said}")
    return [done.stdout] if run.language == "bash" else json.loads(done.stdout)


def _options(found: re.Match[str]) -> Mapping[str, str]:
    options = dict(_OPTION.findall(found["options"]))
    if strange := sorted(options.keys() - _OPTIONS):
        raise BlockError(f"no such option: {', '.join(strange)}, in {found['options']}")
    if found["language"] not in _LANGUAGES:
        raise BlockError(f"only {' and '.join(sorted(_LANGUAGES))} are run: {found['options']}")
    if found["margin"] and "html" in options:
        raise BlockError(f"HTML cannot be indented: {found['options']}")
    return options


def _shown(found: re.Match[str], options: Mapping[str, str], printed: str) -> str:
    """Returns the Markdown in place of a block."""
    code = _HIDDEN.sub("", dedent(found["code"]))
    parts = [_fenced(found["language"], code)] if "source" in options else []
    if printed.strip():
        if "result" in options:
            printed = _fenced(options["result"], printed)
        elif "html" in options:  # the only kind of HTML that Markdown surely leaves alone
            printed = f'<div class="made">\n{printed.strip()}\n</div>'
        parts.append(printed.rstrip())
    return indent("\n\n".join(parts), found["margin"])


def _fenced(kind: str, text: str) -> str:
    longest = max(map(len, re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}{kind}\n{text.rstrip()}\n{fence}"


def _main() -> None:
    """Runs the Python blocks of a session, given as a JSON list, and prints a list of outputs."""
    names: dict[str, object] = {"__name__": "__main__"}
    printed = []
    for code in json.load(sys.stdin):
        with redirect_stdout(StringIO()) as text:
            exec(compile(code, "<block>", "exec"), names)
        printed.append(text.getvalue())
    json.dump(printed, sys.stdout)


if __name__ == "__main__":
    _main()
