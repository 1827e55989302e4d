"""What there is to say of what matters: where, or which entries."""

from collections.abc import Iterator

import numpy as np

from trdlab.explanations.rules import Claim, Fields, Found, every, plain_data
from trdlab.explanations.saliency.belief import (
    BAD,
    certain,
    doubtful,
    hidden,
    redrawn,
    tried_out,
)
from trdlab.explanations.saliency.groups import Group
from trdlab.explanations.saliency.maps import overlap
from trdlab.explanations.saliency.saliency import SALIENCY, Entries, Places, Saliency
from trdlab.explanations.sections import Section, at_first

APART, ALIKE = 1 / 3, 2 / 3
"""Maps that overlap by less lie on different places, by more on the same ones."""
SHIFTED = 0.1
"""So much the share of an entry has to change to be worth a sentence."""

_ROWS, _COLUMNS = ("top", "middle", "bottom"), ("left", "middle", "right")
_EXPECTS = "{whose:text} {group:span}"


def in_brief(saliency: Saliency) -> list[Claim]:
    """Returns what matters most, and first of all what is not to be believed."""
    doubts = [of for of in every(saliency, *redrawn, *hidden) if of.kind in BAD]
    told = every(saliency, *apart, most_hidden, hangs_on, *tried, *shifts)
    return list(at_first([*doubts[:2], *every(saliency, doubtful)[:1], *told]))


def sections(saliency: Saliency) -> tuple[Section, ...]:
    """Returns all there is to say of what matters, by the question that it answers."""
    matters = every(saliency, *apart, *hidden_apart, most_hidden, hangs_on, *shifts, *tried, *sums)
    believed = every(saliency, doubtful, *redrawn, *hidden, certain, tried_out)
    heading = "Which places matter" if isinstance(saliency.of, Places) else "Which entries matter"
    parts = (
        Section("saliency", heading, tuple(matters), _notes(saliency)),
        Section("belief", "Whether to believe that", tuple(believed)),
    )
    return tuple(part for part in parts if part)


def _notes(saliency: Saliency) -> tuple[str, ...]:
    """Returns how the numbers were made."""
    of = saliency.of
    if isinstance(of, Places):
        return (
            f"The maps are {of.made} of convolution {of.layer}.",
            f"Hidden patches are {of.side} pixels wide, and look as most of the frame does.",
        )
    return {
        "gradients": ("The entries are compared with the mean of what it meets in an episode.",),
        "hiding": ("An entry is hidden by what it is at other moments of an episode.",),
        "exchange": ("A coordinate is exchanged for what it is in states alike in all others.",),
    }[of.method]


# ---- images ------------------------------------------------------------------------------------


def _overlap_of(saliency: Saliency, maps: str) -> Iterator[tuple[str, Fields]]:
    pair = saliency.pair
    if pair is None or not isinstance(saliency.of, Places):
        return
    near, far = pair
    of = getattr(saliency.of, maps)
    share = overlap(of.of(near).signed, of.of(far).signed)
    kind = "different" if share < APART else "same" if share > ALIKE else "partly-same"
    if not np.isnan(share):
        yield kind, saliency.whose | {"near": tuple(near), "far": tuple(far), "share": share}


_BOTH = "{whose:text} {near:span} and {far:span} hangs on"


@SALIENCY.kinds(
    {
        "different-places": f"{_BOTH} different places: their maps overlap by {{share:percent}}.",
        "partly-same-places": (
            f"{_BOTH} partly the same places: their maps overlap by {{share:percent}}."
        ),
        "same-places": f"{_BOTH} much the same places: their maps overlap by {{share:percent}}.",
    }
)
def apart(saliency: Saliency) -> Iterator[Found]:
    """How much the maps of near and far overlap, unless one of them is not to be believed."""
    for kind, fields in _overlap_of(saliency, "maps"):
        if not any(saliency.of.checks(group).is_bad for group in saliency.groups):
            yield f"{kind}-places", fields


@SALIENCY.kinds(
    {
        "different-patches": (
            "Hiding parts of the screen changes {whose:text} {near:span} and {far:span} at "
            "different places: these overlap by {share:percent}."
        ),
        "partly-same-patches": (
            "Hiding parts of the screen changes {whose:text} {near:span} and {far:span} at "
            "partly the same places: these overlap by {share:percent}."
        ),
        "same-patches": (
            "Hiding parts of the screen changes {whose:text} {near:span} and {far:span} at "
            "much the same places: these overlap by {share:percent}."
        ),
    }
)
def hidden_apart(saliency: Saliency) -> Iterator[Found]:
    """The same of what hiding changes, which needs no gradients."""
    for kind, fields in _overlap_of(saliency, "hidden"):
        yield f"{kind}-patches", fields


@SALIENCY.rule(
    "A patch hidden at the {place:text} of the screen {does:text} {gap:number} {where:text} "
    "{whose:text} {group:span}."
)
def most_hidden(saliency: Saliency) -> Iterator[Fields]:
    """The patch that changes it most."""
    if not isinstance(saliency.of, Places):
        return
    for group in saliency.told:
        lost = saliency.of.hidden.of(group).signed
        if not lost.any():
            continue
        row, column = np.unravel_index(int(np.abs(lost).argmax()), lost.shape)
        gap = float(lost[row, column])
        does, where = ("takes", "from") if gap > 0.0 else ("adds", "to")
        yield saliency.whose | {
            "group": tuple(group),
            "place": _place((int(row) + 0.5) / lost.shape[0], (int(column) + 0.5) / lost.shape[1]),
            "gap": abs(gap),
            "does": does,
            "where": where,
        }


