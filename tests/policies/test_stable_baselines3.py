"""Archives of Stable-Baselines3, written by hand: what acts, what is known, what is refused."""

import json
import os
import pickle
import zipfile
from base64 import b64encode
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from torch.nn import functional

from archives import (
    PICKLED,
    box,
    cartpole_dqn,
    cartpole_ppo,
    data,
    discrete,
    drawn,
    layers,
    ppo_shapes,
    save_archive,
    several,
    tensors,
    torch_bytes,
)
from trdlab.environments.flat import FlatSpace
from trdlab.environments.interface import Interface
from trdlab.errors import InputError
from trdlab.policies import Policy, ask
from trdlab.policies.files import Options
from trdlab.policies.registry import read_policy

TEACHERS = Path(__file__).parents[3] / "shared" / "teachers"
COMMON, CONTRIB = "stable_baselines3.common.policies", "sb3_contrib"
SEEN = np.random.default_rng(1).normal(size=(6, 4)).astype(np.float32)


def read(path: Path, **options: Any) -> Any:
    return read_policy(path, Options.of(options))


def softmax(logits: np.ndarray) -> np.ndarray:
    odds = np.exp(logits - logits.max(axis=1, keepdims=True))
    return odds / odds.sum(axis=1, keepdims=True)


def relu(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0.0)


def close(one: Any, other: Any) -> None:
    np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-6)


def test_dqn_takes_the_best_of_its_values(tmp_path):
    policy = read(cartpole_dqn(tmp_path / "a.zip"))
    w = drawn(layers("q_net.q_net.", 4, 5, 2) | layers("q_net_target.q_net.", 4, 5, 2))
    hidden = relu(SEEN @ w["q_net.q_net.0.weight"].T + w["q_net.q_net.0.bias"])
    values = hidden @ w["q_net.q_net.2.weight"].T + w["q_net.q_net.2.bias"]
    close(policy.q_values(SEEN), values)
    likely, memory = ask(policy, SEEN)
    assert likely.tolist() == np.eye(2)[values.argmax(axis=1)].tolist()
    assert memory is None
    about = policy.about
    assert (about.title, about.seen, about.num_actions) == (
        "DQN of Stable-Baselines3 2.3.0",
        (4,),
        2,
    )
    assert (about.layers, about.activation, about.gamma) == ("4 → 5 → 2", "ReLU", 0.9)
    assert isinstance(policy, Policy)
    with pytest.raises(InputError, match=r"values at observation 1 of 2 are no numbers: \[nan"):
        ask(policy, np.float32([[0, 0, 0, 0], [0, 0, np.nan, 0]]))
    with pytest.raises(InputError, match=r"shown observations of shape \(3,\)\. It takes \(4,\)"):
        ask(policy, np.zeros((2, 3)))


def test_ppo_draws_and_its_activation_is_said_or_given(tmp_path):
    w = drawn(ppo_shapes())

    def told(between: Any) -> np.ndarray:
        first = w["mlp_extractor.policy_net.0.weight"], w["mlp_extractor.policy_net.0.bias"]
        hidden = between(SEEN @ first[0].T + first[1])
        return softmax(hidden @ w["action_net.weight"].T + w["action_net.bias"])

    plain, path = read(cartpole_ppo(tmp_path / "a.zip")), tmp_path / "b.zip"
    close(ask(plain, SEEN)[0], told(np.tanh))
    assert (plain.about.activation, plain.about.draws) == ("Tanh", True)
    kwargs = {":type:": "dict", ":serialized:": PICKLED,
              "activation_fn": "<class 'torch.nn.modules.activation.ReLU'>"}  # fmt: skip
    save_archive(path, w, data(COMMON, box(4), clip_range=1, policy_kwargs=kwargs))
    close(ask(read(path), SEEN)[0], told(relu))
    close(ask(read(path, activation="tanh"), SEEN)[0], told(np.tanh))
    likeliest = read(path, greedy=True)
    assert ask(likeliest, SEEN)[0].tolist() == np.eye(2)[told(relu).argmax(axis=1)].tolist()
    assert likeliest.about.draws is False
    assert (plain.gamma, likeliest.gamma) == (0.9, 0.9)


@pytest.mark.parametrize(
    ("module", "more", "algorithm"),
    [
        (COMMON, {"clip_range": 1}, "PPO"),
        (COMMON, {}, "A2C"),
        (COMMON, {"cg_max_steps": 15}, "TRPO"),
        (f"{CONTRIB}.common.maskable.policies", {"clip_range": 1}, "MaskablePPO"),
    ],
)
def test_algorithms_with_an_actor(tmp_path, module, more, algorithm):
    path = save_archive(tmp_path / "a.zip", drawn(ppo_shapes()), data(module, box(4), **more))
    assert read(path).about.algorithm == algorithm


