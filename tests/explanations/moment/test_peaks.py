"""Peaks and rhythm of vectors whose bumps are known, and of maps that pay again and again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import peak_prominences

from moments import calibrated, trusted
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.moment.exact import gridworld_moment
from trdlab.explanations.moment.forecast import forecast
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.peaks import peaks, prominence
from trdlab.gridworld import Gridworld, load_map
from trdlab.tabular import exact

STEPS = np.arange(41)


def bumps(*places: int, width: float = 1.2) -> np.ndarray:
    return np.sum([np.exp(-((STEPS - place) ** 2) / (2.0 * width**2)) for place in places], axis=0)


def noise(seed: int, size: float = 0.03) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, size, len(STEPS))


def learned(
    row: np.ndarray, width: int = 1, good: int | None = None, off_by: np.ndarray | None = None
) -> Moment:
    """A moment of one action that expects `row`, before the discount."""
    axis = TimeAxis(0.95, len(row) - 1, width)
    judged = None if good is None else trusted(axis, good)
    judged = judged if off_by is None else calibrated(axis, off_by=off_by)
    components = RewardDecomposition((row * axis.discounts)[None], axis)
    return Moment(components, ("go",), Future("the greedy policy"), calibration=judged)


def told(moment: Moment) -> dict[str, str]:
    return {claim.kind: claim.sentence for claim in forecast(moment.choice("go"))}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_a_rhythm_is_found_under_noise_on_a_slope_and_of_costs(seed, sign, slope):
    row = sign * (bumps(3, 11, 19, 27, 35) + slope * (1.0 - STEPS / 40)) + noise(seed)
    moment = learned(row)
    found = peaks(moment, "go")
    assert np.abs(np.array(found) - [3, 11, 19, 27, 35]).max() <= 1
    what = "reward" if sign > 0 else "cost"
    said = told(moment)["rhythm"]
    assert said.startswith(f"In the first 40 steps the {what} expected of go peaks every ")
    assert said.endswith(
        f"the first time {found[0]} steps later, the last time {found[-1]} steps later."
    )


def test_a_period_is_told_from_its_shortest_to_its_longest():
    said = told(replace(learned(bumps(3, 11, 19, 27, 35)), seconds_per_step=1 / 15))
    assert (
        "every 8 steps, the first time 3 steps later (0.2 s), the last time 35 steps later"
        in said["rhythm"]
    )
    assert "every 7 to 9 steps" in told(learned(bumps(3, 11, 20, 27, 35)))["rhythm"]


def test_what_comes_at_uneven_times_has_peaks_and_no_rhythm():
    said = told(learned(bumps(3, 9, 22, 32) + noise(0)))
    assert "rhythm" not in said
    assert said["several-peaks"].endswith(
        "peaks 3 steps later, 9 steps later, 22 steps later and 32 steps later."
    )


def test_three_peaks_are_a_rhythm_only_of_what_is_more_than_noise():
    row = bumps(3, 11, 19)
    off = np.full(41, 0.5) * TimeAxis(0.95, 40).discounts
    assert "rhythm" not in told(learned(row))
    assert "every 8 steps" in told(learned(row, off_by=off))["rhythm"]


def test_of_many_peaks_the_most_prominent_are_named():
    row = np.zeros(41)
    row[[2, 4, 11, 15, 17, 30]] = [1.0, 0.5, 0.9, 0.6, 0.8, 0.7]
    assert told(learned(row))["several-peaks"].endswith(
        "peaks 2 steps later, 11 steps later, 17 steps later and 30 steps later."
    )


def test_groups_are_counted_in_steps():
    assert "every 24 steps" in told(learned(bumps(3, 11, 19, 27, 35), width=3))["rhythm"]


def test_the_largest_is_that_without_the_discount():
    row = np.zeros(21)
    row[[2, 15]] = [1.0, 1.5]  # 0.90 and 0.69 now
    said = told(learned(row))
    assert said["peak"] == (
        "The largest reward of go in the first 20 steps comes 15 steps later: it is 1.5 on average."
    )


def test_a_reward_that_hardly_varies_has_no_peak_and_is_called_the_same():
    said = told(learned(1.0 + np.clip(noise(0, 0.01), -0.02, 0.02)))
    (first, *_) = said.values()
    assert first.startswith("With go, each of the first 40 steps pays ")
    assert first.endswith(" (more or less, not discounted).")
    assert not {"peak", "several-peaks", "rhythm", "spread"} & set(said)
    assert told(learned(-np.ones(11)))["steady"] == (
        "With go, each of the first 10 steps costs 1 (more or less, not discounted)."
    )
    assert "steady" not in told(learned(1.0 + 0.2 * STEPS / 40.0))


def test_a_wide_peak_is_said_to_be_uncertain_or_drawn_out_but_not_of_what_is_exact():
    moment = learned(bumps(8, width=2.0))
    # half of its height is reached 2.35 steps away
    assert "8 steps later is spread over 5 steps:" in told(moment)["spread"]
    assert "spread" not in told(learned(bumps(8, width=0.5)))
    known = Moment(moment.decomposition, ("go",), moment.future, totals=np.array([5.0]))
    assert "spread" not in told(known)


def test_a_peak_is_not_told_of_what_rises_to_the_end_of_what_is_known():
    rising = STEPS / 40.0
    assert peaks(learned(rising), "go") == []
    assert peaks(learned(bumps(8, 20), good=20), "go") == [8]  # t+20 is not to be trusted
    assert peaks(learned(bumps(8, 20), good=21), "go") == [8]  # it may go on rising
    assert peaks(learned(bumps(8, 20), good=23), "go") == [8, 20]


def test_what_forecasts_are_off_by_is_no_peak():
    row = bumps(8) + 0.4 * bumps(20)
    assert peaks(learned(row), "go") == [8, 20]
    off = np.full(41, 0.5) * TimeAxis(0.95, 40).discounts
    assert peaks(learned(row, off_by=off), "go") == [8]
    assert peaks(learned(row, off_by=3 * off), "go") == []


def test_prominences_are_those_of_scipy():
    rng = np.random.default_rng(0)
    for _ in range(50):
        row = np.append(10.0, rng.normal(size=20))  # with a higher one before, both mean the same
        places = [i for i in range(1, 20) if row[i - 1] < row[i] > row[i + 1]]
        ours = [prominence(row, i) for i in places]
        np.testing.assert_allclose(ours, peak_prominences(row, places)[0])


@pytest.mark.parametrize(
    ("slip", "width", "said"), [(0.0, 1, "14"), (0.05, 1, "14 to 15"), (0.0, 2, "14")]
)
def test_a_circuit_pays_once_each_round(slip, width, said):
    world = Gridworld(load_map("loop").with_slip(slip))
    table = exact(world.mdp, TimeAxis(0.95, 48 // width, width))
    (rhythm,) = (
        c for c in forecast(gridworld_moment(world, table, 0).choice("right")) if c.kind == "rhythm"
    )
    assert rhythm.period == said  # cells in a round; who slips takes longer
    assert f"peaks every {said} steps" in rhythm.sentence
