"""What is expected of actions at one moment: bars, what they can be off by, and the difference."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import Status
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.explanations.moment.outcome import Trial
from trdlab.formatting import decimals_between, decimals_for
from trdlab.show.plots import bars, style
from trdlab.show.plots.bars import Scale, plot_components, scale_of, settled
from trdlab.time_axis import axis_title

_PANEL = 1.75  # inches that one row of bars takes


@style.settings()
def moment_figure(
    choice: Choice,
    title: str = "",
    *,
    trial: Trial | None = None,
    above: tuple[float, Callable[[Axes], object]] | None = None,
) -> Figure:
    """Returns the picture of an action, or of two and their difference (see `plot_moment`).

    With `above`, something else is drawn at the top: how many inches it takes, and what draws it.
    """
    heights = [_PANEL] * (1 if choice.foil is None else 3)
    heights[:0] = () if above is None else above[:1]
    figure = style.new_figure(1.6 + sum(heights), title)
    axes = np.atleast_1d(figure.subplots(len(heights), 1, height_ratios=heights)).tolist()
    if above is not None:
        above[1](axes.pop(0))
    plot_moment(axes, choice, trial=trial)
    axes[len(axes) // 2].set_ylabel("expected discounted reward")
    _explain_marks(figure, choice, trial)
    return figure


def plot_moment(
    axes: Sequence[Axes], choice: Choice, *, trial: Trial | None = None
) -> Sequence[Axes]:
    """Draws an action; with a foil, both on one scale, and their difference below them.

    Args:
        axes: one, or three that share their steps; they are returned.
        choice: the action and its foil.
        trial: what came of the two, where they were tried.
    """
    moment, names = choice.moment, names_of(choice)
    values = [moment.q_value(name) for name in names]
    decimals = decimals_for(values) if len(values) == 1 else decimals_between(*values)
    ends = [_ends(moment, name) for name in names]
    scale = scale_of(np.stack([moment.components(name) for name in names]), *ends)
    for ax, name, value in zip(axes, names, values, strict=False):
        plot_action(ax, moment, name, scale=scale)
        _title(ax, f"{name}: Q = {style.told(value, decimals)}", moment.components(name))
    if choice.foil is not None:
        plot_contrast(axes[-1], moment, *names, trial=trial)
        delta = settled(moment.difference(*names))
        gap = style.told(float(delta.sum()), decimals_for([delta.sum()]))
        _title(axes[-1], f"{' − '.join(names)}: {gap}", delta)
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
    axes[-1].set_xlabel(style.STEPS)
    return axes


def plot_action(ax: Axes, moment: Moment, action: str, *, scale: Scale | None = None) -> Axes:
    """Draws what is expected of an action on `ax`, which is returned, with `whiskers`.

    What has not proved better than a guess stands on red or grey ground. Where the episode may end
    meanwhile, a dotted line is the chance that it is still running, with a scale on the right.
    Without a `scale` the axes show all bars of this action.
    """
    components, ends = moment.components(action), _ends(moment, action)
    scale = scale_of(components[None], ends) if scale is None else scale
    colour = style.action_colours(moment.action_names)[action]
    plot_components(ax, components, moment.time_axis, colour=colour, scale=scale)
    places, chance = style.positions(moment.time_axis), _survival(moment, action)
    if ends is not None:
        bars.draw_whiskers(ax, places, ends, scale)
    behind = _plot_survival(ax, places, chance) if (chance < 1.0).any() else ax
    style.draw_grounds(behind, places, _doubts(moment, action))
    return ax


def plot_contrast(
    ax: Axes, moment: Moment, action: str, foil: str, *, trial: Trial | None = None
) -> Axes:
    """Draws action minus foil on `ax`, which is returned.

    Bars go up, and have the colour of the action, where that pays more. Diamonds are what came of
    the difference in a trial of both.
    """
    delta, axis = settled(moment.difference(action, foil)), moment.time_axis
    came = None if trial is None else _came(trial)
    scale, colours = scale_of(delta[None], came), style.action_colours(moment.action_names)
    plot_components(ax, delta, axis, colour=(colours[action], colours[foil]), scale=scale)
    style.draw_grounds(ax, style.positions(axis), _doubts(moment, action, foil))
    if came is not None:
        bars.draw_whiskers(ax, style.positions(axis) + 0.2, came[1:], scale, came[0])
    return ax


def _explain_marks(figure: Figure, choice: Choice, trial: Trial | None = None) -> None:
    """Adds a legend of the marks that are there, and says whose future it is."""
    moment, names = choice.moment, names_of(choice)
    handles: list[Artist] = [bars.residual_handle()]
    handles += style.ground_handles(_doubts(moment, *names))
    if meaning := whiskers(moment):
        handles.append(bars.handle(f"whiskers: {meaning}"))
    if any((_survival(moment, name) < 1.0).any() for name in names):
        label = "chance that the episode is still running"
        handles.append(bars.handle(label, ":", colour=style.MUTED))
    if trial is not None:
        handles.append(bars.handle(f"as it came, each tried {trial.found.copies} times", "", "D"))
    future, usual = moment.future, Future("")
    whose = [f"after the first action: {future.policy}"]
    whose += [future.reward] * (future.reward != usual.reward)
    whose += [f"ends at {future.ending}"] * (future.ending != usual.ending)
    style.add_legend(figure, handles, axis_title(moment.time_axis), " · ".join(whose))


def names_of(choice: Choice) -> list[str]:
    """Returns the action and, if there is one, its foil."""
    return [choice.action] if choice.foil is None else [choice.action, choice.foil]


def whiskers(moment: Moment) -> str:
    """Returns what the whiskers of a moment mean, empty where there are none."""
    if not any((_lengths(moment, name) > 0.0).any() for name in moment.action_names):
        return ""
    if moment.uncertainty is not None:
        return "one standard deviation"
    return "what such forecasts are off by (root mean square)"


def without_noise(moment: Moment, error: float) -> Moment:
    """Returns a moment in which all that is within a proven error is 0, variances too."""
    found, known = moment.decomposition, moment.uncertainty
    found = RewardDecomposition(settled(found.components, error), found.time_axis)
    if known is not None:
        spread = np.where(known.deviation**2 <= error, 0.0, known.deviation)
        known = known._replace(deviation=spread)
    return replace(moment, decomposition=found, uncertainty=known)


def _title(ax: Axes, text: str, components: FloatArray) -> None:
    """Writes the title of bars, above their numbers if there are any."""
    pad = 20.0 if bars.numbers(settled(components)) else 6.0
    ax.set_title(text, fontsize=style.TITLE, loc="left", pad=pad)


def _survival(moment: Moment, action: str) -> FloatArray:
    """Returns `[N+1]`: the chance that the episode still runs, NaN where it is not known."""
    known, chance = moment.survival(action), np.full(moment.time_axis.num_components, np.nan)
    chance[: len(known)] = known
    return chance


def _plot_survival(ax: Axes, places: FloatArray, chance: FloatArray) -> Axes:
    """Draws it on axes behind `ax`, which are returned: what is on the ground lies there, too."""
    right = ax.twinx()
    right.step(places, chance, where="mid", color=style.MUTED, linewidth=1.2, linestyle=":")
    right.set(ylim=(-0.08, 1.2), yticks=(0.0, 0.5, 1.0), yticklabels=("0", "½", "1"))
    style.tidy(right).tick_params(labelcolor=style.MUTED)
    right.spines[["left", "bottom"]].set_visible(False)
    ax.set_zorder(right.get_zorder() + 1)  # the bars stand in front of it
    ax.patch.set_visible(False)
    return right


def _doubts(moment: Moment, *actions: str) -> list[Status | None]:
    """Returns N+1: the worst of what was found of actions; None where there is no doubt."""
    found = map(moment.judged, actions)
    judged = [of.status for of in found if of is not None]
    order: tuple[Status, ...] = ("bad", "not tested", "open")
    columns = zip(*judged, strict=True) if judged else [()] * moment.time_axis.num_components
    return [next((doubt for doubt in order if doubt in found), None) for found in columns]


def _lengths(moment: Moment, action: str) -> FloatArray:
    """Returns `[N+1]`: how long whiskers are, 0 or NaN where there are none."""
    if moment.uncertainty is not None:
        return np.asarray(moment.uncertainty.deviation[moment.index(action)])
    judged = moment.judged(action)
    return np.zeros(moment.time_axis.num_components) if judged is None else judged.off_by


def _ends(moment: Moment, action: str) -> FloatArray | None:
    """Returns `[2, N+1]`: where whiskers end, NaN where there are none; None if there are none."""
    means, length = moment.components(action), _lengths(moment, action)
    if not (length > 0.0).any():
        return None
    least, most = moment.possible
    if moment.only_reward is not None:
        least, most = (0.0, most) if moment.only_reward > 0.0 else (least, 0.0)
    low = np.minimum(np.maximum(means - length, least), means)
    high = np.maximum(np.minimum(means + length, most), means)
    return np.where(length > 0.0, np.stack([low, high]), np.nan)


def _came(trial: Trial) -> FloatArray:
    """Returns `[3, N+1]`: what came of a difference, and its interval, of no length if unknown."""
    seen = trial.found.observed
    rows = np.stack([seen.value, seen.low, seen.high])[:, :-1]
    return np.where(np.isnan(rows), rows[0], rows)
