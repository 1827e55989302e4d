"""The three agents of a blind reading: one map, three settings of what it pays."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.gridworld import Gridworld, load_map
from trdlab.gridworld.gridmap import GridMap
from trdlab.tabular import ExactTable, exact
from trdlab.tabular.episodes import ModelEnvironments

TIME_AXIS = TimeAxis(0.95, 16)
_MAP = Path(__file__).parent / "islands.txt"
_LONGEST = 100  # steps of an episode: who avoids hazards may wait for long


@dataclass(frozen=True)
class Candidate:
    """One of the agents that a text may be about.

    Args:
        letter: how readers name it.
        about: what it is after, in a few words.
        rewards: what each kind of cell pays it.
    """

    letter: str
    about: str
    rewards: Mapping[str, float]

    @property
    def pays(self) -> str:
        """What each kind of cell pays it, as people write it."""
        coin, treasure, hazard = (f"{self.rewards[of]:g}" for of in ("coin", "treasure", "hazard"))
        return f"{coin} for each coin, {treasure} for the treasure, {hazard} for entering a hazard"


CANDIDATES = (
    Candidate(
        "A",
        "collects small rewards that come soon",
        {"coin": 1.0, "treasure": 0.5, "hazard": -0.1},
    ),
    Candidate(
        "B",
        "goes for one large reward that comes late",
        {"coin": 0.1, "treasure": 10.0, "hazard": -0.1},
    ),
    Candidate(
        "C",
        "avoids losses: a single one costs it more than there is to earn; apart from that it heads "
        "for a reward that comes late",
        {"coin": 0.1, "treasure": 2.0, "hazard": -4.0},
    ),
)
LETTERS = "".join(candidate.letter for candidate in CANDIDATES)


def candidate_of(letter: str) -> Candidate:
    """Returns a candidate by its letter.

    Raises:
        InputError: no candidate has that letter.
    """
    for candidate in CANDIDATES:
        if candidate.letter == letter:
            return candidate
    raise InputError(f"There is no agent '{letter}'.", f"Known: {', '.join(LETTERS)}.")


def study_map() -> GridMap:
    """Returns the map that all candidates act on."""
    return load_map(_MAP)


@cache
def solved(letter: str) -> tuple[Gridworld, ExactTable]:
    """Returns the world as it pays a candidate, and the exact table of its optimal policy."""
    grid = study_map()
    for kind, value in candidate_of(letter).rewards.items():
        grid = grid.with_value(kind, value)
    world = Gridworld(grid)
    return world, exact(world.mdp, TIME_AXIS)


def visited(letter: str, seed: int) -> list[int]:
    """Returns the states of one episode that a candidate plays, each once, in their order."""
    world, table = solved(letter)
    actions = table.solution.policy.argmax(axis=1)
    episode = ModelEnvironments(world.mdp, 1, seed=seed, time_limit=_LONGEST)
    states = [int(episode.reset()[0])]
    step = episode.step(actions[states])
    while not step.ended[0]:
        states.append(int(step.following[0]))
        step = episode.step(actions[states[-1:]])
    return list(dict.fromkeys(states))


def worth_by_source(letter: str, state: int, action: int) -> dict[str, float]:
    """Returns what each source of reward adds to the Q-value of an action, under its policy.

    Q is linear in the rewards of a fixed policy: a source adds what is lost without it.
    """
    world, table = solved(letter)
    policy, q_value = table.solution.policy, table.decomposition.value[state, action]
    parts = {}
    for source in world.sources:
        without = exact(world.mdp_if(source, 0.0), TIME_AXIS, policy=policy)
        parts[source.kind] = float(q_value - without.decomposition.value[state, action])
    return parts
