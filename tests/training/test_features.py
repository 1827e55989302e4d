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
from trdlab.runs.fits import fit_path
from trdlab.training.fitted import load_fit
from trdlab.verbs.fitting import fit_run

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


@pytest.fixture(scope="module")
def frozen(run, tmp_path_factory) -> Path:
    """A fit of the same agent that reads its frozen features, kept elsewhere."""
    out, agent = tmp_path_factory.mktemp("fits") / "frozen", find_agent(str(run), joint=True)
    trdlab.fit(agent, horizon=4, steps=500, layers="frozen", most_updates=200, out=out)
    return out


def test_what_is_told_of_an_observation_is_what_the_fit_tells_of_its_features(run, frozen):
    trunk = trunk_of(find_agent(str(run), joint=True).estimator)
    top, _, plan = load_fit(frozen)
    assert plan.layers == "frozen"
    seen = np.random.default_rng(1).normal(size=(3, 4)).astype(np.float32)
    features = trunk.features(seen)
    with torch.no_grad():
        inputs = trunk.network.preprocess(torch.from_numpy(seen))
        assert np.array_equal(features, trunk.network.body(inputs).numpy())
    alone = top.decompose(features).components
    whole = trdlab.agent(str(frozen)).estimator.decompose(seen).components
    np.testing.assert_allclose(whole, alone, atol=1e-6)


def test_copied_layers_begin_as_the_agent_s_and_leave_these_alone(run):
    agent = find_agent(str(run), joint=True)
    own = agent.estimator.network
    before = {name: of.clone() for name, of in own.state_dict().items()}
    how: dict[str, Any] = {"horizon": 2, "steps": 200, "learning_rate": 1e-12, "check_every": 1}
    few: dict[str, Any] = {"most_updates": 1, "sync_every": 1, "layers": "copied"}
    fitted = trdlab.fit(agent, **how, **few).estimator.network
    for name, of in fitted.body.state_dict().items():
        torch.testing.assert_close(of, before[f"body.{name}"])
    assert fitted.policy_head is None
    assert all(torch.equal(of, before[name]) for name, of in own.state_dict().items())


def test_another_fit_of_a_run_has_an_epsilon_of_its_own(run, tmp_path):
    """That of the fit in the run's folder is a part of that fit alone."""
    few = {"horizon": 2, "steps": 300, "most_updates": 50}
    for epsilon, name in ((0.0, "without"), (0.3, "with")):
        out = tmp_path / name
        for agent in (trdlab.fit(str(run), epsilon=epsilon, out=out, **few), find_agent(str(out))):
            assert getattr(agent.policy, "epsilon", 0.0) == epsilon
            assert not isinstance(getattr(agent.policy, "policy", None), EpsilonGreedy)


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


def test_a_fit_of_features_kept_elsewhere_needs_its_agent(run, frozen):
    with pytest.raises(InputError, match=r"reads the features of '.*drone'\. Load both: "):
        trdlab.load(frozen)


def test_features_that_fit_another_network_are_refused(frozen, tmp_path):
    other = train(tmp_path / "other", "CartPole-v1", **FEW | {"hidden": [8]})
    with pytest.raises(InputError, match=r"reads 16 features, .* has 8\."):
        upon(trunk_of(trdlab.load(other)), load_fit(frozen)[0])


def test_only_networks_of_trdlab_have_features_to_read():
    with pytest.raises(InputError, match=r"The features of a [A-Z][A-Za-z]+ cannot be read"):
        trdlab.fit(lambda seen: 0, "CartPole-v1", layers="frozen", steps=200)
    with pytest.raises(InputError, match=r"no 'frosen' layers\. Did you mean 'frozen'\?"):
        trdlab.fit(lambda seen: 0, "CartPole-v1", layers="frosen", steps=200)


def test_a_run_told_to_fits_when_its_training_is_over(tmp_path):
    few = {"agent_steps": 400, "horizon": 3, "hidden": [8], "fit_steps": 500, "fit": True}
    agent = trdlab.train(
        "CartPole-v1", out=tmp_path / "run", learning_starts=50, evaluate_episodes=0, **few
    )
    assert agent.estimator.future.policy == "the agent's own policy"
    assert fit_path(tmp_path / "run", 400).is_dir()
