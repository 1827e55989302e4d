"""Which precision is chosen: the one whose updates take clearly less time."""

import time

import gymnasium as gym
import numpy as np
import pytest

from trdlab.deep.precision import quicker_precision
from trdlab.deep.settings import TrainSettings
from trdlab.deep.update import Learner

VECTORS = gym.spaces.Box(-1, 1, (3,), np.float32)
IMAGES = gym.spaces.Box(0, 255, (4, 36, 36), np.uint8)
SETTINGS = TrainSettings("gym", "X", batch_size=2, hidden=(4,), device="cpu", precision="auto")


@pytest.mark.parametrize(
    ("milliseconds", "chosen"),
    [
        ({"float32": 4, "bfloat16": 40}, "float32"),  # a processor without instructions for it
        ({"float32": 40, "bfloat16": 10}, "bfloat16"),
        ({"float32": 20, "bfloat16": 19.5}, "float32"),  # hardly quicker, and less exact
    ],
)
def test_the_quicker_one_is_chosen_if_it_is_clearly_quicker(monkeypatch, milliseconds, chosen):
    def update(learner: Learner, batch: object) -> None:
        time.sleep(milliseconds[learner.settings.precision] / 1000)

    monkeypatch.setattr(Learner, "update", update)
    assert quicker_precision(VECTORS, 2, SETTINGS) == chosen


@pytest.mark.parametrize("space", [VECTORS, IMAGES, gym.spaces.Discrete(3, start=5)])
def test_it_is_measured_on_whatever_an_agent_sees(space):
    assert quicker_precision(space, 2, SETTINGS) in ("float32", "bfloat16")
