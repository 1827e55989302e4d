"""What a forecast says in English, against sampled episodes: the words are tested, no formula."""

import re

import numpy as np
import pytest

from trdlab.decomposition import TimeAxis
from trdlab.explanations.moment.exact import tabular_moment
from trdlab.explanations.moment.forecast import forecast
from trdlab.tabular import MDP, ExactTable, exact

GAMMA, STEPS, EPISODES = 0.9, 6, 4_000
NUMBER = r"(-?\d+(?:\.\d+)?(?:e-?\d+)?)"
WHEN = r"(at once|\d+ steps? later)"


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


def step(when: str) -> int:
    return 0 if when == "at once" else int(when.split()[0])


def chance_of(rewards: np.ndarray, at: int, percent: str) -> bool:
    """Whether a reward, or a cost, comes at a step with such a chance."""
    return near(rewards[:, at] != 0.0, float(percent) / 100.0)


def holds(text: str, rewards: np.ndarray) -> bool:
    """Checks what a sentence says of what came with `go`; returns whether it could be read."""
    discounts = GAMMA ** np.arange(STEPS)
    if found := re.fullmatch(
        rf"With go, the first (reward|cost) comes {WHEN}: it is {NUMBER}\.", text
    ):
        at, sign = step(found[2]), 1.0 if found[1] == "reward" else -1.0
        assert set(np.unique(rewards[:, at])) == {sign * float(found[3])}
        assert not (sign * rewards[:, :at] > 0.0).any()
    elif found := re.fullmatch(
        rf"With go, a (reward|cost) of {NUMBER} can come {WHEN}(?: at the earliest)?; the chance "
        rf"that it comes then is {NUMBER} %\.",
        text,
    ):
        at, won = step(found[3]), np.maximum(rewards if found[1] == "reward" else -rewards, 0.0)
        assert set(np.unique(won[:, at])) == {0.0, float(found[2])}
        assert chance_of(won, at, found[4])
        assert not won[:, :at].any()
    elif found := re.fullmatch(
        rf"There is an? {NUMBER} % chance that go (pays|costs) {NUMBER}, {WHEN}\.", text
    ):
        at, paid = step(found[4]), float(found[3]) * (1 if found[2] == "pays" else -1)
        assert set(np.unique(rewards[:, at])) == {0.0, paid}
        assert chance_of(rewards, at, found[1])
    elif found := re.fullmatch(
        rf"The largest (reward|cost) of go in the first {STEPS} steps comes {WHEN}: it is "
        rf"{NUMBER}( on average)?\.",
        text,
    ):
        at = step(found[2])
        assert near(np.abs(rewards[:, at]), float(found[3]))
        means = np.abs(rewards.mean(axis=0))
        assert means[at] >= means.max() - 7.0 * rewards.std(axis=0).max() / EPISODES**0.5
    elif found := re.fullmatch(
        rf"What go pays in the first {STEPS} steps comes {NUMBER} steps later on average\.", text
    ):
        worth = (rewards * discounts).mean(axis=0)
        assert worth @ np.arange(STEPS) / worth.sum() == pytest.approx(float(found[1]), abs=0.15)
    else:
        return False
    return True


@pytest.mark.parametrize("seed", range(10))
def test_what_the_words_say_is_what_comes(seed: int):
    table = exact(random_mdp(seed), TimeAxis(GAMMA, STEPS))
    claims = forecast(tabular_moment(table, 0, ("go", "stay")).choice("go", "stay"))
    rewards = sampled(table, 0, np.random.default_rng(seed))
    read = [claim.kind for claim in claims if holds(claim.sentence, rewards)]
    assert {"first-reward", "first-chance"} & set(read), "these words were found"