def test_quantiles_are_averaged_and_states_are_one_of_n(tmp_path):
    w = drawn(layers("quantile_net.quantile_net.", 7, 3 * 5))
    beside = data(f"{CONTRIB}.qrdqn.policies", discrete(7), actions=3)
    policy = read(save_archive(tmp_path / "a.zip", w, beside))
    states = np.array([0, 6, 2])
    weight, bias = (w[f"quantile_net.quantile_net.0.{part}"] for part in ("weight", "bias"))
    close(policy.q_values(states), (weight.T[states] + bias).reshape(3, 5, 3).mean(axis=1))
    assert (policy.about.algorithm, policy.about.seen) == ("QR-DQN", (7,))


def test_images_are_divided_by_255_unless_the_archive_says_no(tmp_path):
    extractor = {
        "cnn.0.weight": (4, 3, 8, 8), "cnn.0.bias": (4,),
        "cnn.2.weight": (4, 4, 4, 4), "cnn.2.bias": (4,),
        "cnn.4.weight": (4, 4, 3, 3), "cnn.4.bias": (4,),
        "linear.0.weight": (6, 8), "linear.0.bias": (6,),
    }  # fmt: skip
    acting = {f"features_extractor.{name}": shape for name, shape in extractor.items()}
    idle = {f"vf_features_extractor.{name}": shape for name, shape in extractor.items()}
    head = {"action_net.weight": (2, 6), "action_net.bias": (2,)}
    w = drawn(acting | idle | head | {"value_net.weight": (1, 6), "value_net.bias": (1,)})
    images = np.random.default_rng(0).integers(256, size=(3, 3, 36, 44), dtype=np.uint8)

    def told(divisor: float) -> np.ndarray:
        part = {name: torch.from_numpy(w[f"features_extractor.{name}"]) for name in extractor}
        x = torch.from_numpy(images).float() / divisor
        for number, stride in ((0, 4), (2, 2), (4, 1)):
            x = functional.conv2d(
                x, part[f"cnn.{number}.weight"], part[f"cnn.{number}.bias"], stride
            )
            x = x.relu()
        x = functional.linear(x.flatten(1), part["linear.0.weight"], part["linear.0.bias"]).relu()
        return softmax((x.numpy() @ w["action_net.weight"].T + w["action_net.bias"]).astype(float))

    for kwargs, divisor in (({}, 255.0), ({"normalize_images": False}, 1.0)):
        beside = data(COMMON, box(3, 36, 44, dtype="uint8"), clip_range=1, policy_kwargs=kwargs)
        policy = read(save_archive(tmp_path / "a.zip", w, beside))
        close(ask(policy, images)[0], told(divisor))
    assert policy.about.seen == (3, 36, 44)
    assert policy.about.layers == "4 of 8×8 → 4 of 4×4 → 4 of 3×3 → 6 → 2"


@pytest.mark.parametrize(
    "said",
    [
        "{'at': Box([-1. -2.], [1. 2.], (2,), float32), 'key': Discrete(2)}",
        "OrderedDict([('at', Box(-1.0, 1.0, (2,), float32)), ('key', Discrete(2))])",  # of old
    ],
)
def test_a_dict_is_seen_as_one_vector(tmp_path, said):
    beside = data(COMMON, several(said), clip_range=1)
    policy = read(save_archive(tmp_path / "a.zip", drawn(ppo_shapes()), beside))
    plain = read(cartpole_ppo(tmp_path / "b.zip"))
    close(ask(policy, SEEN)[0], ask(plain, SEEN)[0])
    assert policy.about.needs == "a Dict of 'at' (2,), 'key' (2,) and 2 actions"
    assert policy.about.to_dict()["parts"] == {"at": [2], "key": [2]}

    def fits(**parts: gym.Space[Any]) -> None:
        there = Interface(FlatSpace(gym.spaces.Dict(**parts)), ("a", "b"))
        policy.about.check_fits(there, "Maze-v0", "mine")

    fits(at=gym.spaces.Box(0, 1, (2,)), key=gym.spaces.MultiBinary(2))
    with pytest.raises(
        InputError,
        match=r"'Maze-v0' does not fit 'mine': it has a Dict of 'at' \(2,\), 'door' \(2,\) to "
        r"see\. This PPO needs a Dict of 'at' \(2,\), 'key' \(2,\) and 2 actions\.",
    ):
        fits(at=gym.spaces.Box(0, 1, (2,)), door=gym.spaces.Discrete(2))


