"""What is told of an episode is read back and tested, over episodes real and random."""

import re
from collections.abc import Iterable
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mutants
from definitions import holds
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.explanations.episode.played import EPISODES, Played
from trdlab.explanations.episode.promises import foreseen, overdue, told_ahead
from trdlab.explanations.episode.story import tell
from trdlab.explanations.episode.surprises import sizes, surprise
from trdlab.explanations.rules import Claim, UnsupportedSentenceError, check, every
from trdlab.gridworld import Gridworld, load_map
from trdlab.rollouts.episodes import Episode, collect
from trdlab.rollouts.realised import what_followed
from trdlab.tabular import exact
from trdlab.tabular.episodes import ModelEnvironments

NAMES = ("up", "down", "FIRE", "move left")
WORDS = {
    "better": "worse",
    "worse": "better",
    "delayed": "brought",
    "ended": "was cut off",
    "was cut off": "ended",
    "and never came": "and came",
    "came only at": "never came but at",
    "no rewards": "many rewards",
    "largest": "smallest",
    "gained": "lost",
    "foreseen": "missed",
    ", as early as it can be told": "",
    "No step": "Every step",
    ", as the agent had expected": "",
    "a life was lost": "the episode ended",
    "the episode ended": "a life was lost",
    "nothing came": "a reward of 1 came",
    "mainly": "hardly",
    "half": "all",
    "a reward": "a cost",
    "drew": "left out",
    "likeliest": "least likely",
    "rewards": "costs",
}


@cache
def real() -> tuple[Played, ...]:
    """Episodes of the exact tables of some worlds."""
    found = []
    for name, slip, axis, seconds in (
        ("drone", 0.0, TimeAxis(0.95, 4), None),
        ("bridge", 0.2, TimeAxis(0.95, 12), 0.25),
        ("loop", 0.2, TimeAxis(0.9, 3, 3), 0.25),
        ("windy", 0.2, TimeAxis(0.95, 0), None),
        ("ledge", 0.2, TimeAxis(0.95, 4), None),
        ("patience", 0.2, TimeAxis(0.95, 1), None),
    ):
        world = Gridworld(load_map(name).with_slip(slip))
        table = exact(world.mdp, axis)
        play = ModelEnvironments(world.mdp, 6, seed=0, time_limit=60)
        found += [Played(e, world.action_names, seconds) for e in collect(table, play)]
    return tuple(found)


@st.composite
def episodes(draw: st.DrawFn) -> Played:
    """Random episodes: of any forecasts, of true ones changed at a step, of promises that stay."""
    axis = TimeAxis(
        draw(st.sampled_from([0.0, 0.3, 0.95, 0.999])),
        draw(st.integers(0, 5)),
        draw(st.sampled_from([1, 1, 2, 3])),
    )
    total, rng = draw(st.integers(1, 25)), np.random.default_rng(draw(st.integers(0, 2**32)))
    size = draw(st.sampled_from([1e-6, 0.01, 1.0, 1.0, 1e5]))
    rewards = rng.choice(
        draw(st.sampled_from([(0.0, 1.0), (0.0, -1.0, 2.5), (0.0,), (1.0,)])), total
    )
    lives = (rng.random(total) < draw(st.sampled_from([0.0, 0.0, 0.1]))) & (
        np.arange(total) < total - 1
    )
    terminated = draw(st.booleans())
    ends = lives & draw(st.booleans())
    ends[-1] = terminated
    episode = Episode(
        decomposition=RewardDecomposition(np.zeros((total, 4, axis.num_components)), axis),
        expected=np.zeros((total + 1, axis.num_components)),
        actions=rng.integers(4, size=total),
        rewards=rewards * size,
        life_lost=lives,
        ends=ends,
        terminated=terminated,
        random=np.zeros(total + axis.num_steps, dtype=np.bool_),
    )
    expected = np.zeros((total + 1, axis.num_components))
    kind = draw(st.sampled_from(["any", "true", "changed", "stays", "late", "many"]))
    if kind in ("true", "changed"):
        expected[:-1] = what_followed(episode)[0]
    if kind == "changed":
        expected[rng.integers(total)] += rng.normal(size=axis.num_components) * size
    if kind in ("any", "many"):
        noise = rng.normal(size=expected.shape) * (rng.random(expected.shape) < 0.5)
        expected = size * (
            noise if kind == "any" else np.abs(noise) * rng.integers(2, size=(total + 1, 1))
        )
    if kind == "late":
        episode.rewards[:] = size * (np.arange(total) == total - 1)
        expected[-3:, 0] = size
    if kind in ("stays", "late"):
        stop = total + 1 if kind == "stays" else total - 2
        expected[:stop, min(axis.horizon, 1 + rng.integers(2))] = size
    components = rng.normal(size=(total, 4, axis.num_components)) * size
    components[np.arange(total), episode.actions] = expected[:-1]
    object.__setattr__(episode, "decomposition", RewardDecomposition(components, axis))
    if draw(st.booleans()):
        probabilities = rng.dirichlet(np.ones(4), size=total)
        object.__setattr__(episode, "probabilities", probabilities)
        # steps change nothing where the law makes of the next ones what was expected: only draws do
        components[np.arange(total), episode.actions] += (
            rng.normal(size=(total, 1)) * size * (rng.random((total, 1)) < 0.3)
        )
        object.__setattr__(episode, "decomposition", RewardDecomposition(components, axis))
    object.__setattr__(episode, "expected", expected)
    return Played(episode, NAMES, draw(st.sampled_from([None, 0.25, 1 / 15])))


