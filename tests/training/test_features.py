"""What reads a frozen network's features: fits of runs, kept in the run's own folder."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import trdlab
from small_runs import train
from trdlab.agents.naming import find_agent
from trdlab.deep.features import trunk_of, upon
from trdlab.errors import InputError
from trdlab.policies import EpsilonGreedy
from trdlab.training.fitted import fit_path, load_fit
from trdlab.verbs.making import fit_run

FEW: dict[str, Any] = {"agent_steps": 600, "gamma": 0.9, "N": 4, "hidden": [16], "fit_steps": 2_000}


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """A run whose agent was fitted when its training was over."""
    out = tmp_path_factory.mktemp("runs") / "drone"
    train(out, "CartPole-v1", **FEW, evaluate_epsilon=0.05)
    fit_run(out)
    return out


def test_an_agent_of_a_run_is_told_by_its_fit(run):
    agent, joint = find_agent(str(run)), find_agent(str(run), joint=True)
    assert agent.estimator.future.policy == "the agent's own policy (ε = 0.05)"
    assert joint.estimator.future.policy == "the greedy policy of the network"
    assert isinstance(agent.policy, EpsilonGreedy)
    assert agent.policy.epsilon == 0.05
    assert joint.policy is None
    seen = np.random.default_rng(0).normal(size=(5, 4)).astype(np.float32)
    told = agent.estimator.decompose(seen).components
    assert np.array_equal(told, trdlab.load(run).decompose(seen).components)
    learned = joint.estimator.decompose(seen).components
    assert np.array_equal(learned, trdlab.load(run, joint=True).decompose(seen).components)
    assert not np.allclose(told, learned)
    outlook = agent.estimator.outlook(seen)
    assert outlook is not None
    assert outlook.survival.shape == (5, 2, 5)


def test_what_is_told_of_an_observation_is_what_the_fit_tells_of_its_features(run):
    trunk = trunk_of(find_agent(str(run), joint=True).estimator)
    top, _, plan = load_fit(fit_path(run, 600))
    assert plan.features
    seen = np.random.default_rng(1).normal(size=(3, 4)).astype(np.float32)
    features = trunk.features(seen)
    with torch.no_grad():
        inputs = trunk.network.preprocess(torch.from_numpy(seen))
        assert np.array_equal(features, trunk.network.body(inputs).numpy())
    whole = upon(trunk, top)
    alone = top.decompose(features).components
    np.testing.assert_allclose(whole.decompose(seen).components, alone, atol=1e-6)


def test_a_fit_goes_wherever_its_run_goes(run, tmp_path, monkeypatch):
    moved = tmp_path / "elsewhere"
    shutil.copytree(run, moved)
    seen = np.zeros((1, 4), dtype=np.float32)
    expected = trdlab.load(run).decompose(seen).components
    monkeypatch.chdir(tmp_path)
    for name in ("elsewhere", "elsewhere@600", str(fit_path(Path("elsewhere"), 600))):
        found = trdlab.agent(name)
        assert np.array_equal(found.estimator.decompose(seen).components, expected), name
    assert np.array_equal(trdlab.load(fit_path(moved, 600)).decompose(seen).components, expected)


def test_a_fit_of_features_kept_elsewhere_needs_its_agent(run, tmp_path):
    out = tmp_path / "fit"
    agent = find_agent(str(run), joint=True)
    fitted = trdlab.fit(agent, horizon=3, steps=500, features=True, most_updates=200, out=out)
    seen = np.zeros((2, 4), dtype=np.float32)
    again = trdlab.agent(str(out)).estimator.decompose(seen).components
    assert np.array_equal(fitted.estimator.decompose(seen).components, again)
    with pytest.raises(InputError, match=r"reads the features of '.*drone@?.*'\. Load both: "):
        trdlab.load(out)


def test_features_that_fit_another_network_are_refused(run, tmp_path):
    other = train(tmp_path / "other", "CartPole-v1", **FEW | {"hidden": [8]})
    top = load_fit(fit_path(run, 600))[0]
    with pytest.raises(InputError, match=r"reads 16 features, .* has 8\."):
        upon(trunk_of(trdlab.load(other)), top)


def test_only_networks_of_trdlab_have_features_to_read():
    with pytest.raises(InputError, match=r"The features of a [A-Z][A-Za-z]+ cannot be read"):
        trdlab.fit(lambda seen: 0, "CartPole-v1", features=True, steps=200)


def test_a_run_told_to_fits_when_its_training_is_over(tmp_path):
    few = {"agent_steps": 400, "horizon": 3, "hidden": [8], "fit_steps": 500, "fit": True}
    agent = trdlab.train(
        "CartPole-v1", out=tmp_path / "run", learning_starts=50, evaluate_episodes=0, **few
    )
    assert agent.estimator.future.policy == "the agent's own policy"
    assert fit_path(tmp_path / "run", 400).is_dir()
