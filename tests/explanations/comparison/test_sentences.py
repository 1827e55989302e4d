"""What is said of two agents is read back and tested; and the page, the data and the picture."""

import json
import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mutants
from trdlab.agents import Agent, find_pair, gridworld_agent
from trdlab.agents.places import Origin
from trdlab.cli import main
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations import assess
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison.claims import in_brief, sections
from trdlab.explanations.comparison.comparison import COMPARISONS, Comparison, compare, compared
from trdlab.explanations.comparison.states import Visits
from trdlab.explanations.rules import Claim, UnsupportedSentenceError, check
from trdlab.policies import Memoryless
from trdlab.show.text import plain_ascii, text
from trdlab.tabular import ExactTable

NAMES = ("up", "FIRE", "move left")
WORDS = {
    "more": "less",
    "same": "other",
    "other": "same",
    "Both": "Neither",
    "They": "A",
    "largest": "smallest",
    "later": "sooner",
    "rewards": "costs",
    "costs": "rewards",
    "better": "worse",
    "half": "third",
    "too few": "enough",
    "within": "after",
    "Within": "After",
    "in": "after",
    "by": "at",
    "every": "no",
    "would": "would not",
    "on average": "surely",
}


@cache
def reports() -> tuple[CalibrationReport | None, ...]:
    """Reports with different verdicts, and none."""
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
    judged = (agent, with_noise(2), with_noise(0), unpaid)
    found = (assess(of, episodes=200, epsilon=0.0) for of in judged)
    return (*found, assess(agent, episodes=5), None)


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
    one, other = draw(st.permutations(range(6)))[:2]
    futures = Future("the optimal policy"), Future("the greedy policy", clip_rewards=True)
    seconds = draw(st.sampled_from([None, 0.25]))
    agents: Any = tuple(
        SimpleNamespace(
            name=name,
            estimator=SimpleNamespace(future=future),
            action_names=NAMES[:actions],
            seconds_per_step=seconds,
            origin=Origin(name, "World-v0", ("slip=0.2",), None),
        )
        for name, future in (("one", futures[0]), ("other", draw(st.sampled_from(futures))))
    )
    return compared(
        agents,
        visits,
        (reports()[one], reports()[other]),
        episodes=draw(st.sampled_from([1, 12])),
        max_steps=draw(st.sampled_from([1, 1_000])),
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


def told(comparison: Comparison) -> list[Claim]:
    """All that is told of a comparison."""
    return [claim for section in sections(comparison) for claim in section.claims]


def read(sentences: str, comparison: Comparison) -> list[str]:
    return [claim.sentence for claim in check(sentences, [(COMPARISONS, comparison)])]


def mutations(sentence: str) -> list[str]:
    """Returns the sentence with each number, name and word changed."""
    return [
        *mutants.numbers(sentence),
        *mutants.words(sentence, WORDS),
        *mutants.exchanged(sentence, "A", "B"),
        *mutants.words(sentence, {f"do {name}": "do sideways" for name in NAMES}),
        *mutants.words(sentence, {f"B {name}": "B sideways" for name in NAMES}),
    ]


def survivors(comparison: Comparison) -> list[str]:
    said = {claim.sentence for claim in told(comparison)}
    found = {mutant for sentence in said for mutant in mutations(sentence)} - said
    return mutants.survivors(found, lambda mutant: read(mutant, comparison))


def supported(comparison: Comparison) -> None:
    said = [claim.sentence for claim in told(comparison)]
    assert read(" ".join(said), comparison) == said
    brief = [claim.sentence for claim in in_brief(comparison)]
    assert 1 <= len(brief) <= 5
    assert set(brief) <= set(said)


def test_every_sentence_about_real_agents_is_supported_and_no_mutation_is():
    for comparison in real():
        supported(comparison)
        assert survivors(comparison) == []
    assert sum(len(mutations(claim.sentence)) for c in real() for claim in told(c)) > 100


@settings(max_examples=200, deadline=None, derandomize=True)
@given(comparisons())
def test_every_sentence_about_any_comparison_is_supported(comparison: Comparison):
    supported(comparison)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(comparisons())
def test_a_mutated_number_name_or_word_about_any_comparison_fails(comparison: Comparison):
    assert survivors(comparison) == []


def test_every_kind_of_claim_occurs_and_needs_no_more_than_25_words():
    seen: set[str] = set()

    @settings(max_examples=400, deadline=None, derandomize=True)
    @given(comparisons())
    def look(comparison: Comparison) -> None:
        seen.update(claim.kind for claim in told(comparison))

    look()
    assert seen == set(COMPARISONS.rules), f"never found: {set(COMPARISONS.rules) - seen}"
    for rule in COMPARISONS.rules.values():
        assert len(re.sub(r"\{[^}]*\}", "x", rule.says).split()) <= 25, rule.says


def test_a_sentence_that_is_none_of_ours_or_not_true_is_named():
    with pytest.raises(UnsupportedSentenceError, match="no statement about this comparison"):
        read("A is the better one.", real()[0])
    with pytest.raises(UnsupportedSentenceError, match="is not true of this comparison"):
        read("They would take the same action in 99 % of the states.", real()[0])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(comparisons(), st.integers(-12, 12))
def test_scaled_agents_are_told_of_in_the_same_sentences(comparison: Comparison, power: int):
    scale, known = 10.0**power, {"episodes": comparison.episodes, "max_steps": 1_000}
    visits = replace(comparison.visits, components=comparison.visits.components * scale)
    small, large = (
        told(compared(comparison.agents, of, **known)) for of in (comparison.visits, visits)
    )
    assert [claim.kind for claim in small] == [claim.kind for claim in large]
    for one, other in zip(small, large, strict=True):
        for field, value in one.fields.items():
            if isinstance(value, float):
                values = value, value * scale  # shares are not scaled
                assert any(other.fields[field] == pytest.approx(x, rel=1e-6) for x in values)


def said_in_brief(comparison: Comparison) -> list[str]:
    return [claim.sentence for claim in in_brief(comparison)]


def lines(comparison: Comparison, *, details: bool = False) -> list[str]:
    return text(comparison, width=110, details=details).plain.splitlines()


def test_the_page_says_what_matters_most_first():
    found = lines(real()[0])
    assert found[0] == "A: ledge · B: ledge,slip=0.3"
    assert found[1] == "γ = 0.95 · N = 4 · w = 1 · both act in gridworld:ledge"
    assert found[3].split() == ["expected", "at", "A", "B", "B", "−", "A", "95", "%", "interval"]
    assert [line.split()[0] for line in found[4:9]] == ["t", "t+1", "t+2", "t+3", "t+4…∞"]
    assert found[9].startswith("all of it")
    assert found[11] == "A expects more than B: 0.801 against 0.588 on average."
    assert found[11:] == said_in_brief(real()[0])
    assert plain_ascii(text(real()[0])).plain.isascii()


def test_the_details_tell_all_under_their_questions():
    found = lines(real()[0], details=True)
    headings = [section.heading for section in sections(real()[0])]
    assert headings == [
        "Who expects more, and when",
        "Where they are furthest apart",
        "How far to trust each where A acts",
        "What this rests on",
    ]
    assert [line for line in found if line in headings] == headings
    said = " ".join(line.strip() for line in found)
    assert all(claim.sentence in said for claim in told(real()[0]))


def test_a_comparison_prints_as_its_page(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    comparison = real()[0]
    assert str(comparison) == text(comparison, width=80).plain
    assert repr(comparison) == "<Comparison: A: ledge · B: ledge,slip=0.3>"


def test_the_same_agent_twice_says_so_and_shows_no_table():
    found = lines(real()[3])
    assert found[0] == "A: gridworld:ledge · B: gridworld:ledge"
    assert found[3].startswith("They expect the same of every action, at every state")
    assert "expected at" not in "".join(found)


def test_the_moments_that_are_told_can_be_explained(capsys):
    comparison = real()[0]
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
    both = (comparison, replace(comparison, visits=of_b))
    entries = [entry for of in both for entry in of.to_dict()["furthest"]]
    assert {entry["player"] for entry in entries} == {"A", "B"}
    for entry in entries:
        words = comparison.to_dict()["agents"][entry["player"]]["words"]
        where = ["--seed", str(entry["seed"]), "--step", str(entry["step"])]
        with pytest.raises(SystemExit):
            main(["explain", *words, *where, "--what", "forecast", "--episodes", "0", "--json"])
        moment = json.loads(capsys.readouterr().out)["moment"]
        own = entry[entry["player"]]
        assert moment["action"] == own["action"]
        assert moment["actions"][own["action"]]["components"] == pytest.approx(own["components"])


def test_the_plain_data_has_the_numbers_and_their_sentences():
    data = json.loads(json.dumps(real()[0].to_dict(), allow_nan=False))
    assert data["schema"] == "trdlab.compare/2"
    assert data["agents"]["B"]["words"] == ["gridworld:ledge,slip=0.3", "--env", "gridworld:ledge"]
    assert data["place"] == ["--env", "gridworld:ledge"]
    assert data["time_axis"]["labels"] == ["t", "t+1", "t+2", "t+3", "t+4…∞"]
    means = [data["agents"][side]["mean"]["value"] for side in "AB"]
    np.testing.assert_allclose(np.subtract(*means[::-1]), data["difference"]["value"], atol=1e-12)
    assert sum(data["difference"]["value"]) == pytest.approx(data["gap"]["value"])
    furthest = data["furthest"][0]
    apart = np.subtract(furthest["B"]["components"], furthest["A"]["components"])
    assert furthest["distance"] == pytest.approx(np.abs(apart).sum())
    assert data["agents"]["A"]["calibration"]["schema"] == "trdlab.trust/2"
    claims = [claim for section in data["sections"] for claim in section["findings"]]
    said = [claim["sentence"] for claim in claims]
    assert read(" ".join(said), real()[0]) == said
    assert [claim["sentence"] for claim in data["answer"]] == said_in_brief(real()[0])


@settings(max_examples=10, deadline=None, derandomize=True)
@given(comparisons())
def test_any_comparison_can_be_drawn_printed_and_written(comparison: Comparison):
    figure = comparison.plot()
    figure.canvas.draw()
    assert figure.axes[1].get_xticklabels()[-1].get_text() == comparison.time_axis.labels[-1]
    assert lines(comparison)
    json.dumps(comparison.to_dict(), allow_nan=False)
