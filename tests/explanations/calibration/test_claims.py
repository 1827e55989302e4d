"""What is said of a forecast is read back and tested, over reports real and random."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

import mutants
from by_hand import episode
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import Calibration, Status
from trdlab.explanations.calibration.ceiling import Ceiling
from trdlab.explanations.calibration.claims import in_brief, sections, to_dict, verdicts
from trdlab.explanations.calibration.consistency import Consistency
from trdlab.explanations.calibration.errors import Errors
from trdlab.explanations.calibration.faults import REPORTS
from trdlab.explanations.calibration.report import CalibrationReport, Score, judge, score_of
from trdlab.explanations.calibration.residual import Residual
from trdlab.explanations.rules import Claim, UnsupportedSentenceError, check
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Memoryless
from trdlab.rollouts.branches import Branching
from trdlab.rollouts.critique import Critique
from trdlab.rollouts.episodes import collect
from trdlab.show.plots.calibration import plot_trust
from trdlab.statistics import Estimate, Estimates
from trdlab.tabular import exact
from trdlab.tabular.episodes import ModelEnvironments

WORDS = {
    "better": "worse",
    "no better": "better",
    "right": "wrong",
    "wrong": "right",
    "not tested": "tested",
    "too late": "too early",
    "too early": "too late",
    "too little": "too much",
    "too much": "too little",
    "ignores": "minds",
    "More": "Nothing",
    "never": "always",
    "an end": "no end",
    "goes on": "ends",
    "too few": "enough",
    "start": "end",
    "least": "most",
    "says most": "says least",
    "more in every": "less in every",
    "less in every": "more in every",
    "its own critic": "the sum of its forecasts",
    "Its own critic": "The sum of its forecasts",
    "critic is right": "critic is wrong",
    "None": "All",
    "this one nothing": "this one all",
    "the agent's forecasts": "forecasts for actions it would not choose",
    "The agent's forecasts": "Forecasts for actions it would not choose",
}


@cache
def real() -> tuple[CalibrationReport, ...]:
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
def reports(draw: st.DrawFn) -> CalibrationReport:
    """Random reports: numbers that need not fit each other, as long as each can occur."""
    axis = TimeAxis(0.9, draw(st.integers(0, 4)), draw(st.sampled_from([1, 1, 3])))
    size = axis.num_components
    middle = st.sampled_from([-0.5, 0.04, 0.5]) | st.floats(-2.0, 1.0)
    positive = st.sampled_from([0.0, 1.0, 116.0])

    def estimate(value: st.SearchStrategy[float] = middle) -> Estimate:
        at, spread = draw(value), draw(st.sampled_from([0.0, 0.02, 0.6]))
        return Estimate(at, at - spread, at + spread)

    def estimates(shown: list[bool], value: st.SearchStrategy[float] = middle) -> Estimates:
        found = [estimate(value) if is_shown else Estimate(*[np.nan] * 3) for is_shown in shown]
        columns = zip(*((e.value, e.low, e.high) for e in found), strict=True)
        return Estimates(*(np.array(column) for column in columns))

    def calibration() -> Calibration:
        kinds: list[Status] = ["good", "good", "bad", "bad", "open", "not tested"]
        status = tuple(draw(st.sampled_from(kinds)) for _ in range(size))
        constant = np.array([draw(st.sampled_from([False, False, True])) for _ in status])
        known = [s != "not tested" or c for s, c in zip(status, constant, strict=True)]
        enough = [draw(st.sampled_from([10, 400, 30_000, None])) for _ in status]
        low, high = (np.full(size + 1, sign * draw(positive)) for sign in (-1.0, 1.0))
        return Calibration(
            time_axis=axis,
            status=status,
            constant=constant,
            num_samples=np.full(size, 500),
            num_episodes=np.array([draw(st.integers(1, 40)) for _ in status]),
            enough=tuple(enough),
            bias=estimates(known),
            error=Estimates(*[np.ones(size)] * 3),
            mean=np.where(known, 1.0, np.nan),
            variance=np.ones(size),
            skill=estimates([k and not c for k, c in zip(known, constant, strict=True)]),
            predicted_range=np.stack([low, high]),
            observed_range=np.zeros((2, size + 1)),
            reliability=None,
        )

    def score() -> Score:
        mean, sure = draw(st.sampled_from([-500.0, 0.0, 31.4])), draw(st.sampled_from([0, 1, 2]))
        spread = (0.0, np.nan, 2.5)[sure]
        episodes = draw(st.just(1) | st.integers(2, 2_000))
        limit = draw(st.sampled_from([None, 500]))
        lives = draw(st.sampled_from([0, 1, 3]))
        return Score(
            episodes=episodes,
            different=draw(st.integers(2, 40)) if sure else draw(st.sampled_from([1, 7])),
            steps=draw(st.integers(1, 90_000)),
            epsilon=draw(st.sampled_from([0.0, 0.05])),
            returns=Estimate(mean, mean - spread, mean + spread),
            least=draw(st.sampled_from([-1.0, 0.0])),
            most=draw(st.sampled_from([0.0, 1.0])),
            terminated=draw(st.integers(0, 2)),
            truncated=draw(st.integers(0, 2)),
            life_losses=lives,
            life_loss_ends=draw(st.booleans()),
            time_limit=limit,
        )

    def critique() -> Critique:
        gamma = draw(st.sampled_from([0.9, 0.9, 0.98]))
        judged = draw(st.sampled_from([1.0, 1.0, np.nan]))
        said = np.array([draw(middle), draw(middle)])
        near, far = draw(st.sampled_from([1.0, 0.63])), draw(st.sampled_from([1.0, 0.42]))
        flat = st.sampled_from([1.0, 1.0, 1.7])
        thirds = np.array([[draw(middle), draw(middle), 0.0] for _ in range(2)])
        thirds[:, 2] = thirds[:, 0] - thirds[:, 1]
        errors = np.array([draw(positive), draw(positive), 0.0])
        errors[2] = errors[0] - errors[1]
        counts = np.array([near, far, near - far])
        return Critique(
            time_axis=axis,
            gamma=gamma,
            factor=draw(st.sampled_from([1.0, 1.0, 0.053])),
            said=said,
            spread=np.ones(2),
            came=judged * (said - [draw(st.sampled_from([0.0, 0.7])), 0.0]),
            size=np.ones(2),
            bias=estimates([True] * 2, st.sampled_from([0.0, 0.0, 0.7, -0.7])),
            slope=estimates([True] * 2, flat),
            error=Estimates(errors, errors, errors),
            gap=Estimates(said, said, said),
            correlation=0.9,
            left=np.array(draw(st.permutations([0.0, 0.3, draw(st.sampled_from([0.0, 0.6]))]))),
            repair=np.array([draw(st.sampled_from([0.7, -2.5])), 0.053, 0.8]),
            thirds=Estimates(thirds, thirds, thirds),
            split=min(1, axis.horizon),
            reached=draw(st.sampled_from([None, axis.horizon - 1])) if axis.horizon else None,
            counts=Estimates(counts, counts, counts),
            furthest=(),
        )

    discount = draw(st.sampled_from([0.9**axis.width, 0.99]))
    nothing = np.full(axis.horizon, np.nan)
    consistency = Consistency(
        time_axis=axis,
        num_transitions=100,
        num_ends=20,
        gap=Estimates(nothing, nothing, nothing),
        discount=Estimate(discount, discount - 1e-3, discount + 1e-3),
        discount_explains=estimate(st.sampled_from([0.99, 0.5])),
        past_end=estimate(st.sampled_from([0.0, 0.9])),
        past_reset=estimate(st.sampled_from([0.0, 0.9])),
        end_explains=estimate(st.sampled_from([0.99, 0.5])),
    )
    amount, shift = estimate(st.sampled_from([1.0, 1.5, 0.4])), draw(st.sampled_from([0, 0, 1, -2]))
    share = draw(st.floats(0.0, 1.0))
    limits = estimates([True] * size, st.sampled_from([0.04, 0.1, 0.5, 0.9]))
    return CalibrationReport(
        future=Future("the greedy policy"),
        score=score(),
        judged=score(),
        calibration=calibration(),
        residual=Residual(
            axis,
            Estimate(share, share, share),
            Estimate(1.0 - share, 0.0, 1.0),
            0.9 ** np.arange(draw(st.sampled_from([0, 60]))),
        ),
        errors=Errors(shift, amount, estimate()) if axis.horizon > 1 else None,
        consistency=consistency if axis.horizon else None,
        ceiling=draw(st.sampled_from([None, Ceiling(limits, 50, draw(st.booleans()))])),
        foils=draw(st.sampled_from([None, calibration()])),
        scale=116.0,
        chance=draw(st.booleans()),
        critique=draw(st.sampled_from([None, critique()])),
    )


def told(report: CalibrationReport) -> list[Claim]:
    return [claim for section in sections(report) for claim in section.claims]


def everything(report: CalibrationReport) -> list[Claim]:
    """Returns every claim that any rule finds, told or not."""
    return [claim for rule in REPORTS.rules.values() for claim in rule(report)]


def mutations(sentence: str) -> list[str]:
    """Returns the sentence with each number changed in its last digit, and with other words."""
    return [*mutants.numbers(sentence), *mutants.words(sentence, WORDS)]


def survivors(report: CalibrationReport) -> list[str]:
    true = {claim.sentence for claim in everything(report)}
    found = (mutant for claim in told(report) for mutant in mutations(claim.sentence))
    fresh = (mutant for mutant in found if mutant not in true)
    return mutants.survivors(fresh, lambda text: check(text, [(REPORTS, report)]))


def test_every_sentence_about_an_exact_table_is_supported_and_no_mutation_is():
    for report in real():
        claims = told(report)
        read = check(" ".join(claim.sentence for claim in claims), [(REPORTS, report)])
        assert [claim.kind for claim in read] == [claim.kind for claim in claims]
        assert survivors(report) == []
    assert sum(len(mutations(claim.sentence)) for r in real() for claim in told(r)) > 100


@settings(max_examples=200, deadline=None, derandomize=True)
@given(reports())
def test_every_sentence_about_any_report_is_supported_and_no_mutation_is(report):
    claims = told(report)
    read = check(" ".join(claim.sentence for claim in claims), [(REPORTS, report)])
    assert [claim.kind for claim in read] == [claim.kind for claim in claims]
    assert survivors(report) == []
    for claim in everything(report):
        assert len(claim.sentence.replace(" %", "").split()) <= 25, claim.sentence
    assert 2 <= len(in_brief(report)) <= 4 or report.time_axis.horizon == 0


def test_every_kind_of_claim_occurs():
    seen: set[str] = set()

    @settings(max_examples=3_000, deadline=None, derandomize=True)
    @given(reports())
    def look(report: CalibrationReport) -> None:
        seen.update(claim.kind for claim in told(report))

    look()
    assert seen == set(REPORTS.rules)


def test_the_first_sentences_say_how_it_does_how_far_to_trust_it_and_what_is_wrong():
    axis = TimeAxis(0.95, 12)
    mdp = Gridworld(load_map("loop").with_slip(0.2)).mdp
    table = exact(mdp, axis)
    components = table.decomposition.components.copy()
    components[..., 8:] = np.random.default_rng(0).normal(size=components[..., 8:].shape)
    worse = replace(table, decomposition=RewardDecomposition(components, axis))
    play = ModelEnvironments(mdp, 40, seed=0, time_limit=60)
    episodes = collect(worse, play, policy=Memoryless(lambda states: table.solution.policy[states]))
    report = judge(table.future, episodes)
    score, trust, wrong = in_brief(report)
    assert score.sentence == (
        "Over 40 episodes the agent scored 3.45 each, on average; the true average is likely 3.3 "
        "to 3.6."
    )
    assert trust.sentence == (
        "For what comes in the first 8 steps, the agent's forecasts are better than a guess."
    )
    assert wrong.kind == "underestimates"
    assert verdicts(report)[1].sentence == (
        "For what comes 8 to 11 steps later, the agent's forecasts are no better than a guess."
    )
    assert to_dict(report)["trusted"]["last_step"] == 7


def test_good_bad_and_not_tested_are_three_things():
    axis = TimeAxis(0.5, 3)
    rows = [[1.0, 0.1, 0.0, 0.0]] * 5  # where 1 comes now, and ½ and ¼ later

    def one(i: int) -> object:
        expected = np.array(rows) + 1e-4 * (i - 24.5) * np.eye(4)[1]
        return episode([1.0, 1.0, 1.0, 1.0], axis, expected, terminated=False)

    report = judge(Future("a policy"), [one(i) for i in range(50)])  # type: ignore[misc]
    assert report.trust.status == ("good", "bad", "bad", "not tested")
    assert [claim.sentence for claim in verdicts(report)] == [
        "For what comes at once, the agent's forecasts are right (to a tenth): what came never "
        "varied.",
        "For what comes 1 to 2 steps later, the agent's forecasts are wrong: 0.1 on average, "
        "but 0.75 came every time.",
        "For what comes after the first 3 steps, the agent's forecasts were not tested: episodes "
        "were cut off before.",
    ]


def test_it_is_said_how_an_agent_does():
    axis = TimeAxis(0.9, 1)
    failing = [episode([-1.0] * 500, axis, terminated=False, time_limit=500) for _ in range(12)]
    report = judge(Future("a policy"), failing)
    assert [claim.sentence for claim in sections(report)[0].claims] == [
        "The agent scored -500: its episodes are all the same.",
        "None of these episodes ended before the limit of 500 steps.",
    ]
    some = score_of([episode([1.0] * n, axis) for n in range(10, 22)])
    assert some.returns.value == 15.5
    assert some.returns.low < 15.5 < some.returns.high
    few = score_of([episode([1.0] * n, axis) for n in (10, 20)])
    assert np.isnan(few.returns.low), "two episodes make no interval"


def test_more_than_can_come_is_an_overestimate():
    axis = TimeAxis(0.99, 1)
    rows = [[1.0, 115.0]] * 31
    report = judge(Future("a policy"), [episode([1.0] * 30, axis, rows)])
    sentences = [claim.sentence for claim in told(report)]
    assert (
        "The agent expects up to 116: too much, for at most 100 can come if no step pays more than "
        "1, the most seen." in sentences
    )


def test_one_episode_without_a_reward_does_not_tell_that_none_can_come():
    axis = TimeAxis(0.9, 1)
    rows = [[0.0, 0.3]] * 31
    alone = judge(Future("a policy"), [episode([0.0] * 30, axis, rows)])
    many = [episode([0.0] * length, axis, rows[: length + 1]) for length in range(10, 30)]
    kinds = [[claim.kind for claim in told(of)] for of in (alone, judge(alone.future, many))]
    assert ["overestimates" in of for of in kinds] == [False, True]


def test_chance_that_copies_share_is_told_by_the_episodes():
    report = next(r for r in real() if r.ceiling is not None and r.ceiling.deterministic)
    assert not report.chance
    assert "no-chance" in {claim.kind for claim in told(report)}
    shared = {claim.kind for claim in told(replace(report, chance=True))}
    assert "shared-chance" in shared
    assert "no-chance" not in shared
    axis = TimeAxis(0.9, 1)
    coins = [episode([float(i % 2)], axis) for i in range(4)]  # the same was expected of all
    assert judge(Future("a policy"), coins).chance


def test_a_sentence_that_is_none_of_ours_or_not_true_is_named():
    with pytest.raises(UnsupportedSentenceError, match="no statement about"):
        check("Trust me.", [(REPORTS, real()[0])])
    with pytest.raises(UnsupportedSentenceError, match="is not true of"):
        check(
            "For what comes in the first 2 steps, the agent's forecasts are better than a guess.",
            [(REPORTS, real()[0])],
        )


@settings(max_examples=15, deadline=None, derandomize=True)
@given(reports())
def test_any_report_can_be_drawn(report: CalibrationReport):
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
