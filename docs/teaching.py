"""Makes what a lecturer takes along: slides, figures to copy, and a sheet of exercises.

A hook of MkDocs, beside `hooks.py`. `teach/slides.md` is a page like any other; its parts between
rulers become the slides of `teach/deck.html`, one file that needs nothing else. `FIGURES` are drawn
by trdlab's own commands, and packed with their licence. Exercises are read from the lessons, and
their solutions from `trdlab.teach`.
"""

import io
import re
import subprocess
import zipfile
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from html import escape
from mimetypes import guess_type
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml
from kept import Files, fingerprint, made
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure import files as structure
from mkdocs.structure.pages import Page

import trdlab

DOCS = Path(__file__).parent
DECK, SLIDES, ARCHIVE = "teach/deck.html", "teach/slides.md", "teach/figures.zip"
_DRAW = "python -c 'import trdlab; "
_BARS = (
    _DRAW + 'p = trdlab.explain("gridworld:{0}", parts="contrast", episodes=0).plot(); '
    'p.set_size_inches(9, 5); p.savefig("{0}-bars.svg")\''
)
FIGURES = {
    "drone": (
        "The paper's example: up pays 4 late, down pays 1 four times.",
        "trdlab gridworld --map drone --N 4 --plot drone.svg",
    ),
    "drone-pairs": (
        "The same in groups of two steps.",
        "trdlab gridworld --map drone --N 2 --w 2 --plot drone-pairs.svg",
    ),
    "drone-map": (
        "The map alone.",
        _DRAW + "from trdlab.show.plots.figures import figure; "
        'figure(trdlab.agent("gridworld:drone").world).savefig("drone-map.svg")\'',
    ),
    "drone-bars": ("The vectors alone, wide enough for a slide.", _BARS.format("drone")),
    "ledge": (
        "A world with chance: whiskers show how far single episodes differ from the average.",
        "trdlab gridworld --map ledge --N 4 --plot ledge.svg",
    ),
    "ledge-bars": ("Its vectors alone.", _BARS.format("ledge")),
    "bridge": (
        "The long way round, or the short one over the abyss.",
        "trdlab gridworld --map bridge --N 8 --plot bridge.svg",
    ),
    "tie-bars": (
        "Two actions of the same worth that pay at different times.",
        _BARS.format("tie"),
    ),
    "trust": (
        "A calibration: the skill at each step, and that of a perfect forecast (dashed).",
        _DRAW + 'trdlab.calibrate("gridworld:ledge").plot().savefig("trust.svg")\'',
    ),
}
"""What each figure shows, and the command that draws it."""
SHEET = {
    "Read a reward vector": ("1.1", "1.2", "1.3"),
    "Derive it": ("2.1", "2.2"),
    "Learn it": ("3.1", "3.3", "4.1", "4.2"),
    "Trust it": ("6.1", "6.2", "7.4"),
}
"""The exercises on the sheet: those of the lessons that need nothing but paper."""

_EXERCISE = re.compile(r"^# \*\*Exercise (\S+)\.\*\* (.*(?:\n#(?! >).*)*)", re.MULTILINE)
_RULER = re.compile(r"<hr\s*/?>")
_PRINTED = re.compile(r"<pre>(.*?)</pre>", re.DOTALL)
_LINK = re.compile(r'<a class="headerlink".*?</a>', re.DOTALL)
_SOURCE = re.compile(r'src="(?:\.\./)*([^":]+)"')
_CREDIT = """\
These figures are by the trdlab developers. They may be used under the Creative Commons Attribution
4.0 International licence (CC BY 4.0), whose text is in LICENSE.txt. Name the source, for example:
"Figure: trdlab developers, CC BY 4.0", and say if you changed it.

Each was drawn by the command beside it:

"""


# ---- what MkDocs calls ---------------------------------------------------------------------------


