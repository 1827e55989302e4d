"""Bars and whiskers: nothing outside the axes, one colour for one action, text for a phone."""

import os
import subprocess
import sys
from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from moments import calibrated
from trdlab.agents import gridworld_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, OutputError
from trdlab.estimator import Future, Outlook
from trdlab.explanations import Explanation, explain, solve_state
from trdlab.explanations.moment.exact import tabular_moment
from trdlab.explanations.moment.moment import Choice, Moment, Uncertainty
from trdlab.explanations.solved import SolvedState
from trdlab.gridworld import Gridworld, load_map, parse_map
from trdlab.show.plots import style
from trdlab.show.plots.bars import CUT, plot_components
from trdlab.show.plots.figures import explanation_figure
from trdlab.show.plots.figures import figure as figure_of
from trdlab.show.plots.map import plot_map, solved_figure
from trdlab.show.plots.moment import (
    moment_figure,
    plot_action,
    plot_contrast,
    whiskers,
    without_noise,
)
from trdlab.show.plots.outcomes import outcomes_figure
from trdlab.show.plots.style import action_colours
from trdlab.tabular import exact
from trdlab.tabular.toytext import make_world

AXIS = TimeAxis(0.9, 3)


def moment(rows: object, axis: TimeAxis = AXIS, **known: object) -> Moment:
    found = RewardDecomposition(np.array(rows, float), axis)
    return Moment(found, ("go", "stay"), Future("the greedy policy"), **known)  # type: ignore[arg-type]


OFF_BY = [0.2, 0.3, np.nan, 0.0]
UNJUDGED = moment([[0.1, 0.5, 0.2, 0.0], [0.3, 0.4, 0.2, 0.1]])
LEARNED = replace(UNJUDGED, calibration=calibrated(AXIS, off_by=OFF_BY))
MADE_OF = {"coin": [[0.3, 0.9, 0.2, 0.4], [0.4, 0.4, 0.2, 0.1]],
           "a life that was lost": [[-0.2, -0.4, 0.0, -0.4], [-0.1, 0.0, 0.0, 0.0]]}  # fmt: skip
OUTLOOK = Outlook(
    variance=np.zeros((2, 3)),
    survival=np.array([[1.0, 0.8, 0.4, 0.2], [1.0, 0.9, 0.9, 0.9]]),
    chances={},
    parts={name: np.array(rows) for name, rows in MADE_OF.items()},
    events={"crash": np.array([[0.1, 0.4, 0.2], [0.0, 0.0, 0.6]])},
    amounts={"fuel": np.array([[3.0, 2.0, 1.0, 9.0], [1.0, 1.0, 1.0, 1.0]])},
    survival_reach=2,
    reach={"coin": 3, "a life that was lost": 1, "crash": 2},
)


@cache
def solved() -> dict[str, SolvedState]:
    axis = TimeAxis(0.95, 4)
    found = {
        name: solve_state(Gridworld(load_map(name)), axis)
        for name in ("drone", "bridge", "ledge", "windy")
    }
    return found | {"FrozenLake": solve_state(make_world("FrozenLake-v1", {}), axis)}


@cache
def explained() -> Explanation:
    return explain(gridworld_agent("ledge", TimeAxis(0.95, 4)), episodes=60)


def whisker_ends(ax: Axes) -> list[tuple[float, float]]:
    lines = [lines for lines in ax.collections if isinstance(lines, LineCollection)]
    return [(float(a[1]), float(b[1])) for of in lines for a, b in of.get_segments()]


def cut_texts(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.texts if text.get_gid() == CUT]


def bars(ax: Axes) -> list[Rectangle]:
    return list(ax.containers[0].patches)


def heights(ax: Axes) -> list[float]:
    return [bar.get_height() for bar in bars(ax)]


def assert_inside(ax: Axes) -> None:
    """Asserts that all bars, lines and markers lie within the axes."""
    low, high = ax.get_ylim()
    values = [0.0, *heights(ax)]
    for line in ax.lines:
        values += np.asarray(line.get_ydata(), float).tolist()
    for ends in whisker_ends(ax):
        values += ends
    slack = 1e-9 * (high - low)
    assert all(low - slack <= value <= high + slack for value in values if np.isfinite(value))


# ---- the scale -----------------------------------------------------------------------------------


def test_whiskers_of_what_was_learned_are_what_it_is_off_by():
    ax = plot_action(Figure().subplots(), LEARNED, "go")
    np.testing.assert_allclose(whisker_ends(ax), [(-0.1, 0.3), (0.2, 0.8)])
    assert whiskers(LEARNED) == "what such forecasts are off by (root mean square)"


