"""What is said of two agents is read back and tested; and the page, the data and the picture."""

import io
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console
from trdlab.explanations.comparison.differences import ComparisonFinding
from trdlab.explanations.comparison.findings import comparison_findings
from trdlab.intervals import Estimates
from trdlab.show.comparison import TEMPLATES, check_comparison, comparison_sentences, page
from trdlab.show.comparison_data import comparison_to_dict

import mutants
from trdlab.agents import Agent, find_pair, gridworld_agent
from trdlab.cli import main
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations import assess
from trdlab.explanations.calibration.report import TrustReport
from trdlab.explanations.calibration.trust import trust
from trdlab.explanations.comparison.comparing import compare
from trdlab.explanations.comparison.comparison import Comparison, compared
from trdlab.explanations.comparison.states import Visits
from trdlab.policies import Memoryless
from trdlab.show.plots.comparison import comparison_figure
from trdlab.tabular import ExactTable

NAMES = ("up", "FIRE", "move left")
WORDS = {
    "more": "less",
    "same": "other",
    "other": "same",
    "both": "neither",
    "largest": "smallest",
    "later": "sooner",
    "rewards": "costs",
    "costs": "rewards",
    "furthest": "least",
    "can": "cannot",
    "cannot": "can",
    "whole": "half",
    "nothing": "much",
    "half": "third",
    "too few": "enough",
    "from": "at",
    "by": "after",
}


@cache
def reports() -> tuple[TrustReport | None, ...]:
    """Six reports with six different verdicts, and none."""
    axis = TimeAxis(0.95, 3)
    agent = gridworld_agent("ledge,slip=0.3,exploring_starts=true", axis)

    def with_noise(begin: int) -> Agent:
        table = agent.estimator
        assert isinstance(table, ExactTable)
        components = table.decomposition.components.copy()
        components[..., begin:] += np.random.default_rng(0).normal(
            size=(components[..., begin:].shape)
        )
        worse = replace(table, decomposition=RewardDecomposition(components, axis))
        return replace(agent, estimator=worse)

    nothing = gridworld_agent("ledge,exploring_starts=true", axis)
    still = replace(
        nothing, policy=Memoryless(lambda states: np.eye(4)[np.zeros(len(states), dtype=int)])
    )
    zero = RewardDecomposition(np.zeros((8, 4, 4)), axis)
    table = nothing.estimator
    assert isinstance(table, ExactTable)
    free = gridworld_agent("ledge,slip=0", axis)
    unpaid = replace(still, estimator=replace(table, decomposition=zero), make=free.make)
    judged = (agent, with_noise(2), with_noise(0), unpaid, with_noise(1))
    *found, last = (assess(of, episodes=200, epsilon=0.0) for of in judged)
    return (*found, constant_at_first(last), assess(agent, episodes=5), None)


def constant_at_first(report: TrustReport) -> TrustReport:
    """Returns a report that differs in that the first reward was always the same."""
    old = report.calibration
    first = np.arange(len(old.states)) == 0
    calibration = replace(
        old,
        states=("nothing to predict", *old.states[1:]),
        error=Estimates(*(np.where(first, 0.0, end) for end in ends(old.error))),
        skill=Estimates(*(np.where(first, np.nan, end) for end in ends(old.skill))),
    )
    return replace(report, calibration=calibration, trust=trust(calibration))


def ends(found: Estimates) -> tuple[np.ndarray, ...]:
    return found.value, found.low, found.high


