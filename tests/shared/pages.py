"""What the pages show: blocks of code, commands, and what is told to be printed."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs").rglob("*.md"))]

_FENCE = re.compile(
    r"^(?P<indent> *)```(?P<kind>[^\n`]+)\n(?P<body>.*?)^(?P=indent)```(?P<gap>\s*)", re.M | re.S
)
_NUMBER = re.compile(r"[-−]?\d[\d,]*(?:\.\d+)?|–")
_UNIT = re.compile(r"\b(seconds?|minutes?|hours?)\b")


@dataclass(frozen=True)
class Block:
    """A block of code: what stands behind its fence, its text, and whether the next one follows."""

    kind: str
    text: str
    is_followed: bool


@dataclass(frozen=True)
class Shown:
    """A command, what the page shows of its output, and how that is to be read.

    Of `measured` output the numbers depend on the machine, or on how long it ran; only its words
    are compared. What is `recorded` took so long that nobody repeats it.
    """

    command: str
    output: str = ""
    kind: str = ""


def blocks(page: Path) -> list[Block]:
    """Returns the blocks of a page, without the indentation of what they stand in."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _FENCE.finditer(text):
        lines = [line.removeprefix(match["indent"]) for line in match["body"].splitlines()]
        follows = text[match.end() :].startswith("```") and match["gap"].count("\n") <= 2
        found.append(Block(match["kind"].strip(), "\n".join(lines), follows))
    return found


def sources(page: Path, language: str) -> list[str]:
    """Returns the blocks of a language that are only shown, not run while the site is built."""
    return [block.text for block in blocks(page) if block.kind == language]


def commands(page: Path) -> list[Shown]:
    """Returns the commands of a page's consoles in their order, with what is shown of each."""
    found: list[Shown] = []
    is_open = False
    for block in blocks(page):
        if block.kind == "console":
            found += _of_console(block.text)
        elif is_open and ".output" in block.kind:
            kind = next((of for of in ("measured", "recorded") if f".{of}" in block.kind), "")
            found[-1] = Shown(found[-1].command, block.text, kind)
        is_open = block.kind == "console" and block.is_followed
    return found


def _of_console(text: str) -> Iterator[Shown]:
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        lines = part.splitlines()
        command = lines.pop(0)
        while command.endswith("\\"):
            command = command[:-1] + lines.pop(0)
        yield Shown(re.sub(r"\s+# .*", "", command).strip(), "\n".join(lines).strip("\n"))


def in_prose(page: Path) -> list[str]:
    """Returns the whole commands that stand in the sentences of a page."""
    text = _FENCE.sub("", page.read_text(encoding="utf-8"))
    return [words for words in re.findall(r"`(trdlab [a-z][^`]*)`", text) if "…" not in words]


def built(page: Path) -> list[str]:
    """Returns the commands that are run while the site is built."""
    lines = [
        line for of in blocks(page) if of.kind.startswith("bash") for line in of.text.splitlines()
    ]
    return [line.strip() for line in lines if line.strip().startswith("trdlab ")]


def words_of(command: str) -> list[str]:
    """Returns the words of the first command of a line of the shell."""
    lexer = shlex.shlex(re.split(r"\s+(?:2?>|\||&&)", command)[0], posix=True)
    lexer.whitespace_split, lexer.commenters = True, ""
    return list(lexer)


def matches(shown: Shown, printed: str) -> bool:
    """Returns whether this was printed; `…` stands for what is left out, in a line or of lines."""
    lines = [line.rstrip() for line in printed.splitlines()]
    if shown.kind == "recorded":
        return True
    if shown.kind == "measured":
        told = [line for line in shown.output.splitlines() if line != "…"]
        bare = [line for line in map(_bare, lines) if line]
        return all(
            any(_bare(of).startswith(line) or line.startswith(_bare(of)) for line in bare)
            for of in told
        )
    parts = re.split(r"^…$", shown.output, flags=re.MULTILINE)
    patterns = (re.escape(part.strip("\n")).replace("…", ".*") for part in parts)
    return all(re.search(pattern, "\n".join(lines)) for pattern in patterns)


def _bare(line: str) -> str:
    return " ".join(_UNIT.sub("time", _NUMBER.sub("#", line)).split())
