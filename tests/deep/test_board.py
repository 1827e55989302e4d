"""Metrics for TensorBoard: what is written, what a killed process leaves, what is missing."""

import sys

import pytest

from trdlab.deep.board import board, check_board
from trdlab.errors import InputError


def scalars(folder):
    loading = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    events = loading.EventAccumulator(str(folder)).Reload()
    return {
        name: [(event.step, event.value) for event in events.Scalars(name)]
        for name in events.Tags()["scalars"]
    }


def test_metrics_are_written_and_a_resumed_run_hides_what_came_after_its_checkpoint(tmp_path):
    with board(tmp_path, 0, wanted=True) as shown:
        for steps in (10, 20, 30):
            shown.write({"agent_steps": steps, "score": float(steps), "loss": None}, steps)
    with board(tmp_path, 20, wanted=True) as shown:  # killed after 30, resumed at 20
        shown.write({"agent_steps": 30, "score": 7.0, "loss": 0.5}, 30)
    assert scalars(tmp_path) == {"score": [(10, 10.0), (20, 20.0), (30, 7.0)], "loss": [(30, 0.5)]}


def test_nothing_is_written_unless_it_is_wanted(tmp_path):
    with board(tmp_path / "no", 0, wanted=False) as shown:
        shown.write({"agent_steps": 1, "score": 1.0}, 1)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_tensorboard_is_said_before_anything_is_done(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    check_board(wanted=False)
    with pytest.raises(InputError, match=r"not installed.*pip install 'trdlab\[tensorboard\]'"):
        check_board(wanted=True)
