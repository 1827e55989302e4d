"""Documents: what a page holds, whatever it is rendered to; one maker for each noun."""

from collections.abc import Callable
from functools import singledispatch
from importlib import import_module
from typing import Any, NamedTuple, TypeVar

from trdlab.explanations.moment.telling import in_brief, sections
from trdlab.explanations.sections import Section
from trdlab.explanations.solved import SolvedState
from trdlab.formatting import plain
from trdlab.show.scenes import Scene, scene_of
from trdlab.show.tables import Table, action_table
from trdlab.time_axis import TimeAxis

T = TypeVar("T")

_MOST_ERROR = 1e-6  # of the largest reward, beyond which it is not called exact


class Document(NamedTuple):
    """What a page holds, in the order it is shown.

    Args:
        heading: whom or what it is about.
        setting: what else decides the numbers, in short pieces.
        scene: where it is.
        table: the numbers.
        answer: the few sentences that matter most.
        sections: all that there is to tell.
        check: what was checked of the numbers, and whether it is well.
        folded: whether the sections are told only to who asks for details.
        more: how to ask for them, where the page says so itself.
    """

    heading: str
    setting: tuple[str, ...]
    scene: Scene | None = None
    table: Table | None = None
    answer: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()
    check: tuple[str, bool] | None = None
    folded: bool = True
    more: str = ""


@singledispatch
def document(thing: Any) -> Document:
    """Returns the document about a noun of trdlab."""
    return late(document, thing)


def late(render: Callable[[Any], T], thing: Any) -> T:
    """Returns what a renderer makes of a noun whose renderings had not been imported yet.

    Those of agents need Gymnasium, and a solved gridworld does without.

    Raises:
        TypeError: there is no such rendering.
    """
    import_module("trdlab.show.agents")
    found: Callable[[Any], T] = render.dispatch(type(thing))  # type: ignore[attr-defined]
    if found is render.dispatch(object):  # type: ignore[attr-defined]
        raise TypeError(f"{type(thing).__name__} has no such rendering")
    return found(thing)


@document.register
def _(solved: SolvedState) -> Document:
    scene, choice = scene_of(solved.world, solved.state), solved.choice
    here = f"state {solved.state}" + f" ({scene.place})" * bool(scene.place)
    return Document(
        heading=scene.heading,
        setting=(*axis_words(choice.time_axis), here, *scene.rules),
        scene=scene,
        table=action_table(choice),
        answer=tuple(claim.sentence for claim in in_brief(choice)),
        sections=sections(choice),
        check=_check(solved),
    )


def axis_words(axis: TimeAxis) -> tuple[str, ...]:
    """Returns γ, N and w as they stand in a heading."""
    return f"γ = {plain(axis.gamma)}", f"N = {axis.horizon}", f"w = {axis.width}"


def _check(solved: SolvedState) -> tuple[str, bool]:
    largest = float(abs(solved.table.mdp.rewards).max(initial=0.0))
    summed = f"Components sum to Q (largest difference {solved.sum_error:.0e});"
    bound = f"{solved.error_bound:.0e}"
    if solved.error_bound <= _MOST_ERROR * largest or not largest:
        return f"{summed} Q is exact to {bound} (proven).", True
    return f"{summed} γ is so close to 1 that Q is only known to {bound}.", False
