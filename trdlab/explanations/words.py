"""Words: how numbers, steps and names look in sentences."""

from collections.abc import Callable, Sequence
from functools import cache

from trdlab.explanations.rules import Form
from trdlab.formatting import chance_of, likely, percent, plain, said, signed
from trdlab.statistics import Estimate
from trdlab.time_axis import TimeAxis


@cache
def forms_of(axis: TimeAxis, seconds: float | None = None) -> dict[str, Form]:
    """Returns the forms that a slot `{field:form}` of any sentence can take.

    Numbers: `number` (2.71), `size` (2.71, nothing), `gives`, `pays` and `gains` (gives nothing,
    costs 0.5, loses 0.5), `estimate`, `percent`, `chance` (a 5 % chance), `given` (by the user: all
    its digits), `tenths`, `count`, `steps`, `episodes`, `times`, `states`. Of what was learned, to
    two digits: `likely` (about a 15 % chance), `rough` (2.7), `share` (+2.7), `bill` (coin +2.7,
    hazard -0.8). What is said where a flag asks for it: `average` and `averages` (unless it is
    sure), `worth`, `ties`.
    Time, where the action is the first step: `when` (a component: at once, 3 steps later, after the
    first 4 steps), `whens` (several), `span` (from one to another), `within` (up to a step: in the
    first 4 steps), `first` (so many: the first 4 steps), `groups` (so many of w
    steps: the first 2 groups of 4 steps), `step` (of an episode).
    Names: `action`, `names`, `text`. With `seconds`, times are told in both.
    """

    def span(components: tuple[int, int]) -> str:
        first, last = components
        steps = axis.steps(last)
        until = steps[-1] + 1 if axis.start(first) == 0 and steps not in (None, range(1)) else 0
        told = span_of(axis, first, last)
        if seconds is not None and steps is not None and 0 < axis.start(first) < steps[-1]:
            return f"{told} ({axis.start(first) * seconds:.2g} to {steps[-1] * seconds:.2g} s)"
        return told + _played(until or axis.start(first), seconds)

    def when(component: int) -> str:
        return when_of(axis, component) + _played(axis.start(component), seconds)

    def groups(count: int) -> str:
        told = f"the first {count:,} groups of {axis.width} steps"
        return _first(count) if axis.width == 1 else told

    def within(last_step: int) -> str:
        return f"in {_first(last_step + 1)}" + _played(last_step + bool(last_step), seconds)

    return {
        "action": _of(str),
        "text": _of(str),
        "names": _of(joined),
        "number": Form(said, float),
        "gives": Form(lambda x, digits: _does(x, digits, "gives"), abs),
        "pays": Form(lambda x, digits: _does(x, digits, "pays"), abs),
        "gains": Form(lambda x, digits: _does(x, digits, "gains", "loses"), abs),
        "average": _of(lambda is_sure: "" if is_sure else " on average"),
        "averages": _of(lambda are_sure: "" if are_sure else ", on average"),
        "worth": _of(lambda is_discounted: "worth " if is_discounted else ""),
        "tenths": _of(lambda x: f"{x:.1f}"),
        "size": Form(lambda x, digits: said(x, digits) if x else "nothing", abs),
        "estimate": Form(_estimate, lambda estimate: float(estimate.value)),
        "percent": _of(lambda share: f"{percent(share)} %"),
        "chance": _of(chance_of),
        "likely": _of(likely),
        "rough": _of(lambda x: said(x, 2)),
        "share": _of(signed),
        "bill": _of(lambda parts: ", ".join(f"{of} {signed(x)}" for of, x in parts.items())),
        "given": _of(plain),
        "count": _of(lambda count: f"{count:,}"),
        "steps": _of(lambda count: counted(count, "step")),
        "episodes": _of(lambda count: counted(count, "episode")),
        "states": _of(lambda count: counted(count, "state")),
        "ties": _of(lambda is_tied: ", with ties broken as here" if is_tied else ""),
        "times": _of(lambda count: "once" if count == 1 else f"{count:,} times"),
        "when": _of(when),
        "whens": _of(lambda components: joined(whens_of(axis, components))),
        "span": _of(span),
        "within": _of(within),
        "first": _of(_first),
        "groups": _of(groups),
        "step": _of(lambda step: f"step {step:,}"),
    }


def when_of(axis: TimeAxis, component: int) -> str:
    """Returns when a component comes, counted from the action, as people say it.

    >>> axis, grouped = TimeAxis(0.9, 4), TimeAxis(0.9, 2, 2)
    >>> [when_of(axis, i) for i in (0, 1, 3, 4)]
    ['at once', '1 step later', '3 steps later', 'after the first 4 steps']
    >>> [when_of(grouped, i) for i in (0, 1, 2)]
    ['in the first 2 steps', '2 to 3 steps later', 'after the first 4 steps']
    """
    return span_of(axis, component, component)


def span_of(axis: TimeAxis, first: int, last: int) -> str:
    """Returns when some components in a row come, counted from the action, as people say it.

    >>> axis = TimeAxis(0.9, 4)
    >>> [span_of(axis, *of) for of in ((0, 2), (2, 3), (2, 4), (0, 4))]
    ['in the first 3 steps', '2 to 3 steps later', 'after the first 2 steps', 'at any time']
    """
    start, steps = axis.start(first), axis.steps(last)
    if steps is None:
        return f"after {_first(start)}" if start else "at any time"
    end = steps[-1]
    if start == end:
        return "at once" if start == 0 else f"{counted(start, 'step')} later"
    return f"in {_first(end + 1)}" if start == 0 else f"{start:,} to {end:,} steps later"


def whens_of(axis: TimeAxis, components: Sequence[int]) -> list[str]:
    """Returns when some components come, those that follow each other told as one.

    >>> whens_of(TimeAxis(0.9, 9), [0, 2, 3, 4, 6]), whens_of(TimeAxis(0.9, 2, 2), [0, 1])
    (['at once', '2 to 4 steps later', '6 steps later'], ['in the first 4 steps'])
    """
    runs: list[list[int]] = []
    for i in components:
        if runs and runs[-1][-1] == i - 1:
            runs[-1].append(i)
        else:
            runs.append([i])
    return [span_of(axis, run[0], run[-1]) for run in runs]


def _first(count: int) -> str:
    return "the first step" if count == 1 else f"the first {count:,} steps"


def counted(count: int, noun: str) -> str:
    """Returns so many things.

    >>> counted(1, "step"), counted(12000, "step")
    ('1 step', '12,000 steps')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def joined(parts: Sequence[str]) -> str:
    """Returns a list as people say it.

    >>> joined(["up", "down", "left"])
    'up, down and left'
    """
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _of(show: Callable[..., str]) -> Form:
    """Returns the form of a value that needs no certain number of digits."""
    return Form(lambda value, _: show(value))


def _does(value: float, digits: int, gives: str, costs: str = "costs") -> str:
    if value == 0.0:
        return f"{gives} nothing"
    return f"{gives if value > 0.0 else costs} {said(abs(value), digits)}"


def _estimate(of: Estimate, digits: int) -> str:
    if not of.low < of.high:  # where there is no chance, or no interval
        return said(of.value, digits)
    return f"{said(of.value, digits)} ({said(of.low, digits)} to {said(of.high, digits)})"


def _played(steps: int, seconds: float | None) -> str:
    """Returns how long some steps take as people play, in brackets, if that is known."""
    return f" ({steps * seconds:.2g} s)" if seconds is not None and steps else ""
