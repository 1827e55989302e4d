"""CleanRL's weights, and plain linear layers: known by what they hold, whatever they are called."""

import pickle

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from torch.nn import functional

import trdlab
from archives import drawn, layers, tensors
from trdlab.errors import InputError
from trdlab.policies import ask
from trdlab.policies.files import Options, is_text
from trdlab.policies.registry import read_policy

GAME = {
    "network.0.weight": (3, 4, 8, 8), "network.0.bias": (3,),
    "network.2.weight": (3, 3, 4, 4), "network.2.bias": (3,),
    "network.4.weight": (2, 3, 3, 3), "network.4.bias": (2,),
    "network.7.weight": (5, 98), "network.7.bias": (5,),
}  # fmt: skip
DQN = GAME | {"network.9.weight": (6, 5), "network.9.bias": (6,)}
PPO = GAME | {"actor.weight": (6, 5), "actor.bias": (6,)}
PPO |= {"critic.weight": (1, 5), "critic.bias": (1,)}
SCREENS = np.random.default_rng(0).integers(256, size=(2, 4, 84, 84), dtype=np.uint8)
SEEN = np.random.default_rng(1).normal(size=(6, 4)).astype(np.float32)


def read(path, **options):
    return read_policy(path, Options.of(options))


def save(path, shapes):
    weights = drawn(shapes)
    torch.save(tensors(weights), path)
    return weights


def hidden(w):
    part, x = tensors(w), torch.from_numpy(SCREENS).float() / 255.0
    for number, stride in ((0, 4), (2, 2), (4, 1)):
        of = part[f"network.{number}.weight"], part[f"network.{number}.bias"]
        x = functional.conv2d(x, *of, stride).relu()
    return functional.linear(x.flatten(1), part["network.7.weight"], part["network.7.bias"]).relu()


def test_dqn_of_games(tmp_path):
    w = save(tmp_path / "dqn_atari.cleanrl_model", DQN)
    policy = read(tmp_path / "dqn_atari.cleanrl_model")
    values = hidden(w).numpy() @ w["network.9.weight"].T + w["network.9.bias"]
    np.testing.assert_allclose(policy.q_values(SCREENS), values, rtol=1e-4, atol=1e-5)
    assert ask(policy, SCREENS)[0].argmax(axis=1).tolist() == values.argmax(axis=1).tolist()
    about = policy.about
    assert (about.title, about.seen, about.num_actions) == ("DQN of CleanRL", (4, 84, 84), 6)


def test_ppo_of_games_and_of_numbers(tmp_path):
    w = save(tmp_path / "a", PPO)
    logits = hidden(w).numpy() @ w["actor.weight"].T + w["actor.bias"]
    likely, _ = ask(read(tmp_path / "a"), SCREENS)
    np.testing.assert_allclose(np.log(likely[:, 1:] / likely[:, :1]), logits[:, 1:] - logits[:, :1],
                               rtol=1e-3, atol=1e-4)  # fmt: skip
    told = read(tmp_path / "a").state_values(SCREENS, None, np.ones(2, dtype=bool), likely)[0]
    values = hidden(w).numpy() @ w["critic.weight"][0] + w["critic.bias"]
    np.testing.assert_allclose(told, values, rtol=1e-4, atol=1e-5)
    w = save(tmp_path / "b", layers("critic.", 4, 3, 1) | layers("actor.", 4, 3, 2))
    first = np.tanh(SEEN @ w["actor.0.weight"].T + w["actor.0.bias"])
    logits = first @ w["actor.2.weight"].T + w["actor.2.bias"]
    odds = np.exp(logits)
    policy = read(tmp_path / "b")
    np.testing.assert_allclose(ask(policy, SEEN)[0], odds / odds.sum(axis=1)[:, None], rtol=1e-4)
    assert policy.about.title == "PPO of CleanRL"
    told = policy.state_values(SEEN, None, np.ones(6, dtype=bool), ask(policy, SEEN)[0])[0]
    first = np.tanh(SEEN @ w["critic.0.weight"].T + w["critic.0.bias"])
    values = first @ w["critic.2.weight"][0] + w["critic.2.bias"]
    np.testing.assert_allclose(told, values, rtol=1e-4)