def test_whiskers_of_an_exact_table_are_standard_deviations():
    spread = np.array([[0.4, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    known = Uncertainty(spread, np.array([0.4, 0.0]), np.ones((2, 4)))
    ax = plot_action(Figure().subplots(), replace(LEARNED, uncertainty=known), "go")
    np.testing.assert_allclose(whisker_ends(ax), [(-0.3, 0.5)])
    assert whiskers(replace(LEARNED, uncertainty=known)) == "one standard deviation"
    assert whiskers(UNJUDGED) == ""


def test_whiskers_end_where_no_reward_can_be():
    pays_one = replace(UNJUDGED, calibration=calibrated(AXIS, off_by=OFF_BY, only_reward=1.0))
    ax = plot_action(Figure().subplots(), pays_one, "go")
    np.testing.assert_allclose(whisker_ends(ax), [(0.0, 0.3), (0.2, 0.8)])
    lake = solved()["FrozenLake"]
    for drawn in (solved_figure(lake), moment_figure(lake.choice), figure_of(lake.choice.moment)):
        assert min(low for ax in drawn.axes for low, _ in whisker_ends(ax)) == 0.0
    ledge = solved_figure(solved()["ledge"])  # where there are costs
    assert min(low for ax in ledge.axes for low, _ in whisker_ends(ax)) < 0.0


def test_a_whisker_much_longer_than_the_bars_is_cut_off_and_says_where_it_ends():
    long = replace(UNJUDGED, calibration=calibrated(AXIS, off_by=[0.2, 0.3, 0.1, 17.5]))
    ax = plot_action(Figure().subplots(), long, "go")
    assert max(heights(ax)) / ax.get_ylim()[1] > 0.4, "the bars can be seen"
    assert cut_texts(ax) == ["−17.50", "17.50"]


def test_a_residual_that_swamps_the_rest_is_cut_off_and_said():
    found = moment([[1.0, 0.9, 94.5], [1.0, -0.8, 2.0]], TimeAxis(0.95, 2))
    action, foil, contrast = moment_figure(Choice(found, "go", "stay")).axes
    assert action.get_ylim() == foil.get_ylim()
    assert heights(action) == [1.0, 0.9, 1.5]
    assert heights(foil) == [1.0, -0.8, 1.5]
    assert [cut_texts(ax) for ax in (action, foil, contrast)] == [["94.50"], ["2.00"], ["92.50"]]
    off_by = [0.1, 0.1, 6.0]  # its whisker is beyond the scale, too
    unsure = replace(found, calibration=calibrated(found.time_axis, off_by=off_by))
    assert cut_texts(moment_figure(Choice(unsure, "go", "stay")).axes[0]) == ["94.50"]


@pytest.mark.parametrize("residual", [3.0, 4.0, 5.3, 10.0, 20.0])
def test_bars_can_be_seen_beside_any_residual_and_its_whisker(residual):
    off_by = [0.1, 0.1, 0.1, residual]
    unsure = moment([[1.0, 1.0, 0.9, residual]] * 2, calibration=calibrated(AXIS, off_by=off_by))
    ax = plot_action(Figure().subplots(), unsure, "go")
    low, high = ax.get_ylim()
    assert 1.0 / (high - low) > 0.1
    assert residual <= 4.0 or 1.0 / (high - low) > 0.25
    assert heights(ax)[-1] == residual or f"{residual:.2f}" in cut_texts(ax)


@pytest.mark.parametrize("horizon", [1, 4, 25, 30, 40, 60, 100])
@pytest.mark.parametrize("width", [1, 5])
def test_labels_of_steps_stand_apart(horizon, width):
    figure, axis = style.new_figure(3.0), TimeAxis(0.99, horizon, width)
    ax = style.tidy(figure.subplots())
    style.label_steps(ax, axis, style.positions(axis))
    figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in ax.get_xticklabels()]
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))
    assert ax.get_xticklabels()[-1].get_text() == axis.labels[-1]


def test_a_bar_and_its_whisker_that_are_both_cut_off_have_a_number_each():
    long = moment(
        [[1.0, 1.0, 0.9, 5.3]] * 2, calibration=calibrated(AXIS, off_by=[0.1] * 3 + [9.8])
    )
    figure = style.new_figure(3.0)
    ax = plot_action(figure.subplots(), long, "go")
    assert sorted(cut_texts(ax)) == ["15.10", "5.30", "−4.50"]
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts if text.get_gid() == CUT]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))


