"""What MkDocs does beside turning Markdown into pages: lessons, commands, and the reference.

The lessons of `tutorials/` are run, each in a kernel of its own, and become pages; the commands
on the pages are run, and the lists of the reference filled in. Neither a lesson nor a command is
run again before its sources change: the results are kept in `.cache/docs/`. There, in `pages/`,
lies also what comes of it all: plain Markdown, from which another program can build the site.
Nothing else is written into the work tree.
"""

import json
import logging
import os
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from shutil import rmtree
from time import perf_counter
from typing import Any

from catalogue import expanded
from executed import BlockError, Run, executed, outputs
from kept import Files, fingerprint, made
from lesson import LessonError, lesson_page, lesson_run
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.livereload import LiveReloadServer
from mkdocs.structure import files as structure
from mkdocs.structure.pages import Page
from notebooks import lessons

from trdlab import playground

DOCS = Path(__file__).parent
_FROM_THE_NETWORK = re.compile(
    r'<(?:script|img|iframe)[^>]* src="https?:[^"]*|<link[^>]* href="https?:[^"]*'
)
_PLAIN = {"NO_COLOR": "1", "COLUMNS": "80", "MPLBACKEND": "agg"}
_ROOT_OF_A_SERVER = (
    "<script>if (location.protocol !== 'file:') document.write('<base href=\"/\">')</script>"
)
_SLOW = 2.0
"""Seconds after which it is told what took them."""

_log = logging.getLogger("mkdocs.hooks.trdlab")


def on_startup(**_: Any) -> None:
    """Lets pages run the `trdlab` of this environment, printing plain text of one width."""
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    os.environ |= _PLAIN


def on_files(files: structure.Files, config: MkDocsConfig) -> structure.Files:
    """Adds the playground and the lessons, and makes every page plain Markdown."""
    element = structure.File.generated(config, "assets/playground.js", content=playground.script())
    files.append(element)
    add_lessons(files, config)
    pages = files.documentation_pages()
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # the first that fails ends it
        for page, text in zip(pages, pool.map(lambda of: plain(of, config), pages), strict=True):
            page.content_string = text
    write_pages(files, _cache(config))
    return files


def add_lessons(files: structure.Files, config: MkDocsConfig) -> None:
    """Adds a page for each lesson, its pictures, and script and notebook to download."""
    scripts = lessons(_tutorials(config))
    for file in [*scripts, *(_tutorials(config) / "notebooks").glob("*.ipynb")]:
        uri = f"lessons/{file.name}"
        files.append(structure.File.generated(config, uri, abs_src_path=str(file)))
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # the first that fails ends it
        pages = list(pool.map(lambda script: lesson(script, _cache(config)), scripts))
    for script, made_of_it in zip(scripts, pages, strict=True):
        for name, content in made_of_it.items():
            uri = f"lessons/{script.stem}.md" if name == "page.md" else f"lessons/{name}"
            files.append(structure.File.generated(config, uri, content=content))


def plain(page: structure.File, config: MkDocsConfig) -> str:
    """Returns the Markdown of a page with its lists, and with what its commands print."""
    try:
        listed = expanded(page.content_string, _package().parent)
        return executed(listed, lambda run: kept_outputs(run, _cache(config)))
    except (LookupError, BlockError) as error:
        raise PluginError(f"{page.src_uri}: {error}") from error


def write_pages(files: structure.Files, cache: Path) -> None:
    """Writes all pages and what they show into `pages/`, and settings to build them with.

    Zensical, which succeeds MkDocs, reads the settings of MkDocs, but runs no hooks.
    """
    folder = cache / "pages"
    rmtree(folder, ignore_errors=True)
    for file in files:
        if file.inclusion.is_included():
            path = folder / file.src_uri
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(file.content_bytes)


def on_post_page(output: str, page: Page, **_: Any) -> str:
    """Refuses a page that would load something from the network."""
    if found := _FROM_THE_NETWORK.search(output):
        raise PluginError(f"{page.file.src_uri} loads from the network: {found[0]}")
    return output


def on_post_template(output_content: str, template_name: str, **_: Any) -> str:
    """Lets the page for missing pages find its files on disk, too, where there is no root."""
    if template_name != "404.html":
        return output_content
    relative = re.sub(r'((?:href=|src=|"base": |"search": )")/', r"\1", output_content)
    return relative.replace("<head>", f"<head>{_ROOT_OF_A_SERVER}", 1)


def on_serve(server: LiveReloadServer, config: MkDocsConfig, **_: Any) -> None:
    """Rebuilds when a lesson changes."""
    server.watch(str(_tutorials(config)))


def lesson(script: Path, cache: Path) -> Files:
    """Returns the page and the pictures of a lesson, run if it has to be.

    Raises:
        PluginError: a cell of it raises; the message names the script and the line.
    """
    try:
        return lesson_page(script, lesson_run(script, cache))
    except LessonError as error:
        raise PluginError(str(error)) from error


def kept_outputs(run: Run, cache: Path) -> list[str]:
    """Returns what blocks of a page print, run if they have to be.

    Raises:
        BlockError: one of them fails.
    """
    folder = Path(run.workdir).absolute()  # its files, such as a map, count among the sources
    own = [folder] if folder.is_relative_to(DOCS) else []

    def make() -> Files:
        begun = perf_counter()
        printed = outputs(run)
        if (seconds := perf_counter() - begun) > _SLOW:
            _log.info("Block %s: %.0f s", run.codes[-1].strip().splitlines()[-1], seconds)
        return {"outputs.json": json.dumps(printed).encode()}

    thing = f"block-{sha256(repr(run).encode()).hexdigest()[:16]}"
    files = made(cache, thing, lambda: fingerprint(repr(run), *own, str(_PLAIN), _package()), make)
    printed: list[str] = json.loads(files["outputs.json"])
    return printed


def _package() -> Path:
    """Returns the folder of the package that the pages are about, wherever it was found."""
    spec = find_spec("trdlab")
    [folder] = (spec and spec.submodule_search_locations) or [""]
    return Path(folder)


def _cache(config: MkDocsConfig) -> Path:
    return Path(config.config_file_path).parent / ".cache" / "docs"


def _tutorials(config: MkDocsConfig) -> Path:
    return Path(config.config_file_path).parent / "tutorials"
