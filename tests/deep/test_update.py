"""Updates: against the exact table, against a hand-written DQN, and to the bit."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from torch import nn

from trdlab.decomposition import TimeAxis
from trdlab.deep.estimator import ActingEstimator, NetworkEstimator
from trdlab.deep.networks import DecompositionNetwork, build_network
from trdlab.deep.settings import UpdateSettings
from trdlab.deep.update import Batch, Learner
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Future
from trdlab.gridworld import Gridworld, load_map
from trdlab.tabular import MDP, exact

AXIS = TimeAxis(0.95, horizon=4)
VECTOR = gym.spaces.Box(-np.inf, np.inf, (3,), np.float32)
ATARI = gym.spaces.Box(0, 255, (4, 84, 84), np.uint8)


def random_batch(seed: int, size: int = 8, num_actions: int = 2) -> Batch:
    rng = np.random.default_rng(seed)
    return Batch(
        observations=rng.normal(size=(size, 3)).astype(np.float32),
        actions=rng.integers(0, num_actions, size),
        rewards=rng.normal(size=size),
        discounts=np.where(rng.random(size) < 0.3, 0, 0.95),
        next_observations=rng.normal(size=(size, 3)).astype(np.float32),
    )


def learner(horizon: int = 4, seed: int = 0, **settings: object) -> Learner:
    network = build_network(VECTOR, 2, TimeAxis(0.95, horizon), seed=seed, hidden=(16,))
    return Learner(network, UpdateSettings(**settings))


def weights(network: nn.Module) -> torch.Tensor:
    return torch.cat([p.detach().flatten() for p in network.parameters()]).clone()


@pytest.fixture(autouse=True)
def _one_thread():
    """Networks this small only wait for a second thread, for long where others compute too."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def every_transition(mdp: MDP) -> Batch:
    """Every action in every state once, where nothing is left to chance."""
    return Batch(
        observations=np.repeat(np.arange(mdp.num_states), mdp.num_actions),
        actions=np.tile(np.arange(mdp.num_actions), mdp.num_states),
        rewards=mdp.rewards,
        discounts=AXIS.gamma * ~mdp.terminated,
        next_observations=mdp.next_states,
    )


@pytest.mark.parametrize("reduction", ["sum", "mean"])
def test_the_whole_drone_is_learned_exactly(reduction):
    """Every transition of the drone in one batch: the network reaches the exact table.

    It does where it can settle between two copies of the target network; with 50 updates between
    them, or with double DQN, whose online network may choose another action at every update, the
    greedy actions keep flipping, and whole rewards change places.
    """
    mdp = Gridworld(load_map("drone")).mdp
    batch = every_transition(mdp)
    network = build_network(gym.spaces.Discrete(mdp.num_states), mdp.num_actions, AXIS)
    trained = Learner(
        network, UpdateSettings(learning_rate=1e-3, target_sync_updates=200, reduction=reduction)
    )
    for _ in range(2000):
        trained.update(batch)
    learned = NetworkEstimator(network, AXIS, Future("the greedy policy of the network"))
    truth = exact(mdp, AXIS).decomposition
    error = np.abs(learned.decompose(np.arange(mdp.num_states)).components - truth.components)
    assert error.max() <= 0.02, error.max(axis=(0, 1))


def test_the_future_of_a_policy_head_is_learned_exactly():
    """A head that chooses evenly, in the drone: the components are those of that policy."""
    mdp = Gridworld(load_map("drone")).mdp
    batch = every_transition(mdp)
    space = gym.spaces.Discrete(mdp.num_states)
    network = build_network(space, mdp.num_actions, AXIS, policy_head=True)
    for weight in network.policy_head.parameters():
        nn.init.zeros_(weight)
    settings = UpdateSettings(learning_rate=1e-3, target_sync_updates=20, draw=True)
    trained = Learner(network, settings)
    for _ in range(2000):
        trained.update(batch)
    learned = ActingEstimator(network, AXIS, Future("the policy head"), draw=True)
    evenly = np.full(mdp.shape, 1.0 / mdp.num_actions)
    truth = exact(mdp, AXIS, policy=evenly).decomposition
    seen = np.arange(mdp.num_states)
    error = np.abs(learned.decompose(seen).components - truth.components)
    assert error.max() <= 0.02, error.max(axis=(0, 1))
    likely, _ = learned.act(seen, None, np.ones(len(seen), dtype=np.bool_))
    np.testing.assert_array_equal(likely, evenly)


def test_a_teacher_moves_the_components_unless_there_is_a_policy_head():
    """In the first update the head of components has the same gradient with and without it."""
    batch, taught = random_batch(0), np.tile(np.float32([0.9, 0.1]), (8, 1))

    def after(policy_head: bool, distillation: float) -> DecompositionNetwork:
        network = build_network(VECTOR, 2, TimeAxis(0.95, 4), hidden=(16,), policy_head=policy_head)
        told = Learner(network).update(batch, taught=taught, distillation=distillation)
        assert told.distance > 0
        return network

    for policy_head in (False, True):
        alone, both = after(policy_head, 0.0), after(policy_head, 50.0)
        assert torch.equal(alone.head.weight, both.head.weight) == policy_head
        assert not torch.equal(alone.body[0].weight, both.body[0].weight)


