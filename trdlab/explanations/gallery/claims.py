"""What there is to say of rewards that came, and of forecasts that came before them."""

from collections.abc import Iterator

import numpy as np

from trdlab.explanations.gallery.gallery import Gallery
from trdlab.explanations.rules import Claim, Fields, Form, Found, Language, every
from trdlab.explanations.words import forms_of
from trdlab.formatting import said

_OF = "of {moments:count} forecasts {like:text}"


_SIZES = {1: "high", 0: "small", -1: "low"}
"""How a forecast is called, by the sign of its level."""


def _forms(gallery: Gallery) -> dict[str, Form]:
    def paid(value: float, digits: int) -> str:
        return f"a {'reward' if value >= 0.0 else 'cost'} of {said(abs(value), digits)}"

    return forms_of(gallery.time_axis) | {"paid": Form(paid, abs)}


GALLERIES = Language[Gallery]("these recorded episodes", _forms)


def group_claims(gallery: Gallery) -> list[Claim]:
    """Returns a claim for each group of rewards, in their order; or that none came."""
    claims = every(gallery, *came)
    return sorted(claims, key=lambda claim: claim.fields.get("group", -1))


@GALLERIES.kinds(
    {
        "none-came": "In {episodes:episodes} with {steps:steps}, no reward came.",
        "came-from": "{reward:paid} came {count:times} from {parts:names}.",
        "came-with-change": (
            "{reward:paid} came {count:times} with a change at the {place:text} of the picture."
        ),
        "came": "{reward:paid} came {count:times}.",
    }
)
def came(gallery: Gallery) -> Iterator[Found]:
    """Rewards that look alike: what paid, or where something changed for good."""
    if not gallery.came:
        yield "none-came", {"episodes": len(gallery.recorded), "steps": gallery.steps}
    for number, of in enumerate(gallery.groups):
        about: Fields = {"group": number, "reward": of.reward, "count": len(of.members)}
        if of.parts:
            yield "came-from", about | {"parts": list(of.parts)}
        elif of.place:
            yield "came-with-change", about | {"place": of.place}
        else:
            yield "came", about


def likeness(gallery: Gallery) -> dict[tuple[int, int], Claim]:
    """Returns, by component and level, what followed recorded forecasts that are alike."""
    claims = every(gallery, *followed)
    return {(claim.component, claim.level): claim for claim in claims}


@GALLERIES.kinds(
    {
        "only-one-followed": (
            "The one recorded forecast {like:text} was followed by {kind:text} {component:when}"
            "{slack:text}."
        ),
        "only-one-not-followed": (
            "The one recorded forecast {like:text} was not followed by {kind:text} "
            "{component:when}."
        ),
        "none-followed": (
            f"In {{episodes:episodes}}, none {_OF} was followed by {{kind:text}} "
            "{component:when}."
        ),
        "one-followed": (
            f"In {{episodes:episodes}}, 1 {_OF} was followed by {{kind:text}} {{component:when}}"
            "{slack:text}."
        ),
        "some-followed": (
            f"In {{episodes:episodes}}, {{followed:count}} {_OF} were followed by {{kind:text}} "
            "{component:when}"
            "{slack:text}."
        ),
    }
)
def followed(gallery: Gallery) -> Iterator[Found]:
    """How often a reward came after forecasts of an action taken that were about as high."""
    for of in gallery.alike.values():
        fields: Fields = {
            "component": of.component,
            "level": of.level,
            "episodes": len(gallery.recorded),
            "moments": of.moments,
            "followed": of.followed,
            "like": f"as {_SIZES[int(np.sign(of.level))]} as this one",
            "kind": "a cost" if of.level < 0 else "a reward",
            "slack": ", give or take a step" if gallery.slack(of.component) else "",
        }
        if of.moments == 1:
            yield f"only-one-{'' if of.followed else 'not-'}followed", fields
        elif of.followed == 0:
            yield "none-followed", fields
        else:
            yield "one-followed" if of.followed == 1 else "some-followed", fields