def test_a_residual_is_shown_whole_where_the_rest_is_next_to_nothing():
    ax = plot_components(Figure().subplots(), np.array([0.0, -0.01, 0.0, 2.1]), AXIS)
    assert heights(ax)[-1] == 2.1
    assert not cut_texts(ax)


def test_what_is_only_there_by_rounding_is_zero_and_has_no_scale():
    same = solve_state(Gridworld(load_map("windy")), TimeAxis(0.95, 4), action="down", foil="right")
    *_, contrast = solved_figure(same).axes
    assert heights(contrast) == [0.0] * 5
    assert contrast.get_yticks().tolist() == [0.0]
    ax = plot_components(Figure().subplots(), np.array([1.0, 1e-17, 0.0, 0.5]), AXIS)
    assert heights(ax)[1] == 0.0


def test_what_lies_within_the_proven_error_is_zero():
    world = Gridworld(parse_map("slip: 0.1\n---\nHHH.\n#h..\nhE#S"))  # worth 0, all of it
    table = exact(world.mdp, TimeAxis(0.95, 4))
    found = tabular_moment(table, 0, world.action_names)
    settled = without_noise(found, float(table.solution.error_bound[0].max()))
    for ax in moment_figure(Choice(settled, "up", "left")).axes:
        assert heights(ax) == [0.0] * 5
        assert not whisker_ends(ax)


numbers = st.one_of(st.floats(-2.0, 2.0, width=32), st.sampled_from([0.0, 1e-17, -60.0, 90.0]))


@settings(max_examples=30, deadline=None, derandomize=True)
@given(arrays(float, (2, 4), elements=numbers), arrays(float, 4, elements=numbers))
def test_nothing_is_drawn_outside_the_axes_and_whatever_is_cut_off_has_its_number(rows, error):
    found = moment(rows, calibration=calibrated(AXIS, off_by=error))
    ends = rows[0] + np.outer([-1, 1], np.abs(error))
    ax = plot_action(Figure().subplots(), found, "go")
    assert_inside(ax)
    assert_inside(plot_contrast(Figure().subplots(), found, "go", "stay"))
    for height, value in zip(heights(ax), rows[0], strict=True):
        assert height == pytest.approx(value, abs=1e-12) or style.told(value, 2) in cut_texts(ax)
    drawn = np.array(whisker_ends(ax)).reshape(-1, 2).T
    assert np.abs(drawn - ends[:, error != 0.0]).max(initial=0.0) < 1e-9 or cut_texts(ax)


def test_axes_that_share_a_scale_show_the_bars_of_both():
    above, below = Figure().subplots(2, sharey=True)
    plot_components(above, np.array([0.0, 0.0, 5.0, 0.0]), AXIS)
    plot_components(below, np.array([-1.0, 0.0, 0.0, 0.0]), AXIS)
    assert_inside(above)
    assert_inside(below)
    assert above.get_ylim() == below.get_ylim()


# ---- colours -------------------------------------------------------------------------------------


def test_an_action_has_one_colour_whatever_part_it_plays():
    colours = {
        "go": action_colours(["go", "stay"])["go"],
        "stay": action_colours(["go", "stay"])["stay"],
    }
    for action, foil in (("go", "stay"), ("stay", "go")):
        first, second, contrast = moment_figure(Choice(LEARNED, action, foil)).axes
        assert {to_hex(bar.get_edgecolor()) for bar in bars(first)} == {colours[action]}
        assert {to_hex(bar.get_edgecolor()) for bar in bars(second)} == {colours[foil]}
        pairs = zip(bars(contrast), heights(contrast), strict=True)
        assert all(
            to_hex(bar.get_edgecolor()) == colours[action if height > 0.0 else foil]
            for bar, height in pairs
            if height
        )


def test_a_route_has_the_colour_of_its_action_and_directions_the_same_in_every_world():
    colours = action_colours(("up", "down", "left", "right"))
    table = solved()["drone"].table
    world = Gridworld(load_map("drone"))
    for action, foil in (("up", "down"), ("down", "up")):
        ax = plot_map(Figure().subplots(), world, table, 0, (action, foil))
        assert [to_hex(line.get_color()) for line in ax.lines] == [colours[action], colours[foil]]
    lake = action_colours(("left", "down", "right", "up"))
    taxi = action_colours(("south", "north", "east", "west", "pickup", "dropoff"))
    assert all(lake[name] == colours[name] for name in lake)
    assert taxi["north"] == colours["up"]
    assert len(set(taxi.values())) == 6


