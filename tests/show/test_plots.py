"""Whiskers: one standard deviation where it is known, else what such forecasts are off by."""

from dataclasses import replace

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from trdlab.explanations.moment.explanation import explain

from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.moment.moment import Moment, Uncertainty
from trdlab.show.plots.explained import moment_figure
from trdlab.show.plots.moment import plot_components, plot_uncertainty, whiskers

LEARNED = Moment(
    RewardDecomposition(np.array([[0.1, 0.5, 0.2, 0.0], [0.3, 0.4, 0.2, 0.1]]), TimeAxis(0.9, 3)),
    ("go", "stay"),
    Future("the greedy policy"),
    error=np.array([0.2, 0.3, np.nan, 0.0]),
)


def drawn(moment: Moment) -> list[tuple[float, float]]:
    """The lower and upper ends of the whiskers."""
    ax = Figure().subplots()
    plot_components(ax, moment.components("go"), moment.time_axis, colour="black")
    assert plot_uncertainty(ax, moment, "go") is ax
    bars = [lines for lines in ax.collections if isinstance(lines, LineCollection)]
    return [(float(a[1]), float(b[1])) for lines in bars for a, b in lines.get_segments()]


def test_whiskers_of_what_was_learned_are_what_it_is_off_by():
    np.testing.assert_allclose(drawn(LEARNED), [(-0.1, 0.3), (0.2, 0.8)])
    assert whiskers(LEARNED) == "whiskers: what such forecasts are off by (root mean square)"
    foot = moment_figure(explain(LEARNED, "go"), None, "go").texts[-1].get_text()
    assert whiskers(LEARNED) in foot


def test_whiskers_of_an_exact_table_are_standard_deviations():
    spread = np.array([[0.4, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    known = Uncertainty(spread, np.array([0.4, 0.0]), np.ones((2, 4)))
    exact = replace(LEARNED, uncertainty=known)
    np.testing.assert_allclose(drawn(exact), [(-0.3, 0.5)])
    assert whiskers(exact) == "whiskers: one standard deviation"


def test_there_are_no_whiskers_where_nothing_is_known():
    unjudged = replace(LEARNED, error=None)
    assert drawn(unjudged) == []
    assert whiskers(unjudged) == ""
    assert whiskers(replace(LEARNED, error=np.full(4, np.nan))) == ""