def test_memory_is_carried_and_begins_at_zero(tmp_path):
    lstm = {
        "lstm_actor.weight_ih_l0": (12, 4), "lstm_actor.weight_hh_l0": (12, 3),
        "lstm_actor.bias_ih_l0": (12,), "lstm_actor.bias_hh_l0": (12,),
    }  # fmt: skip
    w = drawn(ppo_shapes(3) | lstm)
    beside = data(f"{CONTRIB}.common.recurrent.policies", box(4), clip_range=1)
    policy = read(save_archive(tmp_path / "a.zip", w, beside))
    assert (policy.about.algorithm, policy.about.memory) == ("RecurrentPPO", 6)

    def sigmoid(x: np.ndarray) -> np.ndarray:
        return 1.0 / (1.0 + np.exp(-x))

    h = c = np.zeros((2, 3))
    state = None
    for step in range(5):
        seen, begins = SEEN[step : step + 2], np.array([step == 0, step in (0, 3)])
        h, c = (np.where(begins[:, None], 0.0, part) for part in (h, c))
        gates = seen @ w["lstm_actor.weight_ih_l0"].T + w["lstm_actor.bias_ih_l0"]
        gates = gates + h @ w["lstm_actor.weight_hh_l0"].T + w["lstm_actor.bias_hh_l0"]
        i, f, g, o = np.split(gates, 4, axis=1)
        c = sigmoid(f) * c + sigmoid(i) * np.tanh(g)
        h = sigmoid(o) * np.tanh(c)
        first = w["mlp_extractor.policy_net.0.weight"], w["mlp_extractor.policy_net.0.bias"]
        told = np.tanh(h @ first[0].T + first[1]) @ w["action_net.weight"].T + w["action_net.bias"]
        likely, state = ask(policy, seen, state, begins)
        close(likely, softmax(told))
        assert [part.shape for part in state] == [(2, 1, 3)] * 2


