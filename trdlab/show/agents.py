"""What is rendered of agents: explanations, calibrations and comparisons, as pages and as data."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration import claims as calibration
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison import claims as comparing
from trdlab.explanations.comparison.comparison import SIDES, Comparison
from trdlab.explanations.episode.played import Played
from trdlab.explanations.explanation import Explanation
from trdlab.explanations.moment.moment import Choice
from trdlab.explanations.rules import plain_data
from trdlab.explanations.saliency import claims as mattering
from trdlab.explanations.saliency.saliency import Saliency
from trdlab.explanations.words import counted
from trdlab.formatting import decimals_for, number
from trdlab.show.data import actions_data, axis_data, data, told_data
from trdlab.show.document import Document, axis_words, document
from trdlab.show.scenes import scene_of
from trdlab.show.tables import Row, Table, action_table, entry_table
from trdlab.statistics import Estimate

_MOST_ROWS = 8  # of a table of components


@document.register
def _(explanation: Explanation) -> Document:
    agent, choice, state = explanation.agent, explanation.choice, explanation.state
    seed = f"the episode with seed {explanation.seed}"
    heading = [agent.name]
    matters = explanation.saliency
    is_moment = choice is not None or matters is not None
    if is_moment or explanation.story is not None:
        heading.append(f"step {explanation.step} of {seed}" if is_moment else seed)
    if choice is not None and explanation.parts and "contrast" not in explanation.parts:
        choice = replace(choice, foil=None)  # their difference is told to who asks for a contrast
    return Document(
        heading=" · ".join(heading),
        setting=(*axis_words(explanation.time_axis), *_played(explanation), *_forbidden(choice)),
        scene=None if state is None or agent.world is None else scene_of(agent.world, state),
        table=action_table(choice) if choice else entry_table(matters) if matters else None,
        answer=tuple(claim.sentence for claim in explanation.answer),
        sections=explanation.sections,
        folded=not explanation.parts,
    )


@document.register
def _(saliency: Saliency) -> Document:
    moment = f"step {saliency.step} of the episode with seed {saliency.seed}"
    return Document(
        heading=f"What matters to {saliency.agent.name} · {moment}",
        setting=(*axis_words(saliency.time_axis), saliency.about),
        table=entry_table(saliency),
        answer=tuple(claim.sentence for claim in mattering.in_brief(saliency)),
        sections=mattering.sections(saliency),
        more="There is more: .details() returns all that there is to tell.",
    )


@document.register
def _(report: CalibrationReport) -> Document:
    return Document(
        heading=f"How far its forecasts can be trusted · {report.judged.episodes} episodes",
        setting=axis_words(report.time_axis),
        answer=tuple(claim.sentence for claim in calibration.in_brief(report)),
        sections=calibration.sections(report),
        more="There is more: .details() returns all that there is to tell.",
    )


@document.register
def _(comparison: Comparison) -> Document:
    axis, seconds = axis_words(comparison.time_axis), comparison.agents[0].seconds_per_step
    return Document(
        heading=" · ".join(comparison.titles),
        setting=(*axis, *_where(comparison), *_seconds(seconds)),
        table=_means(comparison) if comparison.visits.apart.any() else None,
        answer=tuple(claim.sentence for claim in comparing.in_brief(comparison)),
        sections=comparing.sections(comparison),
    )


def _played(explanation: Explanation) -> list[str]:
    """Returns how long a step takes, and where episodes were cut off by us."""
    report, story, limit = explanation.report, explanation.story, explanation.max_steps
    words = _seconds(explanation.agent.seconds_per_step)
    cut = [report.judged.time_limit] if report is not None and report.judged.truncated else []
    if story is not None and not story.played.episode.terminated:
        cut.append(story.played.episode.time_limit)
    if limit is not None and limit in cut:
        words.append(f"episodes are cut off after {counted(limit, 'step')}")
    return words


def _forbidden(choice: Choice | None) -> list[str]:
    """Returns which actions cannot be taken, if some cannot."""
    names = () if choice is None else choice.moment.forbidden
    return [f"forbidden here: {', '.join(names)}"] if names else []


def _where(comparison: Comparison) -> list[str]:
    """Returns where both act, if that has a name."""
    origin = comparison.agents[0].origin
    if origin is None or not origin.env:
        return []
    made = f" with {', '.join(origin.env_arguments)}" if origin.env_arguments else ""
    return [f"both act in {origin.env}{made}"]


def _seconds(seconds: float | None) -> list[str]:
    return [] if seconds is None else [f"a step is {seconds:.2g} s of play"]


def _means(comparison: Comparison) -> Table:
    """Returns what each of two agents expects of what it would do, by component, and in all."""
    means, gap, axis = comparison.means.value, comparison.difference, comparison.time_axis
    decimals = decimals_for([*means.ravel(), *gap.value])
    has_intervals = not math.isnan(comparison.gap.low)

    def row(label: str, values: FloatArray, estimate: Estimate) -> Row:
        ends = " to ".join(number(end, decimals) for end in (estimate.low, estimate.high))
        cells = (number(float(x), decimals) for x in (*values, estimate.value))
        return label, *cells, *[ends] * has_intervals

    shown = np.argsort(-comparison.apart.value, kind="stable")[:_MOST_ROWS] if axis.horizon else ()
    rows = [row(axis.label(c), means[:, c], gap[c]) for c in sorted(map(int, shown))]
    rows.append(row("all of it", means.sum(axis=1), comparison.gap))
    heading = ("expected at", *SIDES, "B − A", *["95 % interval"] * has_intervals)
    return Table(heading, tuple(rows), "<" + ">" * len(heading[1:]))


# ---- as plain data -----------------------------------------------------------------------------


@data.register
def _(explanation: Explanation) -> dict[str, Any]:
    agent, report, trial = explanation.agent, explanation.report, explanation.trial
    story = explanation.story
    return {
        "schema": "trdlab.explain/2",
        "agent": agent.name,
        "seed": explanation.seed,
        "step": explanation.step,
        "seconds_per_step": agent.seconds_per_step,
        "max_steps": explanation.max_steps,
        "time_axis": axis_data(explanation.time_axis),
        "future": agent.estimator.future.to_dict(),
        **told_data(explanation.answer, explanation.sections),
        "moment": _moment(explanation),
        "trial": None if trial is None else trial.to_dict(),
        "episode": None if story is None else _episode(story.played, explanation.seed),
        "saliency": None if explanation.saliency is None else data(explanation.saliency),
        "calibration": None if report is None else data(report),
    }


data.register(CalibrationReport, calibration.to_dict)
data.register(Saliency, mattering.to_dict)


@data.register
def _(comparison: Comparison) -> dict[str, Any]:
    visits, agents = comparison.visits, comparison.agents
    found = ("difference", "apart", "of_any_action", "gap", "shift", "agreement")
    return {
        "schema": "trdlab.compare/2",
        "agents": {
            side: {
                "name": comparison.names[i],
                "words": list(comparison.words[i]),
                "future": agents[i].estimator.future.to_dict(),
                "mean": plain_data({end: of[i] for end, of in vars(comparison.means).items()}),
                "calibration": None if report is None else data(report),
            }
            for i, (side, report) in enumerate(zip(SIDES, comparison.reports, strict=True))
        },
        "place": [] if (of := agents[0].origin) is None else list(of.place),
        "seconds_per_step": agents[0].seconds_per_step,
        "max_steps": comparison.max_steps,
        "time_axis": axis_data(comparison.time_axis),
        "episodes": comparison.episodes,
        "different_episodes": visits.different,
        "cut_off": visits.cut,
        "states": len(visits),
        **{name: plain_data(getattr(comparison, name)) for name in found},
        "furthest": [_state(comparison, m) for m in visits.furthest(comparing.FURTHEST)],
        **told_data(comparing.in_brief(comparison), comparing.sections(comparison)),
    }


def _state(comparison: Comparison, m: int) -> dict[str, Any]:
    """Returns a state, and what each of the two would do there and expects of that."""
    visits, names = comparison.visits, comparison.agents[0].action_names
    told = {
        side: {"action": names[visits.actions[i, m]], "components": visits.expected[i, m].tolist()}
        for i, side in enumerate(SIDES)
    }
    return {
        "player": SIDES[visits.player[m]],
        "seed": int(visits.seed[m]),
        "step": int(visits.step[m]),
        "distance": float(visits.apart[m]),
        **told,
    }


def _moment(explanation: Explanation) -> dict[str, Any] | None:
    choice = explanation.choice
    if choice is None:
        return None
    own, foils = choice.moment.calibration, choice.moment.foils
    return {
        "state": explanation.state,
        "actions": actions_data(choice.moment),
        "error": None if own is None else plain_data(own.off_by),
        "foil_error": None if foils is None else plain_data(foils.off_by),
        "only_reward": choice.moment.only_reward,
        "forbidden": list(choice.moment.forbidden),
        "action": choice.action,
        "foil": choice.foil,
    }


def _episode(played: Played, seed: int) -> dict[str, Any]:
    """Returns the numbers of an episode.

    `values` is `[T]`, what was expected in all of the actions taken. `td_errors` is `[T]` too, by
    how much more each step turned out to bring; `null` where a truncation hides it.
    """
    episode, revision = played.episode, played.revision
    errors = np.full(len(episode), np.nan)
    errors[revision.steps] = revision.change.sum(axis=1)
    return {
        "seed": seed,
        "steps": len(episode),
        "terminated": episode.terminated,
        "actions": [played.action(step) for step in range(len(episode))],
        "rewards": episode.rewards.tolist(),
        "values": episode.predicted.sum(axis=1, dtype=np.float64).tolist(),
        "td_errors": plain_data(errors),
    }
