"""What matters for near and for far: of small networks, of vectors, and exactly of maps."""

import json
from dataclasses import replace
from functools import cache

import gymnasium as gym
import numpy as np
import pytest
import torch
from matplotlib.colors import to_rgb
from torch import nn

import trdlab
from moments import trusted
from trdlab.agents import Agent, gridworld_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.networks import DecompositionNetwork, build_network
from trdlab.environments import GymEnvironments
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations import UnsupportedSentenceError, check, explain
from trdlab.explanations.saliency.claims import in_brief, sections
from trdlab.explanations.saliency.groups import Group
from trdlab.explanations.saliency.saliency import SALIENCY, Entries, Places, Saliency
from trdlab.gridworld import Gridworld, load_map
from trdlab.show.plots import style
from trdlab.show.plots.saliency import LOWERS, RAISES, overlay, saliency_figure

AXIS = TimeAxis(0.9, 4)
FUTURE = Future("the greedy policy")
SIDE = 24


class Noise(gym.Env):
    """An image of grey noise; nothing ever changes."""

    observation_space = gym.spaces.Box(0, 255, (1, SIDE, SIDE), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.seen(), {}

    def step(self, action):
        return self.seen(), 0.0, False, False, {}

    def seen(self):
        return np.random.default_rng(0).integers(50, 256, (1, SIDE, SIDE), dtype=np.uint8)


class Looks(DecompositionNetwork):
    """Near reward is what is bright in the left quarter, far reward what is in the right one.

    Each of four channels sees a quarter. Right, the second action, is worth twice as much.
    """

    def __init__(self) -> None:
        body = nn.Sequential(nn.Conv2d(4, 4, 2, stride=2, bias=False), nn.ReLU(), nn.Flatten())
        head = nn.Linear(4 * 12 * 12, 2 * AXIS.num_components, bias=False)
        super().__init__(body, head, (1, SIDE, SIDE), 2, AXIS.num_components)
        with torch.no_grad():
            body[0].weight.copy_(0.25 * torch.eye(4)[:, :, None, None].expand(4, 4, 2, 2))
            weights = torch.zeros(2, AXIS.num_components, 4, 144)
            weights[0, 0, 0], weights[0, 3, 3] = 0.1, 0.1
            weights[1] = 2.0 * weights[0]
            head.weight.copy_(weights.reshape(-1, 4 * 144))

    def preprocess(self, observations):
        quarter = torch.arange(SIDE) // (SIDE // 4)
        masks = (quarter == torch.arange(4)[:, None]).float()  # [4, W]
        return observations.float() / 255.0 * masks[:, None]


class Edges(DecompositionNetwork):
    """A network with one channel alone: its GradCAM is what is bright, whatever was learned."""

    def __init__(self) -> None:
        torch.manual_seed(0)
        body = nn.Sequential(nn.Conv2d(1, 1, 2, stride=2, bias=False), nn.ReLU(), nn.Flatten())
        head = nn.Linear(144, 2 * AXIS.num_components)
        super().__init__(body, head, (1, SIDE, SIDE), 2, AXIS.num_components)
        with torch.no_grad():
            body[0].weight.fill_(0.25)

    def preprocess(self, observations):
        return observations.float() / 255.0


def agent_of(estimator, env, names=("left", "right")) -> Agent:
    return Agent("it", estimator, names, lambda count, seed: GymEnvironments(env, count, seed=seed))


@cache
def seen_by(network: type[DecompositionNetwork], components: str | None = "0,3", **how) -> Saliency:
    agent = agent_of(NetworkEstimator(network(), AXIS, FUTURE), Noise)
    how = {"components": components, "action": "left", "episodes": 0} | how
    found = explain(agent, ("saliency",), **how)
    assert found.saliency is not None
    return found.saliency


@cache
def carts(**how) -> Saliency:
    estimator = NetworkEstimator(
        build_network(gym.spaces.Box(-1, 1, (4,), np.float32), 2, AXIS, seed=3), AXIS, FUTURE
    )
    found = explain(agent_of(estimator, "CartPole-v1"), ("saliency",), step=5, episodes=0, **how)
    assert found.saliency is not None
    return found.saliency


def said(of: Saliency) -> str:
    return " ".join(claim.sentence for part in sections(of) for claim in part.claims)


# ---- images ------------------------------------------------------------------------------------


def test_near_and_far_hang_on_the_quarters_that_they_are_made_of():
    found = seen_by(Looks)
    near, far = (found.map(group) for group in found.groups)
    assert (near.label, far.label) == ("t", "t+3")
    bright = Noise().seen()[0].reshape(12, 2, 12, 2).mean(axis=(1, 3)) / 255.0
    np.testing.assert_allclose(near.signed[:, :3], 0.1 * bright[:, :3], rtol=1e-5)
    np.testing.assert_allclose(far.signed[:, 9:], 0.1 * bright[:, 9:], rtol=1e-5)
    assert not near.signed[:, 3:].any()
    assert not far.signed[:, :9].any()
    difference = found.of.maps.paper_difference(*found.groups).signed
    assert difference.max() == 1.0
    assert difference.min() == -1.0
    hidden = found.of.hidden.of(Group(0, 0)).signed
    median = np.median(Noise().seen()) // 1 / 255.0
    np.testing.assert_allclose(hidden[:, :3], 0.1 * (bright[:, :3] - median), atol=1e-5)
    np.testing.assert_allclose(hidden[:, 3:], 0.0, atol=1e-6)


def test_it_passes_its_checks_and_says_so():
    found = seen_by(Looks)
    assert not any(found.of.checks(group).is_bad for group in found.groups)
    assert in_brief(found)[0].sentence == (
        "What it expects at once and 3 steps later hangs on different places: their maps overlap "
        "by 0 %."
    )
    told = said(found)
    assert " left of the screen takes " in told
    assert "hiding changes more (rank correlation" in told


def test_a_map_that_does_not_depend_on_what_was_learned_fails():
    found = seen_by(Edges)
    for group in found.groups:
        assert found.of.checks(group).redrawn == ("bad", pytest.approx(1.0, abs=1e-4))
    assert in_brief(found)[0].sentence == (
        "Do not believe what counts at once: with new weights it is much the same (rank "
        "correlation 1.00)."
    )
    assert "hangs on" not in said(found)


def test_a_foil_makes_it_about_the_difference():
    found, plain = seen_by(Looks, action="right", foil="left"), seen_by(Looks)
    assert (found.action, found.foil) == ("right", "left")
    # right weighs all twice as much as left, so what it leads by is what left is worth
    np.testing.assert_allclose(found.of.maps.signed, plain.of.maps.signed, atol=1e-6)
    np.testing.assert_allclose(found.of.hidden.signed, plain.of.hidden.signed, atol=1e-6)
    assert "The lead of right over left at once and 3 steps later hangs on" in said(found)


def test_what_is_not_trusted_is_said():
    found = seen_by(Looks)
    doubted = found.judged(trusted(AXIS, 2).trust, usual=False)
    assert [doubted.is_doubtful(group) for group in doubted.groups] == [False, True]
    assert "What it expects 3 steps later has not proved better than a guess" in said(doubted)
    assert found.judged(trusted(AXIS, 2).trust).groups == (Group(0, 0), Group(1, 1))


@pytest.mark.parametrize("components", ["0,3", "all", "later", "0-2", None])
@pytest.mark.parametrize("network", [Looks, Edges])
def test_every_sentence_about_images_is_supported(network, components):
    found = seen_by(network, components)
    told = said(found)
    assert told
    check(told, [(SALIENCY, found)])
    turned = replace(
        found, of=replace(found.of, hidden=replace(found.of.hidden, signed=-found.of.hidden.signed))
    )
    for claim in in_brief(found):
        if "A patch" in claim.sentence:
            with pytest.raises(UnsupportedSentenceError):
                check(claim.sentence, [(SALIENCY, turned)])


def test_layers_that_are_not_there():
    with pytest.raises(InputError, match=r"no convolution 1"):
        seen_by(Looks, layer=1)


# ---- vectors -----------------------------------------------------------------------------------


def test_entries_add_up_and_are_checked():
    found = carts()
    of = found.of
    assert isinstance(of, Entries)
    assert of.names == ("entry 0", "entry 1", "entry 2", "entry 3")
    for group in found.groups:
        assert of.shares(group).sum() == pytest.approx(1.0)
        checks = of.checks(group)
        assert {checks.redrawn.verdict, checks.hidden.verdict} <= {"good", "bad"}
        assert sum(c.kind in ("adds", "takes") for p in sections(found) for c in p.claims) == 2
    check(said(found), [(SALIENCY, found)])


def test_an_entry_that_counts_for_nothing_gets_nothing_and_one_that_is_all_gets_all():
    class Third:
        """Near reward is entry 2; far reward is twice entry 0. Nothing is known of gradients."""

        time_axis, future = AXIS, FUTURE

        def decompose(self, observations):
            seen = np.asarray(observations, dtype=np.float64)
            components = np.zeros((len(seen), 2, AXIS.num_components))
            components[:, :, 0], components[:, :, 3] = seen[:, None, 2], 2.0 * seen[:, None, 0]
            return RewardDecomposition(components, AXIS)

    found = explain(agent_of(Third(), "CartPole-v1"), ("saliency",), step=3, episodes=0).saliency
    assert found.of.method == "hiding"
    assert found.of.shares(Group(0, 0)).tolist() == [0, 0, 1, 0]
    assert found.of.shares(Group(3, 3)).tolist() == [1, 0, 0, 0]
    told = said(found)
    check(told, [(SALIENCY, found)])
    assert "What it expects at once hangs most on entry 2: 100 % of all that counts." in told
    assert "Far ahead, entry 0 counts for more: 100 % 3 steps later, against 0 % at once." in told
    assert "This was tried out, with what was met at" in told


# ---- tables ------------------------------------------------------------------------------------


def test_coordinates_of_a_map_are_exchanged_exactly():
    agent = gridworld_agent("drone", TimeAxis(0.95, 2, 2))
    found = explain(agent, ("saliency",), episodes=0, action="down", components="0,later").saliency
    world, table = agent.world, agent.estimator
    assert found.of.names[:2] == ("row", "column")
    here = world.states[0]
    others = [
        i
        for i, state in enumerate(world.states)
        if state.column == here.column
        and state.row != here.row
        and state.collected == here.collected
        and not world.is_terminal(i)
    ]
    components = table.decomposition.components[:, 1]
    expected = components[0] - components[others].mean(axis=0)
    np.testing.assert_allclose(found.of.signed[:, 0], expected)
    told = said(found)
    check(told, [(SALIENCY, found)])
    assert "This is of a solved model, so there is nothing to doubt." in told


def test_states_without_coordinates_have_no_entries():
    agent = trdlab.solve(Gridworld(load_map("tie")).mdp)
    with pytest.raises(InputError, match=r"no coordinates"):
        explain(agent, ("saliency",), episodes=0)
    network = build_network(gym.spaces.Discrete(14), 4, AXIS)
    drone = gridworld_agent("drone", AXIS)
    learned = replace(drone, estimator=NetworkEstimator(network, AXIS, FUTURE), world=None)
    with pytest.raises(InputError, match=r"only the number of a state"):
        explain(learned, ("saliency",), episodes=0)


def test_as_plain_data():
    for found in (seen_by(Looks), carts()):
        data = json.loads(json.dumps(found.to_dict()))
        assert data["schema"] == "trdlab.saliency/1"
        assert [group["label"] for group in data["groups"]] == ["t", "t+3"]
        assert {group["new_weights"]["verdict"] for group in data["groups"]} <= {"good", "bad"}
        answer = [claim["sentence"] for claim in data["answer"]]
        assert answer == [claim.sentence for claim in in_brief(found)]
        assert str(found).startswith("What matters to it · step")
    np.testing.assert_allclose(
        seen_by(Looks).to_dict()["places"]["maps"], seen_by(Looks).of.maps.signed
    )
    assert isinstance(seen_by(Looks).of, Places)


# ---- pictures ----------------------------------------------------------------------------------


def test_a_map_over_a_screen_by_hand():
    screen = np.zeros((2, 2, 3), np.uint8)
    screen[1] = 255
    drawn = overlay(screen, np.array([[1.0, -1.0], [0.0, 0.0]]))
    np.testing.assert_allclose(drawn[0, 0], to_rgb(RAISES))
    np.testing.assert_allclose(drawn[0, 1], to_rgb(LOWERS))
    assert 0.0 < drawn[1, 0, 0] == drawn[1, 1, 2] < 1.0  # where nothing counts the screen is dark
    faded = overlay(screen, np.array([[1.0, -1.0], [0.0, 0.0]]), faded=True)
    assert 0.0 < faded[0, 0, 0] < drawn[0, 0, 0]


def titles(figure) -> list[str]:
    return [ax.get_title() for ax in figure.axes if ax.get_title()]


def test_near_far_and_their_difference_stand_beside_each_other():
    figure = seen_by(Looks).plot()
    assert titles(figure) == ["t", "t+3", "far − near"]  # above the first of two rows
    assert len(figure.axes) == 6
    notes = [ax.get_xlabel() for ax in figure.axes]
    assert "passed" in notes[0]
    failed = seen_by(Edges).plot().axes[0].xaxis.label
    assert "weights: failed (1.00)" in failed.get_text()
    assert failed.get_color() == style.COST


def test_what_is_not_trusted_is_faded():
    doubted = seen_by(Looks).judged(trusted(AXIS, 2).trust, usual=False)
    assert titles(saliency_figure(doubted))[:2] == ["t", "t+3, not trusted"]
    every = seen_by(Looks, "all").judged(trusted(AXIS, 2).trust, usual=False)
    assert titles(saliency_figure(every)) == ["t", "t+1", "t+2", "t+3", "later"]
    lit = [ax.get_images()[0].get_array().max() for ax in saliency_figure(every).axes[:5]]
    assert lit[0] > lit[3]


def test_one_map_has_what_hiding_changes_beside_it():
    assert titles(seen_by(Looks, "later").plot()) == ["later", "later"]


def test_entries_are_bars_of_shares():
    figure = carts().plot()
    (ax,) = figure.axes
    assert [label.get_text().split(" =")[0] for label in ax.get_yticklabels()] == list(
        carts().of.names
    )
    widths = np.array([bar.get_width() for bar in ax.patches]).reshape(2, 4)
    np.testing.assert_allclose(np.abs(widths).sum(axis=1), 100.0)


def test_the_verb_tells_it_to_who_asks():
    found = trdlab.explain("gridworld:drone", parts="saliency", components="0,later", episodes=0)
    assert found.saliency.told == (Group(0, 0), Group(4, 4))
    assert trdlab.explain("gridworld:drone", episodes=0).saliency is None
