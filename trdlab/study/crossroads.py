"""The choice that all agents face: four ways, each with rewards and a danger, and none leads back.

What the ways are worth is drawn first, alike for all agents. What lies on them is drawn after that,
as fits the agent, and scaled until it is worth as much. So Q tells nothing about whose it is.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.tabular import MDP

TIME_AXIS = TimeAxis(0.95, 16)
WAYS = 4
_STEPS = TIME_AXIS.num_steps
SOON, LATE = range(2, 8), range(10, 16)  # the steps at which rewards come
_DANGER = range(2, 9)
_REWARDS = (2, 3, 4)  # of a way


class Event(NamedTuple):
    """What may come at a step of a way.

    Args:
        amount: of reward; below zero it is a cost.
        chance: that it comes.
    """

    amount: float
    chance: float


Way = Mapping[int, Event]
"""What may come, by the step at which it does; after the last of them the episode is over."""


class _Danger(NamedTuple):
    """How a danger comes to the cost that is expected of it.

    Args:
        cost: expected, and discounted.
        amount: what it costs if it comes; None where its chance is given instead.
        chance: that it comes, if the amount is not given.
    """

    cost: float
    amount: float | None
    chance: float


def draw_worths(rng: np.random.Generator) -> FloatArray:
    """Returns what the ways are worth, the best first, in a unit that is drawn too: `[4]`."""
    second = rng.uniform(0.6, 0.97)
    others = np.sort(rng.uniform(0.1, second, WAYS - 2))[::-1]
    unit = 10.0 ** rng.uniform(0.0, 2.0)
    return np.asarray(unit * np.array([1.0, second, *others]))


def draw_ways(letter: str, worths: FloatArray, rng: np.random.Generator) -> tuple[Way, ...]:
    """Returns what lies on the ways, so that an agent takes the first one for its own reason.

    A and B risk more on it than on the second, for rewards that come soon or that come late. C
    risks much less: were there no dangers, the second way would be worth more to it.

    Args:
        letter: of the agent.
        worths: `[4]`, from the largest to the smallest.
        rng: where the chance comes from.
    """
    late = rng.random(WAYS) < 0.5
    late[0] = letter == "B" or (letter == "C" and late[0])
    dangers = _dangers(letter, float(worths[0]), rng)
    return tuple(
        _draw_way(float(worth), bool(is_late), danger, rng)
        for worth, is_late, danger in zip(worths, late, dangers, strict=True)
    )


def worth_of(way: Way) -> float:
    """Returns what is expected of a way now.

    >>> round(worth_of({0: Event(2.0, 1.0), 1: Event(-1.0, 0.1)}), 3)  # 2 − 0.95·0.1·1
    1.905
    """
    return sum(TIME_AXIS.gamma**k * event.amount * event.chance for k, event in way.items())


def model(ways: tuple[Way, ...]) -> MDP:
    """Returns the choice as an exact model: action i of state 0 takes way i, and nothing turns."""

    def outcomes(of: int, k: int) -> list[tuple[float, int, float, bool]]:
        amount, chance = ways[of].get(k, Event(0.0, 1.0))
        ends = k >= max(ways[of])
        following = 0 if ends else 1 + of * (_STEPS - 1) + k
        results = ((chance, amount), (1.0 - chance, 0.0))
        return [(p, following, reward, ends) for p, reward in results if p > 0.0]

    along = [[outcomes(i, k)] * WAYS for i in range(WAYS) for k in range(1, _STEPS)]
    return MDP.from_transitions([[outcomes(i, 0) for i in range(WAYS)], *along])


def _dangers(letter: str, unit: float, rng: np.random.Generator) -> list[_Danger]:
    """Returns the danger of each way: those of the first two differ in amount, or in chance."""
    if letter == "C":
        costs = [rng.uniform(0.03, 0.08), rng.uniform(0.5, 0.9)]
    else:
        taken = rng.uniform(0.2, 0.5)
        costs = [taken, taken * rng.uniform(0.15, 0.5)]
    chance = float(rng.choice([0.05, 0.1, 0.2, 0.3]))
    amount = unit * max(costs) / chance if rng.random() < 0.5 else None
    others = [_Danger(unit * rng.uniform(0.05, 0.6), None, chance) for _ in range(WAYS - 2)]
    return [*(_Danger(unit * cost, amount, chance) for cost in costs), *others]


def _draw_way(worth: float, is_late: bool, danger: _Danger, rng: np.random.Generator) -> Way:
    steps = np.sort(rng.choice(LATE if is_late else SOON, rng.choice(_REWARDS), replace=False))
    chance = float(rng.choice([0.7, 0.8, 0.9, 1.0]))
    rewards = {int(k): Event(float(rng.uniform(0.7, 1.3)), chance) for k in steps}
    scale = (worth + danger.cost) / worth_of(rewards)
    scaled = {k: Event(scale * event.amount, chance) for k, event in rewards.items()}
    at = int(rng.choice([k for k in _DANGER if k not in rewards]))
    expected = danger.cost / TIME_AXIS.gamma**at  # when it comes
    if danger.amount is None:
        return scaled | {at: Event(-expected / danger.chance, danger.chance)}
    return scaled | {at: Event(-danger.amount, expected / danger.amount)}