def test_the_teacher_is_come_near_to():
    batch, taught = random_batch(0), np.tile(np.float32([0.9, 0.1]), (8, 1))
    for policy_head in (False, True):
        network = build_network(VECTOR, 2, TimeAxis(0.95, 4), hidden=(16,), policy_head=policy_head)
        trained = Learner(network, UpdateSettings(learning_rate=1e-2))
        told = [trained.update(batch, taught=taught, distillation=1e3) for _ in range(200)]
        assert told[-1].distance < 0.01 < told[0].distance
        probabilities = network.logits(torch.as_tensor(batch.observations)).softmax(dim=1)
        np.testing.assert_allclose(probabilities.detach(), taught, atol=0.05)


def test_a_learner_of_before_there_were_teachers_goes_on():
    state = learner().state_dict()
    before = {k: v for k, v in state["settings"].items() if k not in ("temperature", "draw")}
    learner().load_state_dict(state | {"settings": before})
    with pytest.raises(InputError, match=r"temperature 1\.0 there, 2\.0 here"):
        learner(temperature=2.0).load_state_dict(state | {"settings": before})


def test_without_explicit_components_updates_are_those_of_dqn():
    """Ten updates with N = 0, and a DQN written down in full beside it."""
    ours = learner(horizon=0, learning_rate=1e-2, target_sync_updates=3)
    online, target = (
        nn.Sequential(nn.Linear(3, 16), nn.ReLU(), nn.Linear(16, 2)) for _ in range(2)
    )
    own = [weight.detach() for weight in ours.q_network.parameters()]
    start = dict(zip(online.state_dict(), own, strict=True))
    online.load_state_dict(start)
    target.load_state_dict(start)
    adam = torch.optim.Adam(online.parameters(), lr=1e-2)
    for number in range(1, 11):
        batch = random_batch(number)
        observations, actions, rewards, discounts, following = map(torch.as_tensor, batch)
        with torch.no_grad():
            goal = rewards.float() + discounts.float() * target(following).max(1).values
        value = online(observations).gather(1, actions[:, None])[:, 0]
        loss = nn.functional.mse_loss(value, goal)
        adam.zero_grad()
        loss.backward()
        adam.step()
        if number % 3 == 0:
            target.load_state_dict(online.state_dict())
        metrics = ours.update(batch)
        assert metrics.loss == pytest.approx(loss.item(), abs=1e-6)
        assert metrics.mean_value == pytest.approx(value.mean().item(), abs=1e-6)
    torch.testing.assert_close(weights(ours.q_network), weights(online), atol=1e-6, rtol=0)


@pytest.mark.parametrize("settings", [{}, {"double": True}, {"precision": "bfloat16"}])
def test_the_same_seed_learns_the_same_to_the_bit(settings):
    runs = [learner(seed=seed, **settings) for seed in (3, 3, 4)]
    for run in runs:
        for seed in range(5):
            run.update(random_batch(seed))
    one, same, other = (weights(run.q_network) for run in runs)
    assert torch.equal(one, same)
    assert not torch.equal(one, other)


def test_longer_gradients_are_cut_and_shorter_ones_left():
    batch = random_batch(0)
    plain, left, cut = learner(), learner(max_grad_norm=1e6), learner(max_grad_norm=0.5)
    for run in (plain, left, cut):
        run.update(batch)
    flat = [
        torch.cat([p.grad.flatten() for p in run.q_network.parameters()])
        for run in (plain, left, cut)
    ]
    assert flat[0].norm() > 0.5
    assert torch.equal(flat[0], flat[1])
    torch.testing.assert_close(flat[2], flat[0] * 0.5 / flat[0].norm())


def test_the_target_network_follows_every_few_updates():
    run = learner(target_sync_updates=3)
    start = weights(run.target_network)
    for number in range(1, 7):
        run.update(random_batch(number))
        synced = torch.equal(weights(run.q_network), weights(run.target_network))
        assert synced == (number % 3 == 0)
        assert torch.equal(weights(run.target_network), start) == (number < 3)
    assert run.num_updates == 6


def test_a_loss_that_is_not_finite_changes_nothing():
    run = learner()
    run.update(random_batch(0))
    before = weights(run.q_network)
    broken = random_batch(1)
    broken.rewards[2] = np.nan
    with pytest.raises(TrdlabError, match=r"loss is nan at update 2\b"):
        run.update(broken)
    assert torch.equal(weights(run.q_network), before)
    assert run.num_updates == 1


def test_the_agent_is_the_mean_of_the_networks_so_far():
    run, weighed = learner(averaging=0.15), [0.1, 0.15, 0.15]  # 1/10, then no more than 0.15
    mean = weights(run.q_network)
    assert torch.equal(weights(run.agent), mean)
    for seed, past in enumerate(weighed):
        run.update(random_batch(seed))
        mean = past * mean + (1 - past) * weights(run.q_network)
        torch.testing.assert_close(weights(run.agent), mean)
    assert not any(weight.requires_grad for weight in run.agent.parameters())