@st.composite
def comparisons(draw: st.DrawFn) -> Comparison:
    """Random comparisons: equal, raised, shifted and unrelated; few and many episodes; ties."""
    axis = TimeAxis(0.95, draw(st.integers(0, 4)), draw(st.sampled_from([1, 1, 2])))
    count, actions = draw(st.integers(1, 6)), draw(st.integers(1, 3))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    shape = (count, actions, axis.num_components)
    size = draw(st.sampled_from([1e-6, 1.0, 1.0, 1e5]))
    kind = draw(st.sampled_from(["round", "any", "rewards", "costs"]))
    first = (
        rng.choice([0.0, 0.0, 0.5, 1.0, -1.0], shape) if kind == "round" else rng.normal(size=shape)
    )
    if kind in ("rewards", "costs"):
        first = np.abs(first) * (1.0 if kind == "rewards" else -1.0)
    how = draw(st.sampled_from(["same", "raised", "shifted", "turned", "unrelated", "scaled"]))
    second = {
        "same": first,
        "raised": first + 0.5 * (np.arange(axis.num_components) == axis.horizon // 2),
        "shifted": np.roll(first, 1, axis=-1),
        "turned": first[::-1],
        "unrelated": np.where(kind == "costs", -1.0, 1.0) * np.abs(rng.normal(size=shape)),
        "scaled": first * rng.choice([1.0, 1.0, 1.3], (count, 1, 1)),
    }[how]
    chosen = rng.integers(actions, size=(2, count))
    probabilities = np.eye(actions)[chosen]
    if draw(st.booleans()):
        probabilities[1] = probabilities[0]
    player = np.sort(rng.integers(2, size=count))
    visits = Visits(
        time_axis=axis,
        components=size * np.stack([first, second]),
        probabilities=probabilities,
        player=player,
        seed=rng.integers(40, size=count),
        step=np.arange(count),
        different=draw(st.sampled_from([1, 30])),
        cut=draw(st.sampled_from([0, 0, 7])),
    )
    one, other = draw(st.permutations(range(7)))[:2]
    futures = Future("the optimal policy"), Future("the greedy policy", clip_rewards=True)
    return compared(
        visits,
        names=("one", "other"),
        words=(("one",), ("other",)),
        place=("--env", "World-v0", "--env-arg", "slip=0.2"),
        action_names=NAMES[:actions],
        futures=(futures[0], draw(st.sampled_from(futures))),
        reports=(reports()[one], reports()[other]),
        episodes=draw(st.sampled_from([1, 12])),
        max_steps=draw(st.sampled_from([1, 1_000])),
        seconds_per_step=draw(st.sampled_from([None, 0.25])),
    )


@cache
def real() -> tuple[Comparison, ...]:
    """Comparisons of agents that there are."""
    pairs = (
        ("gridworld:ledge", "gridworld:ledge,slip=0.3"),
        ("gridworld:drone", "gridworld:drone,treasure=3"),
        ("gridworld:loop,slip=0.2", "gridworld:loop"),
        ("gridworld:ledge", "gridworld:ledge"),
    )
    return tuple(compare(*find_pair(pair), episodes=15, judged_by=60) for pair in pairs)


def mutations(sentence: str) -> list[str]:
    """Returns the sentence with each number, name and word changed."""
    return [
        *mutants.numbers(sentence),
        *mutants.words(sentence, WORDS),
        *mutants.exchanged(sentence, "A", "B"),
        *mutants.words(sentence, {f"of {name}": "of sideways" for name in NAMES}),
    ]


def survivors(comparison: Comparison) -> list[str]:
    said = comparison_sentences(comparison)
    found = {mutant for text in said for mutant in mutations(text)} - set(said)
    return mutants.survivors(found, lambda text: check_comparison(text, comparison))


def supported(comparison: Comparison) -> None:
    findings = comparison_findings(comparison)
    assert all(finding.holds(comparison) for finding in findings)
    claims = check_comparison(" ".join(comparison_sentences(comparison)), comparison)
    assert [type(claim) for claim in claims] == [type(finding) for finding in findings]


def test_every_sentence_about_real_agents_is_supported_and_no_mutation_is():
    for comparison in real():
        supported(comparison)
        assert survivors(comparison) == []
    assert sum(len(mutations(s)) for c in real() for s in comparison_sentences(c)) > 100


@settings(max_examples=200, deadline=None, derandomize=True)
@given(comparisons())
def test_every_sentence_about_any_comparison_is_supported(comparison: Comparison):
    supported(comparison)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(comparisons())
def test_a_mutated_number_name_or_word_about_any_comparison_fails(comparison: Comparison):
    assert survivors(comparison) == []


def test_every_kind_of_claim_occurs_and_has_a_sentence():
    seen: set[type[ComparisonFinding]] = set()

    @settings(max_examples=400, deadline=None, derandomize=True)
    @given(comparisons())
    def look(comparison: Comparison) -> None:
        seen.update(map(type, comparison_findings(comparison)))

    look()
    assert set(TEMPLATES) == set(ComparisonFinding.kinds.values())
    assert seen == set(TEMPLATES), f"never found: {set(TEMPLATES) - seen}"


def text_of(comparison: Comparison, *, ascii_only: bool = False) -> str:
    console = Console(file=io.StringIO(), width=110, highlight=False)
    console.print(page(comparison, ascii_only=ascii_only))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_the_page_says_what_matters_most_first():
    lines = [line.rstrip() for line in text_of(real()[0]).splitlines()]
    assert lines[0] == "A: ledge · B: ledge,slip=0.3"
    assert lines[1] == "γ = 0.95, N = 4, w = 1 · both act in gridworld:ledge"
    assert lines[3].startswith("A expects more in all than B: 0.")
    assert any(line.startswith("The forecasts of A can be trusted ") for line in lines)
    assert "    trdlab explain gridworld:ledge --seed 0 --step 0" in lines
    assert "in all" in " ".join(lines)
    assert text_of(real()[0], ascii_only=True).isascii()


def test_the_same_agent_twice_says_so_and_shows_no_table():
    text = text_of(real()[3])
    assert "They expect the same of every action at every state" in text
    assert "in all" not in text
    assert text.startswith("A: gridworld:ledge · B: gridworld:ledge")


def test_the_commands_show_the_moments_that_are_printed(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    comparison = real()[0]
    furthest = comparison_to_dict(comparison)["furthest"]
    shown = {entry["player"]: entry for entry in comparison_to_dict(comparison)["furthest"]}
    visits = comparison.visits
    m = int(np.flatnonzero(visits.player == 1)[3])
    of_b = replace(
        visits,
        player=visits.player[[m]],
        seed=visits.seed[[m]],
        step=visits.step[[m]],
        components=visits.components[:, [m]],
        probabilities=visits.probabilities[:, [m]],
    )
    entries = [*furthest, *comparison_to_dict(replace(comparison, visits=of_b))["furthest"]]
    assert {entry["player"] for entry in entries} == {"A", "B"}, shown
    for entry in entries:
        words = entry["command"].split()[1:]
        with pytest.raises(SystemExit):
            main([*words, "--what", "forecast", "--episodes", "0", "--json"])
        moment = json.loads(capsys.readouterr().out)["moment"]
        own = entry[entry["player"]]
        assert moment["action"] == own["action"]
        assert moment["actions"][own["action"]]["components"] == pytest.approx(own["components"])


def test_the_plain_data_has_the_numbers_and_their_sentences():
    data = json.loads(json.dumps(comparison_to_dict(real()[0]), allow_nan=False))
    assert data["schema"] == "trdlab.compare/1"
    assert data["agents"]["B"]["words"] == ["gridworld:ledge,slip=0.3", "--env", "gridworld:ledge"]
    assert data["time_axis"]["labels"] == ["t", "t+1", "t+2", "t+3", "t+4…∞"]
    means = [data["agents"][side]["mean"]["value"] for side in "AB"]
    np.testing.assert_allclose(np.subtract(*means[::-1]), data["difference"]["value"], atol=1e-12)
    assert sum(data["difference"]["value"]) == pytest.approx(data["gap"]["value"])
    assert data["calibration"]["A"]["schema"] == "trdlab.trust/1"
    text = " ".join(finding["sentence"] for finding in data["findings"])
    assert len(check_comparison(text, real()[0])) == len(data["findings"])


@settings(max_examples=10, deadline=None, derandomize=True)
@given(comparisons())
def test_any_comparison_can_be_drawn_printed_and_written(comparison: Comparison):
    figure = comparison_figure(comparison)
    figure.canvas.draw()
    assert figure.axes[1].get_xticklabels()[-1].get_text() == comparison.time_axis.labels[-1]
    assert text_of(comparison)
    json.dumps(comparison_to_dict(comparison), allow_nan=False)
