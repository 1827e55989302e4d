"""What is rendered of agents: explanations, calibrations and comparisons, as pages and as data."""

import math
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration import claims as calibration
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison import claims as comparing
from trdlab.explanations.comparison.comparison import SIDES, Comparison
from trdlab.explanations.explanation import Explanation
from trdlab.explanations.rules import plain_data
from trdlab.formatting import decimals_for, number
from trdlab.show.data import actions_data, axis_data, data, sections_data
from trdlab.show.document import Document, axis_words, document
from trdlab.show.scenes import scene_of
from trdlab.statistics import Estimate, Estimates

_MOST_ROWS = 8  # of a table of components


@document.register
def _(explanation: Explanation) -> Document:
    agent, choice = explanation.agent, explanation.choice
    heading = [agent.name]
    if choice is not None:
        heading.append(f"step {explanation.step} of the episode with seed {explanation.seed}")
    elif explanation.story is not None:
        heading.append(f"the episode with seed {explanation.seed}")
    drawing, legend = "", tuple[str, ...]()
    if explanation.state is not None and agent.world is not None:
        scene = scene_of(agent.world, explanation.state)
        drawing, legend = scene.drawing, scene.legend
    return Document(
        heading=" · ".join(heading),
        setting=(*axis_words(explanation.time_axis), *_played(explanation)),
        drawing=drawing,
        legend=legend,
        choice=choice,
        answer=tuple(claim.sentence for claim in explanation.answer),
        sections=explanation.sections,
        folded=not explanation.parts,
    )


@document.register
def _(report: CalibrationReport) -> Document:
    told = calibration.in_brief(report)
    return Document(
        heading=f"How far its forecasts can be trusted · {report.judged.episodes} episodes",
        setting=axis_words(report.time_axis),
        answer=tuple(claim.sentence for claim in told),
        sections=calibration.sections(report),
    )


@document.register
def _(comparison: Comparison) -> Document:
    named = zip(SIDES, comparison.names, strict=True)
    seconds = comparison.seconds_per_step
    return Document(
        heading=" · ".join(f"{side}: {name}" for side, name in named),
        setting=(*axis_words(comparison.time_axis), *_seconds(seconds)),
        grid=_means(comparison),
        answer=tuple(claim.sentence for claim in comparing.in_brief(comparison)),
        sections=comparing.sections(comparison),
    )


def _played(explanation: Explanation) -> list[str]:
    """Returns how long a step takes, and where episodes were cut off by us."""
    report, story, cut = explanation.report, explanation.story, set()
    if report is not None and report.judged.truncated:
        cut.add(report.judged.time_limit)
    if story is not None and not story.played.episode.terminated:
        cut.add(story.played.episode.time_limit)
    words = _seconds(explanation.agent.seconds_per_step)
    if explanation.max_steps in cut - {None}:
        words.append(f"episodes are cut off after {explanation.max_steps:,} steps")
    return words


def _seconds(seconds: float | None) -> list[str]:
    return [] if seconds is None else [f"a step is {seconds:.2g} s of play"]


def _means(comparison: Comparison) -> tuple[tuple[str, ...], ...]:
    """Returns what each of two agents expects of what it would do, by component, and in all."""
    means, gap, axis = comparison.means.value, comparison.difference, comparison.time_axis
    decimals = decimals_for([*means.ravel(), *gap.value])
    has_intervals = not math.isnan(comparison.gap.low)

    def row(label: str, values: FloatArray, estimate: Estimate) -> tuple[str, ...]:
        ends = " to ".join(number(end, decimals) for end in (estimate.low, estimate.high))
        cells = (number(float(x), decimals) for x in (*values, estimate.value))
        return label, *cells, *([ends] if has_intervals else [])

    shown = np.argsort(-comparison.apart.value, kind="stable")[:_MOST_ROWS]
    parts = [row(axis.label(c), means[:, c], gap[c]) for c in sorted(shown.tolist())]
    heading = ("reward at", *SIDES, "B − A", *(["95 % interval"] if has_intervals else []))
    in_all = row("all of it", means.sum(axis=1), comparison.gap)
    return heading, *(parts if axis.horizon else ()), in_all


# ---- as plain data -----------------------------------------------------------------------------


@data.register
def _(explanation: Explanation) -> dict[str, Any]:
    choice, report, trial = explanation.choice, explanation.report, explanation.trial
    moment = None
    if choice is not None:
        moment = {
            "state": explanation.state,
            "actions": actions_data(choice.moment),
            "error": plain_data(choice.moment.error),
            "foil_error": plain_data(choice.moment.foil_error),
            "only_reward": plain_data(choice.moment.only_reward),
            "action": choice.action,
            "foil": choice.foil,
        }
    return {
        "schema": "trdlab.explain/2",
        "agent": explanation.agent.name,
        "seed": explanation.seed,
        "step": explanation.step,
        "seconds_per_step": explanation.agent.seconds_per_step,
        "max_steps": explanation.max_steps,
        "time_axis": axis_data(explanation.time_axis),
        "future": explanation.agent.estimator.future.to_dict(),
        "answer": [claim.to_dict() for claim in explanation.answer],
        "sections": sections_data(explanation.sections),
        "moment": moment,
        "trial": None if trial is None else trial.to_dict(),
        "episode": None if explanation.story is None else _episode(explanation),
        "calibration": None if report is None else data(report),
    }


data.register(CalibrationReport, calibration.to_dict)


@data.register
def _(comparison: Comparison) -> dict[str, Any]:
    visits = comparison.visits
    return {
        "schema": "trdlab.compare/2",
        "agents": {
            side: {
                "name": comparison.names[i],
                "future": comparison.futures[i].to_dict(),
                "mean": plain_data(_of_side(comparison.means, i)),
                "calibration": None if report is None else data(report),
            }
            for i, (side, report) in enumerate(zip(SIDES, comparison.reports, strict=True))
        },
        "seconds_per_step": comparison.seconds_per_step,
        "max_steps": comparison.max_steps,
        "time_axis": axis_data(comparison.time_axis),
        "episodes": comparison.episodes,
        "different_episodes": visits.different,
        "cut_off": visits.cut,
        "states": len(visits),
        "difference": plain_data(comparison.difference),
        "apart": plain_data(comparison.apart),
        "of_any_action": plain_data(comparison.of_any_action),
        "gap": plain_data(comparison.gap),
        "shift": plain_data(comparison.shift),
        "agreement": plain_data(comparison.agreement),
        "answer": [claim.to_dict() for claim in comparing.in_brief(comparison)],
        "sections": sections_data(comparing.sections(comparison)),
    }


def _of_side(means: Estimates, side: int) -> Estimates:
    return Estimates(means.value[side], means.low[side], means.high[side])


def _episode(explanation: Explanation) -> dict[str, Any]:
    """Returns the numbers of an episode.

    `values` is `[T]`, what was expected in all of the actions taken. `td_errors` is `[T]` too, by
    how much more each step turned out to bring; `null` where a truncation hides it.
    """
    assert explanation.story is not None
    played = explanation.story.played
    episode, revision = played.episode, played.revision
    errors = np.full(len(episode), np.nan)
    errors[revision.steps] = revision.change.sum(axis=1)
    return {
        "seed": explanation.seed,
        "steps": len(episode),
        "terminated": episode.terminated,
        "actions": [played.action(step) for step in range(len(episode))],
        "rewards": episode.rewards.tolist(),
        "values": episode.predicted.sum(axis=1, dtype=np.float64).tolist(),
        "td_errors": plain_data(errors),
    }