def _place(down: float, right: float) -> str:
    """Returns in words where something is, `down` and `right` as shares of the screen."""
    row, column = _ROWS[int(3 * down)], _COLUMNS[int(3 * right)]
    return row if row == column else f"{row} {column}"


# ---- vectors and tables ------------------------------------------------------------------------


@SALIENCY.rule(f"{_EXPECTS} hangs most on {{entry:text}}: {{share:percent}} of all that counts.")
def hangs_on(saliency: Saliency) -> Iterator[Fields]:
    """The entry with the largest share of what all of them add or take."""
    if not isinstance(saliency.of, Entries):
        return
    for group in saliency.told:
        shares = saliency.of.shares(group)
        if shares.any():
            i = int(shares.argmax())
            yield saliency.whose | {
                "group": tuple(group),
                "entry": saliency.of.names[i],
                "share": float(shares[i]),
            }


@SALIENCY.kinds(
    {
        "grows": (
            "Far ahead, {entry:text} counts for more: {later:percent} {far:span}, against "
            "{sooner:percent} {near:span}."
        ),
        "shrinks": (
            "Far ahead, {entry:text} counts for less: {later:percent} {far:span}, against "
            "{sooner:percent} {near:span}."
        ),
    }
)
def shifts(saliency: Saliency) -> Iterator[Found]:
    """The entries whose share grows and shrinks most from near to far."""
    if saliency.pair is None or not isinstance(saliency.of, Entries):
        return
    near, far = saliency.pair
    sooner, later = saliency.of.shares(near), saliency.of.shares(far)
    if not (sooner.any() and later.any()):
        return
    change = later - sooner
    for kind, i in (("grows", int(change.argmax())), ("shrinks", int(change.argmin()))):
        if abs(change[i]) >= SHIFTED:
            shares = {"sooner": float(sooner[i]), "later": float(later[i])}
            about = {"entry": saliency.of.names[i], "near": tuple(near), "far": tuple(far)}
            yield kind, about | shares


@SALIENCY.kinds(
    {
        "tried-more": (
            f"{_EXPECTS} is {{gap:number}} more than on average where only {{entry:text}} differs."
        ),
        "tried-less": (
            f"{_EXPECTS} is {{gap:number}} less than on average where only {{entry:text}} differs."
        ),
    }
)
def tried(saliency: Saliency) -> Iterator[Found]:
    """What it means, of the entry that counts most, where that was tried out."""
    if not isinstance(saliency.of, Entries):
        return
    for group in saliency.told:
        gaps = saliency.of.hidden[group.components].sum(axis=0)
        i = int(np.abs(gaps).argmax())
        if gaps[i]:
            kind = "tried-more" if gaps[i] > 0.0 else "tried-less"
            fields = {"entry": saliency.of.names[i], "gap": abs(float(gaps[i]))}
            yield kind, saliency.whose | {"group": tuple(group)} | fields


@SALIENCY.kinds(
    {
        "adds": f"{_EXPECTS} is {{total:number}} more than at the mean of what it meets.",
        "takes": f"{_EXPECTS} is {{total:number}} less than at the mean of what it meets.",
    }
)
def sums(saliency: Saliency) -> Iterator[Found]:
    """What all entries add together, where they add up."""
    if not isinstance(saliency.of, Entries) or saliency.of.method != "gradients":
        return
    for group in saliency.told:
        total = float(saliency.of.of(group).sum())
        if total:
            fields = saliency.whose | {"group": tuple(group), "total": abs(total)}
            yield "adds" if total > 0.0 else "takes", fields


# ---- as plain data -----------------------------------------------------------------------------


def to_dict(saliency: Saliency) -> Fields:
    """Returns the numbers as plain data at full precision, and all that is told of them."""
    of, axis = saliency.of, saliency.time_axis
    told: Fields = {
        "schema": "trdlab.saliency/1",
        "agent": saliency.agent.name,
        "seed": saliency.seed,
        "step": saliency.step,
        "action": saliency.action,
        "foil": saliency.foil,
        "labels": list(axis.labels),
        "groups": [_group_data(saliency, group) for group in saliency.groups],
    }
    if isinstance(of, Places):
        told["places"] = {
            "method": of.method,
            "layer": of.layer,
            "maps": plain_data(of.maps.signed),
            "patch_side": of.side,
            "hidden": plain_data(of.hidden.signed),
            "shown": plain_data(of.shown),
        }
    else:
        named = ("method", "names", "values", "signed", "hidden", "shown", "met")
        told["entries"] = {name: plain_data(getattr(of, name)) for name in named}
    answer, parts = in_brief(saliency), sections(saliency)
    return told | {
        "answer": [claim.to_dict() for claim in answer],
        "sections": [section.to_dict() for section in parts],
    }


def _group_data(saliency: Saliency, group: Group) -> Fields:
    checks = saliency.of.checks(group)
    return {
        "components": [group.first, group.last],
        "label": group.label(saliency.time_axis),
        "doubtful": saliency.is_doubtful(group),
        "new_weights": {
            "verdict": checks.redrawn.verdict,
            "value": plain_data(checks.redrawn.value),
        },
        "hiding": {"verdict": checks.hidden.verdict, "value": plain_data(checks.hidden.value)},
    }
