"""Reading maps: what the header means, and a clear error for everything that is no map."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trdlab.errors import MapError
from trdlab.gridworld import load_map, map_names, parse_map
from trdlab.gridworld.gridmap import Cell, Wind

UP, DOWN, LEFT, RIGHT = range(4)


# ---- what maps say -----------------------------------------------------------------------------


def test_the_papers_map():
    drone = load_map("drone")
    assert drone.rows == (">...T", "S####", ">cccC")
    assert drone.shape == (3, 5)
    assert drone.start == (1, 0)
    assert drone.cell(0, 0) == Cell("one-way", arrow=RIGHT)
    assert drone.cell(0, 4) == Cell("treasure", 4.0, terminal=True)
    assert drone.cell(2, 1) == Cell("coin", 1.0)
    assert drone.cell(2, 4) == Cell("coin", 1.0, terminal=True)
    assert drone.cell(-1, 0).kind == drone.cell(1, 5).kind == "wall"  # outside


def test_the_papers_map_comes_first_and_there_are_five_more():
    assert map_names()[0] == "drone"
    assert len(map_names()) >= 6
    assert all(load_map(name).title for name in map_names())


def test_a_header_sets_the_rules():
    grid = parse_map(
        """\
title: All at once: rules
step_cost: 0.25
  slip: 0.1
wind: left 0 9
X = coin 5 terminal
Y=fountain -2
  z = hazard
= = exit 1
---

