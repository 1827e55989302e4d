"""Actions that an environment forbids: nobody takes them, and nothing is said of them."""

from dataclasses import replace

import numpy as np
import pytest

import trdlab
from doors import LENGTH, Doors
from trdlab.agents import Agent
from trdlab.deep.experience import gather
from trdlab.environments import GymEnvironments
from trdlab.errors import InputError
from trdlab.explanations import moment_at
from trdlab.explanations.assessment import assess
from trdlab.policies import EpsilonGreedy, Likeliest, Memoryless, ask
from trdlab.policies.adapted import About, Valuing
from trdlab.rollouts.branches import Branching, Effort
from trdlab.rollouts.playing import Playing, any_actions

RNG = np.random.default_rng
SEEN = np.zeros((3, 4))
ALLOWED = np.array([[True, False, True], [True, True, True], [False, False, True]])


def tempted(observations):
    """Would rather take the last door, open or not."""
    return np.tile([0.2, 0.3, 0.5], (len(observations), 1))


class Worth:
    """Expects of door i i, and nothing later."""

    time_axis = trdlab.TimeAxis(0.9, 1)
    future = trdlab.Future("the greedy policy")

    def decompose(self, observations):
        components = np.zeros((len(observations), 3, 2))
        components[:, :, 0] = [0.0, 1.0, 2.0]
        return trdlab.RewardDecomposition(components, self.time_axis)


class Wild(Worth):
    """Expects 1 more of every door that is open, and of others anything."""

    def decompose(self, observations):
        components = super().decompose(observations).components.copy()
        components[:, :, 0] += np.where(observations[:, :3] == 1, 1.0, 1e6)
        return trdlab.RewardDecomposition(components, self.time_axis)


def doors(count: int, seed: int = 0, **how) -> GymEnvironments:
    return GymEnvironments(lambda: Doors(**how), count, seed=seed)


def agent(policy=None, **how) -> Agent:
    names = ("nothing", "one", "two")
    return Agent("keen", Worth(), names, lambda n, s: doors(n, s, **how), policy)


@pytest.mark.parametrize("masks", ["method", "info"])
def test_what_is_allowed_is_told_with_what_is_seen(masks):
    environments = doors(3, 1, masks=masks)
    frames = environments.reset()
    for _ in range(2 * LENGTH):
        np.testing.assert_array_equal(environments.allowed, frames[:, :3] == 1)
        actions = environments.allowed.argmax(axis=1)
        step = environments.step(actions)
        frames = step.following
        open_then = np.where(step.terminated[:, None], True, step.frames[:, :3] == 1)
        np.testing.assert_array_equal(step.allowed, open_then)
    assert doors(1, masks="nowhere").allowed is None


def test_what_is_forbidden_counts_in_no_comparison():
    wild = replace(agent(), estimator=Wild())  # of what it forbids nobody knows anything
    found = trdlab.compare(wild, agent(), episodes=4)
    assert set(found.visits.allowed.sum(axis=1)) == {2, 3}
    assert found.of_any_action.value.tolist() == [1.0, 0.0]  # of each action it expects 1 more
    assert not found.visits.components[:, ~found.visits.allowed].any()


def test_the_chances_of_what_is_allowed_grow_alike():
    told, _ = ask(Memoryless(tempted), SEEN, allowed=ALLOWED)
    np.testing.assert_allclose(told, [[2 / 7, 0, 5 / 7], [0.2, 0.3, 0.5], [0, 0, 1]])
    likeliest = ask(Likeliest(Memoryless(tempted)), SEEN, allowed=~ALLOWED | [True, False, False])
    assert likeliest[0].argmax(axis=1).tolist() == [1, 0, 1]
    valuing = Valuing(About("DQN"), lambda seen: np.tile([1.0, 3.0, 2.0], (len(seen), 1)))
    for policy in (valuing, Likeliest(valuing)):
        assert ask(policy, SEEN, allowed=ALLOWED)[0].argmax(axis=1).tolist() == [2, 1, 2]
    stumbling = ask(EpsilonGreedy(valuing, 0.3), SEEN, allowed=ALLOWED)[0]
    np.testing.assert_allclose(stumbling, [[0.15, 0, 0.85], [0.1, 0.8, 0.1], [0, 0, 1]])
    with pytest.raises(
        InputError,
        match=r"answer to observation 0 of 3 leaves no action that the environment allows: it "
        r"gives \[0\.0, 1\.0, 0\.0\], allowed are the actions \[0, 2\]\. Give it a method "
        "act_within",
    ):
        ask(Memoryless(lambda seen: np.eye(3)[[1, 1, 1]]), SEEN, allowed=ALLOWED)


