"""Agents in flax's format: CleanRL's in JAX, and the students of the paper's authors."""

import os
import pickle
import sys

import numpy as np
import pytest

import trdlab
from flax_files import packed, q_network, said
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Estimator
from trdlab.policies import Policy, ask
from trdlab.policies.files import Options
from trdlab.policies.flax import read_flax
from trdlab.policies.registry import read_policy

STACKS = np.random.default_rng(0).integers(256, size=(2, 4, 84, 84), dtype=np.uint8)
STUDENT = "Breakout-v5-seed-1-n-5-w-3.cleanrl_model"


def save(path, outputs, seed=0):
    params = q_network(outputs, seed)
    path.write_bytes(packed(params))
    return params


def read(path, actions=None, **options):
    return read_policy(path, Options.of(options), lambda: actions)


def test_every_array_by_its_name(tmp_path):
    path, rng = tmp_path / "a", np.random.default_rng(0)
    wide = {f"layer{i}": rng.normal(size=(i, 2)).astype(np.float32) for i in range(20)}
    held = {"params": wide, "step": np.arange(70_000).reshape(2, -1), "x" * 40: np.float64([[1]])}
    path.write_bytes(packed(held))
    arrays = read_flax(path)
    assert len(arrays) == 22
    for name, array in {**{f"params.{k}": v for k, v in wide.items()}, **held}.items():
        if name != "params":
            np.testing.assert_array_equal(arrays[name], array)
            assert arrays[name].dtype == array.dtype


def test_values_of_cleanrl_in_jax(tmp_path):
    params = save(tmp_path / "dqn_atari_jax.cleanrl_model", 6)
    policy = read(tmp_path / "dqn_atari_jax.cleanrl_model")
    np.testing.assert_allclose(policy.q_values(STACKS), said(params, STACKS), atol=1e-4)
    about = policy.about
    assert (about.title, about.seen, about.num_actions, about.gamma) == (
        "DQN of CleanRL (JAX)",
        (4, 84, 84),
        6,
        0.99,
    )


def test_a_student_is_an_estimator_that_acts(tmp_path):
    params = save(tmp_path / STUDENT, 4 * 5)
    student = read(tmp_path / STUDENT)
    assert isinstance(student, Estimator)
    assert isinstance(student, Policy)
    axis = student.time_axis
    assert (axis.gamma, axis.horizon, axis.num_components, axis.width) == (0.99, 4, 5, 3)
    expected = said(params, STACKS).reshape(2, 4, 5)  # action by action
    told = student.decompose(STACKS)
    np.testing.assert_allclose(told.components, expected, atol=1e-4)
    best = expected.sum(axis=2).argmax(axis=1)
    assert ask(student, STACKS)[0].argmax(axis=1).tolist() == best.tolist()
    assert (student.future.clip_rewards, student.future.life_loss_ends) == (True, True)


def test_who_says_how_many_components_there_are(tmp_path):
    path = tmp_path / "mine.cleanrl_model"
    save(path, 20)
    assert read(path, w=1, N=4).time_axis.num_components == 5
    assert read(path, actions=4, w=2).time_axis.num_components == 5
    assert read(path, actions=4, w=2).about.num_actions == 4
    assert read(path, actions=20).about.algorithm == "DQN"
    named = tmp_path / "Breakout-seed-0-n-5-w-1.cleanrl_model"
    named.write_bytes(path.read_bytes())
    assert read(named, N=9, w=7).time_axis.num_components == 10  # an option outweighs a name
    for options, message in (
        ({}, "has 20 outputs, more than games have actions. Say how many"),
        ({"actions": 3}, "20 outputs, which are not 3 actions times a whole number"),
        ({"N": 2}, "20 outputs, which are not 3 components times a whole number"),
        ({"N": -1}, "which are not 0 components"),
        ({"N": 4}, "Nothing says how many steps a component of .* has. Say it: .*,w=1"),
        ({"N": 4, "w": 0}, "w"),
        ({"N": "four"}, "the argument 'four'. It must be a whole number"),
        ({"N": 4, "w": 1, "normalize": "a.pkl"}, "sees frames as they are. Leave out normalize"),
        ({"N": 4, "w": 1, "greedy": False}, "no probabilities to draw from"),
    ):
        with pytest.raises(InputError, match=message) as refusal:
            read(path, **options)
        assert "\n" not in str(refusal.value)


def test_a_student_plays_and_is_explained_without_a_fit(tmp_path):
    save(tmp_path / STUDENT, 4 * 5)
    agent = trdlab.agent(tmp_path / STUDENT, env="Breakout")
    assert agent.is_fitted
    assert agent.estimator.time_axis.num_components == 5
    assert agent.evaluate(2, max_steps=8).lengths.tolist() == [8, 8]
    explanation = trdlab.explain(agent, parts="forecast", step=3, episodes=0)
    assert "w = 3" in str(explanation)
    save(tmp_path / "Pong-n-5-w-1.cleanrl_model", 3 * 5)
    with pytest.raises(InputError, match=r"6 actions \(NOOP, .* TRD-DQN needs .* and 3 actions"):
        trdlab.agent(tmp_path / "Pong-n-5-w-1.cleanrl_model", env="Pong")
    with pytest.raises(InputError, match="has γ, N and w of its own"):
        trdlab.agent(tmp_path / STUDENT, env="Breakout", horizon=4)


class Mark:
    def __reduce__(self):
        return os.system, ("touch mark",)


def deep(levels):
    return b"\x81\xa1a" * levels + packed(np.float32([1]))


