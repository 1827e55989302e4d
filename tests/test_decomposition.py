"""The nouns: what the time axis means, and what a decomposition can and cannot be asked."""

import json
import math
from io import StringIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from rich.console import Console

from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError

PAPER = TimeAxis(0.95, horizon=2, width=2)
UP, DOWN = [0, 0, 4 * 0.95**4], [0.95, 0.95**2 + 0.95**3, 0.95**4]  # the paper's drone


def drone() -> RewardDecomposition:
    return RewardDecomposition([UP, DOWN], PAPER)


def rendered(decomposition: RewardDecomposition) -> str:
    console = Console(width=80, file=StringIO())
    console.print(decomposition)
    return console.file.getvalue()


# ---- the time axis -----------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [math.nan, 1.0, -0.1, math.inf, 1, "0.9", None])
def test_gamma_must_be_a_number_from_0_to_below_1(gamma):
    with pytest.raises(InputError, match=r"gamma is .*less than 1"):
        TimeAxis(gamma, 2)


@pytest.mark.parametrize("horizon", [-1, 2.0, True, "2", None])
def test_the_horizon_must_be_a_whole_number(horizon):
    with pytest.raises(InputError, match=r"horizon N is .* whole number of at least 0"):
        TimeAxis(0.9, horizon)


@pytest.mark.parametrize("width", [0, -1, 1.0, True, np.float64(2)])
def test_the_width_must_be_a_positive_whole_number(width):
    with pytest.raises(InputError, match=r"width w is .* whole number of at least 1"):
        TimeAxis(0.9, 2, width)


def test_which_steps_a_component_covers():
    axis = TimeAxis(0.5, horizon=3, width=4)
    assert axis.num_components == 4
    assert axis.num_steps == 12
    assert [axis.steps(i) for i in range(4)] == [range(4), range(4, 8), range(8, 12), None]
    assert axis.labels == ("t…t+3", "t+4…t+7", "t+8…t+11", "t+12…∞")
    assert axis.discounts.tolist() == [1, 0.5**4, 0.5**8, 0.5**12]
    assert TimeAxis(0.5, 2).labels == ("t", "t+1", "t+2…∞")
    assert TimeAxis(0.0, 0).labels == ("t…∞",)
    for component in (-1, 4):
        with pytest.raises(InputError, match=f"no component {component}.*0 to 3"):
            axis.label(component)


def test_numpy_numbers_become_plain_ones():
    axis = TimeAxis(np.float32(0.5), np.int64(2), np.int8(3))
    assert axis == TimeAxis(0.5, 2, 3)
    assert repr(axis) == "TimeAxis(gamma=0.5, horizon=2, width=3)"
    json.dumps(RewardDecomposition([1, 2, 3], axis).to_dict())


# ---- what it holds -----------------------------------------------------------------------------


def test_the_papers_numbers_add_up_to_q():
    assert drone().value.round(2).tolist() == [3.26, 3.52]
    assert drone().residual.tolist() == [UP[2], DOWN[2]]
    assert drone().shape == (2,)
    assert len(drone()) == 2


def test_components_are_copied_and_cannot_be_changed():
    mine = np.array(DOWN)
    down = RewardDecomposition(mine, PAPER)
    mine[:] = 7
    assert down.components.tolist() == DOWN
    with pytest.raises(ValueError, match="read-only"):
        down.components[0] = 7
    with pytest.raises(ValueError, match="read-only"):
        drone()[0].components[0] = 7


def test_floats_keep_their_precision_and_whole_numbers_become_floats():
    assert RewardDecomposition(np.ones(3, np.float32), PAPER).components.dtype == np.float32
    assert RewardDecomposition(np.ones(3, np.int64), PAPER).components.dtype == np.float64


@pytest.mark.parametrize("shape", [(), (2,), (3, 4), (3, 0)])
def test_the_last_axis_must_have_n_plus_1_entries(shape):
    with pytest.raises(InputError, match="N = 2 needs a last axis of 3"):
        RewardDecomposition(np.zeros(shape), PAPER)


