"""The kit: pages and sheets for two groups, which never replace others and give nothing away."""

import json
import re
from base64 import b64decode
from pathlib import Path

import pytest

from trdlab.errors import OutputError
from trdlab.study.kit import FILES, Group, html, key, text, write_kit
from trdlab.study.trials import Trial, draw_trials

TRIALS = draw_trials(3, 6)
NAMES = ["study.html", "questions.txt", "study-q.html", "questions-q.txt", "answers.json"]


def test_the_page_and_the_text_ask_the_same():
    page = html(TRIALS).replace("\N{NO-BREAK SPACE}", " ")
    printed = " ".join(text(TRIALS).split())
    for number, trial in enumerate(TRIALS, 1):
        assert f"Trial {number} of 6" in page
        assert f"Trial {number} of 6" in printed
        for told in trial.why + trial.promise + trial.instead:
            assert f"<li>{told}</li>" in page
            assert told in printed
    assert all(len(line) <= 78 for line in text(TRIALS).splitlines())


def test_readers_of_q_see_what_each_action_is_worth_and_no_sentence():
    page, printed = html(TRIALS, "q"), text(TRIALS, "q")
    for trial in TRIALS:
        for told in trial.why + trial.promise + trial.instead:
            assert told not in page
            assert told not in printed
        for name, worth in trial.worth.items():
            assert f'<th scope="row">{name}</th><td class="number">{worth}</td>' in page
        taken = trial.action, trial.worth[trial.action]
        assert re.search(r"{} +{} +which it takes\n".format(*taken), printed)
    assert printed.count("which it takes") == printed.count("the next best\n") == len(TRIALS)
    assert all(len(line) <= 78 for line in printed.splitlines())


@pytest.mark.parametrize("group", FILES)
def test_the_page_loads_nothing_and_stands_alone(group: Group):
    page = html(TRIALS, group)
    assert not re.search(r"https?:|//\w|\b(src|href)=|@import|url\(", page)
    assert "default-src 'none'" in page
    assert "$" not in page  # no slot was left open


@pytest.mark.parametrize("group", FILES)
def test_sentences_to_readers_are_short(group: Group):
    head = text(TRIALS, group).partition("-----")[0]
    sentences = (s for paragraph in head.split("\n\n") for s in re.split(r"[.:?]\s", paragraph))
    assert all(len(sentence.split()) <= 25 for sentence in sentences)


@pytest.mark.parametrize("group", FILES)
def test_the_key_is_in_the_page_and_cannot_be_read_by_accident(group: Group):
    page, answers = html(TRIALS, group), "".join(trial.letter for trial in TRIALS)
    hidden = re.search(r'<script id="key"[^>]*>([^<]*)</script>', page)
    assert hidden is not None
    found = json.loads(b64decode(hidden[1]))
    assert found["answers"] == answers
    assert found["reasons"] == [trial.reason for trial in TRIALS]
    for secret in (answers, *(trial.reason for trial in TRIALS)):
        assert secret not in page
        assert secret not in text(TRIALS, group)


def test_what_is_printed_is_escaped():
    worth = {"action <P>": "1", "action Q": "2"}
    odd = Trial("A", "action <P>", "action Q", worth, ("1 < 2 & 3.",), (), (), "because <b>")
    assert "<li>1 &lt; 2 &amp; 3.</li>" in html([odd])
    assert "<b>" not in html([odd])
    assert "action &lt;P&gt;</th>" in html([odd], "q")


def test_a_kit_is_written_once_and_the_same_for_the_same_seed(tmp_path: Path):
    first = write_kit(tmp_path / "a" / "b", TRIALS, 3)
    second = write_kit(tmp_path / "c", draw_trials(3, 6), 3)
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert [path.name for path in first] == NAMES
    written = json.loads(first[-1].read_text())
    assert written == json.loads(json.dumps(key(TRIALS, 3)))
    assert (written["schema"], written["seed"]) == ("trdlab.study/2", 3)
    with pytest.raises(OutputError, match=r"study.html' exists. Choose another `out`."):
        write_kit(tmp_path / "c", TRIALS, 3)


@pytest.mark.parametrize("name", NAMES)
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
