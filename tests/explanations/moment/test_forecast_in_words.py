"""What a forecast says in English, against sampled episodes: the words are tested, no formula."""

import re

import numpy as np
import pytest

from trdlab.decomposition import TimeAxis
from trdlab.explanations import explain, sentences
from trdlab.explanations.moment.exact import tabular_moment
from trdlab.tabular import MDP, ExactTable, exact

GAMMA, STEPS, EPISODES = 0.9, 6, 4_000
NUMBER = r"(-?\d+(?:\.\d+)?(?:e-?\d+)?)"
STEP = r"t(?:\+(\d+))?"


def random_mdp(seed: int) -> MDP:
    """Five states, two actions, two outcomes each; few pay and some end the episode."""
    rng = np.random.default_rng(seed)

    def outcomes() -> list[tuple[float, int, float, bool]]:
        chance = float(rng.choice([0.25, 0.5, 1.0]))
        both = [(chance, int(rng.integers(5)), _reward(rng), bool(rng.random() < 0.1))]
        if chance < 1.0:
            both.append(
                (1.0 - chance, int(rng.integers(5)), _reward(rng), bool(rng.random() < 0.1))
            )
        return both

    return MDP.from_transitions([[outcomes() for _ in range(2)] for _ in range(5)])


def _reward(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, 0.0, 0.0, 1.0, 4.0, -1.0]))


def sampled(table: ExactTable, action: int, rng: np.random.Generator) -> np.ndarray:
    """`[E, K]`: the rewards of episodes that begin in state 0 with an action, 0 after the end."""
    mdp, policy = table.mdp, table.solution.policy
    rewards = np.zeros((EPISODES, STEPS))
    for episode in rewards:
        state, first = 0, action
        for step in range(STEPS):
            acted = first if step == 0 else rng.choice(mdp.num_actions, p=policy[state])
            row = state * mdp.num_actions + int(acted)
            here = slice(mdp.offsets[row], mdp.offsets[row + 1])
            at = mdp.offsets[row] + rng.choice(here.stop - here.start, p=mdp.probabilities[here])
            episode[step], state = mdp.rewards[at], int(mdp.next_states[at])
            if mdp.terminated[at]:
                break
    return rewards


def near(rewards: np.ndarray, claimed: float) -> bool:
    """Whether a claimed mean is within five standard errors and the rounding of two decimals."""
    return abs(rewards.mean() - claimed) <= 5.0 * rewards.std() / len(rewards) ** 0.5 + 0.006


def step(text: str | None) -> int:
    return int(text or 0)


@pytest.mark.parametrize("seed", range(6))
def test_what_the_words_say_is_what_comes(seed: int):
    table = exact(random_mdp(seed), TimeAxis(GAMMA, STEPS))
    explanation = explain(tabular_moment(table, 0, ("go", "stay")), "go", "stay")
    rewards = sampled(table, 0, np.random.default_rng(seed))
    discounts = GAMMA ** np.arange(STEPS)
    read = 0
    for text in sentences(explanation):
        if found := re.match(
            rf"The first (reward|cost) to be expected of go is that of {STEP}: (?:"
            rf"{NUMBER} on average, worth {NUMBER} now|"
            rf"{NUMBER} with a chance of {NUMBER} %, and otherwise nothing; worth {NUMBER} now)",
            text,
        ):
            at, sign = step(found[2]), 1.0 if found[1] == "reward" else -1.0
            if found[3]:
                assert near(rewards[:, at], float(found[3]))
            else:
                assert set(np.unique(rewards[:, at])) == {0.0, sign * float(found[5])}
                assert near(rewards[:, at] != 0.0, float(found[6]) / 100.0)
            assert near(rewards[:, at] * discounts[at], float(found[4] or found[7]))
            for earlier in range(at):  # no step before it pays on average
                wins = sign * rewards[:, earlier]
                assert wins.mean() <= 5.0 * wins.std() / EPISODES**0.5
        elif found := re.match(
            rf"Before t\+{STEPS} the largest (reward|cost) to be expected of go is that of {STEP}, "
            rf"worth {NUMBER} now",
            text,
        ):
            at = step(found[2])
            assert near(rewards[:, at] * discounts[at], float(found[3]))
            means = np.abs(rewards.mean(axis=0))
            error = rewards.std(axis=0).max() / EPISODES**0.5
            assert means[at] >= means.max() - 7.0 * error
        elif found := re.match(
            rf"At {STEP} go (pays|costs) {NUMBER} with a chance of {NUMBER} %, "
            r"and otherwise nothing",
            text,
        ):
            at, paid = step(found[1]), float(found[3]) * (1 if found[2] == "pays" else -1)
            assert set(np.unique(rewards[:, at])) <= {0.0, paid}
            assert near(rewards[:, at] != 0.0, float(found[4]) / 100.0)
        elif found := re.match(rf"Nothing is expected of go before t\+{STEPS}", text):
            assert not rewards.any()
        else:
            continue
        read += 1
    assert read > 0, "these words were found"