def test_a_single_vector_cannot_be_iterated_by_mistake():
    down = RewardDecomposition(DOWN, PAPER)
    for mistake in (len, list, sum):  # sum() would otherwise be 0
        with pytest.raises(TypeError, match="no length"):
            mistake(down)
    assert [row.components.tolist() for row in drone()] == [UP, DOWN]


# ---- indexing ----------------------------------------------------------------------------------


@given(arrays(np.float64, (3, 4, 3), elements=st.floats(-9, 9)), st.data())
def test_indexing_selects_states_and_actions_but_never_components(components, data):
    table = RewardDecomposition(components, PAPER)
    index = data.draw(
        st.sampled_from(
            [
                1,
                -1,
                (2, 3),
                (2, -1),
                slice(1, None),
                (slice(None), 1),
                (slice(None, None, 2), slice(1, 3)),
                [2, 0],
                np.array([1, 1, 2]),
                (np.array([0, 2]), np.array([3, 1])),  # one action in each of a batch of states
                np.array([True, False, True]),
                (None, 0),
                (),
            ]
        )
    )
    whole = index if isinstance(index, tuple) else (index,)
    np.testing.assert_array_equal(table[index].components, components[(*whole, ..., slice(None))])
    np.testing.assert_array_equal(table[index].value, table.value[index])
    assert table[index].time_axis == PAPER


def test_ellipsis_stands_for_the_leading_axes():
    table = RewardDecomposition(np.arange(36.0).reshape(3, 4, 3), PAPER)
    np.testing.assert_array_equal(table[..., 1].components, table.components[:, 1])
    np.testing.assert_array_equal(table[2, ...].components, table.components[2])
    np.testing.assert_array_equal(table[...].components, table.components)
    np.testing.assert_array_equal(table[1, ..., 2].components, table.components[1, 2])


@pytest.mark.parametrize(
    "index", [(0, 0, 0), (..., 0, 0, 0), 3, (0, 4), np.ones((3, 4, 3), dtype=bool)]
)
def test_the_component_axis_cannot_be_indexed_away(index):
    table = RewardDecomposition(np.zeros((3, 4, 3)), PAPER)
    with pytest.raises(IndexError, match=r"does not select from shape \(3, 4\)"):
        table[index]


# ---- contrasts and groups ----------------------------------------------------------------------


def test_a_contrast_is_a_difference_component_by_component():
    difference = drone()[1] - drone()[0]
    assert difference.components.round(2).tolist() == [0.95, 1.76, -2.44]
    assert (drone() - drone()[0]).components[1].tolist() == difference.components.tolist()
    with pytest.raises(InputError, match="time axes differ"):
        drone() - RewardDecomposition(DOWN, TimeAxis(0.9, 2, 2))
    with pytest.raises(TypeError):
        drone() - 1


def test_regrouping_gives_the_papers_pairs():
    fine = RewardDecomposition([0, 0.95, 0.95**2, 0.95**3, 0.95**4], TimeAxis(0.95, 4))
    np.testing.assert_allclose(fine.regroup(2).components, DOWN, atol=1e-15)
    assert fine.regroup(2).time_axis == PAPER
    np.testing.assert_allclose(
        fine.regroup(4).components, fine.regroup(2).regroup(4).components, atol=1e-15
    )


def test_a_short_last_group_is_refused_with_the_widths_that_fit():
    fine = RewardDecomposition(np.zeros(7), TimeAxis(0.9, 6))
    with pytest.raises(InputError, match=r"6 steps.*groups of 4.*\[1, 2, 3, 6\].*multiple of 4"):
        fine.regroup(4)
    with pytest.raises(InputError, match=r"\[2, 6\].*horizon N that is a multiple of 2"):
        fine.regroup(2).regroup(4)
    with pytest.raises(InputError, match="Groups of 2 cannot be regrouped to a width of 3"):
        fine.regroup(2).regroup(3)
    for width in (0, -1, 1.0, True):
        with pytest.raises(InputError, match="whole number of at least 1"):
            fine.regroup(width)


