"""A frozen policy's decomposition, fitted to what it did, against answers that are exact."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import trdlab
from tests.shared.doors import Doors
from trdlab.bellman import target as law
from trdlab.deep.channels import Channel, groups_of
from trdlab.deep.experience import Ahead, Experience, gather
from trdlab.deep.fit import Fit
from trdlab.deep.fit_settings import FitSettings
from trdlab.environments import GymEnvironments
from trdlab.environments.outcomes import Outcomes
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Future
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Memoryless
from trdlab.tabular import MDP, exact
from trdlab.tabular.episodes import ModelEnvironments
from trdlab.tabular.uncertainty import spread
from trdlab.time_axis import TimeAxis

FUTURE = Future("the agent's own policy")
FAR = 1_000


def experience(rewards: list[float], until: list[int], *, ended: bool = True) -> Experience:
    """One episode of the numbered states 0, 1, …; the last row is what was seen after it."""
    count = len(rewards) + 1
    ends = np.zeros(count, dtype=np.bool_)
    ends[count - 2] = ended
    return Experience(
        frames=np.arange(count),
        probabilities=np.full((count, 2), 0.5),
        actions=np.zeros(count, dtype=np.int64),
        forced=np.zeros(count, dtype=np.bool_),
        rewards=np.array([*rewards, 0.0]),
        outcomes=np.zeros((count, 0)),
        ends=ends,
        until=np.array([*until, FAR]),
        last=np.full(count, count - 1),
    )


def ahead_of(of: Experience, rows: list[int], axis: TimeAxis) -> Ahead:
    """What followed some rows in a single channel, the reward."""
    return of.ahead(np.array(rows), axis, groups_of(of, (Channel("reward"),), (), axis))


# ---- what followed a step ------------------------------------------------------------------------


def test_what_came_is_known_as_far_as_the_policy_acted():
    axis = TimeAxis(0.5, 3)
    of = experience([1.0, 2.0, 4.0, 8.0], until=[2, 2, FAR, FAR])  # at step 2 it was forced
    ahead = ahead_of(of, [0, 1, 2], axis)
    assert ahead.came[:, 0].tolist() == [[1.0, 1.0, 0.0], [2.0, 0.0, 0.0], [4.0, 4.0, 0.0]]
    assert ahead.span.tolist() == [2, 1, 3]
    assert ahead.over.tolist() == [False, False, True]
    assert ahead.follows.tolist() == [2, 2, 4]
    known = [[True, True, False], [True, False, False], [True, True, True]]
    assert ahead.known(axis).tolist() == known


def test_what_would_have_been_forced_after_the_end_is_not_known_either():
    """Else episodes that ended would count, and those that went on until then would not."""
    axis = TimeAxis(0.5, 3)
    ahead = ahead_of(experience([1.0], until=[2]), [0], axis)
    assert ahead.over.tolist() == [True]
    assert ahead.known(axis).tolist() == [[True, True, False]]
    nothing = ahead.target(axis, np.full((1, 1, 4), 7.0))
    assert nothing.tolist() == [[[1.0, 0.0, 0.0, 0.0]]], "nothing is to come after an end"


def test_a_cut_episode_goes_on_in_what_is_expected():
    axis = TimeAxis(0.5, 2)
    ahead = ahead_of(experience([1.0], until=[FAR], ended=False), [0], axis)
    assert (ahead.span[0], ahead.follows[0], ahead.over[0]) == (1, 1, False)
    assert ahead.target(axis, np.array([[[2.0, 4.0, 6.0]]])).tolist() == [[[1.0, 1.0, 5.0]]]


def test_groups_are_known_as_a_whole_or_not():
    axis = TimeAxis(0.5, 2, 2)
    of = experience([1.0, 2.0, 4.0, 8.0, 16.0], until=[3, 3, FAR, FAR, FAR])
    ahead = ahead_of(of, [0, 2], axis)
    assert ahead.span.tolist() == [1, 2]
    assert ahead.came[:, 0].tolist() == [[2.0, 0.0], [8.0, 4.0]]
    assert ahead.known(axis).tolist() == [[True, False], [True, True]]


def test_without_components_it_is_the_target_of_a_value():
    axis = TimeAxis(0.5, 0)
    ahead = ahead_of(experience([1.0, 2.0], until=[FAR, FAR]), [0, 1], axis)
    assert ahead.target(axis, np.full((2, 1, 1), 8.0)).tolist() == [[[5.0]], [[2.0]]]


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 5), st.integers(1, 5), st.floats(0.1, 0.99), st.integers(0, 2**32))
def test_a_target_is_the_law_applied_as_often_as_rewards_are_known(horizon, span, gamma, seed):
    axis, rng = TimeAxis(gamma, horizon), np.random.default_rng(seed)
    span = min(span, horizon)
    paid, following = rng.normal(size=span), rng.normal(size=(1, horizon + 1))
    by_law = following
    for reward in paid[::-1]:
        by_law = law(np.array([reward]), np.array([gamma]), by_law)
    rewards = np.zeros((1, horizon))
    rewards[0, :span] = paid * gamma ** np.arange(span)
    one = np.array([span])
    ahead = Ahead(rewards[:, None], one, np.array([False]), one, one)
    told = ahead.target(axis, following[:, None])[:, 0]
    np.testing.assert_allclose(told, by_law, rtol=1e-9, atol=1e-12)


# ---- playing -------------------------------------------------------------------------------------


def walk() -> MDP:
    """Four places in a row: on to the next or back; the last pays 1 and ends, the first costs."""
    return MDP.from_transitions(
        [
            [[(1.0, 0, -0.2, False)], [(0.8, 1, 0.0, False), (0.2, 0, 0.0, False)]],
            [[(1.0, 0, 0.0, False)], [(0.8, 2, 0.0, False), (0.2, 1, 0.5, False)]],
            [[(1.0, 1, 0.0, False)], [(0.7, 3, 1.0, True), (0.3, 0, 0.0, False)]],
            [[(1.0, 3, 0.0, True)], [(1.0, 3, 0.0, True)]],
        ]
    )


POLICY = np.array([[0.3, 0.7], [0.0, 1.0], [0.5, 0.5], [1.0, 0.0]])  # from place 1 never back


def played(*, steps: int = 40_000, share: float = 0.2, pause: int = 0, seed: int = 0) -> Experience:
    starts = np.array([0.4, 0.3, 0.3, 0.0])

    def make(count: int, own: int) -> ModelEnvironments:
        return ModelEnvironments(walk(), count, seed=own, starts=starts, time_limit=200)

    policy = Memoryless(lambda states: POLICY[states])
    how = {"steps": steps, "share": share, "pause": pause, "num_envs": 500, "seed": seed}
    return gather(make, policy, FUTURE, **how)  # type: ignore[arg-type]


def test_actions_are_forced_as_often_as_asked_for_and_cover_what_the_policy_never_does():
    of = played(steps=20_000)
    at_one = of.steps[of.frames[of.steps] == 1]
    back = (of.actions[at_one] == 0).mean()
    assert of.forced[at_one][of.actions[at_one] == 0].all(), "the policy never goes back"
    assert 0.08 < back < 0.12, "a fifth is forced, half of that goes back"
    assert (of.last[of.steps] > of.steps).all()
    assert of.ends[of.last - 1].mean() > 0.99, "nearly all came to an end"
    paused = played(steps=20_000, share=1.0, pause=9)
    gaps = np.minimum(paused.until, paused.last)[paused.steps] - paused.steps
    assert gaps.max() <= 10, "each tenth action is forced"


def test_the_same_seed_plays_the_same():
    one, other = played(steps=2_000), played(steps=2_000)
    assert one.actions.tobytes() == other.actions.tobytes()
    assert one.until.tobytes() == other.until.tobytes()


@pytest.mark.parametrize(("steps", "share"), [(0, 0.1), (10, 1.5)])
def test_what_cannot_be_played_is_refused(steps: int, share: float):
    with pytest.raises(InputError, match=r"Ask for at least 1 step, and a share from 0 to 1\."):
        played(steps=steps, share=share)


# ---- learning ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "width"), [("mixed", 1), ("mixed", 2), ("regression", 1), ("td", 1)]
)
def test_each_method_finds_the_exact_components_of_actions_it_never_takes_too(method, width):
    axis = TimeAxis(0.9, 4, width)
    of = played(steps=80_000, pause=axis.num_steps if method == "regression" else 0)
    how = FitSettings(method, learning_rate=0.01, batch_size=512, most_updates=2_000)
    fit = Fit(of, gym.spaces.Discrete(4), axis, how)
    while not fit.done:
        fit.learn()
    told = fit.estimator(FUTURE).decompose(np.arange(3)).components
    true = exact(walk(), axis, policy=POLICY)
    largest = np.abs(true.solution.q_values).max()
    np.testing.assert_allclose(told, true.decomposition.components[:3], atol=0.03 * largest)
    outlook, known = fit.estimator(FUTURE).outlook(np.arange(3)), spread(true)
    assert outlook is not None
    np.testing.assert_allclose(outlook.survival, known.survival[:3], atol=0.03)
    np.testing.assert_allclose(outlook.variance, known.variance[:3, :, :-1], atol=0.03 * largest)


def test_parts_add_up_and_each_is_what_the_exact_table_of_it_says():
    world = Gridworld(load_map("ledge").with_slip(0.2))
    axis, mdp = TimeAxis(0.9, 4), world.mdp
    rng = np.random.default_rng(0)
    policy = rng.dirichlet(np.ones(4), mdp.num_states)  # [S, A]
    alive = ~mdp.terminal_states
    of = gather(
        lambda count, own: ModelEnvironments(
            mdp, count, seed=own, starts=alive / alive.sum(), time_limit=100, parts=world.parts
        ),
        Memoryless(lambda states: policy[states]),
        FUTURE,
        steps=300_000,
        share=0.2,
        num_envs=500,
        outcomes=Outcomes(
            {name: f"info.parts.{name}" for name in world.parts}
            | {"fell": lambda step: step.info["parts"]["hazard"] < 0.0}
        ),
    )
    how = FitSettings(batch_size=512, most_updates=3_000)
    names, parts = (*world.parts, "fell"), tuple(world.parts)
    fit = Fit(of, gym.spaces.Discrete(mdp.num_states), axis, how, names=names, parts=parts)
    while not fit.done:
        fit.learn()
    estimator, states = fit.estimator(FUTURE), np.flatnonzero(alive)
    outlook = estimator.outlook(states)
    assert outlook is not None
    told = estimator.decompose(states).components
    np.testing.assert_allclose(sum(outlook.parts.values()), told, rtol=1e-6, atol=1e-6)
    scale = 0.03 * np.abs(exact(mdp, axis, policy=policy).solution.q_values).max()
    for name, paid in world.parts.items():
        true = exact(mdp.with_rewards(paid), axis, policy=policy).decomposition.components[alive]
        np.testing.assert_allclose(outlook.parts[name], true, atol=scale)
    fell = exact(mdp.with_rewards((world.parts["hazard"] < 0.0) * 1.0), axis, policy=policy)
    chances = fell.decomposition.components[alive][..., :-1] / axis.discounts[:-1]
    np.testing.assert_allclose(outlook.events["fell"], chances, atol=0.03)


def test_what_hardly_ever_comes_is_not_blown_up():
    """Else the few steps before it teach so much at once that all else is forgotten."""
    rewards = [1.0, 0.0] * 500
    of = experience(rewards, [FAR] * 1000)
    rare = np.zeros((1001, 1))
    rare[700] = 1.0
    twice = replace(of, outcomes=rare, last=np.repeat([499, 1000], [500, 501]))
    fit = Fit(twice, gym.spaces.Discrete(1001), TimeAxis(0.9, 3), names=("crash",))
    at = [channel.name for channel in fit.channels].index("crash")
    np.testing.assert_allclose(fit.scale[at, :3], 0.05 * 0.9 ** np.arange(3), rtol=1e-6)


def test_a_fit_that_was_stopped_goes_on_to_the_bit():
    of, how = played(steps=3_000), FitSettings(most_updates=600, batch_size=64)

    def begun() -> Fit:
        return Fit(of, gym.spaces.Discrete(4), TimeAxis(0.9, 3), how)

    whole, first, second = begun(), begun(), begun()
    while not whole.done:
        whole.learn()
    first.learn()
    second.load_state_dict(first.state_dict())
    while not second.done:
        second.learn()
    assert (second.num_updates, second.best) == (whole.num_updates, whole.best)
    for one, other in zip(whole.network.parameters(), second.network.parameters(), strict=True):
        assert one.detach().numpy().tobytes() == other.detach().numpy().tobytes()


def test_without_components_the_value_of_the_policy_is_learned():
    how = FitSettings(learning_rate=0.01, batch_size=512, most_updates=2_000)
    fit = Fit(played(steps=120_000), gym.spaces.Discrete(4), TimeAxis(0.9, 0), how)
    while not fit.done:
        fit.learn()
    told = fit.estimator(FUTURE).decompose(np.arange(3)).value
    true = exact(walk(), TimeAxis(0.9, 0), policy=POLICY).solution.q_values[:3]
    np.testing.assert_allclose(told, true, atol=0.03 * np.abs(true).max())


def test_what_is_told_is_a_mean_of_networks_however_often_the_fit_looks():
    how = FitSettings(check_every=5, sync_every=5, most_updates=5, learning_rate=0.01)
    fit = Fit(played(steps=3_000), gym.spaces.Discrete(4), TimeAxis(0.9, 3), how)
    begun = fit.estimator(FUTURE).decompose(np.arange(3)).components
    fit.learn()
    told = fit.estimator(FUTURE).decompose(np.arange(3)).components
    assert not np.array_equal(told, begun), "five updates have been learned from"

    often = FitSettings(check_every=40, sync_every=40, most_updates=80, learning_rate=0.01)
    fit = Fit(played(steps=3_000), gym.spaces.Discrete(4), TimeAxis(0.9, 3), often)
    seen = []
    update = fit.update

    def noted() -> float:
        loss = update()
        if fit.num_updates in (10, 20, 30, 40):
            seen.append(fit.network.head.weight.detach().clone())
        return loss

    fit.update = noted  # type: ignore[method-assign]
    fit.learn()
    sizes = torch.as_tensor(fit.scale, dtype=torch.float32).flatten().repeat(fit.num_actions)
    mean = torch.stack(seen).mean(dim=0) * sizes[:, None]  # in discounted reward
    got = fit.estimator(FUTURE).network.head.weight
    torch.testing.assert_close(got, mean, rtol=1e-5, atol=1e-6)


def test_no_learning_gets_slower_before_every_step_was_drawn_once():
    how = FitSettings(
        batch_size=16, check_every=50, patience=1, most_updates=20_000, learning_rate=1e-12
    )  # with which nothing is ever gained
    fit = Fit(played(steps=12_000), gym.spaces.Discrete(4), TimeAxis(0.9, 3), how)
    rates = []
    while not fit.done:
        fit.learn()
        rates.append((fit.num_updates, fit.optimizer.param_groups[0]["lr"]))
    steps = len(fit.experience.steps)
    first_slower = next(updates for updates, rate in rates if rate < rates[0][1])
    assert first_slower * how.batch_size > 0.85 * steps, "nine of ten episodes are learned from"


def test_the_same_seed_learns_the_same_bits():
    def weights() -> bytes:
        fit = Fit(played(steps=3_000), gym.spaces.Discrete(4), TimeAxis(0.9, 3))
        for _ in range(20):
            fit.update()
        return fit.estimator(FUTURE).network.head.weight.detach().numpy().tobytes()

    assert weights() == weights()


def test_nothing_is_told_that_no_reward_allows():
    fit = Fit(played(steps=3_000), gym.spaces.Discrete(4), TimeAxis(0.9, 2))
    estimator = fit.estimator(FUTURE)
    with torch.no_grad():
        estimator.network.head.bias += 100.0
    told = estimator.decompose(np.arange(4)).components
    most = [1.0, 0.9, 0.81 / 0.1]  # if every step paid 1, the most that one did
    assert (told <= np.array(most) * (1.0 + 1e-6)).all()
    outlook = estimator.outlook(np.arange(4))
    assert outlook is not None
    assert sorted(outlook.chances) == [-0.2, 0.5, 1.0]
    np.testing.assert_allclose(sum(outlook.chances.values()), 1.0, rtol=1e-6)


def test_wrong_settings_are_refused():
    with pytest.raises(InputError, match=r"no method 'regresion'\. Did you mean 'regression'\?"):
        FitSettings("regresion")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"A share of 1\.0 is held out"):
        FitSettings(held_out=1.0)
    with pytest.raises(InputError, match=r"There is a single episode\. Play more steps\."):
        Fit(experience([1.0], [FAR]), gym.spaces.Discrete(2), TimeAxis(0.9, 2))


def test_a_fitted_agent_acts_as_before_and_is_explained():
    agent = trdlab.solve("ledge", gamma=0.9, horizon=2)
    fitted = trdlab.fit(agent, horizon=3, steps=20_000, most_updates=600, learning_rate=0.01)
    assert fitted.policy is agent.policy
    assert fitted.estimator.time_axis == TimeAxis(0.9, 3), "γ is the agent's own"
    assert fitted.estimator.future.policy == "the agent's own policy"
    page = str(trdlab.explain(fitted, episodes=20))
    assert "ledge · step 0 of the episode with seed 0" in page


class Lamps(gym.Env):
    """Grey pictures that show how many steps were taken; each pays 1, and the fifth is the last."""

    observation_space = gym.spaces.Box(0, 255, (36, 36), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def seen(self) -> np.ndarray:
        return np.full((36, 36), 50 * self.steps, dtype=np.uint8)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return self.seen(), {}

    def step(self, action):
        self.steps += 1
        return self.seen(), 1.0, self.steps == 5, False, {}


def pictures(steps: int = 40) -> Experience:
    return gather(
        lambda count, seed: GymEnvironments(Lamps, count, seed=seed),
        Memoryless(lambda seen: np.tile([0.5, 0.5], (len(seen), 1))),
        FUTURE,
        steps=steps,
        share=0.0,
        num_envs=2,
        seed=0,
    )


def test_of_pictures_each_frame_is_kept_once():
    of = pictures()
    assert of.frames.shape[1:] == (36, 36)
    stacked = replace(of, stack=3)
    assert (stacked.seen(np.array([0, 1, 4]))[:, :, 0, 0] // 50).tolist() == [
        [0, 0, 0],
        [0, 0, 1],
        [2, 3, 4],
    ]
    assert (stacked.seen(np.array([6]))[:, :, 0, 0] // 50).tolist() == [[0, 0, 0]], "a new episode"
    dark = replace(of, frames=of.frames + 1, stack=3, padding="zero")
    assert (dark.seen(np.array([7]))[:, :, 0, 0]).tolist() == [[0, 1, 51]]


def test_a_fit_reads_pictures():
    of = pictures(100)
    space = gym.spaces.Box(0, 255, (1, 36, 36), np.uint8)
    how = FitSettings(most_updates=200, check_every=50, batch_size=32)
    fit = Fit(of, space, TimeAxis(0.9, 2), how)
    while not fit.done:
        fit.learn()
    last = fit.estimator(FUTURE).decompose(of.seen(np.array([0, 4]))).components
    np.testing.assert_allclose(last[..., 0], 1.0, atol=0.05)
    np.testing.assert_allclose(last[:, 0, 1], [0.9, 0.0], atol=0.1)


def test_it_is_told_how_many_steps_have_been_taken():
    heard: list[int] = []
    gather(
        lambda count, seed: GymEnvironments(Lamps, count, seed=seed),
        Memoryless(lambda seen: np.tile([0.5, 0.5], (len(seen), 1))),
        FUTURE,
        steps=23,
        share=0.0,
        num_envs=2,
        tell=heard.append,
    )
    assert heard == list(range(2, 31, 2)), "to the end of episodes of five steps"


def test_what_does_not_fit_into_memory_is_refused(monkeypatch):
    monkeypatch.setattr("trdlab.deep.experience.available_memory", lambda: 1_000_000)
    with pytest.raises(TrdlabError, match=r"1,000,000 steps take about .* GB.* Play at most"):
        pictures(1_000_000)


def test_forbidden_actions_are_not_forced_either():
    def any_open(observations: np.ndarray) -> np.ndarray:
        return np.tile([0.4, 0.3, 0.3], (len(observations), 1))

    def make(count: int, seed: int) -> GymEnvironments:
        return GymEnvironments(Doors, count, seed=seed)

    of = gather(make, Memoryless(any_open), FUTURE, steps=400, share=0.9, num_envs=4, seed=0)
    assert set(of.actions[of.steps].tolist()) == {0, 1, 2}, "and no door was closed: see Doors"
