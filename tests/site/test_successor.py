"""Zensical, which succeeds MkDocs, reads the same settings and pages."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.site

ROOT = Path(__file__).parents[2]
PAGES = ROOT / ".cache" / "docs" / "pages"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the site as Zensical builds it."""
    if not PAGES.exists():
        pytest.skip("There are no pages yet: `make docs` makes them.")
    folder = tmp_path_factory.mktemp("successor")
    shutil.copytree(PAGES, folder / "pages")
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    (folder / "mkdocs.yml").write_text(f"{settings}\ndocs_dir: pages\n", encoding="utf-8")
    for name in ("docs", "trdlab"):  # which the settings name
        (folder / name).symlink_to(ROOT / name)
    command = [sys.executable, "-m", "zensical", "build"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    said = re.sub("\x1b\\[[0-9;]*m", "", f"{done.stdout}{done.stderr}")
    assert done.returncode == 0, said
    found = set(re.findall("^Warning: (.*)$", said, re.MULTILINE))
    assert found <= {"anchor does not exist"}, said  # the playground's links hold its state
    return folder / "site"


@pytest.mark.parametrize(
    ("page", "says"),
    [
        ("index.html", "When does an agent expect which reward"),
        ("lessons/01_read_a_reward_vector.html", 'class="output'),
        ("reference/tabular.html", 'id="trdlab.tabular.MDP"'),
        ("reference/explanations/calibration.html", "<dt>"),
        ("reference/cli.html", "--gamma"),
        ("index.html", 'class="picture"'),
        ("playground.html", "assets/playground.js"),
    ],
)
def test_it_shows_what_ours_shows(built: Path, page: str, says: str) -> None:
    assert says in (built / page).read_text(encoding="utf-8")


def test_it_reads_every_page_of_ours(built: Path) -> None:
    ours = {path.relative_to(PAGES).with_suffix(".html") for path in PAGES.rglob("*.md")}
    assert ours <= {path.relative_to(built) for path in built.rglob("*.html")}


def test_it_hands_formulas_to_the_same_script(built: Path) -> None:
    page = (built / "reference" / "bellman.html").read_text(encoding="utf-8")
    assert re.search(r'<div class="arithmatex">\\\[\s*\\text\{target\}', page)
    assert "assets/maths.js" in page