@given(
    groups=st.integers(0, 4),
    width=st.integers(1, 4),
    shape=array_shapes(min_dims=0, max_dims=2, min_side=0, max_side=3),
    data=st.data(),
)
def test_regrouping_keeps_the_value_and_commutes_with_contrasts(groups, width, shape, data):
    axis = TimeAxis(0.9, groups * width)
    a, b = (
        RewardDecomposition(
            data.draw(arrays(np.float64, (*shape, axis.num_components), elements=st.floats(-9, 9))),
            axis,
        )
        for _ in range(2)
    )
    grouped = a.regroup(width)
    assert grouped.components.shape == (*shape, groups + 1)
    np.testing.assert_allclose(grouped.value, a.value, atol=1e-12)
    np.testing.assert_array_equal(grouped.residual, a.residual)
    np.testing.assert_allclose(
        (a - b).regroup(width).components, (grouped - b.regroup(width)).components, atol=1e-12
    )
    for i in range(groups):
        block = a.components[..., i * width : (i + 1) * width].sum(axis=-1)
        np.testing.assert_allclose(grouped.components[..., i], block, atol=1e-12)


# ---- without discount --------------------------------------------------------------------------


def test_single_steps_are_undiscounted_exactly():
    fine = RewardDecomposition([3, 2 * 0.5, 8 * 0.25, 0.7], TimeAxis(0.5, 3))
    assert fine.undiscounted().tolist() == [3, 2, 8]  # the residual has no entry
    assert RewardDecomposition([[1.0]], TimeAxis(0.5, 0)).undiscounted().shape == (1, 0)


def test_what_cannot_be_undiscounted_is_refused():
    with pytest.raises(InputError, match=r"group of 2 steps.*undiscounted_bounds"):
        drone().undiscounted()
    at_zero = RewardDecomposition([1, 0, 0], TimeAxis(0.0, 2))
    vanishing = RewardDecomposition(np.zeros(201), TimeAxis(0.01, 200))  # 0.01**200 is 0
    for ask in (RewardDecomposition.undiscounted, RewardDecomposition.undiscounted_bounds):
        with pytest.raises(InputError, match=r"gamma = 0.*gamma above 0"):
            ask(at_zero)
        with pytest.raises(InputError, match=r"vanishes.*smaller horizon"):
            ask(vanishing)


