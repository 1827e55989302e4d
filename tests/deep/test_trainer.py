"""The trainer: what it does, remembers, tells and learns when, and that it goes on to the bit."""

import re
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

from trdlab.deep.replay import ReplayBuffer
from trdlab.deep.settings import TrainSettings
from trdlab.deep.trainer import Trainer
from trdlab.environments import GymEnvironments, NotReproducible, Step
from trdlab.errors import InputError, TrdlabError

END, CUT, LIFE = "the game is over", "cut off", "a life is lost"
STORY = [(3.0, None), (-2.0, LIFE), (0.5, None), (7.0, END), (1.0, None), (5.0, CUT)]
"""Reward and event of each step. Frames: 0 → 1 → 2 → 3 → 4, then 5 → 6 → 7, then 8 …"""


class Scripted:
    """Environments that do what is written, over and over; a frame shows its own number.

    Args:
        stories: of each environment, the reward and the event of every step.
        options: what else environments have, such as `stack`.
    """

    num_actions, first_action, action_names = 2, 0, ("left", "right")
    frame_skip, frames_per_second, time_limit = 1, None, None
    stack, padding = None, "reset"

    def __init__(self, *stories: Sequence[tuple[float, str | None]], **options: Any) -> None:
        vars(self).update(options)
        self.stories, self.num_envs = stories, len(stories)
        self.observation_space = gym.spaces.Box(-1e9, 1e9, (1,), np.float32)
        self.taken: list[list[int]] = []

    def reset(self) -> np.ndarray:
        self.steps, self.frame = 0, np.zeros((self.num_envs, 1), np.float32)
        return self.frame.copy()

    def step(self, actions: np.ndarray) -> Step:
        self.taken.append(actions.tolist())
        rewards, events = zip(
            *(story[self.steps % len(story)] for story in self.stories), strict=True
        )
        is_ = {event: np.array([of == event for of in events]) for event in (END, CUT, LIFE)}
        self.steps += 1
        frames = self.frame + 1
        self.frame = frames + (is_[END] | is_[CUT])[:, None]
        return Step(frames, np.array(rewards), is_[END], is_[CUT], is_[LIFE], self.frame.copy())

    def state_dict(self) -> dict[str, Any]:
        return {"steps": self.steps, "frame": self.frame.copy()}

    def load_state_dict(self, state: Any) -> np.ndarray:
        self.steps, self.frame = state["steps"], state["frame"].copy()
        return self.frame.copy()

    def close(self) -> None:
        pass


def settings(**lines: Any) -> TrainSettings:
    few = {
        "device": "cpu",
        "N": 2,
        "hidden": [8],
        "batch_size": 4,
        "learning_starts": 10,
        "capacity": 1000,
    }
    return TrainSettings("gym", "CartPole-v1").changed(few | lines)


def scripted(*stories: Any, steps: int = 0, options: Any = None, **lines: Any) -> Trainer:
    trainer = Trainer(settings(**lines), Scripted(*(stories or (STORY,)), **(options or {})))
    for _ in range(steps):
        trainer.step()
    return trainer


def windows(memory: ReplayBuffer) -> dict[float, tuple[float, float, float]]:
    """Returns reward, discount and next frame of every window, by the frame it begins at."""
    batch = memory.sample(500, np.random.default_rng(0))
    rows = zip(
        batch.observations[:, 0].tolist(),
        batch.rewards.tolist(),
        batch.discounts.tolist(),
        batch.next_observations[:, 0].tolist(),
        strict=True,
    )
    return {begin: tuple(rest) for begin, *rest in sorted(rows)}  # type: ignore[misc]