def test_what_is_bad_and_what_is_not_tested_stand_on_different_ground():
    own = calibrated(AXIS, ("good", "bad", "open", "good"))
    of_foils = calibrated(AXIS, ("good", "good", "good", "not tested"))
    judged = replace(LEARNED, calibration=own, foils=of_foils, policy=np.array([1.0, 0.0]))
    figure = moment_figure(Choice(judged, "go", "stay"))
    grounds = [
        [to_hex(patch.get_facecolor()) for patch in ax.patches if patch not in bars(ax)]
        for ax in figure.axes
    ]
    bad, grey = style.EVIDENCE["bad"], style.EVIDENCE["not tested"]
    assert grounds == [[bad, grey], [grey], [bad, grey, grey]]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"no better than a guess", "open, or not tested"} <= set(labels)


# ---- outcomes ------------------------------------------------------------------------------------


def test_parts_are_stacked_to_the_components_of_the_reward():
    figure = outcomes_figure(Choice(UNJUDGED, "go", "stay"), OUTLOOK)
    *_, go, stay = figure.axes
    assert go.get_ylim() == stay.get_ylim()
    for row, ax in enumerate((go, stay)):
        coin, lost = (np.array(rows)[row] for rows in MADE_OF.values())
        tops = [[bar.get_height() for bar in stack] for stack in ax.containers]
        np.testing.assert_allclose(np.max(tops, axis=0), coin)
        np.testing.assert_allclose(np.min(tops, axis=0), lost)
        np.testing.assert_allclose(
            np.asarray(ax.lines[-1].get_ydata(), float), UNJUDGED.components(("go", "stay")[row])
        )


def test_action_and_foil_stand_side_by_side_and_what_cannot_be_told_is_veiled():
    figure = outcomes_figure(Choice(UNJUDGED, "go", "stay"), OUTLOOK)
    crash, fuel, go, _ = figure.axes
    for ax, rows in ((crash, OUTLOOK.events["crash"]), (fuel, OUTLOOK.amounts["fuel"])):
        for row, at in zip(rows, (0, 2), strict=True):  # what is above zero, and below
            drawn = [bar.get_height() for bar in ax.containers[at]]
            np.testing.assert_allclose(drawn[: len(row)], row)
    begins = [ax.patches[-1].get_x() for ax in (crash, fuel, go)]
    assert begins == [1.5, -0.5, 0.5], "crash is told to t+1, fuel not at all, all parts at t"
    alone = outcomes_figure(Choice(UNJUDGED, "go", None), OUTLOOK)
    assert len(alone.axes) == 3


def test_survival_that_was_learned_is_drawn_as_far_as_it_can_be_told():
    learned = replace(LEARNED, outlook=OUTLOOK)
    action, right = moment_figure(Choice(learned, "go", None)).axes
    (line,) = right.lines
    np.testing.assert_array_equal(np.asarray(line.get_ydata()), [1.0, 0.8, 0.4, np.nan])
    assert not action.patch.get_visible(), "the line can be seen behind the bars"


# ---- the page ------------------------------------------------------------------------------------


@cache
def figures() -> list[Figure]:
    found = explained()
    parts = [explanation_figure(found, part) for part in ("contrast", "episode", "calibration")]
    learned = replace(LEARNED, outlook=OUTLOOK)
    outcomes = outcomes_figure(Choice(learned, "go", "stay"), OUTLOOK, "what else there is")
    return [*map(solved_figure, solved().values()), *parts, outcomes]


def texts(figure: Figure) -> list[Text]:
    figure.draw_without_rendering()
    everything = figure.findobj(Text)
    return [text for text in everything if text.get_visible() and text.get_text().strip()]


def test_text_can_be_read_where_a_picture_is_as_wide_as_a_phone():
    for figure in figures():
        pixels = 360 / figure.get_figwidth() / 72  # of a point
        assert min(text.get_fontsize() for text in texts(figure)) * pixels >= 8.0