def test_the_bounds_of_the_papers_groups():
    low, high = drone()[1].undiscounted_bounds(0, 1)
    # Group 0: 0.95 is one coin one step later, or 0.95 of a coin now. Group 1 at its own start
    # is 1.95 = 1 + 0.95: only two full coins pay that. The residual is one coin, or many later.
    np.testing.assert_allclose(low, [0.95, 2.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(high, [1.0, 2.0, np.inf], atol=1e-12)


@pytest.mark.parametrize(
    ("lowest", "highest", "message"),
    [
        (-math.inf, math.inf, "bound nothing"),
        (2, 1, "no reward from 2 to 1"),
        (math.nan, 1, "no reward from nan"),
        (math.inf, 5, "no reward from inf"),
        (-math.inf, -math.inf, "no reward from -inf"),
        (0, 0.5, "Widen the range"),  # a group of 0.95 + 0.9025 needs more
        (-1, 0, "Widen the range"),
        (-math.inf, 0, "Widen the range"),
    ],
)
def test_ranges_that_cannot_be_are_refused(lowest, highest, message):
    with pytest.raises(InputError, match=message):
        drone()[1].undiscounted_bounds(lowest, highest)


def test_the_residual_is_bounded_on_one_side_by_rewards_of_one_sign():
    tail = RewardDecomposition([0.0, -0.5], TimeAxis(0.5, 1))  # −1 at its own start
    for lowest, highest, bounds in (
        (-3, 0, (-np.inf, -1)),
        (-np.inf, 0, (-np.inf, -1)),
        (-1, 1, (-np.inf, np.inf)),  # +1 late weighs little, and so does −1
    ):
        low, high = tail.undiscounted_bounds(lowest, highest)
        assert (low[1], high[1]) == bounds
    nothing = RewardDecomposition([0.0, 0.0], TimeAxis(0.5, 1)).undiscounted_bounds()
    assert [bound.tolist() for bound in nothing] == [[0, 0], [0, 0]]


def test_a_residual_outside_the_range_is_refused_too():
    with pytest.raises(InputError, match="Widen the range"):
        RewardDecomposition([0, 0, -1], PAPER).undiscounted_bounds(0, 1)
    with pytest.raises(InputError, match="Widen the range"):  # at most 1/(1 − 0.95) = 20
        RewardDecomposition([0, 0, 20.1 * 0.95**4], PAPER).undiscounted_bounds(0, 1)


GAMMAS = st.floats(0.3, 0.99)


def decomposed(stream: np.ndarray, axis: TimeAxis) -> RewardDecomposition:
    """Decomposes a finite stream of rewards, step by step as the definition says."""
    components = np.zeros(axis.num_components)
    for step, reward in enumerate(stream):
        components[min(step // axis.width, axis.horizon)] += axis.gamma**step * reward
    return RewardDecomposition(components, axis)


@given(st.floats(-5, 5), st.floats(0, 5), GAMMAS, st.integers(0, 3), st.integers(1, 4), st.data())
def test_no_stream_of_rewards_leaves_the_bounds(lowest, room, gamma, horizon, width, data):
    lowest, highest = min(lowest, 0.0), max(lowest + room, 0.0)  # 0 once the stream is over
    axis = TimeAxis(gamma, horizon, width)
    stream = np.array(
        data.draw(st.lists(st.floats(lowest, highest), max_size=axis.num_steps + 6)), dtype=float
    )
    for low_end, high_end in (
        (lowest, highest),
        (lowest, math.inf),
        (-math.inf, highest),
    ):
        low, high = decomposed(stream, axis).undiscounted_bounds(low_end, high_end)
        for i in range(axis.num_components):
            steps = axis.steps(i)
            part = stream[i * width :] if steps is None else stream[steps.start : steps.stop]
            assert low[i] - 1e-6 <= part.sum() <= high[i] + 1e-6
    if lowest == 0.0:
        assert np.isfinite(decomposed(stream, axis).undiscounted_bounds(0, highest)[0]).all()
    if highest == 0.0:
        assert np.isfinite(decomposed(stream, axis).undiscounted_bounds(lowest, 0)[1]).all()


@given(st.floats(-5, 0), st.floats(0.1, 5), GAMMAS, st.integers(1, 5), st.floats(0, 1))
def test_the_bounds_of_a_group_are_attained(lowest, highest, gamma, width, share):
    """Paying all as early as possible, and as late, gives the same group at the two bounds."""
    weights, room = gamma ** np.arange(width), highest - lowest
    group = (lowest + share * room) * weights.sum()
    decomposition = RewardDecomposition([group, 0], TimeAxis(gamma, 1, width))
    [low, _], [high, _] = decomposition.undiscounted_bounds(lowest, highest)
    for order, bound in ((range(width), low), (reversed(range(width)), high)):
        rewards, left = np.full(width, lowest), share * room * weights.sum()
        for step in order:
            paid = min(room, left / weights[step])
            rewards[step] += paid
            left -= paid * weights[step]
        assert (weights * rewards).sum() == pytest.approx(group, abs=1e-9)
        assert rewards.sum() == pytest.approx(bound, abs=1e-6)


def test_float32_components_at_the_end_of_their_range_are_not_refused():
    ones = np.array([(0.95 ** np.arange(3)).sum(), 0], np.float32)
    low, high = RewardDecomposition(ones, TimeAxis(0.95, 1, 3)).undiscounted_bounds(0, 1)
    np.testing.assert_allclose([low[0], high[0]], 3, rtol=1e-6)


# ---- as data, and as text ----------------------------------------------------------------------


@given(arrays(np.float64, (2, 3), elements=st.floats(allow_nan=False, allow_infinity=False)))
def test_plain_data_comes_back_bit_for_bit(components):
    data = RewardDecomposition(components, PAPER).to_dict()
    back = RewardDecomposition.from_dict(json.loads(json.dumps(data)))
    np.testing.assert_array_equal(back.components, components)
    assert back.time_axis == PAPER


def test_the_data_names_its_schema_and_the_papers_letters():
    assert drone().to_dict() == {
        "schema": "trdlab.RewardDecomposition/1",
        "gamma": 0.95,
        "N": 2,
        "w": 2,
        "components": [UP, DOWN],
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "trdlab.RewardDecomposition/2"}, "schema is 'trdlab.RewardDecomposition/2'"),
        ({"schema": None}, "schema is None"),
        ({"gamma": "high"}, "gamma is high"),
        ({"N": 3}, "N = 3 needs a last axis of 4"),
        ({"N": 2.0}, "horizon N is 2.0"),
        ({"components": [[1, 2, 3], [1]]}, "no array of numbers"),
        ({"components": {"a": 1}}, "no array of numbers"),
    ],
)
def test_other_data_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        RewardDecomposition.from_dict(drone().to_dict() | change)


@pytest.mark.parametrize("field", ["schema", "gamma", "N", "w", "components"])
def test_a_missing_field_is_named(field):
    data = drone().to_dict()
    del data[field]
    with pytest.raises(InputError, match=field):
        RewardDecomposition.from_dict(data)


def test_tables_show_the_papers_numbers():
    text, html = rendered(drone()), drone()._repr_html_()
    for shown in (
        "t…t+1",
        "t+4…∞",
        "0.95",
        "1.76",
        "0.81",
        "3.26",
        "3.52",
        "γ = 0.95, N = 2, w = 2",
    ):
        assert shown in text
        assert shown in html
    assert html.startswith("<table>")
    assert "3.52" in rendered(drone()[1])  # a single vector is a table of one row


def test_what_is_too_large_for_a_table_is_shown_by_its_shape():
    for shape in ((2, 4, 3), (1000, 3)):
        large = RewardDecomposition(np.zeros(shape), PAPER)
        for text in (repr(large), rendered(large), large._repr_html_()):
            assert str(shape) in text.replace("\n", " ")
            assert len(text) < 200


def test_two_axes_share_the_finest_one_that_both_can_be_brought_to():
    assert TimeAxis(0.9, 10).shared(TimeAxis(0.9, 4)) == TimeAxis(0.9, 4)
    assert TimeAxis(0.9, 10).shared(TimeAxis(0.9, 4, 3)) == TimeAxis(0.9, 3, 3)
    assert TimeAxis(0.9, 6, 2).shared(TimeAxis(0.9, 4, 3)) == TimeAxis(0.9, 2, 6)
    assert TimeAxis(0.9, 3, 2).shared(TimeAxis(0.9, 1, 5)) == TimeAxis(0.9, 0, 10)
    with pytest.raises(InputError, match=r"discount factors differ: 0\.9 and 0\.95"):
        TimeAxis(0.9, 4).shared(TimeAxis(0.95, 4))


def test_a_decomposition_is_brought_to_a_coarser_axis():
    fine = RewardDecomposition([[1.0, 2.0, 4.0, 8.0, 16.0, 32.0]] * 2, TimeAxis(0.9, 5))
    coarse = fine.on(TimeAxis(0.9, 2, 2))
    assert coarse.time_axis == TimeAxis(0.9, 2, 2)
    assert coarse.components.tolist() == [[1 + 2, 4 + 8, 16 + 32]] * 2
    assert fine.on(TimeAxis(0.9, 3)).components[0].tolist() == [1, 2, 4, 8 + 16 + 32]
    assert fine.on(TimeAxis(0.9, 0, 7)).components[0].tolist() == [63]
    assert fine.on(TimeAxis(0.9, 5)).components.tolist() == fine.components.tolist()
    for axis in (TimeAxis(0.9, 6), TimeAxis(0.9, 3, 2)):
        with pytest.raises(InputError, match="cannot be brought to"):
            fine.on(axis)
    with pytest.raises(InputError, match="cannot be brought to"):
        coarse.on(TimeAxis(0.9, 2))
