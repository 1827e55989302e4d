"""What matters for near and for far reward, at one moment: the evidence that sentences speak of."""

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trdlab.agents.agent import Agent
from trdlab.arrays import BoolArray, FloatArray
from trdlab.estimator import MapMethod
from trdlab.explanations.calibration.calibration import Trust
from trdlab.explanations.rules import Form, Language
from trdlab.explanations.saliency.checks import (
    NOT_TESTED,
    Check,
    hidden_check,
    patch_means,
    redrawn_check,
)
from trdlab.explanations.saliency.groups import Group, usual_groups
from trdlab.explanations.saliency.maps import SaliencyMap, SaliencyMaps, enlarged
from trdlab.explanations.words import forms_of
from trdlab.printable import Printable
from trdlab.time_axis import TimeAxis

Method = Literal["gradients", "hiding", "exchange"]
"""How an attribution of entries was made; see `Entries`."""


class Checks(NamedTuple):
    """Whether an attribution can be believed.

    Args:
        redrawn: whether it depends on what was learned.
        hidden: whether it is strong where hiding changes much.
    """

    redrawn: Check
    hidden: Check

    @property
    def is_bad(self) -> bool:
        """Whether one of them was not passed."""
        return "bad" in (self.redrawn.verdict, self.hidden.verdict)


@dataclass(frozen=True, eq=False)
class Places:
    """Which places of an image matter for each component of an action.

    Args:
        method: how the maps were made.
        maps: `[N+1, h, w]`, of a convolution.
        layer: which convolution.
        hidden: `[N+1, rows, columns]`: how much more is expected than with each patch hidden.
        shown: `[rows, columns]`, where there was something to hide.
        redrawn: `[R, N+1, h, w]`, the maps of networks with new weights.
        side: of a patch, in pixels.
        seen: `[C, H, W]`, what the agent sees.
        screen: `[H', W', 3]`, what people see; None where that is not known.
    """

    method: MapMethod
    maps: SaliencyMaps
    layer: int
    hidden: SaliencyMaps
    shown: BoolArray
    redrawn: FloatArray
    side: int
    seen: NDArray[np.uint8]
    screen: NDArray[np.uint8] | None = None

    @property
    def made(self) -> str:
        """How the maps were made, as people call it."""
        return {"gradcam": "GradCAM", "hirescam": "HiResCAM"}[self.method]

    def checks(self, group: Group) -> Checks:
        """Returns whether the map of some components can be believed."""
        strength = self.maps.of(group).strength
        others = np.abs(self.redrawn[:, group.components].sum(axis=1))
        per_patch = patch_means(enlarged(strength, *self.seen.shape[-2:]), self.side)
        return Checks(
            redrawn_check(strength, others),
            hidden_check(per_patch, self.hidden.of(group).strength, self.shown),
        )


@dataclass(frozen=True, eq=False)
class Entries:
    """Which entries of a vector, or coordinates of a state, matter for each component.

    Args:
        method: `gradients`, integrated from the mean of what was met: over the entries they add up;
            `hiding`, as for `hidden`, where there are no gradients; `exchange`, of a solved model:
            how much more is expected than on average in states that differ only in that coordinate.
        names: F of them.
        values: F, what they are here, in words.
        signed: `[N+1, F]`.
        hidden: `[N+1, F]`, how much more is expected than on average with each entry taken from
            what was met.
        shown: `[F]`, which entries can be other than they are.
        redrawn: `[R, N+1, F]`, as `signed`, of networks with new weights.
        time_axis: what the components mean.
        met: how many observations, or states, they are held against.
    """

    method: Method
    names: tuple[str, ...]
    values: tuple[str, ...]
    signed: FloatArray
    hidden: FloatArray
    shown: BoolArray
    redrawn: FloatArray
    time_axis: TimeAxis
    met: int

    def of(self, group: Group) -> FloatArray:
        """Returns `[F]`: what each entry adds to some components together."""
        return np.asarray(self.signed[group.components].sum(axis=0, dtype=np.float64))

    def shares(self, group: Group) -> FloatArray:
        """Returns `[F]`: of what all entries add or take, the share of each; 0 if nothing does."""
        strength = np.abs(self.of(group))
        return np.asarray(strength / strength.sum() if strength.any() else strength)

    def checks(self, group: Group) -> Checks:
        """Returns whether the attribution of some components can be believed."""
        if self.method != "gradients":  # it is what was tried out
            return Checks(NOT_TESTED, NOT_TESTED)
        strength = np.abs(self.of(group))
        others = np.abs(self.redrawn[:, group.components].sum(axis=1))
        hidden = self.hidden[group.components].sum(axis=0)
        return Checks(redrawn_check(strength, others), hidden_check(strength, hidden, self.shown))


@dataclass(frozen=True, eq=False, repr=False)
class Saliency(Printable):
    """What matters for near and for far reward, at a moment of an agent.

    Args:
        agent: whom it is about.
        seed: of the episode that the moment is in.
        step: of that episode.
        action: whose reward is asked about.
        foil: the one that it is held against: then all is of how the two differ; None for none.
        groups: of components that are asked about: one, two that are held against each other, the
            near one first, or all of them.
        of: the numbers.
        trust: how far the forecast can be trusted; None where that was not judged.
    """

    agent: Agent
    seed: int
    step: int
    action: str
    foil: str | None
    groups: tuple[Group, ...]
    of: Places | Entries
    trust: Trust | None = None

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.agent.estimator.time_axis

    @property
    def pair(self) -> tuple[Group, Group] | None:
        """Near and far, where two groups are held against each other."""
        return (self.groups[0], self.groups[1]) if len(self.groups) == 2 else None

    @property
    def told(self) -> tuple[Group, ...]:
        """The groups that sentences speak of."""
        return self.groups if len(self.groups) <= 2 else (self.groups[0], self.groups[-1])

    @property
    def whose(self) -> dict[str, str]:
        """What is explained, as sentences call it."""
        of = (
            "what it expects"
            if self.foil is None
            else f"the lead of {self.action} over {self.foil}"
        )
        return {"whose": of}

    @property
    def about(self) -> str:
        """Whose reward it is about, in a few words."""
        return self.action if self.foil is None else f"{self.action} − {self.foil}"

    def judged(self, trust: Trust, *, usual: bool = True) -> "Saliency":
        """Returns the same, where it is known how far the forecast can be trusted.

        Args:
            trust: of the agent's forecasts.
            usual: whether it is asked about the usual groups, which end where trust does.
        """
        groups = usual_groups(self.time_axis, trust) if usual else self.groups
        return replace(self, trust=trust, groups=groups)

    def is_doubtful(self, group: Group) -> bool:
        """Returns whether some of the components are known not to be trusted."""
        return self.trust is not None and bool(self.trust.doubtful[group.components].any())

    def map(self, group: Group) -> SaliencyMap:
        """Returns the map of some components, of an agent that sees images.

        Raises:
            TypeError: it sees no images.
        """
        if not isinstance(self.of, Places):
            raise TypeError("there are no maps of vectors")
        return self.of.maps.of(group)


def _correlation(value: Any, _: int) -> str:
    return f"{value:.2f}"


SALIENCY = Language[Saliency](
    "what matters here",
    lambda of: (
        forms_of(of.time_axis, of.agent.seconds_per_step) | {"correlation": Form(_correlation)}
    ),
)