S.XY
#.z=
""",
        name="rules",
    )
    assert (grid.name, grid.title) == ("rules", "All at once: rules")
    assert (grid.step_cost, grid.slip, grid.wind) == (0.25, 0.1, Wind(LEFT, (0, 9)))
    assert grid.rows == ("S.XY", "#.z=")  # empty lines around the map do not count
    assert grid.cell(0, 2) == Cell("coin", 5.0, terminal=True)
    assert grid.cell(0, 3) == Cell("fountain", -2.0)
    assert grid.cell(1, 2) == Cell("hazard", -1.0)  # its usual value
    assert grid.cell(1, 3) == Cell("exit", 1.0, terminal=True)  # an exit always ends


def test_a_usual_symbol_can_be_given_another_value_in_one_map():
    assert parse_map("T = treasure 9\n---\nST").cell(0, 1) == Cell("treasure", 9.0)
    assert load_map("drone").cell(0, 4).value == 4.0


def test_values_and_slip_can_be_changed_afterwards():
    drone = load_map("drone")
    richer = drone.with_value("treasure", 5).with_slip(0.5)
    assert (richer.cell(0, 4).value, richer.slip) == (5.0, 0.5)
    assert (drone.cell(0, 4).value, drone.slip) == (4.0, 0.0)
    with pytest.raises(MapError, match=r"'drone' has no hazard.*coin, treasure"):
        drone.with_value("hazard", 1)
    with pytest.raises(MapError, match=r"has no tresure.*Did you mean 'treasure'"):
        drone.with_value("tresure", 1)
    with pytest.raises(MapError, match=r"treasure is 'nan'.*finite"):
        drone.with_value("treasure", float("nan"))
    for slip in (-0.1, 1.1, float("nan")):
        with pytest.raises(MapError, match="slip"):
            drone.with_slip(slip)


# ---- what is no map ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty.*Draw at least a start"),
        ("\n  \n", "empty"),
        ("slip: 0.1\n---\n", "empty"),
        ("S..\n.", r"Row 1 .* 1 cells, row 0 has 3.*equally long"),
        ("...\n..c", "no start.*exactly one cell with S"),
        ("S.S", "2 starts.*exactly one"),
        ("S?.", r"Unknown symbol '\?' at row 0, column 1.*Known symbols: S .*\? = coin 5"),
        ("S\t.", r"Unknown symbol '\\t' at row 0, column 1"),
        ("S" + "." * 10_000, "1 rows of up to 10001 cells.*10000 cells"),
        ("S\n" + ".\n" * 10_000, "10001 rows"),
        ("sli: 0.1\n---\nS.", "header line 'sli: 0.1'.*Did you mean 'slip'"),
        ("no colon\n---\nS.", "header line 'no colon'.*X = coin 5"),
        ("slip: 0.1\nslip: 0.2\n---\nS.", "sets slip twice"),
        ("slip: 2\n---\nS.", "slip probability is 2.*between 0 and 1"),
        ("slip: often\n---\nS.", "slip is 'often'.*finite"),
        ("slip: nan\n---\nS.", "slip is 'nan'"),
        ("step_cost: inf\n---\nS.", "step_cost is 'inf'"),
        ("X = gem\n---\nSX", "symbol 'X = gem'.*coin, treasure, hazard, fountain, exit"),
        ("X =\n---\nSX", "Cannot read the symbol 'X = '"),
        ("X = coin 5 6\n---\nSX", "Cannot read the symbol"),
        ("X = coin five\n---\nSX", "coin is 'five'"),
        ("X = coin 5\nX = coin 6\n---\nSX", "defines 'X' twice"),
        ("# = coin\n---\nS#", "'#' has a fixed meaning"),
        ("S = coin\n---\nS.", "'S' has a fixed meaning"),
        (" = coin\n---\nS.", "header line '= coin'"),
        ("wind: north 1\n---\nS.", "wind blows 'north'.*up"),
        ("wind: upp 1 1\n---\nS.", "Did you mean 'up'"),
        ("wind:\n---\nS.", "wind blows ''"),
        ("wind: up 1\n---\nS.", "1 strengths.*each of the 2 columns"),
        ("wind: left 1 1\n---\nS.", "2 strengths.*each of the 1 rows"),
        ("wind: up 1 -1\n---\nS.", "wind strengths '1 -1'.*from 0 to 9"),
        ("wind: up 1 0.5\n---\nS.", "wind strengths"),
        ("wind: up 1 10\n---\nS.", "wind strengths"),
        ("wind: up 1 ²\n---\nS.", "wind strengths"),
        (f"wind: up 1 {'9' * 5000}\n---\nS.", "wind strengths"),
        (f"wind: up 1 {'0' * 5000}\n---\nS.", "wind strengths"),
    ],
)
def test_what_is_wrong_is_named_with_its_cure(text, message):
    with pytest.raises(MapError, match=message) as caught:
        parse_map(text)
    assert "\n" not in str(caught.value)


@given(st.text(st.sampled_from("S.#cT>?X=-: \n\t0159slipwnd"), max_size=80))
def test_any_text_is_a_map_or_a_map_error(text):
    try:
        grid = parse_map(text)
    except MapError:
        return
    rows, columns = grid.shape
    assert all(len(row) == columns for row in grid.rows)
    assert all(grid.cell(i, j) for i in range(rows) for j in range(columns))
    assert grid.cell(*grid.start).kind == "floor"


# ---- files -------------------------------------------------------------------------------------


def test_a_file_is_read_with_its_name(tmp_path):
    file = tmp_path / "my map.txt"
    file.write_bytes("\ufefftitle: Über\r\n---\r\nS.T\r\n".encode())  # as Windows writes it
    grid = load_map(file)
    assert (grid.name, grid.title, grid.rows) == ("my map", "Über", ("S.T",))
    assert load_map(str(file)) == grid


def test_files_that_cannot_be_read(tmp_path):
    binary, huge = tmp_path / "binary.txt", tmp_path / "huge.txt"
    binary.write_bytes(b"S.\xff\xfe")
    huge.write_text("S" + "." * 200_000)
    for name, message in (
        (binary, "is no map: it is not UTF-8 text.* save a map as UTF-8"),
        (huge, "more than 100000 characters.*10000 cells"),
        (tmp_path, r"cannot be read: .*path of a text file"),
        (tmp_path / "missing.txt", "cannot be read: No such file"),
        (tmp_path / ("x" * 300), "cannot be read"),
        ("a\0b", "cannot be read: embedded null"),
        ("", "cannot be read"),
    ):
        with pytest.raises(MapError, match=message):
            load_map(name)


def test_an_unknown_name_gets_a_suggestion():
    with pytest.raises(MapError, match=r"no map 'dron'.*Did you mean 'drone'"):
        load_map("dron")
    with pytest.raises(MapError, match=r"no map 'zzz'.*Known: bridge, .*drone"):
        load_map("zzz")
