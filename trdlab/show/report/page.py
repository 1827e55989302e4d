"""The page: what it holds as data, and as HTML that needs nothing else."""

import json
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration.calibration import Calibration
from trdlab.explanations.calibration.claims import verdicts
from trdlab.explanations.episode.story import Story, place
from trdlab.explanations.explanation import Explanation
from trdlab.explanations.gallery.claims import group_claims, likeness
from trdlab.explanations.gallery.gallery import Came, Gallery, Group
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.telling import in_brief
from trdlab.explanations.rules import plain_data
from trdlab.explanations.words import when_of
from trdlab.formatting import said
from trdlab.rollouts.reel import Reel
from trdlab.show.data import axis_data
from trdlab.show.document import document
from trdlab.show.report.card import card
from trdlab.show.report.numbers import packed, packed_shares
from trdlab.show.report.pictures import sheets
from trdlab.show.report.recording import Take
from trdlab.show.report.told import Told

SCHEMA = "trdlab.report/1"
MOST_GROUPS = 6
"""Of rewards are shown at once; the others to who asks for them."""
MOST_ANSWERS = 3
"""Sentences below the first ones."""
EXAMPLES = 2
"""Rewards of a group that are shown."""
AROUND = (-6, -3, 0, 1, 3)
"""The pictures of a reward: how many steps from the one at which it was earned."""

UNTESTED = "That has not been tested: no other episodes were played to judge these forecasts by."

