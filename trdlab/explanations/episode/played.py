"""An episode that was played, and how what is said of one looks."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trdlab.explanations.episode.revision import Revision, revise
from trdlab.explanations.rules import Form, Language
from trdlab.explanations.words import forms_of
from trdlab.formatting import said
from trdlab.rollouts.episodes import Episode


@dataclass(frozen=True, eq=False)
class Played:
    """An episode with all that a story of it is held against.

    Args:
        episode: what was predicted and what happened.
        action_names: A names.
        seconds_per_step: how long a step takes as people play, if that is known.
    """

    episode: Episode
    action_names: tuple[str, ...]
    seconds_per_step: float | None = None

    @cached_property
    def revision(self) -> Revision:
        """What each step changed."""
        return revise(self.episode)

    @property
    def scale(self) -> float:
        """The largest reward that came, or value that was expected, whatever its sign."""
        episode = self.episode
        values = (episode.predicted.sum(axis=1), episode.expected.sum(axis=1), episode.rewards)
        return float(max(np.abs(of).max() for of in values))

    def action(self, step: int) -> str:
        """Returns the name of the action taken at a step."""
        return self.action_names[int(self.episode.actions[step])]


def _forms(played: Played) -> dict[str, Form]:
    axis = played.episode.time_axis
    plural = axis.width > 1

    def at(place: tuple[int, int]) -> str:
        step, component = place
        ahead = axis.steps(component)
        if ahead is None:
            return f"after step {step + axis.start(component) - 1:,}"
        first, last = step + ahead[0], step + ahead[-1]
        return f"at step {first:,}" if first == last else f"at steps {first:,} to {last:,}"

    return forms_of(axis, played.seconds_per_step) | {
        "at": Form(lambda place, _: at(place)),
        "rewards": Form(lambda worth, digits: _named(worth, digits, plural=True), abs),
        "paid": Form(lambda paid, digits: _named(paid, digits, plural=plural), abs),
        "bound": Form(lambda most, _: said(_rounded_up(most))),
    }


def _named(value: float, digits: int, *, plural: bool) -> str:
    """Returns a reward or a cost, or the worth of several."""
    kind, size = "reward" if value >= 0.0 else "cost", said(abs(value), digits)
    return f"{kind}s worth {size}" if plural else f"a {kind} of {size}"


def _rounded_up(value: float) -> float:
    """Returns a number of three digits that is no smaller."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.ceil(value / unit - 1e-9) * unit


EPISODES = Language[Played]("this episode", _forms)
