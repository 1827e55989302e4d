"""Statistics of VecNormalize: read without executing anything, and applied to what is seen."""

import os
import pickle
import sys
from types import ModuleType

import numpy as np
import pytest

from archives import cartpole_dqn, cartpole_ppo, data, drawn, ppo_shapes, save_archive, several
from trdlab.errors import InputError
from trdlab.policies import ask
from trdlab.policies.files import Options
from trdlab.policies.registry import read_policy

MEANS, VARIANCES = np.array([1.0, 0.0, -2.0, 0.5]), np.array([4.0, 1.0, 0.25, 1e-12])
SEEN = np.random.default_rng(1).normal(size=(6, 4)).astype(np.float32)


@pytest.fixture
def save(tmp_path, monkeypatch):
    """Returns a function that writes what `VecNormalize.save` writes, as a library of that name."""
    module = ModuleType("stable_baselines3")
    monkeypatch.setitem(sys.modules, "stable_baselines3", module)
    for name in ("VecNormalize", "RunningMeanStd"):
        kind = type(name, (), {"__module__": "stable_baselines3"})
        monkeypatch.setattr(module, name, kind, raising=False)

    def written(by_part="", **held):
        monkeypatch.setitem(sys.modules, "stable_baselines3", module)
        statistics, whole = module.RunningMeanStd(), module.VecNormalize()
        statistics.__dict__.update(mean=MEANS, var=VARIANCES, count=np.float64(7.0))
        statistics = {by_part: statistics} if by_part else statistics
        usual = {"norm_obs": True, "obs_rms": statistics, "clip_obs": 3.0, "epsilon": 1e-8}
        whole.__dict__.update(usual | held)
        path = tmp_path / "vecnormalize.pkl"
        path.write_bytes(pickle.dumps(whole))
        monkeypatch.setitem(sys.modules, "stable_baselines3", None)  # it is not needed to read
        return path

    return written


@pytest.mark.parametrize("write", [cartpole_dqn, cartpole_ppo])
def test_observations_are_normalised_as_they_were_in_training(tmp_path, save, write):
    agent, statistics = write(tmp_path / "a.zip"), save()
    plain = read_policy(agent, Options())
    policy = read_policy(agent, Options.of({"normalize": str(statistics)}))
    seen = np.clip((SEEN - MEANS) / np.sqrt(VARIANCES + 1e-8), -3.0, 3.0).astype(np.float32)
    np.testing.assert_array_equal(ask(policy, SEEN)[0], ask(plain, seen)[0])
    assert (ask(policy, SEEN)[0] != ask(plain, SEEN)[0]).any()
    assert policy.about == plain.about
    if hasattr(plain, "q_values"):
        np.testing.assert_array_equal(policy.q_values(SEEN), plain.q_values(seen))


def test_parts_of_observations_are_normalised_each_or_left_alone(tmp_path, save, monkeypatch):
    said = several("{'at': Box(-9.0, 9.0, (2,), float32), 'key': Discrete(2)}")
    beside = data("stable_baselines3.common.policies", said, clip_range=1)
    agent = save_archive(tmp_path / "a.zip", drawn(ppo_shapes()), beside)
    monkeypatch.setitem(globals(), "MEANS", MEANS[2:])
    monkeypatch.setitem(globals(), "VARIANCES", VARIANCES[2:])
    plain, path = read_policy(agent, Options()), save(by_part="at")
    policy = read_policy(agent, Options.of({"normalize": str(path)}))
    seen = SEEN.copy()
    seen[:, :2] = np.clip((SEEN[:, :2] - MEANS) / np.sqrt(VARIANCES + 1e-8), -3.0, 3.0)
    np.testing.assert_array_equal(ask(policy, SEEN)[0], ask(plain, seen)[0])
    for name, message in (
        ("door", r"is of \['door'\], and the agent sees \['at', 'key'\]"),
        ("", r"is of one thing, and the agent sees \['at', 'key'\]"),
    ):
        with pytest.raises(InputError, match=message):
            read_policy(agent, Options.of({"normalize": str(save(by_part=name))}))


def test_where_observations_were_left_alone_they_are(tmp_path, save):
    agent, statistics = cartpole_ppo(tmp_path / "a.zip"), save(norm_obs=False)
    policy = read_policy(agent, Options.of({"normalize": str(statistics)}))
    np.testing.assert_array_equal(ask(policy, SEEN)[0], ask(read_policy(agent, Options()), SEEN)[0])


class Mark:
    """Pickled code: whoever executes it leaves a mark."""

    def __init__(self, how, path):
        self.how = {
            "system": (os.system, (f"touch '{path}'",)),
            "eval": (eval, (f"open({str(path)!r}, 'w')",)),
            "getattr": (getattr, (os, "system")),
        }[how]

    def __reduce__(self):
        return self.how


@pytest.mark.parametrize(
    ("how", "code"),
    [("system", r"posix\.system"), ("eval", r"builtins\.eval"), ("getattr", r"builtins\.getattr")],
)
def test_code_is_refused_by_name_and_leaves_no_mark(tmp_path, save, how, code):
    mark = tmp_path / "mark"
    agent = cartpole_ppo(tmp_path / "a.zip")
    held = Mark(how, mark) if how != "getattr" else {"held": None}
    path = save(extra=held)
    if how == "getattr":
        path.write_bytes(b"cbuiltins\ngetattr\n(cbuiltins\nobject\nVx\ntR.")
    with pytest.raises(InputError, match=rf"vecnormalize.pkl' holds code \({code}\)"):
        read_policy(agent, Options.of({"normalize": str(path)}))
    assert not mark.exists()


@pytest.mark.parametrize(
    ("held", "message"),
    [
        ({"obs_rms": {"a": 1}}, "holds no statistics of observations"),
        ({"clip_obs": "far"}, "holds no statistics of observations"),
        ({"epsilon": None}, "holds no statistics of observations"),
    ],
)
def test_other_statistics_are_refused(tmp_path, save, held, message):
    agent, path = cartpole_ppo(tmp_path / "a.zip"), save(**held)
    with pytest.raises(InputError, match=message):
        read_policy(agent, Options.of({"normalize": str(path)}))


def test_files_of_something_else_are_refused(tmp_path, save):
    agent, path = cartpole_ppo(tmp_path / "a.zip"), save()
    whole = path.read_bytes()
    options = Options.of({"normalize": str(path)})
    for content in (b"", b"S....", whole[: len(whole) // 2], pickle.dumps([1])):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"is torn, or no file of|is no file of VecNormalize"):
            read_policy(agent, options)
    path.unlink()
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_policy(agent, options)
    rng = np.random.default_rng(0)
    for at in rng.integers(len(whole), size=400).tolist():
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x15]) + whole[at + 1 :])
        try:
            read_policy(agent, options)
        except InputError:
            continue


def test_statistics_of_other_observations_are_refused(tmp_path, save, monkeypatch):
    agent = cartpole_ppo(tmp_path / "a.zip")
    monkeypatch.setitem(globals(), "MEANS", np.zeros(3))
    monkeypatch.setitem(globals(), "VARIANCES", np.ones(3))
    with pytest.raises(InputError, match=r"of shape \(3,\), and the agent sees \(4,\)"):
        read_policy(agent, Options.of({"normalize": str(save())}))
