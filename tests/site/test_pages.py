"""The pages of the site, as `make docs` has built them, opened from disk in a browser."""

from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

from browser import chromium

pytestmark = pytest.mark.site

SITE = Path(__file__).parents[2] / "site"
LONGEST = 15_000
"""How many pixels a page of the reference may be long."""

_MEASURED = """() => ({
    unreadable: document.querySelectorAll(".katex-error").length,
    bare: [...document.querySelectorAll(".arithmatex")].filter(of => !of.querySelector(".katex"))
        .length,
    broken: [...document.images].filter(of => of.complete && !of.naturalWidth).map(of => of.src),
    wider: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    height: document.documentElement.scrollHeight,
})"""


@pytest.fixture(scope="module")
def pages() -> list[Path]:
    if not (SITE / "index.html").exists():
        pytest.skip("There is no site yet: `make docs` builds it.")
    return sorted(SITE.rglob("*.html"))


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_every_page_reads_well_without_a_network(
    pages: list[Path], width: int, scheme: Any
) -> None:
    with chromium() as browser:
        faults = [
            f"{path.relative_to(SITE)}: {fault}"
            for path, fault in _visited(browser, pages, width, scheme)
        ]
    assert faults == []


def _visited(
    browser: Any, pages: list[Path], width: int, scheme: str
) -> Iterator[tuple[Path, str]]:
    """Yields what is wrong with pages in a window of some width."""
    context = browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True
    )
    page = context.new_page()
    page.set_default_timeout(120_000)
    said: list[str] = []
    page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: said.append(f"error: {error}"))
    page.on("request", lambda request: said.extend(_from_elsewhere(request.url)))
    for path in pages:
        said.clear()
        page.goto(path.as_uri())
        found = page.evaluate(_MEASURED)
        yield from ((path, fault) for fault in said)
        if found["unreadable"] or found["bare"]:
            yield path, f"formulas not rendered: {found['unreadable'] + found['bare']}"
        yield from ((path, f"no such picture: {src}") for src in found["broken"])
        if found["wider"] > 0:
            yield path, f"{found['wider']} pixels wider than the window"
        if width > 1000 and "reference" in path.parts and found["height"] > LONGEST:
            yield path, f"{found['height']} pixels long"


def _from_elsewhere(url: str) -> list[str]:
    own = url.startswith((SITE.as_uri(), "data:", "blob:", "about:"))
    return [] if own else [f"request: {url}"]


class _Links(HTMLParser):
    """Collects the places that a page links to, and those that it has."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.targets: set[str] = set()
        self.ids: set[str] = {""}
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        told = {name: value or "" for name, value in attrs}
        self.ids |= {told[name] for name in ("id", "name") if name in told}
        self.targets |= {told[name] for name in ("href", "src") if name in told}


def test_every_link_leads_somewhere(pages: list[Path]) -> None:
    links = {path: _Links(path) for path in pages}
    lost = []
    for path, of in links.items():
        for target in of.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if there.is_dir():
                there /= "index.html"
            place = "" if "=" in parts.fragment else unquote(parts.fragment)  # or a state
            if not there.exists() or place not in (links[there].ids if there in links else {place}):
                lost.append(f"{path.relative_to(SITE)}: {target}")
    assert lost == []
