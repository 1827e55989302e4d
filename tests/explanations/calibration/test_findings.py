"""What is said of a forecast is read back and tested, over reports real and random."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

import mutants
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explain.copies import ModelEnvironments
from trdlab.explanations import UnsupportedSentenceError
from trdlab.explanations.calibration.calibration import Calibration, Endings, State
from trdlab.explanations.calibration.ceiling import Ceiling
from trdlab.explanations.calibration.consistency import Audit
from trdlab.explanations.calibration.errors import Blame
from trdlab.explanations.calibration.faults import diagnose
from trdlab.explanations.calibration.findings import trust_findings
from trdlab.explanations.calibration.report import TrustReport, judge
from trdlab.explanations.calibration.residual import Hidden
from trdlab.explanations.calibration.sentences import TEMPLATES, check_trust, trust_sentences
from trdlab.explanations.calibration.trust import trust
from trdlab.explanations.calibration.verdicts import TrustFinding
from trdlab.gridworld import Gridworld, load_map
from trdlab.intervals import Estimates
from trdlab.rollouts.branches import Branching
from trdlab.rollouts.episodes import collect
from trdlab.show.plots.calibration import plot_trust
from trdlab.statistics import Estimate
from trdlab.tabular import exact

WORDS = {
    "can be": "cannot be",
    "cannot be": "can be",
    "no better": "better",
    "may be": "is",
    "whole": "half",
    "at any step": "at every step",
    "From": "At",
    "too late": "too early",
    "too early": "too late",
    "ignores": "minds",
    "hardly": "easily",
    "More could": "Nothing could",
    "ever": "always",
    "which count": "which do not count",
    "do not count": "count",
    "Too few": "Enough",
    "start": "end",
    "expects": "leaves out",
    "nothing to predict": "much to predict",
}


@cache
def real() -> tuple[TrustReport, ...]:
    """Reports on the exact tables of some worlds."""
    reports = []
    for name, slip, axis in (
        ("bridge", 0.1, TimeAxis(0.95, 12)),
        ("drone", 0.0, TimeAxis(0.95, 4)),
        ("loop", 0.2, TimeAxis(0.95, 4, 3)),
        ("drone", 0.2, TimeAxis(0.95, 0)),
        ("patience", 0.2, TimeAxis(0.95, 1)),
    ):
        mdp = Gridworld(load_map(name).with_slip(slip)).mdp
        table = exact(mdp, axis)
        play = ModelEnvironments(mdp, 40, seed=0, time_limit=60)
        episodes = collect(table, play, epsilon=0.0 if slip else 0.1)
        branches = Branching(table, copies=3).along(
            ModelEnvironments(mdp, 20, seed=1, time_limit=60), every=5
        )
        reports.append(judge(table.future, episodes, branches))
    return tuple(reports)


@st.composite
def reports(draw: st.DrawFn) -> TrustReport:
    """Random reports: numbers that need not fit each other, as long as each can occur."""
    axis = TimeAxis(0.9, draw(st.integers(0, 4)), draw(st.sampled_from([1, 1, 3])))
    size = axis.num_components
    middle = st.sampled_from([-0.5, 0.04, 0.5]) | st.floats(-2.0, 1.0)

    def estimate(value: st.SearchStrategy[float] = middle) -> Estimate:
        at, spread = draw(value), draw(st.sampled_from([0.0, 0.02, 0.6]))
        return Estimate(at, at - spread, at + spread)

    def estimates(shown: list[bool], value: st.SearchStrategy[float] = middle) -> Estimates:
        found = [estimate(value) if is_shown else Estimate(*[np.nan] * 3) for is_shown in shown]
        columns = zip(*((e.value, e.low, e.high) for e in found), strict=True)
        return Estimates(*(np.array(column) for column in columns))

    kinds: list[State] = ["judged", "judged", "nothing to predict", "too few episodes", "unknown"]
    states = tuple(draw(st.sampled_from(kinds)) for _ in range(size))
    judged = [state == "judged" for state in states]
    few = [5 if state == "too few episodes" else 40 for state in states]
    error = draw(st.sampled_from([0.0, 1e-3, 10.0]))
    calibration = Calibration(
        time_axis=axis,
        states=states,
        num_samples=np.full(size, 500),
        num_episodes=np.array(
            [0 if s == "unknown" else n for s, n in zip(states, few, strict=True)]
        ),
        bias=estimates(judged),
        error=Estimates(*[np.full(size, error)] * 3),
        mean=np.ones(size),
        variance=np.ones(size),
        skill=estimates(judged),
        correlation=estimates(judged),
        reliability=None,
    )
    nothing = np.full(axis.horizon, np.nan)
    blame = Blame(
        time_axis=axis,
        shift=draw(st.sampled_from([0, 0, 1, -2])),
        agreement=1.0,
        best_shift=0,
        amount=estimate(st.sampled_from([1.0, 1.5, 0.4])),
        smear=estimate(),
        error=nothing,
        timing=nothing,
        scale=nothing,
        sharpness=nothing,
        rest=nothing,
    )
    discount = draw(st.sampled_from([0.9**axis.width, 0.99]))
    audit = Audit(
        time_axis=axis,
        num_transitions=100,
        num_ends=20,
        gap=Estimates(nothing, nothing, nothing),
        discount=Estimate(discount, discount - 1e-3, discount + 1e-3),
        discount_near=discount,
        discount_far=discount,
        explained=draw(st.sampled_from([0.99, 0.5])),
        past_end=estimate(st.sampled_from([0.0, 0.9])),
        past_reset=estimate(st.sampled_from([0.0, 0.9])),
    )
    share = draw(st.floats(0.0, 1.0))
    limits = estimates(judged, st.sampled_from([0.04, 0.1, 0.5, 0.9]))
    ceiling = Ceiling(axis, limits, 50, 4, draw(st.sampled_from([False, False, True])))
    lives = draw(st.sampled_from([0, 0, 3]))
    return TrustReport(
        future=Future("the greedy policy"),
        num_episodes=draw(st.integers(1, 2_000)),
        num_steps=draw(st.integers(1, 90_000)),
        epsilon=draw(st.sampled_from([0.0, 0.05])),
        endings=Endings(draw(st.integers(0, 9)), 7, lives, draw(st.booleans())),
        calibration=calibration,
        trust=trust(calibration),
        hidden=Hidden(
            axis,
            Estimate(share, share, share),
            Estimate(1.0 - share, 0.0, 1.0),
            np.ones(size),
            0.9 ** np.arange(draw(st.sampled_from([0, 60]))),
        ),
        blame=blame if axis.horizon > 1 else None,
        audit=audit if axis.horizon else None,
        ceiling=draw(st.sampled_from([None, ceiling])),
        foils=draw(st.sampled_from([None, replace(calibration, skill=estimates(judged))])),
        faults=diagnose(blame if axis.horizon > 1 else None, audit if axis.horizon else None),
    )


def mutations(sentence: str) -> list[str]:
    """Returns the sentence with each number changed in its last digit, and with other words."""
    return [*mutants.numbers(sentence), *mutants.words(sentence, WORDS)]


def survivors(report: TrustReport) -> list[str]:
    found = (mutant for text in trust_sentences(report) for mutant in mutations(text))
    return mutants.survivors(found, lambda text: check_trust(text, report))


def test_every_sentence_about_an_exact_table_is_supported_and_no_mutation_is():
    for report in real():
        claims = check_trust(" ".join(trust_sentences(report)), report)
        assert [type(claim) for claim in claims] == [type(f) for f in trust_findings(report)]
        assert survivors(report) == []
    assert sum(len(mutations(s)) for report in real() for s in trust_sentences(report)) > 100


@settings(max_examples=200, deadline=None, derandomize=True)
@given(reports())
def test_every_sentence_about_any_report_is_supported(report: TrustReport):
    findings = trust_findings(report)
    assert all(finding.holds(report) for finding in findings)
    claims = check_trust(" ".join(trust_sentences(report)), report)
    assert [type(claim) for claim in claims] == [type(finding) for finding in findings]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(reports())
def test_a_mutated_number_or_word_about_any_report_fails(report: TrustReport):
    assert survivors(report) == []


def test_every_kind_of_claim_occurs_and_has_a_sentence():
    seen: set[type[TrustFinding]] = {type(f) for report in real() for f in trust_findings(report)}

    @settings(max_examples=1500, deadline=None, derandomize=True)
    @given(reports())
    def look(report: TrustReport) -> None:
        seen.update(map(type, trust_findings(report)))

    look()
    assert set(TEMPLATES) == set(TrustFinding.kinds.values())
    assert seen == set(TEMPLATES), f"never found: {set(TEMPLATES) - seen}"


def test_the_first_sentence_says_how_far_and_the_second_why_no_further():
    axis = TimeAxis(0.95, 12)
    mdp = Gridworld(load_map("loop").with_slip(0.2)).mdp
    table = exact(mdp, axis)
    components = table.decomposition.components.copy()
    components[..., 8:] = np.random.default_rng(0).normal(size=components[..., 8:].shape)
    worse = replace(table, decomposition=RewardDecomposition(components, axis))
    play = ModelEnvironments(mdp, 40, seed=0, time_limit=60)
    episodes = collect(worse, play, policy=lambda states: table.solution.policy[states])
    assert trust_sentences(judge(table.future, episodes))[:2] == [
        "The forecast can be trusted to t+7.",
        "From t+8 on it is no better than a constant guess.",
    ]
    whole = "The forecast can be trusted over its whole horizon, to t+11."
    assert trust_sentences(real()[2])[0] == whole


def test_a_sentence_that_is_none_of_ours_or_not_true_is_named():
    with pytest.raises(UnsupportedSentenceError, match="no statement about"):
        check_trust("Trust me.", real()[0])
    with pytest.raises(UnsupportedSentenceError, match="is not true of"):
        check_trust("The forecast can be trusted to t+1.", real()[0])


@settings(max_examples=15, deadline=None, derandomize=True)
@given(reports())
def test_any_report_can_be_drawn(report: TrustReport):
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    ax = figure.subplots()
    assert plot_trust(ax, report) is ax
    figure.canvas.draw()
    step = report.trust.last_step
    title = "not trusted" if step is None else f"trusted to t+{step}".replace("t+0", "t")
    assert ax.get_title(loc="left") == title
    assert ax.get_xticklabels()[-1].get_text() == report.time_axis.labels[-1]


def test_a_report_needs_one_time_axis():
    mdp = Gridworld(load_map("bridge")).mdp
    short, long = (exact(mdp, TimeAxis(0.95, n)) for n in (3, 4))
    play = ModelEnvironments(mdp, 12, seed=0)
    branches = Branching(long, copies=2).along(play, every=3)
    with pytest.raises(InputError, match="Play both with the same estimator"):
        judge(short.future, collect(short, play), branches)
    with pytest.raises(InputError, match="0 episodes on 0 time axes"):
        judge(short.future, ())
