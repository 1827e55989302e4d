"""A headless Chromium, for what only a browser can tell of a page."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

import pytest

_ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)

_PATIENCE = 120_000  # milliseconds: other work may keep the machine busy


@contextmanager
def chromium() -> Iterator[Any]:
    """Yields a browser; where there is none, the test is skipped, or fails if one is required."""
    program = which("chromium") or which("chromium-browser") or which("google-chrome")
    if program is None:
        if os.environ.get("TRDLAB_TEST_BROWSER") == "required":
            pytest.fail("There is no Chromium, and TRDLAB_TEST_BROWSER requires one.")
        pytest.skip("There is no Chromium to drive.")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(_ARGUMENTS))
        try:
            yield browser
        finally:
            browser.close()


class Visit:
    """A page that is open in a browser, and all that went wrong with it.

    Args:
        browser: the browser.
        file: the page.
        how: of the browser's context: `viewport`, `color_scheme`, …

    Attributes:
        page: of playwright.
        faults: errors, warnings, dialogs and requests other than for the file itself.
    """

    def __init__(self, browser: Any, file: Path, **how: Any) -> None:
        how = {"viewport": {"width": 1280, "height": 900}} | how
        self.page = browser.new_context(**how).new_page()
        self.page.set_default_timeout(_PATIENCE)
        self.faults: list[str] = []
        self.page.on("console", lambda message: self.faults.append(message.text))
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("dialog", self._on_dialog)
        self.page.on("request", self._on_request)
        self._url = file.absolute().as_uri()
        self.page.goto(self._url)

    def text(self, selector: str) -> str:
        """Returns what is to be read in an element."""
        return str(self.page.text_content(selector)).strip()

    def _on_dialog(self, dialog: Any) -> None:
        self.faults.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    def _on_request(self, request: Any) -> None:
        if not request.url.startswith((self._url, "data:", "blob:")):
            self.faults.append(f"request: {request.url}")
