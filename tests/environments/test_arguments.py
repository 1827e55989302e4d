"""Arguments of environments, read and written."""

import numpy as np
import pytest

from trdlab.agents.models import find_model
from trdlab.environments.arguments import parse_arguments, parse_name, say_arguments, say_name
from trdlab.errors import InputError

READ = {
    "8x8": "8x8",
    "0.5": 0.5,
    "7": 7,
    "False": False,
    "null": None,
    '["SFFF","FHFG"]': ["SFFF", "FHFG"],
    '[[0, -2.5, null], ["a,b=[", {"c": true}]]': [[0, -2.5, None], ["a,b=[", {"c": True}]],
    '{"pole": 0.5}': {"pole": 0.5},
    '"7"': "7",
    "": "",
    "a]b": "a]b",
}


@pytest.mark.parametrize(("text", "value"), READ.items())
def test_a_value_is_read_as_what_it_looks_like(text, value):
    assert parse_arguments([f"key={text}"]) == {"key": value}
    name, arguments = parse_name(f"Some-v0,first={text},key={text},last=1")
    assert (name, arguments) == ("Some-v0", {"first": value, "key": value, "last": 1})


def test_what_is_written_is_read_as_the_same():
    odd = ["true", "NULL", "1e3", "[", '{"', "a,b", 'say "so"', "ä", "", "x=y", "inf", "-0", "nan"]
    values = [*READ.values(), *odd, -1.5e300, 0.1, ["1", 1, "a,b"], np.float64(0.25)]
    for value in values:
        assert parse_arguments([say_arguments({"key": value})]) == {"key": value}
        told = say_name("a-v0", {"key": value, "other": value})
        assert parse_name(told) == ("a-v0", {"key": value, "other": value})
    assert say_arguments({"a": np.arange(2), "b": ("x", None)}) == 'a=[0,1], b=["x",null]'


def test_a_map_is_given_in_the_name_of_an_environment():
    model = find_model('tabular:FrozenLake-v1,desc=["SFFF","FHFG"],is_slippery=false')
    assert model.world.mdp.num_states == 8
    assert model.name == 'FrozenLake-v1,desc=["SFFF","FHFG"],is_slippery=false'


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("desc=[SFFF,FHFG]", r"The value of desc begins as JSON and is none: Expecting value"),
        ("desc=[1] 2", r"' 2' follows the value of desc\. Leave it out"),
        ("desc", r"'desc' is not KEY=VALUE"),
        ("two words=1", r"'two words=1' is not KEY=VALUE"),
    ],
)
def test_what_cannot_be_read_is_refused(word, message):
    with pytest.raises(InputError, match=message):
        parse_arguments([word])
    with pytest.raises(InputError, match="given twice"):
        parse_name("a-v0,key=[1],key=2")
