"""Together: the first reward comes at the same step after either of two actions."""

from collections.abc import Iterator
from dataclasses import replace

from trdlab.explanations.moment.forecast import firsts
from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.explanations.rules import Fields, every

_TOLD = ("first-reward", "first-expected")


@CHOICES.rule(
    "With both {action} and {foil}, the first {effect:text}{expected:text} comes {component:when}."
)
def first_together(choice: Choice) -> Iterator[Fields]:
    """Nothing that stands out comes before it; how much it is may differ."""
    for action, foil in choice.orders[:1]:
        ones, others = (
            [c for c in every(replace(choice, action=name, foil=None), *firsts) if c.kind in _TOLD]
            for name in (action, foil)
        )
        coming = {(other.kind, other.effect, other.component) for other in others}
        for one in ones if choice.moment.difference(action, foil).any() else ():
            if (one.kind, one.effect, one.component) in coming:
                yield {
                    "action": action,
                    "foil": foil,
                    "effect": one.effect,
                    "expected": "" if one.is_sure else " to expect",
                    "component": one.component,
                }
