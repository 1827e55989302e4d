"""What is told of every moment of an episode, each sentence kept once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.explanations.moment.telling import in_brief

MOST_PAIRS = 3_000
"""Of actions and foils of which sentences are kept, in a whole episode: each takes milliseconds."""

Pair = tuple[int, int | None]
"""The numbers of an action and of its foil, which there may not be."""


@dataclass(frozen=True)
class Told:
    """The sentences of an episode.

    Args:
        sentences: each once.
        usual: `[T]`, the action and the foil that are told of where nobody chooses others.
        moments: `[T]`, for each pair the numbers of its sentences, what matters most first.
    """

    sentences: tuple[str, ...]
    usual: tuple[Pair, ...]
    moments: tuple[dict[Pair, tuple[int, ...]], ...]

    def sentences_of(self, step: int) -> tuple[str, ...]:
        """Returns what is told of a step where nobody chooses other actions."""
        return tuple(self.sentences[i] for i in self.moments[step][self.usual[step]])


def tell_moments(moments: Sequence[Moment], names: Sequence[str]) -> Told:
    """Returns the few sentences that matter most of each moment, for as many pairs as is quick.

    They are of what the agent does: against the next best action, and then against each other one.

    Args:
        moments: T of them.
        names: of the A actions.
    """
    numbers: dict[str, int] = {}
    known: dict[int, dict[Pair, tuple[int, ...]]] = {}  # of moments that come up again
    index = {name: i for i, name in enumerate(names)}
    count = max(1, MOST_PAIRS // max(1, len({id(moment) for moment in moments})))
    usual, told = [], []
    for moment in moments:
        choice = moment.choice()
        usual.append(_pair(choice, index))
        if id(moment) not in known:
            known[id(moment)] = {
                _pair(one, index): tuple(
                    numbers.setdefault(claim.sentence, len(numbers)) for claim in in_brief(one)
                )
                for _, one in zip(range(count), _choices(choice), strict=False)
            }
        told.append(known[id(moment)])
    return Told(tuple(numbers), tuple(usual), tuple(told))


def _choices(choice: Choice) -> Iterator[Choice]:
    """Yields a choice, and then others, those that are most likely asked for first."""
    yield choice
    moment, done = choice.moment, choice.action
    others = [name for name in moment.action_names if name != done]
    yield from (moment.choice(done, other) for other in others if other != choice.foil)


def _pair(choice: Choice, index: dict[str, int]) -> Pair:
    return index[choice.action], None if choice.foil is None else index[choice.foil]