def within(levels):
    """Arrays in what should be an array's numbers, one in the other."""
    content = packed(np.float32([1]))
    for _ in range(levels):
        content = b"\xc9" + len(content).to_bytes(4, "big") + b"\x01" + content
    return b"\x81\xa1a" + content


def zeros(*shape):
    return np.zeros(shape, np.float32)


WHOLE = packed(q_network(4))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (WHOLE[: len(WHOLE) // 2], "incomplete input"),
        (WHOLE[:-1], "incomplete input"),
        (WHOLE + b"\x00", "extra data"),
        (b"\x81\xa1a\xdf\xff\xff\xff\xff", "exceeds"),  # a map of four thousand million parts
        (b"\x81\xa1a\xdd\xff\xff\xff\xff", "exceeds"),
        (b"\x81\xa1a\xc6\xff\xff\xff\xff", "incomplete input"),
        (b"\x81\xa1a\xc9\xff\xff\xff\xff\x01", "exceeds"),
        (b"\xdf\xff\xff\xff\xff\xa1a", "exceeds"),
        (deep(5_000), "without end"),
        (b"\x81\xa1a" + b"\x91" * 5_000, "without end"),
        (within(5_000), "is none"),
        (b"\x81\xa1a" + packed([2**40, 2**40]), "'a' holds no array"),
        (packed({"a": "b"}), "'a' holds no array"),
        (packed({"a": [np.float32([1])]}), "'a' holds no array"),
        (packed({"a": b"x"}), "'a' holds no array"),
        (packed({"a": None}), "'a' holds no array"),
        (b"\x81\xa1\xff\x01", "can't decode byte"),
        (b"\x81\xa1a\xc1", "torn"),  # a byte that msgpack never uses
        (b"\x81\xa1a\xd4\x02\x00", "is none"),  # another extension
        (b"\x81\xa1a\xc7\x09\x01" + packed([[2**62], "f", b""])[:9], "torn"),
    ],
)  # fmt: skip
def test_what_is_torn_or_made_to_hurt_is_refused_in_one_line(tmp_path, data, message):
    path = tmp_path / "a.cleanrl_model"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message) as refusal:
        read(path)
    assert "\n" not in str(refusal.value)
    assert "is no file of flax, or torn" in str(refusal.value)


@pytest.mark.parametrize(
    "content",
    [
        [[2**31, 2**31], "float32", b"1234"],
        [[1], "float32", b"12345"],
        [[1], "object", b"12345678"],
        [[1], "O", b"12345678"],
        [[1], "V4", b"1234"],
        [[1], "bfloat16", b"12"],
        [["1"], "float32", b"1234"],
        ["1", "float32", b"1234"],
        [[1], "float32"],
        [[1] * 40, "float32", b"1234"],
        [[], 4, b"1234"],
        4,
    ],
)
def test_arrays_that_are_none(tmp_path, content):
    inner, path = packed(content), tmp_path / "a.cleanrl_model"
    path.write_bytes(b"\x81\xa1a\xc7" + bytes([len(inner)]) + b"\x01" + inner)
    with pytest.raises(InputError, match="should be an array of numbers is none"):
        read(path)


@pytest.mark.parametrize(
    ("layer", "part", "array", "message"),
    [
        ("Conv_1", "bias", zeros(3), "have shape"),
        ("Conv_0", "kernel", zeros(3, 3), "'Conv_0' in"),
        ("Dense_0", "kernel", zeros(10, 16), "no square image"),
        ("Dense_0", "kernel", zeros(2304, 16), "cannot be shown what it says"),
        ("Dense_1", "kernel", zeros(9, 4), "takes 9 numbers"),
        ("Dense_1", "kernel", zeros(16, 0), r"shape \(0, 16\)"),
        ("Conv_1", "kernel", zeros(4, 4, 0, 0), r"of shapes .*\(0, 0, 4, 4\)"),
        ("Dense_1", "bias", zeros(4) * np.nan, "nan in 'params.Dense_1.bias'"),
        ("Dense_1", "scale", zeros(4), "nobody who is known here writes such weights"),
    ],
)
def test_tensors_that_do_not_fit(tmp_path, layer, part, array, message):
    params = q_network(4)
    params["params"][layer][part] = array
    path = tmp_path / "a.cleanrl_model"
    path.write_bytes(packed(params))
    with pytest.raises(InputError, match=message) as refusal:
        read(path)
    assert "\n" not in str(refusal.value)


def test_a_pickle_with_code_is_refused_and_not_executed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / STUDENT
    path.write_bytes(pickle.dumps({"params": Mark()}))
    with pytest.raises(InputError, match="holds code"):
        read(path)
    assert not (tmp_path / "mark").exists()


def test_without_msgpack_it_says_what_to_install(tmp_path, monkeypatch):
    save(tmp_path / STUDENT, 4 * 5)
    monkeypatch.setitem(sys.modules, "msgpack", None)
    with pytest.raises(TrdlabError, match=r"pip install 'trdlab\[flax\]'"):
        read(tmp_path / STUDENT)


def test_as_flax_itself_writes_them(tmp_path):
    serialization = pytest.importorskip("flax.serialization", reason="flax is not installed")
    params = q_network(20)
    data = serialization.to_bytes(params)
    assert data == packed(params)
    (tmp_path / STUDENT).write_bytes(data)
    told = read(tmp_path / STUDENT).decompose(STACKS).value
    expected = said(params, STACKS).reshape(2, 4, 5).sum(axis=2)
    np.testing.assert_allclose(told, expected, atol=1e-4)
