"""Takes the picture of a report that the documentation shows.

    python docs/picture.py AGENT FILE.png [MAX_STEPS]

Writes the report of the agent, opens it in a headless Chromium, and saves what its first screen
shows.
"""

import sys
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright

import trdlab

SIZE = {"width": 1240, "height": 980}


def main(agent: str, picture: str, max_steps: str = "1000") -> None:
    """Takes the picture."""
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        out = Path(folder) / "report.html"
        page = trdlab.report(agent, out=out, max_steps=int(max_steps), others=1)
        browser = playwright.chromium.launch(
            executable_path=which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        tab = browser.new_page(viewport=SIZE, color_scheme="light")
        tab.goto(page.as_uri())
        tab.wait_for_timeout(1_000)  # until the pictures are drawn
        tab.screenshot(path=picture)
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
