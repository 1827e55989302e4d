"""The trials of a blind reading: what is printed of an agent at a moment, names left out."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from trdlab.errors import InputError
from trdlab.explanations.claims import Finding
from trdlab.explanations.moment.contrast import in_short
from trdlab.explanations.moment.exact import tabular_moment
from trdlab.explanations.moment.explanation import Explanation, explain
from trdlab.explanations.moment.sentences import check, sentence
from trdlab.formatting import number
from trdlab.study.candidates import (
    CANDIDATES,
    LETTERS,
    solved,
    visited,
    worth_by_source,
)

FEWEST, MOST = 3, 30
_NAMES = ("action P", "action Q", "action R", "action S")
_MOST_EPISODES = 1_000


@dataclass(frozen=True)
class Trial:
    """A text about a moment, and which agent it is about.

    Args:
        letter: of that agent.
        action: what it does, under a neutral name.
        foil: the next best action, under a neutral name.
        promise: the sentences on what the action promises.
        against: the sentences on the action against its foil.
        reason: where it was, and where what it expects comes from; for after the answer.
    """

    letter: str
    action: str
    foil: str
    promise: tuple[str, ...]
    against: tuple[str, ...]
    reason: str

    @property
    def parts(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """The two parts of the text, each below its heading."""
        return (
            (f"What it expects of {self.action}, which it takes", self.promise),
            (f"Why not {self.foil}", self.against),
        )


def draw_trials(seed: int, count: int = 12) -> tuple[Trial, ...]:
    """Returns trials in random order, equally many about each candidate.

    Each is about another state, drawn from the first half of an episode that the candidate plays:
    later there is little left to expect. The text is what the sentences module prints, less
    what would give the map away: actions have other names in each trial, and what would change
    if a named source paid something else is left out.

    Args:
        seed: of all chance.
        count: of trials.

    Raises:
        InputError: the count is no multiple of three, or out of range.
    """
    each, rest = divmod(count, len(CANDIDATES))
    if rest or not FEWEST <= count <= MOST:
        raise InputError(
            f"There cannot be {count} trials.",
            f"Give a multiple of {len(CANDIDATES)}, from {FEWEST} to {MOST}.",
        )
    rng = np.random.default_rng(seed)
    trials = [trial for letter in LETTERS for trial in _trials_about(letter, each, rng)]
    return tuple(trials[i] for i in rng.permutation(count))


def _trials_about(letter: str, count: int, rng: np.random.Generator) -> Iterator[Trial]:
    done: set[int] = set()
    for _ in range(_MOST_EPISODES):
        states = visited(letter, seed=int(rng.integers(2**31)))
        state = states[rng.integers((len(states) + 1) // 2)]
        trial = None if state in done else _trial(letter, state, rng)
        done.add(state)
        if trial is not None:
            yield trial
            count -= 1
        if not count:
            return
    raise InputError(f"Agent {letter} does not see that many states.", "Ask for fewer trials.")


def _trial(letter: str, state: int, rng: np.random.Generator) -> Trial | None:
    """Returns a trial about a state; None where the agent does nothing that could be contrasted."""
    world, table = solved(letter)
    names = [str(name) for name in rng.permutation(_NAMES)]
    explanation = explain(tabular_moment(table, state, names))
    action, foil = explanation.action, explanation.foil
    does = names.index(action)
    if foil is None or not table.solution.policy[state, does] > 0.0:
        return None
    reason = _reason(letter, state, does, f"{action} ({world.action_names[does]})")
    return Trial(
        letter=letter,
        action=action,
        foil=foil,
        promise=_printed(explanation.forecast, explanation),
        against=_printed(in_short(explanation.contrast), explanation),
        reason=reason,
    )


def _printed(findings: Iterable[Finding], explanation: Explanation) -> tuple[str, ...]:
    """Returns findings as sentences, read back and checked."""
    texts = tuple(sentence(finding, explanation) for finding in findings)
    check(" ".join(texts), explanation)
    return texts


def _reason(letter: str, state: int, action: int, name: str) -> str:
    world, table = solved(letter)
    worth = number(float(table.decomposition.value[state, action]))
    sources = {"coin": "coins", "treasure": "the treasure", "hazard": "hazards"}
    parts = worth_by_source(letter, state, action)
    told = ", ".join(f"{sources[kind]} {number(part)}" for kind, part in parts.items())
    return f"Agent {letter} at {world.states[state]}: {name} is worth {worth} to it ({told})."
