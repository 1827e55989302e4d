"""Errors say what went wrong and what to do, and survive the way to another process."""

import pickle

import pytest

from trdlab.errors import InputError, MapError, OutputError, TrdlabError, closest


def test_an_error_reads_as_cause_and_cure():
    error = MapError("The map is empty.", "Draw a start.")
    assert str(error) == "The map is empty. Draw a start."
    assert (error.cause, error.cure) == ("The map is empty.", "Draw a start.")
    assert str(TrdlabError("It broke.")) == "It broke."


def test_wrong_input_is_a_value_error_and_ends_a_command_with_2():
    assert TrdlabError("x").exit_code == 1
    for kind in (InputError, MapError, OutputError):
        assert kind("x").exit_code == 2
        with pytest.raises(ValueError, match="x"):
            raise kind("x")


def test_errors_cross_process_boundaries():
    error = pickle.loads(pickle.dumps(OutputError("The disk is full.", "Make room.")))
    assert isinstance(error, OutputError)
    assert (str(error), error.cure) == ("The disk is full. Make room.", "Make room.")


@pytest.mark.parametrize(
    ("name", "cure"),
    [
        ("brigde", "Did you mean 'bridge'?"),
        ("DRONE", "Did you mean 'drone'?"),
        ("", "Known: bridge, drone."),
        ("submarine", "Known: bridge, drone."),
    ],
)
def test_the_nearest_name_is_suggested(name, cure):
    assert closest(name, {"drone", "bridge"}) == cure
