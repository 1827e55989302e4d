"""Real Atari agents of others, and small ones of the same formats."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn
from torch.nn import functional

import trdlab
from archives import drawn, tensors
from trdlab.atari import AtariEnvironments
from trdlab.errors import InputError
from trdlab.policies import EpsilonGreedy, Likeliest, ask, rows
from trdlab.policies.a3c_lstm import STATISTICS
from trdlab.policies.files import Options
from trdlab.policies.registry import read_policy
from trdlab.rollouts.playing import Playing

TEACHERS = Path(__file__).parents[3] / "shared" / "teachers"

FOUR = {f"conv{i}.weight": (32, 1 if i == 1 else 32, 3, 3) for i in range(1, 5)}
FOUR |= {f"conv{i}.bias": (32,) for i in range(1, 5)}
HEADS = {"critic_linear.weight": (1, 256), "critic_linear.bias": (1,)}
HEADS |= {"actor_linear.weight": (4, 256), "actor_linear.bias": (4,)}
GRU = {"gru.weight_ih": (768, 800), "gru.weight_hh": (768, 256)}
GRU |= {"gru.bias_ih": (768,), "gru.bias_hh": (768,)}
BABY = FOUR | GRU | HEADS
ACKTR = {
    "conv1.weight": (3, 4, 8, 8), "ab1.bias": (3, 1), "conv2.weight": (5, 3, 4, 4),
    "ab2.bias": (5, 1), "conv3.weight": (2, 5, 3, 3), "ab3.bias": (2, 1),
    "linear1.weight": (7, 98), "ab_fc1.bias": (7, 1), "critic_linear.weight": (1, 7),
    "ab_fc2.bias": (1, 1), "actor_linear.weight": (4, 7), "ab_fc3.bias": (4, 1),
}  # fmt: skip
LIST = [
    *(shape for i in range(1, 5) for shape in ((32, 1 if i == 1 else 32, 3, 3), (32,))),
    *((1024, 288), (1024, 256), (1024,), (1024,), (1, 256), (1,), (18, 256), (18,)),
]
SCREENS = np.random.default_rng(0).integers(256, size=(3, 210, 160, 3), dtype=np.uint8)
BEGIN = np.ones(3, dtype=bool)


def read(path, **options):
    return read_policy(path, Options.of(options))


def save(path, shapes):
    weights = drawn(shapes)
    torch.save(tensors(weights), path)
    return tensors(weights)


def save_list(path):
    weights = tensors(drawn({str(i): shape for i, shape in enumerate(LIST)}))
    torch.save(list(weights.values()), path)
    return list(weights.values())


def convolved(images, layers):
    for weight, bias in layers:
        images = functional.elu(functional.conv2d(images, weight, bias, 2, 1))
    return images.flatten(1)


def small_grey(screen):
    """What baby-a3c sees of one screen, by its definition, in numpy and loops over rows."""
    grey = screen[35:195].astype(np.float32).mean(axis=2)
    stretched = np.round((grey - grey.min()) / (grey.max() - grey.min()) * 255.0)
    halved = np.zeros((80, 160))
    for half, whole in ((halved, stretched), (np.zeros((80, 80)), None)):
        whole = halved.T if whole is None else whole
        for row in range(80):  # a triangle over the four rows around, those that are there
            at = [r for r in range(2 * row - 1, 2 * row + 3) if 0 <= r < 160]
            weights = np.array([1.0 - abs(r + 0.5 - (2 * row + 1.0)) / 2.0 for r in at])
            half[row] = weights @ whole[at] / weights.sum()
    return half.T / 255.0


def test_baby_a3c_sees_one_small_grey_image_and_remembers(tmp_path):
    w = save(tmp_path / "a.pt", BABY)
    policy = read(tmp_path / "a.pt")
    cell = nn.GRUCell(800, 256)
    cell.load_state_dict({name: w[f"gru.{name}"] for name in cell.state_dict()})
    layers = [(w[f"conv{i}.weight"], w[f"conv{i}.bias"]) for i in range(1, 5)]
    images = np.stack([small_grey(screen) for screen in SCREENS])[:, None]
    assert (images.min(), images.max() <= 1.0) == (pytest.approx(0, abs=0.3), True)
    hidden, memory, critic = torch.zeros(3, 256), None, None
    for step in range(3):
        with torch.no_grad():
            features = convolved(torch.from_numpy(images).float(), layers)
            hidden = cell(features, hidden)
            logits = functional.linear(hidden, w["actor_linear.weight"], w["actor_linear.bias"])
            value = functional.linear(hidden, w["critic_linear.weight"], w["critic_linear.bias"])
        begins = BEGIN & (step == 0)
        likely, memory = ask(policy, SCREENS, memory, begins)
        told, critic = policy.state_values(SCREENS, critic, begins, likely)
        np.testing.assert_allclose(likely, logits.softmax(dim=1).numpy(), atol=2e-4)
        np.testing.assert_allclose(told, value[:, 0].numpy(), atol=2e-3)
    likely, _ = ask(policy, SCREENS[1:2], rows(memory, np.array([1])), BEGIN[:1])
    first, _ = ask(policy, SCREENS[1:2])
    np.testing.assert_allclose(likely, first, atol=1e-6)  # an episode begins: nothing is left
    about = policy.about
    assert (about.seen, about.num_actions, about.memory) == ((210, 160, 3), 4, 256)
    blank = np.zeros_like(SCREENS)
    assert np.isfinite(ask(policy, blank)[0]).all()  # there is nothing to stretch


def test_acktr_has_its_biases_apart(tmp_path):
    w = save(tmp_path / "a.pt", ACKTR)
    policy = read(tmp_path / "a.pt")
    stacks = np.random.default_rng(0).integers(256, size=(3, 4, 84, 84), dtype=np.uint8)
    x = torch.from_numpy(stacks).float() / 255.0
    for number, stride in ((1, 4), (2, 2), (3, 1)):
        x = functional.conv2d(x, w[f"conv{number}.weight"], w[f"ab{number}.bias"][:, 0], stride)
        x = x.relu()
    hidden = (x.flatten(1) @ w["linear1.weight"].T + w["ab_fc1.bias"][:, 0]).relu()
    logits = hidden @ w["actor_linear.weight"].T + w["ab_fc3.bias"][:, 0]
    values = hidden @ w["critic_linear.weight"][0] + w["ab_fc2.bias"][0, 0]
    likely, _ = ask(policy, stacks)
    np.testing.assert_allclose(likely, logits.softmax(dim=1).numpy(), atol=1e-5)
    told, _ = policy.state_values(stacks, None, BEGIN, likely)
    np.testing.assert_allclose(told, values.numpy(), rtol=1e-4, atol=1e-4)
    assert policy.about.games == {"separate_lives": True}


def test_the_list_of_river_raid_is_normalised_as_it_goes(tmp_path):
    w = save_list(tmp_path / "a.pt")
    policy = read(tmp_path / "a.pt", greedy=False)
    cell = nn.LSTMCell(288, 256)
    names = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
    cell.load_state_dict(dict(zip(names, w[8:12], strict=True)))
    layers = list(zip(w[0:8:2], w[1:8:2], strict=True))
    rng, held, memory = np.random.default_rng(1), (torch.zeros(3, 256),) * 2, None
    mean, deviation = (np.full((3, 1, 1, 1), value) for value in STATISTICS)
    for step in range(1, 4):
        screens = rng.integers(256 // step, size=(3, 210, 160, 3), dtype=np.uint8)
        x = torch.from_numpy(screens[:, 34:194]).float().permute(0, 3, 1, 2)
        for side in (80, 42):
            x = functional.interpolate(x, (side, side), mode="bilinear")
        x = x.mean(dim=1, keepdim=True).numpy() / 255.0
        mean = 0.9999 * mean + 0.0001 * x.mean(axis=(1, 2, 3), keepdims=True)
        deviation = 0.9999 * deviation + 0.0001 * x.std(axis=(1, 2, 3), keepdims=True)
        x = (x - mean) / (deviation + 1e-8)
        with torch.no_grad():
            held = cell(convolved(torch.from_numpy(x).float(), layers), held)
            logits = functional.linear(held[0], w[14], w[15])
        likely, memory = ask(policy, screens, memory, BEGIN & (step == 1))
        np.testing.assert_allclose(likely, logits.softmax(dim=1).numpy(), atol=1e-3)
    alone, _ = ask(policy, screens[2:], rows(memory, np.array([2])), BEGIN[:1])
    np.testing.assert_allclose(alone, ask(policy, screens[2:])[0], atol=1e-6)
    assert not read(tmp_path / "a.pt").about.draws  # it takes the likeliest, if nobody objects
    assert ask(read(tmp_path / "a.pt"), screens)[0].max(axis=1).tolist() == [1.0] * 3


def test_who_sees_whole_screens_plays_without_an_option(tmp_path):
    save(tmp_path / "baby.pt", BABY)
    agent = trdlab.agent(tmp_path / "baby.pt", env="Breakout")
    assert agent.interface.space.shape == (4, 84, 84)  # what a fit of it sees
    assert agent.origin.words == (str(tmp_path / "baby.pt"), "--env", "Breakout")
    assert agent.evaluate(2, max_steps=12).lengths.tolist() == [12, 12]
    same = trdlab.agent(agent.policy, env="Breakout", env_arguments={"sticky": 0.25})
    assert same.evaluate(2, max_steps=12).lengths.tolist() == [12, 12]
    moved = trdlab.agent(agent, env="ALE/Breakout-v5")
    for policy in (Likeliest(agent.policy), EpsilonGreedy(agent.policy, 0.5)):
        wrapped = trdlab.agent(moved, env="Breakout", policy=policy)
        assert wrapped.evaluate(1, max_steps=3).lengths.tolist() == [3]
    with pytest.raises(InputError, match=r"has 210×160×3 uint8 to see and 6 actions"):
        trdlab.agent(tmp_path / "baby.pt", env="Pong")
    with pytest.raises(InputError, match=r"has 250×160×3 uint8 to see"):
        trdlab.agent(tmp_path / "baby.pt", env="AirRaid")
    with pytest.raises(InputError, match=r"needs observations of shape \(210, 160, 3\) and 4"):
        trdlab.agent(tmp_path / "baby.pt", env="CartPole-v1")


def test_who_sees_whole_screens_needs_to_be_shown_them(tmp_path):
    save(tmp_path / "baby.pt", BABY)
    policy, rng = read(tmp_path / "baby.pt"), np.random.default_rng(0)
    playing = Playing(None, AtariEnvironments("Breakout", 1, seed=0), rng, policy=policy)
    with pytest.raises(InputError, match="whole screens, and they are not shown here"):
        playing.turn()
    args = {"screens": True}
    agent = trdlab.agent(lambda seen: 1, env="Breakout", env_arguments=args)
    playing = Playing(None, agent.make(2, 0), rng, policy=policy, max_steps=3)
    while playing.running.any():
        playing.take(playing.turn().actions)
    seen, likely = playing.last_seen()
    assert (seen.shape, likely.shape) == ((2, 4, 84, 84), (2, 4))


def test_who_sees_whole_screens_is_fitted_and_explained(tmp_path):
    save(tmp_path / "baby.pt", BABY)
    agent = trdlab.agent(tmp_path / "baby.pt", env="Breakout", env_arguments={"max_frames": 100})
    short = {"most_updates": 2, "check_every": 2, "sync_every": 2, "batch_size": 8}
    agent = trdlab.fit(agent, horizon=2, steps=300, out=tmp_path / "fit", **short)
    assert agent.estimator.decompose(np.zeros((1, 4, 84, 84), np.uint8)).components.shape == (
        1,
        4,
        3,
    )
    again = trdlab.agent(tmp_path / "fit")
    assert "Breakout" in again.origin.env
    with again.begin(seed=0) as recording:
        recording.play()
    (episode,) = recording.episodes()
    assert np.isfinite(episode.critic).all()
    assert len(episode) == 25
    trdlab.explain(again, parts="forecast", step=3, episodes=0)


def test_lives_are_apart_for_acktr(tmp_path):
    save(tmp_path / "acktr.pt", ACKTR)
    agent = trdlab.agent(tmp_path / "acktr.pt", env="Breakout")
    games = agent.make(1, 0)
    assert games.separate_lives
    apart = trdlab.agent(
        tmp_path / "acktr.pt", env="Breakout", env_arguments={"separate_lives": False}
    )
    assert not apart.make(1, 0).separate_lives


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        ({name: BABY[name] for name in BABY if name != "conv1.bias"}, "nobody who is known"),
        (BABY | {"gru.weight_hh": (768, 255)}, r"'gru.weight_hh_l0' have shape \(768, 255\)"),
        (BABY | {"gru.weight_ih": (768, 801)}, "cannot be shown what it says to see"),
        (BABY | {"gru.weight_ih": (2, 2)}, "are no GRU's"),
        (BABY | {"conv2.weight": (32, 32)}, "4 layers for images, of shapes"),
        (BABY | {"actor_linear.weight": (4, 255)}, "cannot be shown what it says to see"),
        (BABY | {"critic_linear.bias": (2,)}, r"'critic_linear.bias' have shape \(2,\)"),
        (ACKTR | {"ab1.bias": (4, 1)}, "'conv1.bias' have shape"),
        (ACKTR | {"linear1.weight": (7, 99)}, "cannot be shown what it says to see"),
        ({str(i): LIST[i] for i in range(15)}, "nobody who is known"),
        ({str(i): LIST[i] for i in range(16)} | {"8": (1024, 289)}, "cannot be shown"),
        ({str(i): LIST[i] for i in range(16)} | {"0": (32, 9)}, "nobody who is known"),
        ({str(i): LIST[i] for i in range(16)} | {"9": (1024, 1)}, "'lstm.weight_hh_l0' have"),
    ],
)
def test_wrong_tensors_are_refused_in_one_line(tmp_path, shapes, message):
    save(tmp_path / "a.pt", shapes)
    with pytest.raises(InputError, match=message) as refusal:
        read(tmp_path / "a.pt")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("held", [[], [1.0], [torch.zeros(2), "a"], (torch.zeros(2),)])
def test_lists_of_something_else(tmp_path, held):
    torch.save(held, tmp_path / "a.pt")
    with pytest.raises(InputError, match="holds no weights by name"):
        read(tmp_path / "a.pt")
    data = (tmp_path / "a.pt").read_bytes()
    (tmp_path / "a.pt").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="torn"):
        read(tmp_path / "a.pt")


@pytest.mark.skipif(not TEACHERS.is_dir(), reason=f"there is no folder {TEACHERS.name} of agents")
@pytest.mark.parametrize(
    ("file", "game", "least"),
    [
        ("baby-a3c-breakout.pt", "Breakout", 4),
        ("baby-a3c-pong.pt", "Pong", 0),
        ("acktr-breakout.pt", "Breakout", 4),
        ("acktr-seaquest.pt", "Seaquest", 40),
        ("a3c-lstm-riverraid.pt", "Riverraid", 600),
    ],
)
def test_real_agents_play_well_from_the_start(file, game, least):
    agent = trdlab.agent(TEACHERS / file, env=game)
    assert agent.evaluate(2, max_steps=200).mean.value >= least
