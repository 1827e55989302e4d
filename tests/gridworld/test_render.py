"""Pictures: the same state looks the same, at any size, and every difference shows."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from trdlab.errors import InputError
from trdlab.gridworld import Gridworld, load_map, map_names, parse_map
from trdlab.gridworld.render import draw_map, frame


def cell(picture: np.ndarray, row: int, column: int, pixels: int) -> np.ndarray:
    return picture[row * pixels : (row + 1) * pixels, column * pixels : (column + 1) * pixels]


@pytest.mark.parametrize("name", map_names())
def test_every_map_has_a_picture_of_exact_size(name):
    world = Gridworld(load_map(name))
    rows, columns = world.grid.shape
    picture = frame(world, 0, 12)
    assert picture.shape == (rows * 12, columns * 12, 3)
    assert picture.dtype == np.uint8
    assert picture.flags.c_contiguous
    assert picture.flags.owndata


def test_pictures_scale_with_the_cell():
    world = Gridworld(load_map("drone"))
    assert frame(world, 0).shape == (192, 320, 3)
    small, large = frame(world, 0, 32).astype(float), frame(world, 0, 128).astype(float)
    averaged = large.reshape(96, 4, 160, 4, 3).mean(axis=(1, 3))
    assert np.abs(averaged - small).mean() < 2.0  # of 255: the same picture but for the edges
    for wrong in (0, -8, 10.5):
        with pytest.raises(InputError, match="whole number"):
            frame(world, 0, wrong)


def test_all_states_look_different_and_each_always_alike():
    world = Gridworld(load_map("drone"))
    pictures = [frame(world, state, 24).tobytes() for state in range(len(world.states))]
    assert len(set(pictures)) == len(world.states)
    assert pictures == [frame(world, state, 24).tobytes() for state in range(len(world.states))]


def test_the_users_settings_do_not_change_a_picture():
    world = Gridworld(load_map("drone"))
    before = frame(world, 0, 24)
    settings = {
        "figure.facecolor": "black",
        "figure.autolayout": True,
        "patch.antialiased": False,
        "font.family": "serif",
        "figure.dpi": 300,
    }
    with mpl.rc_context(settings):
        np.testing.assert_array_equal(frame(world, 0, 24), before)


def test_only_what_changed_changes():
    world = Gridworld(load_map("drone"))
    before, after = frame(world, 0, 32), frame(world, world.find_state("2,2"), 32)
    places = [(row, column) for row in range(3) for column in range(5)]
    changed = [p for p in places if not np.array_equal(cell(before, *p, 32), cell(after, *p, 32))]
    assert changed == [(1, 0), (2, 1), (2, 2)]  # the start, the emptied coin, and the drone


@pytest.mark.parametrize("pixels", [16, 64])
def test_every_kind_of_cell_can_be_told_apart_in_grey(pixels):
    symbols = ".ctCTfhHE^v<>"
    world = Gridworld(parse_map("\n".join(["S" + "." * 12, symbols, "#" + "." * 12])))
    grey = frame(world, 0, pixels).mean(axis=2)
    seen = [cell(grey, 1, j, pixels) for j in range(len(symbols))] + [cell(grey, 2, 0, pixels)]
    for i, one in enumerate(seen):
        for other in seen[:i]:
            assert np.abs(one - other).mean() > 2.0


def test_values_are_written_where_they_do_not_go_without_saying():
    def middle(text: str) -> bytes:
        return cell(frame(Gridworld(parse_map(text)), 0, 48), 0, 1, 48).tobytes()

    for kind, usual in (("coin", "1"), ("fountain", "1"), ("exit", "0")):
        assert middle(f"X = {kind} {usual}\n---\nSX.") != middle(f"X = {kind} 7\n---\nSX.")
    for kind in ("treasure", "hazard", "coin"):
        assert middle(f"X = {kind} 7\n---\nSX.") != middle(f"X = {kind} -1234.5\n---\nSX.")


def test_wind_is_drawn_where_it_blows_and_the_stronger_the_more():
    world = Gridworld(parse_map("wind: up 0 1 2 3\n---\n....\nS..."))
    tiles = [cell(frame(world, 0, 32), 0, j, 32).mean() for j in range(4)]
    assert tiles == sorted(tiles, reverse=True)
    assert len(set(tiles)) == 4


def test_a_map_is_drawn_on_axes_in_units_of_cells():
    figure = Figure()
    canvas = FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    world = Gridworld(load_map("windy"))
    assert draw_map(right, world, 0) is right
    assert (right.get_xlim(), right.get_ylim()) == ((0.0, 10.0), (7.0, 0.0))
    assert right.get_aspect() == 1.0
    assert not left.collections
    canvas.draw()


def test_a_state_that_does_not_exist_is_refused():
    world = Gridworld(load_map("drone"))
    for wrong in (-1, 14):
        with pytest.raises(InputError, match="States run from 0 to 13"):
            frame(world, wrong)
