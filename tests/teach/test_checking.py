"""Exercises know right from wrong, and show how to find the answer."""

import re

import pytest

from trdlab.errors import InputError
from trdlab.teach import check, solution
from trdlab.teach.checking import EXERCISES


@pytest.mark.parametrize("name", EXERCISES)
def test_check_explains_each_known_mistake(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    for wrong, said in EXERCISES[name].mistakes:
        check(name, wrong)
        assert capsys.readouterr().out == f"Exercise {name}: {wrong} is not right. {said}\n"


@pytest.mark.parametrize("answer", [1e6, -3, [1, 2, 3, 4, 5, 6], "many", [[1], [1, 2]], object])
def test_check_gives_a_hint_on_any_other_answer(
    answer: object, capsys: pytest.CaptureFixture[str]
) -> None:
    check("1.3", answer)
    printed = capsys.readouterr().out
    assert printed.endswith(f"is not right. Hint: {EXERCISES['1.3'].hint}\n")


def test_check_waits_for_an_answer(capsys: pytest.CaptureFixture[str]) -> None:
    check("1.3", None)
    assert capsys.readouterr().out.startswith("Exercise 1.3: not answered yet.")


def test_check_compares_to_two_decimals(capsys: pytest.CaptureFixture[str]) -> None:
    check("1.3", 4.33)
    assert "right." in capsys.readouterr().out
    check("1.3", 4.34)
    assert "not right" in capsys.readouterr().out


@pytest.mark.parametrize("name", EXERCISES)
def test_a_solution_comes_to_the_right_answer(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The numbers of the answer are among those of the text, in the same order."""
    solution(name)
    lines = capsys.readouterr().out.splitlines()
    assert 1 <= len(lines) <= 5
    assert max(map(len, lines)) <= 80
    said = " ".join(lines).replace("10 000", "10000").replace("−", "-")
    told = iter([float(number) for number in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?", said)])
    right = EXERCISES[name].right
    for entry in right if isinstance(right, list) else [right]:
        assert any(abs(number - entry) <= 0.005 for number in told), said


@pytest.mark.parametrize("door", [lambda name: check(name, 2), solution])
def test_an_exercise_that_is_not_there_is_named(door) -> None:
    with pytest.raises(InputError, match=r"There is no exercise '1\.9'\. Did you mean '1\.\d'\?"):
        door("1.9")