def same(a: Any, b: Any) -> bool:
    """Returns whether two states are equal to the bit."""
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, np.ndarray):
        return (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    return type(a) is type(b) and bool(a == b)


@pytest.fixture(autouse=True)
def _one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


# ---- what is remembered --------------------------------------------------------------------------


def test_the_memory_holds_rewards_as_they_are_paid_and_whole_games():
    trainer = scripted(steps=6, w=2, gamma=0.5, learning_starts=100)
    found = windows(trainer.memory)
    assert found.keys() == {0, 1, 2, 3, 5}  # of 6 on, the second step never came
    assert found[0] == (3 - 2 / 2, 0.25, 2)
    assert found[1] == (-2 + 0.5 / 2, 0.25, 3)
    assert found[2][:2] == (0.5 + 7 / 2, 0)
    assert found[3][:2] == (7, 0)
    assert found[5] == (1 + 5 / 2, 0.25, 7)  # cut off: the true last frame is bootstrapped from


def test_the_memory_holds_signs_and_single_lives_if_told_so():
    lines = {"clip_rewards": True, "life_loss_ends": True}
    trainer = scripted(steps=6, w=2, gamma=0.5, learning_starts=100, **lines)
    found = windows(trainer.memory)
    assert found.keys() == {0, 1, 2, 3, 5}
    assert found[0][:2] == (1 - 1 / 2, 0)
    assert found[1][:2] == (-1, 0)
    assert found[2][:2] == (1 + 1 / 2, 0)
    assert found[3][:2] == (1, 0)
    assert found[5] == (1 + 1 / 2, 0.25, 7)


@pytest.mark.parametrize("lives", [False, True])
def test_scores_are_raw_and_of_whole_games_whatever_is_learned(lives):
    trainer = scripted(steps=6, clip_rewards=True, life_loss_ends=lives, learning_starts=100)
    told = trainer.metrics()
    assert (told.episodes, told.score, told.length) == (2, (8.5 + 6) / 2, 3)
    none_yet = scripted(steps=3, learning_starts=100).metrics()
    assert (none_yet.episodes, none_yet.score, none_yet.length) == (0, None, None)


def test_the_score_is_that_of_the_last_hundred_episodes():
    trainer = scripted([(1.0, END)] * 50 + [(2.0, END)] * 75, steps=125, learning_starts=200)
    assert trainer.metrics().score == (25 * 1 + 75 * 2) / 100
    assert trainer.metrics().episodes == 125


@pytest.mark.parametrize("padding", ["reset", "zero"])
@pytest.mark.parametrize("lives", [False, True])
def test_what_is_learned_from_is_what_was_seen_when_acting(padding, lives):
    other = [(1.0, None), (1.0, LIFE), (1.0, CUT), (1.0, END)]
    trainer = scripted(
        STORY,
        other,
        options={"stack": 3, "padding": padding},
        life_loss_ends=lives,
        learning_starts=100,
    )
    seen = []
    for _ in range(12):
        seen += [stack.tobytes() for stack in trainer.stack.observations]
        trainer.step()
    batch = trainer.memory.sample(500, np.random.default_rng(0))
    assert {observation.tobytes() for observation in batch.observations} == set(seen)


# ---- what is done --------------------------------------------------------------------------------


def test_actions_are_random_at_first_and_then_greedy():
    trainer = scripted(steps=500, epsilon_start=0, epsilon_end=0, learning_starts=400)
    taken = [actions[0] for actions in trainer.environments.taken]
    assert 150 < sum(taken[:400]) < 250
    trainer = scripted(STORY, STORY, STORY, epsilon_start=0, epsilon_end=0)
    for _ in range(200):
        frames = torch.from_numpy(trainer.stack.observations)
        with torch.no_grad():
            greedy = trainer.learner.q_network(frames).sum(2).argmax(1).tolist()
        acts_greedily = trainer.agent_steps >= 10
        trainer.step()
        if acts_greedily:
            assert trainer.environments.taken[-1] == greedy


def test_epsilon_is_the_share_of_random_actions():
    half = {"epsilon_start": 0.5, "epsilon_end": 0.5, "learning_starts": 1}
    trainer = scripted(*[STORY] * 100, update_every=10**6, **half)
    with torch.no_grad():
        trainer.learner.q_network.head.bias[:3] += 1000.0  # of action 0
    for _ in range(21):
        trainer.step()
    taken = np.array(trainer.environments.taken[1:])  # [20, 100]
    assert (taken == 0).mean() == pytest.approx(0.75, abs=0.05)


def test_what_was_seen_before_the_first_update_standardises_all_networks():
    trainer = scripted(STORY, STORY, steps=60, standardise=True, averaging=0.9)
    networks = (trainer.learner.q_network, trainer.learner.target_network, trainer.learner.agent)
    middles = {float(network.middle) for network in networks}
    assert len(middles) == 1
    assert 2.0 < middles.pop() < 10.0  # frames show their numbers: 0 to 13 by then
    assert float(scripted(STORY, STORY, steps=60).learner.q_network.middle) == 0.0


@pytest.mark.parametrize("standardise", [False, True])
def test_frames_on_a_device_teach_the_same(monkeypatch, standardise):
    """The CPU stands in for a card: what is drawn there are tensors."""

    def learned() -> torch.Tensor:
        trainer = scripted(STORY, STORY, steps=60, options={"stack": 2}, standardise=standardise)
        return torch.cat([of.flatten() for of in trainer.learner.q_network.state_dict().values()])

    from_arrays = learned()
    monkeypatch.setattr(
        "trdlab.deep.trainer.ReplayBuffer",
        lambda *told, **how: ReplayBuffer(*told, **how | {"device": "cpu"}),
    )
    assert torch.equal(learned(), from_arrays)


def test_nothing_is_held_beyond_the_end_of_an_episode():
    trainer = scripted(STORY, epsilon_hold=1000, learning_starts=10**6)
    for _ in range(12):
        trainer.step()
        _, event = STORY[(trainer.agent_steps - 1) % len(STORY)]
        assert (trainer.exploring.left[0] == 0) == (event in (END, CUT))


@pytest.mark.parametrize("num_envs", [1, 3, 8])
def test_updates_are_made_when_they_are_due_whatever_the_number_of_environments(num_envs):
    trainer = scripted(*[STORY] * num_envs, learning_starts=20, update_every=4)
    for step in range(1, 30):
        trainer.step()
        assert trainer.agent_steps == step * num_envs
        assert trainer.learner.num_updates == max(0, step * num_envs - 20) // 4


def test_the_learning_rate_of_an_update_is_that_of_its_moment():
    trainer = scripted(steps=20, learning_rate=1.0, learning_rate_end=0.0, agent_steps=100)
    rates = {group["lr"] for group in trainer.learner.optimizer.param_groups}
    assert rates == {1 - 18 / 100}  # the last update was due at step 18
    assert trainer.metrics().learning_rate == pytest.approx(1 - 20 / 100)


def test_the_loss_told_is_the_mean_since_the_line_before(monkeypatch):
    trainer, made = scripted(), []
    update = trainer.learner.update
    monkeypatch.setattr(
        trainer.learner, "update", lambda of, **_: made.append(update(of)) or made[-1]
    )
    for _ in range(10):
        trainer.step()
    assert trainer.metrics().loss is None
    assert trainer.metrics().mean_value is None
    for _ in range(20):
        trainer.step()
    told = trainer.metrics()
    assert told.updates == len(made) == 5
    assert told.loss == pytest.approx(np.mean([of.loss for of in made]))
    assert told.mean_value == pytest.approx(np.mean([of.mean_value for of in made]))
    assert trainer.metrics().loss is None


# ---- the same again ------------------------------------------------------------------------------


def on_cart_pole(num_envs: int, seed: int = 3) -> Trainer:
    told = settings(
        w=3,
        seed=seed,
        num_envs=num_envs,
        agent_steps=800,
        capacity=120,  # it wraps
        learning_starts=40,
        target_sync_updates=7,
        learning_rate_end=1e-5,
        epsilon_steps=400,
        epsilon_hold=6,
        double=True,
    )
    return Trainer(told, GymEnvironments("CartPole-v1", num_envs, seed=seed))


def finish(trainer: Trainer) -> dict[str, Any]:
    while not trainer.done:
        trainer.step()
    return trainer.state_dict()


@pytest.mark.parametrize("num_envs", [1, 8])
def test_the_same_seed_is_the_same_run_and_another_is_another(num_envs):
    end = finish(on_cart_pole(num_envs))
    again = finish(on_cart_pole(num_envs))
    assert same(end, again)
    other = finish(on_cart_pole(num_envs, seed=4))
    for part in ("learner", "memory", "scores", "progress", "environments"):
        assert not same(end[part], other[part])


@pytest.mark.parametrize("num_envs", [1, 3])
def test_a_trainer_goes_on_where_another_stood_to_the_bit(num_envs):
    end = finish(on_cart_pole(num_envs))
    trainer = on_cart_pole(num_envs)
    for at in np.random.default_rng(num_envs).choice(800 // num_envs, 12, replace=False):
        while not trainer.done and trainer.agent_steps < at * num_envs:
            trainer.step()
        state, trainer = trainer.state_dict(), on_cart_pole(num_envs)
        assert trainer.load_state_dict(state) is None
        assert same(trainer.state_dict(), state)
    assert same(finish(trainer), end)


class Wayward(Scripted):
    """Environments that cannot be restored."""

    def load_state_dict(self, state: Any) -> np.ndarray:
        raise NotReproducible("It did something else.")


def test_where_environments_cannot_be_restored_new_episodes_begin():
    state = scripted(steps=2, w=2, gamma=0.5, learning_starts=100).state_dict()
    trainer = Trainer(settings(w=2, gamma=0.5, learning_starts=100), Wayward(STORY))
    problem = trainer.load_state_dict(state)
    assert "It did something else." in str(problem)
    assert trainer.agent_steps == 2
    for _ in range(6):
        trainer.step()
    assert trainer.metrics().score == (8.5 + 6) / 2  # not of the episode that was lost
    assert len(trainer.memory) == 8
    batch = trainer.memory.sample(500, np.random.default_rng(0))
    steps = batch.next_observations[:, 0] - batch.observations[:, 0]
    assert set(steps[batch.discounts > 0].tolist()) == {2.0}  # none leads from the old to the new


# ---- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_a_reward_that_is_no_number_is_refused_before_it_is_remembered(number):
    trainer = scripted([(1.0, None)] * 30 + [(number, None)], steps=30)
    state = trainer.state_dict()
    message = f"gave the reward {number} after 30 agent steps. Nothing was learned from it. Correct"
    with pytest.raises(TrdlabError, match=re.escape(message)):
        trainer.step()
    kept = trainer.state_dict()
    assert all(same(kept[part], state[part]) for part in ("memory", "learner", "scores"))


def test_an_observation_that_is_no_number_is_refused():
    trainer = scripted(steps=5)
    trainer.environments.frame[:] = np.nan
    with pytest.raises(TrdlabError, match=r"gave the observation nan after 5 agent steps"):
        trainer.step()


def test_a_loss_that_is_not_finite_stops_the_training():
    trainer = scripted([(1e30, None)], steps=13)
    before = trainer.state_dict()["learner"]
    with pytest.raises(TrdlabError, match=r"The loss is inf at update 1\. Nothing was learned"):
        trainer.step()
    assert same(trainer.state_dict()["learner"], before)


def test_a_state_of_other_settings_is_refused():
    state = scripted(steps=3).state_dict()
    with pytest.raises(InputError, match=r"settings differ: double False there, True here"):
        scripted(double=True).load_state_dict(state)
    with pytest.raises(InputError, match=r"saved replay memory has width = 1, this one has 2"):
        scripted(w=2).load_state_dict(state)


def test_it_begins_with_the_weights_that_it_is_given():
    weights = scripted(seed=9).learner.state_dict()["q_network"]
    trainer = scripted(seed=1)
    trainer.begin_with(weights)
    kept = trainer.learner.state_dict()
    assert same(kept["q_network"], weights)
    assert same(kept["target_network"], weights)
    with pytest.raises(InputError, match=r"'head\.bias' has shape \(6,\), not \(8,\)\. Build"):
        scripted(N=3).begin_with(weights)
