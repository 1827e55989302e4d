"""The kit: three files that say the same, which never replace others and give nothing away."""

import json
import re
from base64 import b64decode
from pathlib import Path

import pytest

from trdlab.errors import OutputError
from trdlab.study.kit import html, key, text, write_kit
from trdlab.study.trials import Trial, draw_trials

TRIALS = draw_trials(3, 6)


def test_the_page_and_the_text_ask_the_same():
    page = html(TRIALS).replace("\N{NO-BREAK SPACE}", " ")
    printed = " ".join(text(TRIALS).split())
    for number, trial in enumerate(TRIALS, 1):
        assert f"Trial {number} of 6" in page
        assert f"Trial {number} of 6" in printed
        for told in trial.promise + trial.against:
            assert f"<li>{told}</li>" in page
            assert told in printed
    assert all(len(line) <= 78 for line in text(TRIALS).splitlines())


def test_the_page_loads_nothing_and_stands_alone():
    page = html(TRIALS)
    assert not re.search(r"https?:|//\w|\b(src|href)=|@import|url\(", page)
    assert "default-src 'none'" in page
    assert "$" not in page  # no slot was left open


def test_the_key_is_in_the_page_and_cannot_be_read_by_accident():
    page, answers = html(TRIALS), "".join(trial.letter for trial in TRIALS)
    hidden = re.search(r'<script id="key"[^>]*>([^<]*)</script>', page)
    assert hidden is not None
    found = json.loads(b64decode(hidden[1]))
    assert found["answers"] == answers
    assert found["reasons"] == [trial.reason for trial in TRIALS]
    for secret in (answers, "treasure", *(trial.reason for trial in TRIALS)):
        assert secret not in page
        assert secret not in text(TRIALS)


def test_what_is_printed_is_escaped():
    odd = Trial("A", "action P", "action Q", ("1 < 2 & 3.",), (), "because <b>")
    assert "<li>1 &lt; 2 &amp; 3.</li>" in html([odd])
    assert "<b>" not in html([odd])


def test_a_kit_is_written_once_and_the_same_for_the_same_seed(tmp_path: Path):
    first = write_kit(tmp_path / "a" / "b", TRIALS, 3)
    second = write_kit(tmp_path / "c", draw_trials(3, 6), 3)
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert [path.name for path in first] == ["study.html", "questions.txt", "answers.json"]
    written = json.loads(first[2].read_text())
    assert written == json.loads(json.dumps(key(TRIALS, 3)))
    assert (written["schema"], written["seed"]) == ("trdlab.study/1", 3)
    with pytest.raises(OutputError, match=r"study.html' exists. Choose another `out`."):
        write_kit(tmp_path / "c", TRIALS, 3)


@pytest.mark.parametrize("name", ["study.html", "questions.txt", "answers.json"])
def test_no_file_is_replaced_nor_any_written_beside_it(name: str, tmp_path: Path):
    (tmp_path / name).write_text("mine")
    with pytest.raises(OutputError, match=f"{name}' exists"):
        write_kit(tmp_path, TRIALS, 3)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "mine"


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file' is a file"):
        write_kit(tmp_path / "file", TRIALS, 3)
    for impossible in (tmp_path / "file" / "kit", tmp_path / "\0", tmp_path / ("x" * 300)):
        with pytest.raises(OutputError, match=r"Cannot make .*Choose another `out`"):
            write_kit(impossible, TRIALS, 3)