class Mark:
    """Pickled code: whoever executes it leaves a mark."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return os.system, (f"touch '{self.path}'",)


def test_code_in_the_weights_is_refused_and_in_the_data_never_read(tmp_path):
    path, mark = tmp_path / "a.zip", tmp_path / "mark"
    cartpole_dqn(path, policy=torch_bytes({"a": Mark(mark)}))
    with pytest.raises(InputError, match=r"a.zip: policy.pth' holds code \(posix.system\)"):
        read(path)
    hostile = b64encode(pickle.dumps(Mark(mark))).decode()
    beside = data(
        COMMON, {**box(4), ":serialized:": hostile}, lr_schedule={":serialized:": hostile}
    )
    beside["policy_class"][":serialized:"] = hostile
    save_archive(path, drawn(ppo_shapes()), beside, pytorch_variables=torch_bytes(Mark(mark)))
    ask(read(path), SEEN)
    assert not mark.exists()
    pickle.loads(pickle.dumps(Mark(mark)))
    assert mark.exists()  # so dangerous they are


def test_a_torn_archive_is_refused_wherever_it_ends(tmp_path):
    whole = cartpole_dqn(tmp_path / "a.zip").read_bytes()
    for length in (4, 30, 500, len(whole) // 2, len(whole) - 30, len(whole) - 1):
        (tmp_path / "a.zip").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"a\.zip' is torn"):
            read(tmp_path / "a.zip")


def test_damage_anywhere_is_refused_or_harmless(tmp_path):
    path, rng = tmp_path / "a.zip", np.random.default_rng(0)
    whole, refused = cartpole_ppo(path).read_bytes(), []
    for at in rng.integers(len(whole), size=300).tolist():
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        try:
            ask(read(path), SEEN)
        except InputError as error:
            refused.append(str(error))
    assert len(refused) > 100
    assert "\n" not in "".join(refused)


@pytest.mark.parametrize("name", sorted(ppo_shapes()))
@pytest.mark.parametrize("how", ["missing", "shorter", "deeper", "not finite"])
def test_weights_that_do_not_fit_are_named(tmp_path, name, how):
    w = drawn(ppo_shapes())
    changed = {
        "missing": None,
        "shorter": w[name][:-1],
        "deeper": w[name][None],
        "not finite": w[name] * np.float32(np.nan),
    }[how]
    w = {key: of for key, of in w.items() if key != name} | (
        {} if changed is None else {name: changed}
    )
    path = save_archive(tmp_path / "a.zip", w, data(COMMON, box(4), clip_range=1))
    last_bias = how == "missing" and name.endswith("bias")  # layers may have none
    if last_bias:
        ask(read(path), SEEN)
        return
    with pytest.raises(InputError):
        ask(read(path), SEEN)


@pytest.mark.parametrize(
    ("beside", "message"),
    [
        (data("stable_baselines3.sac.policies", box(4)), "weights|SAC"),
        (data("mine.policies", box(4)), "a class of its own, in the module 'mine'"),
        (data(COMMON, several("{}")), "sees a Dict of observations, and their parts are not said"),
        (
            data(COMMON, several("{'at': Box(-1.0, 1.0, (3,), float32)}")),
            r"cannot be shown what it says to see, \(3,\): mat1 and mat2 shapes",
        ),
        (data(COMMON, box(4)) | {"action_space": box(2)}, "are a Box. A decomposition has one row"),
        (
            data(COMMON, box(4))
            | {
                "action_space": {
                    ":type:": "<class 'gymnasium.spaces.multi_discrete.MultiDiscrete'>",
                    "nvec": "[7 7 7]",
                }
            },
            "have 343 combinations. A decomposition has .* There may be 256 of them",
        ),
        (data(COMMON, box(4), actions=3), "has 2 outputs for 3 choices"),
        (
            data(COMMON, box(4), policy_kwargs={"activation_fn": "<class 'mine.Wave'>"}),
            "There is no activation 'Wave'",
        ),
        (
            data(
                COMMON,
                box(4),
                policy_kwargs={"features_extractor_class": "<class 'mine.f.<locals>.CNN'>"},
            ),
            "The extractor in .* is of a class of its own, in the module 'mine'",
        ),
        ([], "holds no names"),
    ],
)
def test_archives_that_cannot_be_read_say_why(tmp_path, beside, message):
    w = drawn(layers("actor.mu.", 4, 2) if "sac" in str(beside) else ppo_shapes())
    path = save_archive(tmp_path / "a.zip", w, beside)
    with pytest.raises(InputError, match=message) as refusal:
        read(path)
    assert "\n" not in str(refusal.value)


def test_a_network_of_ones_own_is_refused_by_what_is_strange(tmp_path):
    strange = {"features_extractor.net.0.weight": (4, 4)}
    path = save_archive(tmp_path / "a.zip", drawn(ppo_shapes() | strange), data(COMMON, box(4)))
    with pytest.raises(InputError, match=r"has 'features_extractor.net.0.weight', which A2C"):
        read(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", json.dumps({}))
    with pytest.raises(InputError, match=r"without its policy\.pth"):
        read(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("policy.pth", torch_bytes(tensors(drawn(ppo_shapes()))))
    with pytest.raises(InputError, match=r"without its data\. Save the model again"):
        read(path)
    with pytest.raises(InputError, match=r"no argument 'activations'. Did you mean 'activation'"):
        read(path, activations="tanh")
    with pytest.raises(InputError, match=r"argument '3'. It must be true or false"):
        read(path, greedy=3)
    with pytest.raises(InputError, match="holds the values of actions, and no probabilities"):
        read(cartpole_dqn(path), greedy=False)


@pytest.mark.parametrize("algorithm", ["dqn", "ppo"])
def test_agents_of_others_reach_their_score(algorithm):
    import trdlab

    path = TEACHERS / f"sb3-{algorithm}-CartPole-v1.zip"
    if not path.exists():
        pytest.skip(f"there is no {path.name} in ../shared/teachers")
    agent = trdlab.agent(path, env="CartPole-v1")
    result = agent.evaluate(5, seed=0)
    assert result.returns.tolist() == [500.0] * 5
    assert agent.policy.about.version == "1.0rc0"


@pytest.mark.parametrize("shape", [(3, 60, 60), (3, 8, 8), (3, 10**5, 10**5), (1, 36, 44), ()])
def test_images_of_another_size_than_the_network_takes(tmp_path, shape):
    extractor = {
        "cnn.0": (4, 3, 8, 8),
        "cnn.2": (4, 4, 4, 4),
        "cnn.4": (4, 4, 3, 3),
        "linear.0": (6, 8),
    }
    acting = {f"features_extractor.{name}.weight": of for name, of in extractor.items()}
    w = drawn(acting | {"action_net.weight": (2, 6)})
    path = save_archive(tmp_path / "a.zip", w, data(COMMON, box(*shape, dtype="uint8")))
    with pytest.raises(InputError, match=r"cannot be shown what it says to see|takes 3 channels"):
        read(path)