def shown(figure: Figure) -> list[tuple[str, Bbox]]:
    """Returns the texts of a page that are drawn, and where; of a legend only its whole."""
    drawn = [text for text in texts(figure) if text in figure.texts]
    for ax in figure.axes:
        drawn += [*ax.texts, *([ax.xaxis.label, ax.yaxis.label] if ax.axison else [])]
        drawn += [ax.title, ax._left_title, ax._right_title]
        for axis in (ax.xaxis, ax.yaxis) if ax.axison else ():
            low, high = sorted(axis.get_view_interval())
            drawn += [t.label1 for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
            drawn += [t.label2 for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
    boxes = [(t.get_text(), t.get_window_extent()) for t in drawn if t.get_visible()]
    boxes += [("the legend", legend.get_window_extent()) for legend in figure.legends]
    return [(text, box) for text, box in boxes if text.strip() and box.width > 1.0]


def test_no_text_overlaps_another_or_leaves_the_page():
    for figure in figures():
        figure.draw_without_rendering()
        page, boxes = figure.bbox, shown(figure)
        for text, box in boxes:
            assert min(box.x0 - page.x0, page.x1 - box.x1) >= -1.0, text
            assert min(box.y0 - page.y0, page.y1 - box.y1) >= -1.0, text
        for (one, a), (other, b) in combinations(boxes, 2):
            across = min(a.x1, b.x1) - max(a.x0, b.x0)
            down = min(a.y1, b.y1) - max(a.y0, b.y0)
            assert across < 1.0 or down < 1.0, f"'{one}' and '{other}'"


def test_the_line_of_those_still_running_is_explained():
    labels = [text.get_text() for text in figures()[1].legends[0].get_texts()]
    assert "chance that the episode is still running" in labels


def test_a_route_stops_before_the_treasure_that_it_leads_to():
    bridge = solved()["bridge"]
    assert isinstance(bridge.world, Gridworld)
    ax = plot_map(Figure().subplots(), bridge.world, bridge.table, 0, ("down", "left"))
    for line in ax.lines:
        x, y = (values[-1] for values in line.get_data())
        assert 6 < x < 7
        assert y > 2.0, "the treasure lies between 1 and 2"


def test_the_way_that_an_episode_took_is_drawn_on_the_map():
    told = explain(gridworld_agent("windy,slip=0.2", TimeAxis(0.95, 4)), ("episode",), episodes=0)
    assert told.story is not None
    assert isinstance(told.agent.world, Gridworld)
    states, places = told.story.played.episode.states, told.agent.world.states
    assert states is not None
    assert len(states) == len(told.story.played.episode) + 1
    (way,) = explanation_figure(told, "episode").axes[0].lines
    x, y = way.get_data()
    assert (y[0] - 0.5, x[0] - 0.5) == places[states[0]].place
    assert len(x) > 5


# ---- files, notebooks, backends ------------------------------------------------------------------


def test_pictures_need_no_pyplot_and_no_backend_of_the_users(tmp_path: Path):
    code = (
        "import sys\n"
        "from pathlib import Path\n"
        "from trdlab.gridworld import Gridworld, load_map, parse_map\n"
        "from trdlab.show.plots.figures import figure\n"
        "from trdlab.show.plots.style import save\n"
        "picture = figure(Gridworld(load_map('drone')))\n"
        "save(picture, Path(sys.argv[1]))\n"
        "assert picture._repr_png_().startswith(b'\\x89PNG')\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    env = os.environ | {"MPLBACKEND": "module://a_backend_that_is_not_here"}
    path = tmp_path / "drone.svg"
    subprocess.run([sys.executable, "-c", code, path], env=env, check=True)
    assert path.read_bytes().startswith(b"<?xml")


def test_the_users_settings_stay_theirs_and_change_no_picture():
    drone = solved()["drone"]
    before = solved_figure(drone)._repr_png_()
    with mpl.rc_context({"axes.facecolor": "black", "font.size": 30.0, "axes.grid": True}):
        mine = dict(mpl.rcParams)
        assert solved_figure(drone)._repr_png_() == before
        assert dict(mpl.rcParams) == mine


def test_a_picture_is_written_whole_or_not_at_all(tmp_path: Path):
    picture = figure_of(LEARNED)
    style.save(picture, tmp_path / "new" / "go.png")
    with pytest.raises(OutputError, match="exists"):
        style.check_pictures([tmp_path / "new" / "go.png"])
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match="Cannot make the folder"):
        style.save(picture, tmp_path / "file" / "go.png")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["go.png"]


def test_there_is_a_picture_of_every_noun_and_of_nothing_else():
    found = explained()
    assert found.choice is not None
    for thing in (
        found,
        found.choice,
        found.choice.moment,
        found.story,
        solved()["drone"],
        solved()["drone"].table,
        Gridworld(load_map("loop")),
    ):
        assert figure_of(thing).get_figwidth() == style.WIDTH
    with pytest.raises(InputError, match="no picture of a int"):
        figure_of(3)
