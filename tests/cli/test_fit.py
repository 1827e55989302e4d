"""`trdlab fit` and what it keeps, as users meet them."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import trdlab
from trdlab.cli import main
from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.policies import EpsilonGreedy
from trdlab.training.fitted import Stopped, load_fit

QUICK = {"horizon": 3, "steps": 4_000, "most_updates": 400, "learning_rate": 0.01}


@pytest.fixture(scope="module")
def kept(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("fits") / "ledge"
    trdlab.fit("gridworld:ledge", out=path, **QUICK)  # type: ignore[arg-type]
    return path


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    told = capsys.readouterr()
    return int(caught.value.code or 0), told.out, told.err


def test_a_fit_says_how_far_it_can_be_trusted_and_where_it_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ("fit", "gridworld:ledge", "--N", 3, "--steps", 4_000, "--time", "1s")
    code, out, err = run(capsys, *words)
    assert code == 0
    assert re.match(r"Over 300 episodes the agent scored 0\.8", out)
    assert "the agent's forecasts" in out
    assert out.rstrip().endswith("Try: trdlab explain fits/ledge-N3-w1")
    assert "Kept: fits/ledge-N3-w1" in err
    code, page, _ = run(capsys, "explain", "fits/ledge-N3-w1", "--what", "forecast")
    assert code == 0
    assert "After the first action, the agent's own policy acts." in page
    code, _, err = run(capsys, *words, "--out", "fits/ledge-N3-w1")
    assert (code, err) == (
        2,
        "error: 'fits/ledge-N3-w1' holds a fit that is done. Choose another --out.\n",
    )


@pytest.mark.parametrize("text", ["soon", "0", "10 days"])
def test_a_time_is_written_as_people_do(text: str, capsys: pytest.CaptureFixture[str]):
    code, _, err = run(capsys, "fit", "gridworld:ledge", "--time", text)
    assert (code, err) == (2, f"error: The time is '{text}'. Write it as 90s, 10m or 1h.\n")


def test_what_is_kept_is_what_was_fitted(kept: Path):
    fitted = trdlab.fit("gridworld:ledge", **QUICK)  # type: ignore[arg-type]
    estimator, interface, whose = load_fit(kept)
    states = np.arange(6)
    told = fitted.estimator.decompose(states).components
    assert estimator.decompose(states).components.tobytes() == told.tobytes()
    assert estimator.future == fitted.estimator.future
    assert interface.action_names == fitted.action_names
    assert (whose.agent, whose.env) == ("gridworld:ledge", None)
    again = trdlab.agent(str(kept))
    assert (again.name, again.estimator.time_axis) == ("ledge", trdlab.TimeAxis(0.95, 3))
    assert len(estimator.reach) == len(estimator.channels) > 2
    assert estimator.reach == fitted.estimator.reach
    assert trdlab.load(kept).decompose(states).components.tobytes() == told.tobytes()


def test_an_agent_without_a_name_is_kept_and_named_in_python(tmp_path):
    agent = trdlab.solve("ledge", horizon=2)
    unnamed = trdlab.agent(agent.estimator, env="gridworld:ledge", name="mine")
    trdlab.fit(unnamed, out=tmp_path / "mine", **QUICK)  # type: ignore[arg-type]
    assert trdlab.load(tmp_path / "mine").time_axis.horizon == 3
    with pytest.raises(InputError, match=r"an agent without a name\. Give it in Python"):
        trdlab.agent(str(tmp_path / "mine"))


def test_who_acts_is_the_same_when_it_is_found_again(tmp_path):
    agent = trdlab.agent("gridworld:bridge", gamma=0.1)  # to whom the far bank is worth nothing
    fitted = trdlab.fit(agent, out=tmp_path / "fit", **QUICK)  # type: ignore[arg-type]
    again, states = trdlab.agent(str(tmp_path / "fit")), np.arange(8)
    for one in (fitted, again):
        assert one.policy.act(states, None, None)[0].tolist() == (  # type: ignore[union-attr]
            agent.policy.act(states, None, None)[0].tolist()  # type: ignore[union-attr]
        )
    other = trdlab.agent("gridworld:bridge")
    assert other.policy.act(states, None, None)[0].tolist() != (  # type: ignore[union-attr]
        again.policy.act(states, None, None)[0].tolist()  # type: ignore[union-attr]
    )


def test_actions_keep_the_names_that_they_were_given(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = ("--action-names", "hoch, runter, links, rechts")
    words = ("gridworld:ledge", "--N", 2, "--steps", 2_000, "--time", "1s", "--out", "fit")
    code, _, _ = run(capsys, "fit", *words, *names)
    assert code == 0
    assert trdlab.agent("fit").action_names == ("hoch", "runter", "links", "rechts")
    manifest = json.loads(Path("fit/manifest.json").read_text())
    told = json.dumps(manifest).replace('"hoch", "runter"', '"down", "up"')
    told = told.replace('"links", "rechts"', '"left", "right"')
    Path("fit/manifest.json").write_text(told)
    with pytest.raises(InputError, match="does not fit the agent"):  # the same in another order
        trdlab.agent("fit")


def test_another_policy_is_another_agent_and_has_not_its_name(tmp_path):
    agent = trdlab.agent("gridworld:ledge", horizon=2)
    stumbling = trdlab.agent(agent, policy=EpsilonGreedy(agent.policy, 0.3))
    trdlab.fit(stumbling, out=tmp_path / "fit", **QUICK)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="an agent without a name"):
        trdlab.agent(str(tmp_path / "fit"))


def test_nothing_is_replaced_and_what_is_torn_is_named(kept: Path, tmp_path):
    with pytest.raises(OutputError, match=r"holds a fit that is done\. Choose another `out`\."):
        trdlab.fit("gridworld:ledge", out=kept, **QUICK)  # type: ignore[arg-type]
    torn = tmp_path / "torn"
    shutil.copytree(kept, torn)
    manifest = json.loads((torn / "manifest.json").read_text())
    (torn / "manifest.json").write_text(json.dumps({**manifest, "fit": {}}))
    with pytest.raises(TrdlabError, match="does not say what was fitted: it is torn"):
        trdlab.agent(str(torn))
    (torn / "manifest.json").write_text(json.dumps(manifest))
    (weights,) = torn.glob("checkpoints/*/q_network.safetensors")
    weights.write_bytes(weights.read_bytes()[:-1])
    with pytest.raises(TrdlabError, match="torn"):
        trdlab.load(torn)


def test_a_fit_that_was_stopped_goes_on_with_the_same_bits(kept: Path, tmp_path, capsys):
    path, asked = tmp_path / "ledge", 0

    def later() -> bool:
        nonlocal asked
        asked += path.exists()  # which it does when all is played
        return asked > 1  # at the second look

    with pytest.raises(Stopped, match=r"Stopped at \d+ updates\."):
        trdlab.fit("gridworld:ledge", out=path, should_stop=later, **QUICK)  # type: ignore[arg-type]
    assert trdlab.load(path).time_axis.horizon == 3, "the best of it so far"
    with pytest.raises(InputError, match=r"was begun with steps = 4000, and this has 5000\."):
        trdlab.fit("gridworld:ledge", out=path, **{**QUICK, "steps": 5_000})  # type: ignore[arg-type]
    code, out, _ = run(capsys, "resume", path)
    assert code == 0
    assert "the agent's forecasts" in out
    weights = "checkpoints/*/q_network.safetensors"
    (one,), (other,) = kept.glob(weights), path.glob(weights)
    assert one.read_bytes() == other.read_bytes()
    assert not list((path / "replay").iterdir()), "what was played is not needed any more"


def test_a_fit_that_was_stopped_while_it_played_begins_again(tmp_path):
    path = tmp_path / "ledge"
    with pytest.raises(Stopped, match="before anything was learned"):
        trdlab.fit("gridworld:ledge", out=path, should_stop=lambda: True, **QUICK)  # type: ignore[arg-type]
    assert not path.exists(), "there is nothing to keep"
    assert trdlab.fit("gridworld:ledge", out=path, **QUICK).is_fitted  # type: ignore[arg-type]


def test_a_fit_is_listed_with_runs_and_is_none(kept: Path, capsys):
    code, out, _ = run(capsys, "runs", kept.parent)
    assert code == 0
    assert re.search(r"ledge +gridworld:ledge +3 +1 +4000 +a fit, \d+ updates", out)
    code, _, err = run(capsys, "evaluate", kept)
    assert code == 2
    assert f"is a fit, and no training run. Its agent is played by: trdlab agent {kept}" in err


def test_what_was_given_in_python_goes_on_in_python(tmp_path, capsys):
    path = tmp_path / "fit"  # which is made when all is played
    given = {"fell": lambda step: step.terminated}
    stopped = {"out": path, "should_stop": path.exists, "outcomes": given}
    with pytest.raises(Stopped):
        trdlab.fit("gridworld:ledge", **stopped, **QUICK)  # type: ignore[arg-type]
    code, _, err = run(capsys, "resume", path)
    assert code == 2
    assert "The outcomes of" in err
    assert "were given in Python. Go on there: trdlab.fit" in err


def test_outcomes_are_named_on_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ("fit", "gridworld:ledge", "--N", 2, "--steps", 2_000, "--time", "1s")
    out = ("--out", tmp_path / "fit")
    parts = ("--part", "coin=info.parts.coin", "--part", "hazard=info.parts.hazard")
    code, _, _ = run(capsys, *words, *parts, "--outcome", "fell=info.parts.hazard", *out)
    assert code == 0
    outlook = trdlab.load(tmp_path / "fit").outlook(np.arange(3))
    assert outlook is not None
    assert (list(outlook.parts), list(outlook.amounts)) == (["coin", "hazard"], ["fell"])
    code, _, err = run(capsys, *words, "--outcome", "row")
    assert (code, err) == (2, "error: The outcome is 'row'. Write it as NAME=info.KEY.\n")
    code, _, err = run(capsys, *words, *parts, "--outcome", "coin=info.parts.hazard")
    assert code == 2
    assert "'coin' is the name of a part and of an outcome. Give each a name of its own." in err
    code, _, err = run(capsys, *words, "--part", "coin=info.parts.coin")
    assert code == 2
    assert "The parts do not add up to the reward" in err


def test_who_knows_nothing_yet_is_told_how_to_find_out(tmp_path):
    def policy(observations: np.ndarray) -> np.ndarray:
        return np.tile([0.5, 0.5], (len(observations), 1))

    agent = trdlab.agent(policy, env="CartPole-v1")
    with pytest.raises(InputError, match=r"Fit it first: trdlab\.fit\(agent\), or trdlab fit\."):
        trdlab.explain(agent)
    fitted = trdlab.fit(agent, horizon=4, steps=2_000, most_updates=200)
    assert fitted.estimator.time_axis == trdlab.TimeAxis(0.99, 4)
    assert "the agent's own policy" in str(trdlab.explain(fitted, parts="forecast", episodes=10))
