"""Metrics: lines that are always valid JSON, and the same whether a run was interrupted or not."""

import errno
import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest

from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.runs import MetricsFile, read_metrics


def no_constants(name: str) -> None:
    raise AssertionError(f"{name} is not valid JSON")


def test_numbers_that_json_cannot_hold_are_named(tmp_path):
    path = tmp_path / "metrics.jsonl"
    row = {"loss": math.nan, "best": -math.inf, "score": np.float64(0.1), "why": "é", "none": None}
    with MetricsFile(path) as metrics:
        metrics.append(row)
        metrics.append({"agent_steps": 8, "ok": True})
    first, second = path.read_text().splitlines()
    plain = json.loads(first, parse_constant=no_constants)
    assert plain["loss"] is plain["best"] is plain["none"] is None
    assert plain["non_finite"] == {"loss": "nan", "best": "-inf"}
    assert json.loads(second) == {"agent_steps": 8, "ok": True}
    back = read_metrics(path)
    assert repr(back[0]) == repr({**row, "score": 0.1})
    assert back[1] == {"agent_steps": 8, "ok": True}


@pytest.mark.parametrize("value", [np.float32(1), [1.0], {"a": 1}, b"x"])
def test_other_values_are_refused(tmp_path, value):
    refused = pytest.raises(InputError, match=r"The metric 'loss' is .*plain numbers and texts")
    with MetricsFile(tmp_path / "m") as metrics, refused:
        metrics.append({"loss": value})
    assert (tmp_path / "m").read_bytes() == b""


def test_a_line_is_there_as_soon_as_it_is_written_and_a_torn_one_is_left_out(tmp_path):
    path = tmp_path / "m"
    with MetricsFile(path) as metrics:
        metrics.append({"a": 1})
        assert read_metrics(path) == [{"a": 1}]
    with path.open("a") as file:
        file.write('{"a": 2}')  # perhaps 20, or 2.5
    assert read_metrics(path) == [{"a": 1}]
    with MetricsFile(path) as metrics:
        metrics.append({"a": 3})
    assert read_metrics(path) == [{"a": 1}, {"a": 3}]


def test_a_torn_line_in_the_middle_is_named(tmp_path):
    path = tmp_path / "m"
    for torn in ('{"a"', "[1]", "1", '{"non_finite": 1}', '{"non_finite": {"a": "x"}}'):
        path.write_text(f'{{"a": 1}}\n{torn}\n{{"a": 2}}\n')
        with pytest.raises(TrdlabError, match=r"m', line 2, is torn\. Delete that line\."):
            read_metrics(path)
    with pytest.raises(TrdlabError, match=r"cannot be read: No such file or directory\."):
        read_metrics(tmp_path / "none")


def write_rows(metrics: MetricsFile, begin: int, end: int) -> None:
    for step in range(begin, end):
        metrics.append({"agent_steps": step, "loss": 1 / (step + 1)})


def test_an_interrupted_run_has_the_same_file_as_an_uninterrupted_one(tmp_path):
    with MetricsFile(tmp_path / "whole") as metrics:
        write_rows(metrics, 0, 20)
    with MetricsFile(tmp_path / "parts") as metrics:
        write_rows(metrics, 0, 11)  # the last ones after the checkpoint at 6
    with MetricsFile(tmp_path / "parts", after=6) as metrics:
        write_rows(metrics, 7, 20)
    assert (tmp_path / "parts").read_bytes() == (tmp_path / "whole").read_bytes()


@pytest.mark.parametrize(
    ("before", "kept"),
    [
        ("", ""),
        ('{"agent_steps": 8}\n{"agent', '{"agent_steps": 8}\n'),
        ('{"agent_steps": 16}\n', '{"agent_steps": 16}\n'),  # those before were lost
        ('{"agent_steps": 8}\n{"ag\n{"agent_steps": 24}\n', '{"agent_steps": 8}\n{"ag\n'),
        ("# mine\n[]\n", "# mine\n[]\n"),
    ],
)
def test_lines_that_are_lost_torn_or_mended_are_no_obstacle(tmp_path, before, kept):
    path = tmp_path / "m"
    path.write_text(before)
    with MetricsFile(path, after=16) as metrics:
        metrics.append({"agent_steps": 24})
    assert path.read_text() == kept + '{"agent_steps": 24}\n'


def test_a_full_disk_leaves_whole_lines(tmp_path, monkeypatch):
    path = tmp_path / "m"
    with MetricsFile(path) as metrics:
        metrics.append({"a": 1})
        file = metrics._file

        class Full:
            """Takes a part, and then nothing."""

            def write(self, data: memoryview) -> int:
                if len(data) < 8:
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                return file.write(data[:5])

            truncate, close, fileno = file.truncate, file.close, file.fileno

        metrics._file = Full()
        with pytest.raises(OutputError, match=r"Cannot write '.*m': No space left on device\."):
            metrics.append({"a": 2})
        metrics._file = file
        metrics.append({"a": 3})
    assert path.read_text() == '{"a": 1}\n{"a": 3}\n'
    with pytest.raises(OutputError, match=r"Cannot write '.*': Is a directory"):
        MetricsFile(tmp_path)


def test_nothing_heavy_is_imported():
    code = "import sys, trdlab.runs; assert not {'torch', 'gymnasium', 'rich'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
