"""What MkDocs does beside turning Markdown into pages: lessons, commands, and the reference.

The lessons of `tutorials/` are run, each in a process of its own, and become pages; so do the
commands on the pages. Neither is run again before its sources change: the results are kept in
`.cache/docs/`. Nothing else is written into the work tree.
"""

import logging
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import markdown_exec
from catalogue import expanded
from kept import Files, fingerprint, made
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.livereload import LiveReloadServer
from mkdocs.structure import files as structure
from mkdocs.structure.pages import Page

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


def on_config(config: MkDocsConfig) -> None:
    """Takes the place of the plugin that runs commands, and keeps what they print."""
    cache = _cache(config)

    def run(code: str, returncode: int = 0, **_: Any) -> str:
        return command_output(code, returncode, cache)

    def bash(**options: Any) -> str:
        return markdown_exec.base_format(language="bash", run=run, **options)

    markdown_exec.formatters["bash"] = bash


def on_files(files: structure.Files, config: MkDocsConfig) -> structure.Files:
    """Adds the playground, a page for each lesson, its pictures, and the scripts to download."""
    element = structure.File.generated(config, "assets/playground.js", content=playground.script())
    files.append(element)
    scripts = sorted(_tutorials(config).glob("*.py"))
    lessons = [script for script in scripts if script.name[0].isdigit()]
    for script in scripts:
        uri = f"lessons/{script.name}"
        files.append(structure.File.generated(config, uri, abs_src_path=str(script)))
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # the first that fails ends it
        pages = list(pool.map(lambda script: lesson(script, _cache(config)), lessons))
    for script, made_of_it in zip(lessons, pages, strict=True):
        for name, content in made_of_it.items():
            uri = f"lessons/{script.stem}.md" if name == "page.md" else f"lessons/{name}"
            files.append(structure.File.generated(config, uri, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Fills in the lists of a page, and notes when the work on it begins."""
    page.meta["begun"] = perf_counter()
    try:
        return expanded(markdown, _package().parent)
    except LookupError as error:
        raise PluginError(f"{page.file.src_uri}: {error}") from error


def on_page_content(html: str, page: Page, **_: Any) -> None:
    """Tells of a page that took long."""
    if (seconds := perf_counter() - page.meta["begun"]) > _SLOW:
        _log.info("Page %s: %.0f s", page.file.src_uri, seconds)


def on_post_page(output: str, page: Page, **_: Any) -> str:
    """Refuses a page that would load something from the network."""
    if found := _FROM_THE_NETWORK.search(output):
        raise PluginError(f"{page.file.src_uri} loads from the network: {found[0]}")
    return output


def on_post_template(output_content: str, template_name: str, **_: Any) -> str:
    """Lets the page for missing pages find its files on disk, too, where there is no root."""
    if template_name != "404.html":
        return output_content
    relative = re.sub(r'((?:href=|src=|"base": )")/', r"\1", output_content)
    return relative.replace("<head>", f"<head>{_ROOT_OF_A_SERVER}", 1)


def on_serve(server: LiveReloadServer, config: MkDocsConfig, **_: Any) -> None:
    """Rebuilds when a lesson changes."""
    server.watch(str(_tutorials(config)))


def lesson(script: Path, cache: Path) -> Files:
    """Returns the page and the pictures of a lesson, run if it has to be.

    Raises:
        PluginError: a cell of it raises; the message names the script and the line.
    """

    def hashed() -> str:
        return fingerprint(
            script, script.parent / "exercise.py", DOCS / "lesson.py", str(_PLAIN), _package()
        )

    def make() -> Files:
        _log.info("Lesson %s: running", script.stem)
        begun = perf_counter()
        files = run_lesson(script)
        _log.info("Lesson %s: done in %.0f s", script.stem, perf_counter() - begun)
        return files

    return made(cache, script.stem, hashed, make)


def run_lesson(script: Path) -> Files:
    """Runs a lesson in a process of its own and returns its page and its pictures."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-P", str(DOCS / "lesson.py"), str(script), folder]
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # lessons share the cores
        done = subprocess.run(
            command, env=os.environ | threads, capture_output=True, text=True, check=False
        )
        if done.returncode:
            said = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
            raise PluginError(said if script.name in said else f"{script.name}: {said}")
        return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}


def command_output(code: str, returncode: int, cache: Path) -> str:
    """Returns what a command of a page prints, run if it has to be.

    Raises:
        ExecutionError: it ends with another code than the one that is expected.
    """
    folder = Path.cwd()  # of the block; its files, such as a map, count among the sources
    own = [folder] if folder.is_relative_to(DOCS) else []

    def make() -> Files:
        begun = perf_counter()
        done = subprocess.run(
            ["bash", "-c", code],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        if done.returncode != returncode:
            said = markdown_exec.code_block("sh", done.stdout)
            raise markdown_exec.ExecutionError(said, done.returncode)
        if (seconds := perf_counter() - begun) > _SLOW:
            _log.info("Command %s: %.0f s", code.strip().splitlines()[-1], seconds)
        return {"output.txt": done.stdout.encode()}

    thing = f"command-{sha256(f'{folder} {code}'.encode()).hexdigest()[:16]}"
    files = made(cache, thing, lambda: fingerprint(code, *own, str(_PLAIN), _package()), make)
    return files["output.txt"].decode()


def _package() -> Path:
    """Returns the folder of the package that the pages are about, wherever it was found."""
    spec = find_spec("trdlab")
    [folder] = (spec and spec.submodule_search_locations) or [""]
    return Path(folder)


def _cache(config: MkDocsConfig) -> Path:
    return Path(config.config_file_path).parent / ".cache" / "docs"


def _tutorials(config: MkDocsConfig) -> Path:
    return Path(config.config_file_path).parent / "tutorials"