def mutations(sentence: str, names: tuple[str, ...] = NAMES) -> list[str]:
    """Returns the sentence with each number changed in its last digit, other words and names."""
    result = [*mutants.numbers(sentence), *mutants.words(sentence, WORDS)]
    named = re.match(rf"At step [\d,]+, ({'|'.join(names)}) ", sentence, re.IGNORECASE)
    if named:
        others = [name for name in ("sideways", *names) if name.lower() != named[1].lower()]
        result += [sentence.replace(named[1], name, 1) for name in others]
    return result


def said(claims: Iterable[Claim]) -> list[str]:
    return [claim.sentence for claim in claims]


def read(text: str, played: Played) -> list[str]:
    return said(check(text, [(EPISODES, played)]))


def true_elsewhere(played: Played) -> set[str]:
    """Returns what can be said of each single step: another number of a step may lead there."""
    rows = range(len(sizes(played)))
    claims = [surprise(played, row) for row in rows if sizes(played)[row] > 0.0]
    return set(said((*claims, *foreseen(played))))


def survivors(played: Played) -> list[str]:
    texts = said(tell(played).claims)
    found = (mutant for text in texts for mutant in mutations(text, played.action_names))
    true = true_elsewhere(played)
    survived = mutants.survivors(found, lambda text: read(text, played))
    return [mutant for mutant in survived if mutant not in true]


def all_hold(played: Played) -> bool:
    """Whether all rewards that were foreseen, and all promises, are so by their definitions."""
    return all(map(holds, every(played, *told_ahead, *overdue)))


def test_every_sentence_about_a_real_episode_is_supported_and_no_mutation_is():
    for played in real():
        story = tell(played)
        assert read(" ".join(said(story.claims)), played) == said(story.claims)
        assert all_hold(played)
        assert survivors(played) == []
    assert sum(len(mutations(s)) for p in real() for s in said(tell(p).claims)) > 500


@settings(max_examples=300, deadline=None, derandomize=True)
@given(episodes())
def test_every_sentence_about_any_episode_is_supported(played: Played):
    story = tell(played)
    assert read(" ".join(said(story.claims)), played) == said(story.claims)
    assert all_hold(played)
    assert len(story.claims) <= 8
    assert all(len(text.split()) <= 38 for text in said(story.claims))
    assert story.most is None or story.most in story.moments


@settings(max_examples=150, deadline=None, derandomize=True)
@given(episodes())
def test_a_mutated_number_name_or_word_about_any_episode_fails(played: Played):
    assert survivors(played) == []


def test_every_kind_of_claim_occurs_and_needs_no_more_than_25_words():
    seen = {claim.kind for played in real() for claim in tell(played).claims}

    @settings(max_examples=1000, deadline=None, derandomize=True)
    @given(episodes())
    def look(played: Played) -> None:
        seen.update(claim.kind for claim in tell(played).claims)

    look()
    assert seen == set(EPISODES.rules), f"never found: {set(EPISODES.rules) - seen}"
    for rule in EPISODES.rules.values():
        assert len(re.sub(r"\{[^}]*\}", "x", rule.says).split()) <= 25, rule.says


def test_a_sentence_that_is_none_of_ours_or_not_true_is_named():
    with pytest.raises(UnsupportedSentenceError, match="no statement about this episode"):
        read("It played well.", real()[0])
    with pytest.raises(UnsupportedSentenceError, match="is not true of this episode"):
        read("The episode ended after 6 steps.", real()[0])
    with pytest.raises(UnsupportedSentenceError, match="is not true of this episode"):
        read("From step 1 to step 90 a reward was always 9 steps away, and never came.", real()[0])


def test_a_story_reads_well():
    assert said(tell(real()[0]).claims) == [
        "At the start, all that the agent expected was worth 3.52.",
        "A reward of 1 at step 3 was foreseen 3 steps before, as early as it can be told.",
        "No step brought a surprise.",
        "The episode ended after 5 steps.",
        "What came was worth 3.52 at the start, as the agent had expected.",
    ]