@pytest.mark.parametrize("safe", [True, False])
def test_linear_layers_in_the_order_of_the_file(tmp_path, safe):
    w = drawn(layers("z.", 4, 5) | layers("a.", 5, 3, 2))
    path = tmp_path / "mine.zip"  # a name says nothing
    w = w if not safe else drawn(layers("a.", 4, 5) | layers("z.", 5, 3, 2))
    (save_file if safe else torch.save)(tensors(w), path)
    names = list(dict.fromkeys(name.rpartition(".")[0] for name in w))
    x = SEEN
    for at, name in enumerate(names):
        x = x @ w[f"{name}.weight"].T + w[f"{name}.bias"]
        x = np.maximum(x, 0.0) if at < len(names) - 1 else x
    policy = read(path)
    np.testing.assert_allclose(policy.q_values(SEEN), x, rtol=1e-4, atol=1e-5)
    assert (policy.about.algorithm, policy.about.layers) == ("MLP", "4 → 5 → 3 → 2")
    odds = np.exp(x - x.max(axis=1)[:, None])
    drawing = read(path, greedy=False)
    np.testing.assert_allclose(ask(drawing, SEEN)[0], odds / odds.sum(axis=1)[:, None], rtol=1e-4)
    assert drawing.about.draws
    assert read(path, activation="elu").about.activation == "ELU"
    with pytest.raises(InputError, match=r"no activation 'tahn'. Did you mean 'tanh'"):
        read(path, activation="tahn")


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        ({"gru.weight_ih": (3, 3)}, r"'gru.weight_ih' of shape \(3, 3\): nobody who is known"),
        ({"a.weight": (3,)}, r"'a.weight' of shape \(3,\): nobody"),
        ({"a.bias": (3,)}, r"'a.bias' of shape \(3,\): nobody"),
        (
            layers("a.", 4, 5) | layers("b.", 4, 2),
            "'b.0' takes 4 numbers, and 'a.0' before",
        ),
        (DQN | {"network.7.weight": (5, 99)}, "cannot be shown what it says to see"),
        (DQN | {"network.2.weight": (3, 3)}, "3 layers for images, of shapes"),
    ],
)
def test_weights_of_nobody_who_is_known(tmp_path, shapes, message):
    save(tmp_path / "a.pt", shapes)
    with pytest.raises(InputError, match=message) as refusal:
        read(tmp_path / "a.pt")
    assert "\n" not in str(refusal.value)


def test_texts_are_no_weights_and_weights_no_texts(tmp_path):
    path = tmp_path / "a"
    for text in ("", "S..T\n", "title: Größe\n---\nS.", "ä" * 512 + "x"):
        path.write_text(text, encoding="utf-8")
        assert is_text(path)
    path.write_text("x" + "ä" * 600, encoding="utf-8")  # a letter is cut in two after 1024 bytes
    assert is_text(path)
    torch.save({"a": torch.zeros(2)}, path)
    assert not is_text(path)
    torch.save({"a": torch.zeros(2)}, path, _use_new_zipfile_serialization=False)
    assert not is_text(path)
    save_file({"a": torch.zeros(2)}, path)
    assert not is_text(path)
    path.write_bytes(pickle.dumps({"a": 1}))
    assert not is_text(path)
    with pytest.raises(InputError, match=r"is no file of weights|holds no weights"):
        read(path)


def test_an_agent_of_games_plays_them(tmp_path):
    save(tmp_path / "a.cleanrl_model", DQN | {"network.9.weight": (4, 5), "network.9.bias": (4,)})
    agent = trdlab.agent(tmp_path / "a.cleanrl_model", env="ALE/Breakout-v5")
    assert agent.action_names == ("NOOP", "FIRE", "RIGHT", "LEFT")
    assert agent.evaluate(2, max_steps=12).lengths.tolist() == [12, 12]
    assert (
        trdlab.agent(agent, env="Breakout", env_arguments={"sticky": 0.25}).policy is agent.policy
    )
    with pytest.raises(InputError, match=r"it has 4×84×84 uint8 to see and 6 actions \(NOOP"):
        trdlab.agent(tmp_path / "a.cleanrl_model", env="Pong")
    with pytest.raises(InputError, match=r"observations of shape \(4, 84, 84\) and 4 actions"):
        trdlab.agent(tmp_path / "a.cleanrl_model", env="CartPole-v1")