def test_any_action_is_one_of_those_allowed_evenly():
    many = np.repeat(ALLOWED, 3000, axis=0)
    drawn = any_actions(RNG(0), len(many), 3, many).reshape(3, 3000)
    shares = np.array([np.bincount(row, minlength=3) for row in drawn]) / 3000
    np.testing.assert_allclose(shares, [[0.5, 0, 0.5], [1 / 3] * 3, [0, 0, 1]], atol=0.03)
    assert any_actions(RNG(0), 5, 3).tolist() == RNG(0).integers(3, size=5).tolist()


@pytest.mark.parametrize("policy", [None, Memoryless(tempted)], ids=["greedy", "drawing"])
@pytest.mark.parametrize("how", [{}, {"masks": "info"}, {"terminates": False}])
def test_nobody_goes_through_a_closed_door(policy, how):  # which raises an error
    keen = agent(policy, **how)
    assert keen.evaluate(20).mean.value > 4
    episodes = keen.play(10, seed=3, epsilon=0.5)
    assert {len(episode) for episode in episodes} == {LENGTH}
    report = assess(keen, episodes=20, effort=Effort(10, 3, 4), seed=5)
    assert report.foils is not None
    assert not report.lost


def test_the_last_observation_has_its_own_mask():
    environments = doors(40, terminates=False)
    playing = Playing(None, environments, RNG(0), policy=Memoryless(tempted))
    while playing.running.any():
        playing.take(playing.turn().actions)
    seen, likely = playing.last_seen()
    np.testing.assert_array_equal(likely > 0, seen[:, :3] == 1)
    assert (playing.allowed != (seen[:, :3] == 1)).any()  # other episodes have begun


def test_copies_know_what_is_allowed_and_a_foil_is_never_forbidden():
    environments = doors(30)
    playing = Playing(Worth(), environments, RNG(0), policy=Memoryless(tempted))
    closed = int(np.argmin(playing.allowed.all(axis=1)))  # the number of an episode with one
    branch = playing.branch(np.array([closed, closed]), rng=RNG(1), max_steps=9)
    np.testing.assert_array_equal(branch.allowed, playing.allowed[[closed, closed]])
    branches = Branching(Worth(), Memoryless(tempted), 2).along(doors(20, 2), every=2, foils=True)
    assert len(branches) > 20  # where a closed door would have been an error
    lone = next(s for s in range(20) if doors(1, s).reset()[0, 0] == 0)
    with (
        agent().begin(seed=lone) as recording,
        pytest.raises(
            InputError, match=r"The environment forbids action 0 here\. It allows \[1, 2\]\."
        ),
    ):
        Branching(Worth()).at(recording.playing, 0)


def test_a_moment_speaks_of_what_can_be_done():
    keen = agent()
    seed = next(s for s in range(20) if doors(1, s).reset()[0, 2] == 0)  # door 2 is closed
    moment = moment_at(keen, seed=seed)
    assert (moment.action_names, moment.forbidden) == (("nothing", "one"), ("two",))
    choice = moment.choice()
    assert (choice.action, choice.foil) == ("one", "nothing")
    page = str(trdlab.explain(keen, seed=seed, step=0, episodes=0))
    assert "forbidden here: two" in page
    with pytest.raises(
        InputError, match=r"The environment forbids 'two' here\. It allows nothing, one\."
    ):
        trdlab.explain(keen, seed=seed, step=0, foil="two", episodes=0)
    told = trdlab.explain(keen, seed=seed, step=0, episodes=0).to_dict()["moment"]
    assert (list(told["actions"]), told["forbidden"]) == (["nothing", "one"], ["two"])


def test_two_agents_are_compared_at_what_they_can_do():
    keen, lazy = agent(), replace(agent(Memoryless(tempted)), name="lazy")
    assert trdlab.compare(keen, lazy, episodes=3)  # a closed door would have been an error


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        ([True, False], r"The action mask of Wrong has shape \(2,\) and type bool\. Give 3 values"),
        ([0.5, 1, 1], r"has shape \(3,\) and type float64\. Give 3 values of true or false\."),
        ([0, 0, 0], r"Wrong forbids every action\. Leave at least one\."),
    ],
)
def test_what_is_no_mask_is_refused(mask, message):
    class Wrong(Doors):
        def __init__(self):
            super().__init__()
            self.action_masks = lambda: mask

    environments = GymEnvironments(Wrong, seed=0)
    with pytest.raises(InputError, match=message):
        environments.reset()


def test_what_is_fitted_to_has_never_seen_a_closed_door():
    keen = agent(terminates=False)
    experience = gather(keen.make, Memoryless(tempted), Worth.future, steps=200, share=0.4)
    closed = experience.frames[:, :3] == 0
    assert closed.any(axis=1).mean() > 0.5
    assert not experience.probabilities[closed].any()
    np.testing.assert_allclose(experience.probabilities.sum(axis=1), 1.0)
