"""Rewards that came: by hand, what changed on the screen, and what is told read back."""

import numpy as np
import pytest

import mutants
from by_hand import episode
from trdlab.decomposition import TimeAxis
from trdlab.explanations.gallery.claims import GALLERIES, group_claims, likeness
from trdlab.explanations.gallery.gallery import Gallery, Recorded, gallery_of
from trdlab.explanations.rules import check
from trdlab.rollouts.reel import Reel

WORDS = {
    "reward": "cost",
    "cost": "reward",
    "high": "low",
    "low": "high",
    "came": "never came",
    "coin": "hazard",
    "top": "bottom",
    "left": "right",
    "none was": "1 was",
    "no reward": "one reward",
    "was followed": "was not followed",
    "give or take a step": "give or take two steps",
}


def forecasts(rewards, axis, **changes) -> Recorded:
    """An episode in which each reward was foreseen as well as it can be."""
    total, rows = len(rewards), np.zeros((len(rewards) + 1, axis.num_components))
    for t in range(total):
        for i in range(axis.horizon):
            if t + i < total:
                rows[t, i] = axis.gamma**i * rewards[t + i]
    return Recorded(episode(rewards, axis, rows, **changes), seed=0)


def test_rewards_are_grouped_by_value_and_by_what_paid():
    axis = TimeAxis(0.5, 2)
    parts = (("coin",), (), ("coin",), ("hazard",), ("coin", "hazard"))
    recorded = Recorded(episode([1.0, 0.0, 1.0, -3.0, -2.0], axis), 0, parts=parts)
    gallery = gallery_of([recorded], Reel())
    assert [of.members for of in gallery.groups] == [(0, 1), (2,), (3,)]
    assert [claim.sentence for claim in group_claims(gallery)] == [
        "A reward of 1 came 2 times from coin.",
        "A cost of 3 came once from hazard.",
        "A cost of 2 came once from coin and hazard.",
    ]


def test_what_followed_forecasts_that_are_alike():
    axis = TimeAxis(0.5, 2)
    gallery = gallery_of([forecasts([0.0, 1.0, 0.0, 1.0, 0.0, 0.0], axis)], Reel())
    told = {key: claim.sentence for key, claim in likeness(gallery).items()}
    assert told[0, 3] == (
        "In 1 episode, 2 of 2 forecasts as high as this one were followed by a reward at once."
    )
    assert told[0, 0] == (
        "In 1 episode, none of 4 forecasts as small as this one was followed by a reward at once."
    )
    assert told[1, 3] == (
        "In 1 episode, 2 of 2 forecasts as high as this one were followed by a "
        "reward 1 step later, give or take a step."
    )
    # step 1 is followed by the reward of step 1 itself, and step 3 likewise: a step before
    assert gallery.alike[1, 0].followed == 2
    assert gallery.alike[1, 3].examples == (0, 1)
    assert gallery.level(1, 0.5 * 0.29) == 1
    assert gallery.level(1, -0.5) == -3


def test_what_a_cut_hides_is_not_counted_and_what_an_end_ends_is():
    axis = TimeAxis(0.5, 3)
    cut = gallery_of([forecasts([1.0, 0.0, 0.0, 0.0], axis, terminated=False)], Reel())
    assert sum(of.moments for (i, _), of in cut.alike.items() if i == 2) == 1  # 0 + 2 + 1 < 4
    ended = gallery_of([forecasts([1.0, 0.0, 0.0, 0.0], axis)], Reel())
    assert sum(of.moments for (i, _), of in ended.alike.items() if i == 2) == 4
    lost = np.array([False, True, False, True])
    lives = gallery_of([forecasts([0.0, 0.0, 1.0, 0.0], axis, ends=lost)], Reel())
    assert lives.alike[2, 3].followed == 0, "the future that was told of had ended"


def screens(reel: Reel, *changes: tuple[int, int]) -> tuple[int, ...]:
    """Pictures, numbered: a ball moves, a score counts, and a brick goes when a reward comes."""
    numbers, base = [], np.zeros((90, 90, 3), dtype=np.uint8)
    for top, left in changes:
        base[top : top + 6, left : left + 6] = 200
    for t in range(4 * len(changes) + 1):
        if t and t % 4 == 0:
            top, left = changes[t // 4 - 1]
            base[top : top + 6, left : left + 6] = 0
            base[80:86, 40:50] = 40 * (t // 4)
        seen = base.copy()
        seen[45:48, (7 * t) % 80 : (7 * t) % 80 + 3] = 255
        numbers.append(reel.add(seen))
    return tuple(numbers)


def test_what_changed_for_good_is_told_apart_from_the_ball_and_the_score():
    reel, bricks = Reel(), ((2, 2), (2, 80), (2, 4), (40, 42))
    rewards = [0.0, 0.0, 0.0, 1.0] * 4
    recorded = Recorded(episode(rewards, TimeAxis(0.9, 3)), 0, screens(reel, *bricks))
    gallery = gallery_of([recorded], reel)
    assert [one.place for one in gallery.came] == ["top left", "top right", "top left", "centre"]
    assert gallery.came[1].box == (2, 80, 8, 86)
    told = [claim.sentence for claim in group_claims(gallery)]
    assert told[0] == "A reward of 1 came 2 times with a change at the top left of the picture."


def test_where_most_steps_pay_the_screen_says_nothing():
    reel = Reel()
    pictures = screens(reel, (2, 2))
    recorded = Recorded(episode([1.0] * 4, TimeAxis(0.9, 3)), 0, pictures)
    told = [claim.sentence for claim in group_claims(gallery_of([recorded], reel))]
    assert told == ["A reward of 1 came 4 times."]


def galleries() -> list[Gallery]:
    reel, axis = Reel(), TimeAxis(0.5, 2)
    bricks = Recorded(episode([0.0, 0.0, 0.0, 1.0] * 2, axis), 0, screens(reel, (2, 2), (80, 2)))
    parts = (("coin",), (), ("hazard",), (), ("coin",), ())
    named = forecasts([1.0, 0.0, -2.0, 0.0, 1.0, 0.0], axis)
    return [
        gallery_of([bricks], reel),
        gallery_of([Recorded(named.episode, 0, parts=parts)], reel),
        gallery_of([forecasts([0.0, 0.0], axis)], reel),
        gallery_of([forecasts([0.0, 3.0, 0.0], TimeAxis(0.9, 2, 1))], reel),
    ]


@pytest.mark.parametrize("number", range(4))
def test_what_is_told_is_true_and_what_is_changed_is_not(number):
    gallery = galleries()[number]
    claims = [*group_claims(gallery), *likeness(gallery).values()]
    known = [(GALLERIES, gallery)]
    told = {claim.sentence for claim in claims}
    for sentence in told:
        assert check(sentence, known)[0].sentence == sentence
        assert len(sentence.split()) <= 25
        others = [*mutants.numbers(sentence), *mutants.words(sentence, WORDS)]
        survived = mutants.survivors(others, lambda text: check(text, known))
        assert set(survived) <= told  # another true sentence about the same episodes
