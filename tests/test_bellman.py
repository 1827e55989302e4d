"""The law: a target by hand, for numpy and torch, and what follows from it for any batch."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trdlab.bellman import target
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError

NUMBERS = st.floats(-100, 100, width=32)


@st.composite
def batches(draw, least_horizon: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draws rewards `[B]`, discounts `[B]` (some terminated) and next components `[B, N+1]`."""
    batch, horizon = draw(st.integers(1, 4)), draw(st.integers(least_horizon, 5))
    return (
        draw(arrays(np.float64, batch, elements=NUMBERS)),
        draw(arrays(np.float64, batch, elements=st.just(0.0) | st.floats(0, 1, width=32))),
        draw(arrays(np.float64, (batch, horizon + 1), elements=NUMBERS)),
    )


@pytest.mark.parametrize(
    ("next_components", "expected"),
    [
        ([8.0], [1 + 4]),  # N = 0: Q-learning
        ([8.0, 6.0], [1, 4 + 3]),  # N = 1: r, and everything after it
        ([2.0, 4.0, 6.0, 8.0, 10.0], [1, 1, 2, 3, 4 + 5]),  # N = 4: the last two are folded
    ],
)
@pytest.mark.parametrize("kind", [np.asarray, torch.tensor])
def test_targets_by_hand(next_components, expected, kind):
    assert target(1.0, 0.5, kind(next_components)).tolist() == expected
    terminated = [1.0] + [0.0] * (len(expected) - 1)
    assert target(1.0, 0.0, kind(next_components)).tolist() == terminated


@given(batches())
def test_the_target_sums_to_the_scalar_target(batch):
    reward, discount, following = batch
    np.testing.assert_allclose(
        target(*batch).sum(-1), reward + discount * following.sum(-1), atol=1e-9
    )


@given(batches(least_horizon=2))
def test_the_target_is_its_definition(batch):
    reward, discount, following = batch
    expected = np.empty_like(following)
    expected[:, 0] = reward
    for i in range(1, following.shape[1] - 1):
        expected[:, i] = discount * following[:, i - 1]
    expected[:, -1] = discount * (following[:, -2] + following[:, -1])
    np.testing.assert_allclose(target(*batch), expected, atol=1e-9)


@given(batches(), st.sampled_from(["float32", "float64"]))
def test_numpy_and_torch_agree(batch, dtype):
    ours = [np.asarray(array, dtype=dtype) for array in batch]
    theirs = target(*(torch.from_numpy(array) for array in ours))
    assert str(theirs.dtype) == f"torch.{dtype}"
    assert target(*ours).dtype == dtype
    tolerance = 1e-4 if dtype == "float32" else 1e-9
    np.testing.assert_allclose(theirs.numpy(), target(*ours), rtol=1e-5, atol=tolerance)


def test_rewards_of_any_kind_take_that_of_the_components():
    """What a replay memory holds as float64 numpy meets a float32 network."""
    following = torch.ones(2, 3)
    result = target(np.array([1.0, 2.0]), np.float64(0.5), following)
    assert result.dtype == torch.float32
    assert result.tolist() == [[1, 0.5, 1], [2, 0.5, 1]]
    assert target(torch.tensor(1), torch.tensor(0.5), torch.ones(3)).tolist() == [1, 0.5, 1]
    assert target(np.float32(1), 0.5, np.ones(3)).dtype == np.float64


def test_a_batch_of_actions_keeps_its_axes():
    result = target(np.ones((2, 4)), 0.5, np.ones((2, 4, 3)))
    assert result.tolist() == [[[1, 0.5, 1]] * 4] * 2


def test_gradients_flow_back_to_the_next_components():
    following = torch.ones(2, 3, requires_grad=True)
    target(torch.ones(2), torch.tensor([0.5, 0.0]), following)[:, -1].sum().backward()
    assert following.grad.tolist() == [[0, 0.5, 0.5], [0, 0, 0]]


@given(
    groups=st.integers(0, 3),
    width=st.integers(1, 4),
    gamma=st.floats(0.1, 0.99),
    ends_after=st.none() | st.integers(0, 3),
    data=st.data(),
)
def test_a_group_is_single_steps_summed(groups, width, gamma, ends_after, data):
    """Going back w steps one at a time, then grouping, is going back one group of w steps."""
    axis = TimeAxis(gamma, groups * width)
    following = data.draw(arrays(np.float64, axis.num_components, elements=NUMBERS))
    rewards = data.draw(arrays(np.float64, width, elements=NUMBERS))
    discounts = np.full(width, gamma)
    if ends_after is not None and ends_after < width:  # nothing is paid after the end
        discounts[ends_after], rewards[ends_after + 1 :] = 0.0, 0.0
    singly = following
    for reward, discount in zip(rewards[::-1], discounts[::-1], strict=True):
        singly = target(reward, discount, singly)
    grouped = target(
        (gamma ** np.arange(width) * rewards).sum(),
        discounts.prod(),
        RewardDecomposition(following, axis).regroup(width).components,
    )
    np.testing.assert_allclose(
        RewardDecomposition(singly, axis).regroup(width).components, grouped, atol=1e-9
    )


@pytest.mark.parametrize("kind", [np.zeros, torch.zeros])
def test_shapes_that_do_not_fit_are_named(kind):
    with pytest.raises(InputError, match=r"reward has shape \(3,\).* batch shape \(2,\)"):
        target(kind(3), 0.5, kind((2, 4)))
    with pytest.raises(InputError, match=r"discount has shape \(2, 1\)"):
        target(kind(2), kind((2, 1)), kind((2, 4)))
    with pytest.raises(InputError, match=r"reward has shape \(1,\)"):  # no silent broadcasting
        target(kind(1), 0.5, kind((2, 4)))
    for shape in ((), (2, 0)):
        with pytest.raises(InputError, match="no component"):
            target(0.0, 0.5, kind(shape))


@pytest.mark.parametrize("following", [np.ones(3, np.int64), torch.ones(3, dtype=torch.int32)])
def test_integer_components_are_refused(following):
    """A reward of 0.5 would be cut to 0, and so would the discount."""
    with pytest.raises(InputError, match=r"int.*floating-point"):
        target(0.5, 0.9, following)
