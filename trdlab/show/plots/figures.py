"""The picture of each noun, and the pictures of an explained agent, one for each part."""

from dataclasses import replace
from functools import singledispatch
from pathlib import Path
from typing import Any, Literal

from matplotlib.figure import Figure

from trdlab.errors import InputError
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison.comparison import Comparison
from trdlab.explanations.episode.played import Played
from trdlab.explanations.episode.story import Story, tell
from trdlab.explanations.explanation import USUAL, Explanation, Part
from trdlab.explanations.moment.moment import Choice, Moment, moment_of
from trdlab.explanations.saliency.saliency import Saliency
from trdlab.explanations.solved import SolvedState
from trdlab.gridworld import Gridworld
from trdlab.show.plots.calibration import trust_figure
from trdlab.show.plots.comparison import comparison_figure
from trdlab.show.plots.episode import story_figure
from trdlab.show.plots.map import solved_figure, world_figure
from trdlab.show.plots.moment import moment_figure
from trdlab.show.plots.outcomes import outcomes_figure
from trdlab.show.plots.saliency import saliency_figure
from trdlab.tabular import ExactTable

Picture = Part | Literal["outcomes"]
_ORDER: tuple[Part, ...] = ("contrast", "forecast", "episode", "saliency", "calibration")


@singledispatch
def figure(thing: Any, **how: Any) -> Figure:
    """Returns the picture of a thing: what its `.plot()` shows.

    Args:
        thing: an explanation, a moment, a report, an episode, a comparison, a table, a world.
        how: as the function takes it that draws such a thing.

    Raises:
        InputError: there is no picture of such a thing.
    """
    known = ", ".join(sorted(cls.__name__ for cls in figure.registry if cls is not object))
    raise InputError(f"There is no picture of a {type(thing).__name__}.", f"Draw one of: {known}.")


@figure.register
def explanation_figure(explained: Explanation, part: Part | None = None) -> Figure:
    """Returns the picture of a part, by default of the first one there is.

    Raises:
        InputError: there is nothing to draw.
    """
    for one in (part,) if part else _ORDER:
        if (found := part_figure(explained, one)) is not None:
            return found
    raise InputError("There is nothing to draw.", "Ask for a part that there is a picture of.")


def part_figure(explained: Explanation, part: Picture) -> Figure | None:
    """Returns the picture of a part, or of outcomes; None where there is nothing to draw."""
    agent, report, choice = explained.agent, explained.report, explained.choice
    if part == "calibration":
        return None if report is None else trust_figure(report, agent.name)
    if part == "saliency":
        return None if explained.saliency is None else saliency_figure(explained.saliency)
    if part == "episode":
        return None if explained.story is None else _episode(explained, explained.story)
    if choice is None or (part == "contrast" and choice.foil is None):
        return None
    title = f"{agent.name}, step {explained.step} of the episode with seed {explained.seed}"
    if part == "outcomes":
        known = choice.moment.outlook
        return outcomes_figure(choice, known, title) if known is not None and known.names else None
    return moment_figure(
        choice if part == "contrast" else replace(choice, foil=None),
        title,
        trial=explained.trial if part == "contrast" else None,
    )


def picture_paths(
    folder: Path, parts: tuple[Part, ...], *, seed: int, step: int
) -> dict[Picture, Path]:
    """Returns where the picture of each part goes; of all parts where none was asked for.

    Outcomes belong to a moment: theirs is among those of a forecast or a contrast.
    """
    ending = {"episode": f"-seed-{seed}", "calibration": ""}
    moment = f"-seed-{seed}-step-{step}"
    names: list[Picture] = [*(parts or USUAL)]
    names += ["outcomes"] * bool({"forecast", "contrast"} & set(names))
    return {name: folder / f"{name}{ending.get(name, moment)}.png" for name in names}


def _episode(explained: Explanation, told: Story) -> Figure:
    agent, report = explained.agent, explained.report
    return story_figure(
        told,
        f"{agent.name}, the episode with seed {explained.seed}",
        trust=None if report is None else report.trust,
        world=agent.world if isinstance(agent.world, Gridworld) and not agent.is_away else None,
    )


@figure.register
def _(table: ExactTable, **how: Any) -> Figure:
    names = [f"action {i}" for i in range(table.mdp.num_actions)]
    return figure(moment_of(table, table.mdp.start, names), **how)


figure.register(CalibrationReport, trust_figure)
figure.register(Choice, moment_figure)
figure.register(Comparison, comparison_figure)
figure.register(Gridworld, world_figure)
figure.register(Moment, lambda moment, **how: moment_figure(moment.choice(), **how))
figure.register(Played, lambda played, **how: story_figure(tell(played), **how))
figure.register(Saliency, saliency_figure)
figure.register(SolvedState, solved_figure)
figure.register(Story, story_figure)