_FIRST = ("first-reward", "first-expected")
_HERE = Path(__file__).parent
_TRUST = ("score", "trust", "faults", "later", "others", "critic", "judged")
_UNSAFE = {ord(c): f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"}


@dataclass(frozen=True, eq=False)
class Material:
    """All that a page is made of.

    Args:
        explained: the moment that it begins with, and how far to trust it.
        take: the episode that is shown.
        story: of that episode.
        told: the sentences of all of its moments.
        gallery: the rewards that came in all recorded episodes.
        reel: their pictures.
        maps: where the agent looks, packed; None where that is not known.
    """

    explained: Explanation
    take: Take
    story: Story
    told: Told
    gallery: Gallery
    reel: Reel
    maps: dict[str, Any] | None = None


def html(material: Material) -> str:
    """Returns the page."""
    explained, page = material.explained, document(material.explained)
    episode = material.take.recorded.episode
    script, style = (_read(f"page.{kind}") for kind in ("js", "css"))
    lead, trusted = _lead(material), _trusted_in_short(material)
    beside = (lead, trusted, *material.told.sentences_of(explained.step))
    answer = [sentence for sentence in page.answer if sentence not in beside]
    claims = group_claims(material.gallery)
    trust = [section for section in page.sections if section.name in _TRUST]
    made = Environment(
        loader=FileSystemLoader(_HERE), autoescape=True, undefined=StrictUndefined
    ).get_template("page.html")
    return made.render(
        title=explained.agent.name,
        setting=page.setting,
        lead=lead,
        trusted=trusted,
        answer=answer[:MOST_ANSWERS],
        names=explained.agent.action_names,
        steps=len(episode),
        seed=explained.seed,
        score=said(float(episode.rewards.sum()), 3),
        is_over=episode.terminated,
        has_clips=bool(material.take.recorded.pictures and material.gallery.came),
        step=explained.step,
        key=[(place(claim), claim.sentence) for claim in material.story.moments],
        start=[claim.sentence for claim in material.story.start],
        end=[claim.sentence for claim in material.story.end],
        groups=[claim.sentence for claim in claims] if material.gallery.groups else [],
        most_groups=MOST_GROUPS,
        empty="" if material.gallery.groups else claims[0].sentence,
        trust=trust,
        untested=UNTESTED,
        details=[section for section in page.sections if section.name not in _TRUST],
        card=card(explained.agent),
        version=import_module("trdlab").__version__,  # which stands above this room
        script=script,
        style=style,
        script_hash=_hash(script),
        style_hash=_hash(style),
        data=data(material).translate(_UNSAFE),  # so that nothing in it can end it
    )


def _lead(material: Material) -> str:
    """Returns when the first reward is expected, or else what matters most of the moment."""
    choice = material.explained.choice
    claims = [] if choice is None else in_brief(choice)
    ahead = [claim for claim in claims if claim.kind in _FIRST] or claims
    return ahead[0].sentence if ahead else ""


def _trusted_in_short(material: Material) -> str:
    report = material.explained.report
    return UNTESTED if report is None else verdicts(report)[0].sentence


def data(material: Material) -> str:
    """Returns what the script reads, as JSON of the schema `trdlab.report/1`."""
    explained, take, told = material.explained, material.take, material.told
    episode, report, axis = take.recorded.episode, explained.report, explained.time_axis
    components = [moment.decomposition.components for moment in take.moments]
    chances = [_chances(moment) for moment in take.moments]
    known = all(of is not None for of in chances)
    shown = _shown(material)
    parts: dict[str, Any] = {
        "schema": SCHEMA,
        "agent": explained.agent.name,
        "seed": explained.seed,
        "step": explained.step,
        "seconds": explained.agent.seconds_per_step,
        "time_axis": axis_data(axis),
        "when": [when_of(axis, i) for i in range(axis.num_components)],
        "actions": list(explained.agent.action_names),
        "taken": episode.actions.tolist(),
        "rewards": episode.rewards.tolist(),
        "ends": np.flatnonzero(episode.ends).tolist(),
        "usual": told.usual,
        "chosen": _chosen(material),
        "sentences": told.sentences,
        "told": [_by_pair(each) for each in told.moments],
        "trust": None if report is None else _trusted(report.calibration),
        "foils": None if report is None or report.foils is None else _trusted(report.foils),
        "key": [place(claim) for claim in material.story.moments],
        "pictures": _pictures(material, shown),
        "texts": _once(take.texts),
        "gallery": _gallery(material.gallery, shown),
        "maps": material.maps,
        "components": packed(_of_all(components, take, explained)),
        "probabilities": packed(_probabilities(material)),
        "chances": packed_shares(_of_all(chances, take, explained)) if known and chances else None,
    }
    return json.dumps(plain_data(parts), separators=(",", ":"), allow_nan=False)


def _chosen(material: Material) -> tuple[int, int | None] | None:
    """Returns the action and the foil that the user has chosen; None where they are the usual."""
    choice = material.explained.choice
    if choice is None:
        return None
    names = material.explained.agent.action_names
    pair = names.index(choice.action), None if choice.foil is None else names.index(choice.foil)
    return None if pair == material.told.usual[material.explained.step] else pair


def _of_all(rows: Sequence[Any], take: Take, explained: Explanation) -> FloatArray:
    """Returns `[T, A, ...]` of what is known of allowed actions `[≤ A, ...]`; NaN of others."""
    names = explained.agent.action_names
    found = np.full((len(rows), len(names), *np.shape(rows[0])[1:]), np.nan)
    for t, (moment, row) in enumerate(zip(take.moments, rows, strict=True)):
        found[t, [names.index(name) for name in moment.action_names]] = row
    return found


def _probabilities(material: Material) -> FloatArray:
    moments = material.take.moments
    likely = [
        np.full(len(of.action_names), np.nan) if of.policy is None else of.policy for of in moments
    ]
    return _of_all(likely, material.take, material.explained)


def _chances(moment: Moment) -> FloatArray | None:
    """Returns `[A, N]`: how likely each step pays or costs anything; None where nobody knows."""
    known, learned = moment.uncertainty, moment.outlook
    if known is not None and known.outcomes and known.outcomes[0]:
        return np.array(
            [
                [sum(chance for reward, chance in step.items() if reward) for step in action]
                for action in known.outcomes
            ]
        )
    if learned is None or not learned.chances:
        return None
    paid = [np.asarray(chance) for reward, chance in learned.chances.items() if reward]
    return np.clip(np.sum(paid, axis=0), 0.0, 1.0) if paid else None


def _by_pair(told: dict[tuple[int, int | None], tuple[int, ...]]) -> dict[str, tuple[int, ...]]:
    return {f"{a},{'' if foil is None else foil}": numbers for (a, foil), numbers in told.items()}


def _trusted(found: Calibration) -> dict[str, Any]:
    trust = found.trust
    return {
        "status": trust.status,
        "doubtful": trust.doubtful.tolist(),
        "last_step": trust.last_step,
        "off_by": np.round(found.off_by, 6).tolist(),
    }


def _once(texts: Sequence[str]) -> dict[str, Any] | None:
    """Returns texts, each once, and which of them stands where."""
    numbers: dict[str, int] = {}
    at = [numbers.setdefault(text, len(numbers)) for text in texts]
    return {"at": at, "texts": list(numbers)} if texts else None


# ---- rewards that came, and pictures -------------------------------------------------------------


def _shown(material: Material) -> dict[int, list[tuple[int, int]]]:
    """Returns the rewards that are shown, each with its pictures: how many steps away, and which.

    The picture `k + 1` steps after the one at which an action was chosen shows what came of it.
    """
    gallery = material.gallery
    wanted = {i for of in gallery.groups for i in _examples(of)}
    wanted |= {i for of in gallery.alike.values() for i in of.examples}
    return {i: _clip(gallery, gallery.came[i]) for i in sorted(wanted)}


def _examples(of: Group) -> list[int]:
    """Returns some members of a group, spread over all."""
    at = np.linspace(0, len(of.members) - 1, min(EXAMPLES, len(of.members))).round()
    return [of.members[int(i)] for i in at]


def _clip(gallery: Gallery, one: Came) -> list[tuple[int, int]]:
    pictures = gallery.recorded[one.episode].pictures
    near = ((k, one.step + k) for k in AROUND)
    return [(k, pictures[at]) for k, at in near if 0 <= at < len(pictures)]


def _pictures(material: Material, shown: dict[int, list[tuple[int, int]]]) -> dict[str, Any] | None:
    """Returns sheets of pictures, where each picture is, and which are the episode's own."""
    own = material.take.recorded.pictures
    if not own:
        return None
    needed = [*own, *(number for clip in shown.values() for _, number in clip)]
    made = sheets(material.reel, needed)
    where = {
        number: (i, at) for i, sheet in enumerate(made) for at, number in enumerate(sheet.numbers)
    }
    numbers = {number: i for i, number in enumerate(where)}
    for clip in shown.values():
        clip[:] = [(k, numbers[number]) for k, number in clip]
    return {
        "sheets": [sheet[:4] for sheet in made],
        "where": list(where.values()),
        "at": [numbers[number] for number in own],
    }


def _gallery(gallery: Gallery, shown: dict[int, list[tuple[int, int]]]) -> dict[str, Any]:
    claims = likeness(gallery)
    return {
        "groups": [_examples(of) for of in gallery.groups],
        "came": {
            str(i): {
                "step": gallery.came[i].step,
                "own": gallery.came[i].episode == 0,
                "reward": gallery.came[i].reward,
                "clip": clip,
                "box": gallery.came[i].box,
            }
            for i, clip in shown.items()
        },
        "edges": gallery.edges.tolist(),
        "alike": {
            f"{component},{level}": {
                "says": claims[component, level].sentence,
                "examples": of.examples,
            }
            for (component, level), of in gallery.alike.items()
        },
    }


def _read(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
