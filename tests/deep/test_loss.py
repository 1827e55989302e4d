"""Target and loss: by hand, against loops in plain Python, and for N = 0 against DQN."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import nn

from trdlab.deep.loss import (
    acted,
    distillation_loss,
    finite_loss,
    greedy_actions,
    td_loss,
    trd_target,
)
from trdlab.errors import InputError, TrdlabError


def rand(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


# Two moments, two actions, N = 2. Sums: 6 against 7, and 9 against 3.
FOLLOWING = torch.tensor([[[1.0, 2, 3], [0, 0, 7]], [[8, 1, 0], [1, 1, 1]]])
REWARD, DISCOUNT = torch.tensor([1.0, -1.0]), torch.tensor([0.5, 0.25])


def test_the_target_by_hand():
    assert trd_target(REWARD, DISCOUNT, FOLLOWING).tolist() == [[1, 0, 3.5], [-1, 2, 0.25]]


def test_after_the_end_nothing_follows():
    assert trd_target(REWARD, torch.zeros(2), FOLLOWING).tolist() == [[1, 0, 0], [-1, 0, 0]]


def test_double_dqn_chooses_with_one_network_and_reads_the_other():
    chooser = torch.tensor([[[9.0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 9]]])
    target = trd_target(REWARD, DISCOUNT, FOLLOWING, selected_by=chooser)
    assert target.tolist() == [[1, 0.5, 2.5], [-1, 0.25, 0.5]]


def test_the_target_of_a_given_policy_by_hand():
    policy = torch.tensor([[0.5, 0.5], [0.0, 1.0]])
    target = trd_target(REWARD, DISCOUNT, FOLLOWING, policy=policy)
    assert target.tolist() == [[1, 0.25, 3], [-1, 0.25, 0.5]]


def test_a_policy_head_draws_or_takes_the_likeliest():
    logits = torch.log(torch.tensor([[1.0, 3.0], [2.0, 2.0]]))
    torch.testing.assert_close(acted(logits, draw=True), torch.tensor([[0.25, 0.75], [0.5, 0.5]]))
    assert acted(logits, draw=False).tolist() == [[0, 1], [1, 0]]  # of equals the first


# ---- distillation --------------------------------------------------------------------------------


def test_the_distance_from_a_teacher_by_hand():
    logits = torch.log(torch.tensor([[0.5, 0.5], [0.25, 0.75]]))
    taught = torch.tensor([[1.0, 0.0], [0.5, 0.5]])
    one, other = np.log(2), 0.5 * np.log(0.5 / 0.25) + 0.5 * np.log(0.5 / 0.75)
    assert distillation_loss(logits, taught).item() == pytest.approx((one + other) / 2)


def test_where_student_and_teacher_agree_there_is_neither_distance_nor_gradient():
    taught = torch.tensor([[0.25, 0.75]])
    logits = (taught.log() + 3.0).requires_grad_()  # logits have no level
    distance = distillation_loss(logits, taught)
    distance.backward()
    assert abs(distance.item()) < 1e-7
    assert logits.grad.abs().max() < 1e-7


def test_going_down_the_gradient_does_more_often_what_the_teacher_does():
    logits = torch.zeros(1, 3, requires_grad=True)
    distillation_loss(logits, torch.tensor([[0.7, 0.2, 0.1]])).backward()
    np.testing.assert_allclose(logits.grad, [[1 / 3 - 0.7, 1 / 3 - 0.2, 1 / 3 - 0.1]], atol=1e-6)


def test_of_tied_actions_the_first_is_taken():
    assert greedy_actions(torch.tensor([[[0.0, 1], [2, -1], [1, 0]]])).tolist() == [0]


def test_the_loss_by_hand():
    components = torch.tensor([[[1.0, 2, 3], [0, 0, 0]], [[0, 0, 0], [1, 1, 1]]])
    target = torch.tensor([[1.0, 0, 0], [0, 1, 1]])
    actions = torch.tensor([0, 1])
    assert td_loss(components, actions, target) == (0 + 4 + 9 + 1) / 2
    assert td_loss(components, actions, target, "mean") == pytest.approx((0 + 4 + 9 + 1) / 6)


@given(
    batch=st.integers(1, 4),
    num_actions=st.integers(1, 4),
    horizon=st.integers(0, 4),
    double=st.booleans(),
    seed=st.integers(0, 2**16),
)
def test_loops_in_plain_python_agree(batch, num_actions, horizon, double, seed):
    shape = (batch, num_actions, horizon + 1)
    components, following, online = (rand(*shape, seed=seed + i) for i in range(3))
    reward, discount = rand(batch, seed=seed + 3), rand(batch, seed=seed + 4).abs()
    rng = np.random.default_rng(seed)
    discount[torch.from_numpy(rng.random(batch) < 0.3)] = 0.0
    actions = torch.from_numpy(rng.integers(0, num_actions, batch))

    total = 0.0
    for b in range(batch):
        chooser = (online if double else following)[b].tolist()
        best = max(range(num_actions), key=lambda a, rows=chooser: sum(rows[a]))
        n, r, d = following[b, best].tolist(), reward[b].item(), discount[b].item()
        if horizon == 0:
            expected = [r + d * n[0]]
        else:
            expected = [r, *(d * x for x in n[:-2]), d * (n[-2] + n[-1])]
        taken = components[b, actions[b]].tolist()
        total += sum((x - y) ** 2 for x, y in zip(taken, expected, strict=True))

    target = trd_target(reward, discount, following, selected_by=online if double else None)
    assert td_loss(components, actions, target).item() == pytest.approx(total / batch)
    mean = td_loss(components, actions, target, "mean").item()
    assert mean == pytest.approx(total / batch / (horizon + 1))


def twice_smooth_l1(value: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    return 2 * nn.functional.smooth_l1_loss(value, target)


@pytest.mark.parametrize(
    ("loss_name", "scalar"), [("squared", nn.functional.mse_loss), ("huber", twice_smooth_l1)]
)
def test_without_explicit_components_it_is_dqn(loss_name, scalar):
    """Loss and gradients of a network with N = 0 are those of a scalar DQN, written by hand."""
    torch.manual_seed(0)
    ours, target_network = nn.Linear(5, 3), nn.Linear(5, 3)
    theirs = nn.Linear(5, 3)
    theirs.load_state_dict(ours.state_dict())
    observations, following, rewards = torch.randn(8, 5), torch.randn(8, 5), 3 * torch.randn(8)
    actions, terminated = torch.randint(0, 3, (8,)), torch.rand(8) < 0.3

    discount = 0.99 * (1 - terminated.float())
    target = trd_target(rewards, discount, target_network(following)[..., None])
    loss = td_loss(ours(observations)[..., None], actions, target, loss=loss_name)
    loss.backward()

    with torch.no_grad():
        next_value = target_network(following).max(1).values
        scalar_target = rewards + 0.99 * (1 - terminated.float()) * next_value
    value = theirs(observations).gather(1, actions[:, None]).squeeze(1)
    scalar_loss = scalar(value, scalar_target)
    assert ((value - scalar_target).abs() > 1).any()
    assert ((value - scalar_target).abs() < 1).any()
    scalar_loss.backward()

    assert loss.item() == pytest.approx(scalar_loss.item(), abs=1e-6)
    for mine, other in zip(ours.parameters(), theirs.parameters(), strict=True):
        torch.testing.assert_close(mine.grad, other.grad, atol=1e-6, rtol=0)


@pytest.mark.parametrize("reduction", ["sum", "mean"])
def test_huber_minds_the_length_of_the_errors_and_not_each_of_them(reduction):
    """A reward of 12 comes at one of four steps, each as likely: it is 3 on average at each.

    The median of each component is 0, and Huber's error of each would be least at 1/3.
    """
    components, rewards = torch.zeros(1, 1, 4, requires_grad=True), 12 * torch.eye(4)
    optimiser = torch.optim.SGD([components], lr=0.3)
    for _ in range(1000):
        optimiser.zero_grad()
        everyone = components.expand(4, 1, 4)
        loss = td_loss(everyone, torch.zeros(4, dtype=torch.int64), rewards, reduction, "huber")
        loss.backward()
        optimiser.step()
    torch.testing.assert_close(components.detach()[0, 0], torch.full((4,), 3.0), atol=1e-3, rtol=0)


def test_huber_without_an_error_has_no_gradient():
    components = torch.zeros(1, 1, 3, requires_grad=True)
    td_loss(components, torch.tensor([0]), torch.zeros(1, 3), loss="huber").backward()
    assert components.grad.tolist() == [[[0.0, 0.0, 0.0]]]


def test_no_gradient_flows_into_the_target():
    components = rand(2, 3, 4).requires_grad_()
    following = rand(2, 3, 4, seed=1).requires_grad_()
    target = trd_target(torch.ones(2), torch.ones(2), following)
    td_loss(components, torch.tensor([0, 2]), target).backward()
    assert following.grad is None
    learned = components.grad.abs().sum(-1) > 0
    assert learned.tolist() == [[True, False, False], [False, False, True]]
    live = components[:, 0] * 2  # even if somebody forgot: a target is taken as given
    (gradient,) = torch.autograd.grad(
        td_loss(components.detach().requires_grad_(), torch.tensor([0, 2]), live),
        components,
        allow_unused=True,
    )
    assert gradient is None


@pytest.mark.parametrize("kind", [torch.float32, torch.bool])
def test_actions_that_are_no_whole_numbers_are_refused(kind):
    with pytest.raises(InputError, match=r"actions have type (float32|bool)\. Give whole numbers"):
        td_loss(torch.zeros(2, 3, 4), torch.zeros(2, dtype=kind), torch.zeros(2, 4))


def test_actions_of_any_integer_type_are_taken():
    for kind in (torch.uint8, torch.int32, torch.int64):
        assert td_loss(torch.ones(1, 2, 1), torch.ones(1, dtype=kind), torch.zeros(1, 1)) == 1


def test_shapes_that_do_not_fit_are_named():
    components, actions = torch.zeros(2, 3, 4), torch.zeros(2, dtype=torch.int64)
    with pytest.raises(InputError, match=r"actions \(3,\)\. Give \[B, A, N\+1\] and \[B\]"):
        td_loss(components, torch.zeros(3, dtype=torch.int64), torch.zeros(2, 4))
    with pytest.raises(InputError, match=r"components have shape \(2, 4\)"):
        td_loss(torch.zeros(2, 4), actions, torch.zeros(2, 4))
    with pytest.raises(InputError, match=r"target has shape \(2,\).*\(2, 4\)"):
        td_loss(components, actions, torch.zeros(2))  # no silent broadcasting
    with pytest.raises(InputError, match=r"next_components has shape \(2, 4\)"):
        trd_target(REWARD, DISCOUNT, torch.zeros(2, 4))
    with pytest.raises(InputError, match=r"selects the next action \(2, 2, 4\)"):
        trd_target(REWARD, DISCOUNT, components, selected_by=torch.zeros(2, 2, 4))
    with pytest.raises(InputError, match=r"reward has shape \(2, 1\)"):
        trd_target(REWARD[:, None], DISCOUNT, components)
    with pytest.raises(InputError, match=r"'median'.*'sum' or 'mean'"):
        td_loss(components, actions, torch.zeros(2, 4), "median")
    with pytest.raises(InputError, match=r"'l1'.*'squared' or 'huber'"):
        td_loss(components, actions, torch.zeros(2, 4), loss="l1")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_loss_that_is_not_finite_is_refused(value):
    with pytest.raises(TrdlabError, match=rf"loss is {value} at update 7.*learning rate"):
        finite_loss(torch.tensor(value), 7)
    assert finite_loss(torch.tensor(2.0, requires_grad=True), 7) == 2.0