def dots(count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Bright screens `[B, 1, 36, 36]` with one dark dot, and whether that is to the right."""
    images, right = np.full((count, 1, 36, 36), 200, dtype=np.uint8), rng.integers(0, 2, count)
    images[np.arange(count), 0, rng.integers(4, 32, count), np.where(right, 28, 8)] = 100
    return images, right


@pytest.mark.parametrize("standardised", [False, True])
def test_what_moves_on_a_bright_screen_is_learned_once_the_rest_is_taken_away(standardised):
    """A teacher says with 90 % on which side the dot is; who knows nothing is 0.37 away from it."""
    space, rng = gym.spaces.Box(0, 255, (1, 36, 36), np.uint8), np.random.default_rng(0)
    run = Learner(
        build_network(space, 2, TimeAxis(0.9, 1), policy_head=True),
        UpdateSettings(learning_rate=1e-3),
    )
    if standardised:
        run.standardise(dots(200, rng)[0])
    for _ in range(140):
        images, right = dots(32, rng)
        batch = Batch(images, right, np.zeros(32), np.zeros(32), images)
        taught = np.eye(2, dtype=np.float32)[right] * 0.8 + 0.1
        apart = run.update(batch, taught=taught, distillation=1.0).distance
    assert apart < 0.05 if standardised else apart > 0.3


@pytest.mark.parametrize("averaging", [0.0, 0.9])
def test_a_resumed_learner_is_the_uninterrupted_one_to_the_bit(averaging):
    told = {"target_sync_updates": 4, "averaging": averaging}
    whole, first = learner(**told), learner(**told)
    for seed in range(6):
        whole.update(random_batch(seed))
        first.update(random_batch(seed))
    second = learner(seed=9, **told)
    second.load_state_dict(first.state_dict())
    for seed in range(6, 12):
        whole.update(random_batch(seed))
        second.update(random_batch(seed))
    assert second.num_updates == 12
    for of in ("q_network", "target_network", "agent"):
        assert torch.equal(weights(getattr(whole, of)), weights(getattr(second, of)))
    apart = not torch.equal(weights(second.agent), weights(second.q_network))
    assert apart == bool(averaging)


def test_other_settings_are_not_resumed():
    state = learner(target_sync_updates=4).state_dict()
    with pytest.raises(InputError, match=r"target_sync_updates 4 there, 5 here"):
        learner(target_sync_updates=5).load_state_dict(state)


@pytest.mark.parametrize("double", [False, True])
def test_bfloat16_gives_nearly_the_same_gradients(double):
    """Autocast caches cast weights: those of the target's side must not cut off the gradient."""
    gradients = []
    for precision in ("float32", "bfloat16"):
        network = build_network(ATARI, 2, AXIS)
        run = Learner(network, UpdateSettings(double=double, precision=precision))
        rng = np.random.default_rng(0)
        images = rng.integers(0, 256, (2, 4, *ATARI.shape), dtype=np.uint8)
        run.update(Batch(images[0], [0, 1, 1, 0], np.ones(4), np.full(4, 0.9), images[1]))
        gradients.append(torch.cat([p.grad.flatten() for p in network.parameters()]))
        assert all(p.dtype == torch.float32 for p in network.parameters())
    similarity = nn.functional.cosine_similarity(*gradients, dim=0)
    assert similarity > 0.99
    assert (gradients[1].norm() / gradients[0].norm()).item() == pytest.approx(1, rel=0.05)


def test_read_only_arrays_and_tensors_are_taken():
    frozen = random_batch(0)
    for array in frozen:
        array.setflags(write=False)
    from_arrays, from_tensors = learner(), learner()
    from_arrays.update(frozen)
    from_tensors.update(Batch(*map(torch.as_tensor, random_batch(0))))
    assert torch.equal(weights(from_arrays.q_network), weights(from_tensors.q_network))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"actions": np.zeros(8)}, r"actions have type float64"),
        ({"actions": np.zeros(7, np.int64)}, r"actions \(7,\)"),
        ({"rewards": np.zeros((8, 1))}, r"reward has shape \(8, 1\)"),
        ({"observations": np.zeros((8, 4), np.float32)}, r"shape \(8, 4\).*\[B, 3\]"),
    ],
)
def test_a_batch_that_does_not_fit_is_refused(changed, message):
    with pytest.raises(InputError, match=message):
        learner().update(random_batch(0)._replace(**changed))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"learning_rate": 0.0}, r"learning rate is 0\.0"),
        ({"learning_rate": float("nan")}, r"learning rate is nan"),
        ({"target_sync_updates": 0}, r"target_sync_updates` is 0"),
        ({"reduction": "max"}, r"reduction is 'max'"),
        ({"precision": "bfloat"}, r"precision is 'bfloat'\. Use 'float32' or"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        UpdateSettings(**settings)