def on_files(files: structure.Files, config: MkDocsConfig) -> structure.Files:
    """Adds the figures, one by one and packed, and a place for the deck."""
    for name, content in figures(_cache(config)).items():
        files.append(structure.File.generated(config, f"teach/{name}", content=content))
    files.append(structure.File.generated(config, DECK, content=b""))
    return files


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Writes the deck when its slides have become HTML."""
    if page.file.src_uri == SLIDES:
        heading = next(iter(page.toc)).title
        text = deck(heading, str(page.content), figures(_cache(config)))
        Path(config.site_dir, DECK).write_text(text, encoding="utf-8")
    return output


def _cache(config: MkDocsConfig) -> Path:
    return Path(config.config_file_path).parent / ".cache" / "docs"


# ---- figures -------------------------------------------------------------------------------------


def figures(cache: Path) -> Files:
    """Returns the figures and the archive of all, by their names, drawn if they have to be."""
    licence, package = DOCS / "teach" / "CC-BY-4.0.txt", Path(trdlab.__file__).parent

    def hashed() -> str:
        return fingerprint(DOCS / "teaching.py", licence, package)

    return made(cache, "figures", hashed, lambda: drawn(licence.read_bytes()))


def drawn(licence: bytes) -> Files:
    """Draws the figures, each by its command.

    Raises:
        PluginError: a command fails.
    """
    with TemporaryDirectory() as folder:
        for name, (_, command) in FIGURES.items():
            done = subprocess.run(
                ["bash", "-c", command], cwd=folder, capture_output=True, text=True, check=False
            )
            if done.returncode:
                raise PluginError(f"The figure {name} could not be drawn: {done.stderr.strip()}")
        found = {f"{name}.svg": Path(folder, f"{name}.svg").read_bytes() for name in FIGURES}
    about = _CREDIT + "".join(f"{name}.svg: {command}\n" for name, (_, command) in FIGURES.items())
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as file:
        texts = {"LICENSE.txt": licence, "README.txt": about.encode()}
        for name, content in (texts | found).items():
            entry = zipfile.ZipInfo(f"trdlab-figures/{name}")  # of no date: the same each time
            file.writestr(entry, content, zipfile.ZIP_DEFLATED)
    pictures = {f"figures/{name}": content for name, content in found.items()}
    return pictures | {Path(ARCHIVE).name: packed.getvalue()}


def gallery() -> str:
    """Returns the Markdown that shows all figures, each with its command and its file."""
    return "\n".join(
        f"## {name}\n\n{about} [{name}.svg](figures/{name}.svg){{ download }}\n\n"
        f"![{about}](figures/{name}.svg){{ .figure }}\n\n```console\n$ {command}\n```\n"
        for name, (about, command) in FIGURES.items()
    )


# ---- slides --------------------------------------------------------------------------------------


def deck(title: str, content: str, pictures: Files) -> str:
    """Returns a page of slides that stands alone.

    Args:
        title: of all.
        content: the HTML of the slides, with a ruler between two of them.
        pictures: the figures that they show, beside files of the documentation.

    Raises:
        PluginError: they show a picture that is not there.
    """

    def inlined(found: re.Match[str]) -> str:
        path = found[1]
        if path not in pictures and not (DOCS / path).is_file():
            raise PluginError(f"A slide shows {path}, which is not there.")
        data = pictures.get(path) or (DOCS / path).read_bytes()
        kind = guess_type(path)[0]
        return f'src="data:{kind};base64,{b64encode(data).decode()}"'

    def sized(found: re.Match[str]) -> str:
        is_short = found[1].count("\n") < 10
        return f'<pre class="short">{found[1]}</pre>' if is_short else found[0]

    content = _PRINTED.sub(sized, _SOURCE.sub(inlined, _LINK.sub("", content)))
    parts = _RULER.split(content)
    slides = "\n".join(f"<section>{part.strip()}</section>" for part in parts if part.strip())
    template = (DOCS / "deck.html").read_text(encoding="utf-8")
    return template.replace("{{ title }}", escape(title)).replace("{{ slides }}", slides)


# ---- exercises -----------------------------------------------------------------------------------


def exercises() -> str:
    """Returns the Markdown of the sheet, with room for answers."""
    asked = dict(questions())
    return _by_heading(lambda name: f"{asked[name]}\n\n<p class='answer'></p>")


def solutions() -> str:
    """Returns the Markdown of how to find each answer, and what wrong ones usually mean."""
    from trdlab.teach.checking import EXERCISES

    def solved(name: str) -> str:
        mistakes = (f"- Not {_number(no)}: {said}" for no, said in EXERCISES[name].mistakes)
        return "\n".join([EXERCISES[name].solution, "", *mistakes])

    return _by_heading(solved)


def _by_heading(text: Callable[[str], str]) -> str:
    return "\n".join(
        f"## {heading}\n\n" + "\n".join(f"**{name}.** {text(name)}\n" for name in names)
        for heading, names in SHEET.items()
    )


def questions(tutorials: Path = DOCS.parent / "tutorials") -> Iterator[tuple[str, str]]:
    """Yields the name and the question of each exercise of the lessons."""
    for script in sorted(tutorials.glob("[0-9]*.py")):
        for found in _EXERCISE.finditer(script.read_text(encoding="utf-8")):
            lines = [line.removeprefix("#").removeprefix(" ") for line in found[2].splitlines()]
            yield found[1], "\n".join(lines).rstrip().replace("](", "](../lessons/")


def bibliography() -> str:
    """Returns BibTeX of the paper and of trdlab, from `CITATION.cff`."""
    own = yaml.safe_load((DOCS.parent / "CITATION.cff").read_text(encoding="utf-8"))
    paper = own["preferred-citation"]
    fields = {
        "inproceedings{towers2024explaining": {
            "title": paper["title"],
            "author": _authors(paper),
            "booktitle": paper["collection-title"],
            "year": paper["year"],
            "url": paper["url"],
        },
        "software{trdlab": {
            "title": own["title"],
            "author": f"{{{_authors(own)}}}",
            "version": own["version"],
            "license": own["license"],
        },
    }
    entries = [
        f"@{kind},\n" + "".join(f"  {name} = {{{value}}},\n" for name, value in of.items()) + "}"
        for kind, of in fields.items()
    ]
    return "\n\n".join(["```bibtex", *entries, "```"]).replace("```bibtex\n\n", "```bibtex\n")


def _authors(work: dict[str, Any]) -> str:
    people = work["authors"]
    return " and ".join(
        one.get("name") or f"{one['family-names']}, {one['given-names']}" for one in people
    )


def _number(answer: Any) -> str:
    """Returns an answer as a student would write it."""
    if isinstance(answer, Sequence):
        return f"[{', '.join(map(_number, answer))}]"
    return f"{answer:.4g}"
