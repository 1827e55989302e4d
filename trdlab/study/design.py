"""What kits ask: which answers there are to choose from, and which groups of readers answer."""

from collections.abc import Mapping
from dataclasses import dataclass

from trdlab.study.candidates import LETTERS


@dataclass(frozen=True)
class Design:
    """How a study is made.

    Args:
        schema: of the answers of its kits.
        letters: the answers to choose from.
        groups: what each group of readers sees, by its name. The first is held against each of the
            others, which are controls.
        sentences: where the answers have the sentences of a trial.
    """

    schema: str
    letters: str
    groups: Mapping[str, str]
    sentences: tuple[str, ...]

    @property
    def chance(self) -> float:
        """How often a guess is right."""
        return 1.0 / len(self.letters)

    @property
    def tested(self) -> str:
        """The group whose reading is tested."""
        return next(iter(self.groups))


BLIND_READING = Design(
    schema="trdlab.study/2",
    letters=LETTERS,
    groups={"text": "the text", "q": "Q alone"},
    sentences=("why", "promise", "instead"),
)
GOAL_STUDY = Design(
    schema="trdlab.goal-study/1",
    letters="ABCD",
    groups={
        "report": "the report",
        "bars": "bars alone",
        "saliency": "saliency alone",
        "clips": "clips alone",
    },
    sentences=("sentences",),
)
DESIGNS = (BLIND_READING, GOAL_STUDY)
