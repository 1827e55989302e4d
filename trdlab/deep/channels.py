"""Channels: the numbers of every group of w steps that a fit forecasts, and what follows from them.

The law asks of a number only that it is paid step by step and that nothing is paid after the end.
That is so of the reward, of its parts, of whether something happened, of whether the episode still
runs, and of the square of the reward of a group: so all of these are fitted alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.deep.experience import Experience
from trdlab.environments.outcomes import check_parts
from trdlab.estimator import Outlook
from trdlab.time_axis import TimeAxis

Kind = Literal["reward", "part", "value", "square", "running", "event", "ending", "amount"]
FEW = 3
"""So many different rewards besides 0, and the chance of each is told."""

_RARE = 0.05  # of the most that came: so small the scale of what is rare can be


@dataclass(frozen=True)
class Channel:
    """What is forecast of each group of w steps.

    Args:
        kind: the discounted `reward` of the group, a `part` of it, whether it is one `value`, its
            `square`, whether the episode is still `running` after the group, whether an `event`
            happened in it, an `ending` likewise, which never came but with the end of an episode,
            or another `amount`, discounted.
        name: of an outcome.
        reward: what a `value` is.
    """

    kind: Kind
    name: str = ""
    reward: float = 0.0

    @property
    def weight(self) -> float:
        """How often it counts in the reward."""
        return {"reward": 1.0, "part": 1.0, "value": self.reward}.get(self.kind, 0.0)


Channels = tuple[Channel, ...]


def channels_of(
    experience: Experience, names: Sequence[str], parts: Sequence[str], axis: TimeAxis
) -> Channels:
    """Returns what to forecast of what a policy did.

    Args:
        experience: what it did.
        names: of the outcomes, Q of them.
        parts: the names of those that add up to the reward; where there are none, and only a few
            different rewards ever came, the chance of each is forecast in place of the reward.
        axis: γ, N and w.

    Raises:
        InputError: the parts do not add up.
    """
    rows = np.arange(len(experience)) < experience.last  # [M]
    rewards, outcomes = experience.rewards, experience.outcomes
    beside: Channels = (Channel("square"), Channel("running")) if axis.horizon else ()
    values = np.unique(rewards[rows & (rewards != 0.0)])
    if parts:
        part = outcomes[:, [names.index(name) for name in parts]]  # [M, P]
        check_parts(parts, part, rewards, rows)
        paid: Channels = tuple(Channel("part", name) for name in parts)
    elif beside and axis.width == 1 and 0 < len(values) <= FEW:
        paid = tuple(Channel("value", reward=float(value)) for value in values)
        beside = beside[1:]  # the chances tell the squares, too
    else:
        paid = (Channel("reward"),)
    seen = zip(names, outcomes[rows].T, strict=True)  # [T] each
    others = (
        Channel(_kind(column, experience.ends[rows]), name)
        for name, column in seen
        if name not in parts
    )
    return (*paid, *beside, *others)


def _kind(outcome: FloatArray, ends: BoolArray) -> Kind:
    """Returns what an outcome `[T]` is, by what came of it, and by which steps were the last."""
    if not np.isin(outcome, (0.0, 1.0)).all():
        return "amount"
    came = outcome == 1.0
    return "ending" if came.any() and ends[came].all() else "event"


def groups_of(
    experience: Experience, channels: Channels, names: Sequence[str], axis: TimeAxis
) -> FloatArray:
    """Returns `[M, C]`: what the w steps from each row on brought, up to the end.

    What an episode's end cuts off counts as nothing; what it was cut off from is not known (see
    `Experience.ahead`).
    """
    within = _within(experience, axis.width)  # [w, M], whether the step j later still counts
    rewards = experience.rewards

    def total(values: FloatArray, gamma: float) -> FloatArray:
        summed = np.zeros(len(values))
        for j, counts in enumerate(within):
            summed[: len(values) - j] += gamma**j * np.where(counts, values, 0.0)[j:]
        return summed

    columns = []
    for channel in channels:
        given = experience.outcomes[:, names.index(channel.name)] if channel.name else rewards
        match channel.kind:
            case "value":
                column = np.where(rewards == channel.reward, 1.0, 0.0)
            case "square":
                column = total(rewards, axis.gamma) ** 2
            case "running":
                after = np.arange(len(experience)) + axis.width
                column = np.where(experience.next_end >= after, 1.0, 0.0)
            case "event" | "ending":
                column = np.minimum(total(given, 1.0), 1.0)
            case _:
                column = total(given, axis.gamma)
        columns.append(column)
    return np.column_stack(columns)


def sizes_of(
    experience: Experience, rows: IntArray, groups: FloatArray, axis: TimeAxis
) -> tuple[FloatArray, FloatArray]:
    """Returns the mean of what came after some steps and its deviation, `[C, N+1]` each.

    Of the residual they are what it would be, and its size, if rewards went on as they came. A
    deviation is no less than a part of the most that ever came: else the few steps before something
    rare would teach so much at once that all else is forgotten.

    Args:
        experience: what a policy did.
        rows: `[K]`, the numbers of the steps.
        groups: `[M, C]`, see `groups_of`.
        axis: γ, N and w.
    """
    ahead = experience.ahead(rows, axis, groups)
    known = ahead.known(axis)[:, None]  # [K, 1, N]
    came = np.where(known, ahead.came[..., : axis.horizon], 0.0)  # [K, C, N]
    count = np.maximum(known.sum(axis=0), 1)  # [1, N]
    mean = came.sum(axis=0) / count
    deviation = np.sqrt((np.where(known, came - mean, 0.0) ** 2).sum(axis=0) / count)  # [C, N]
    length = np.mean(experience.last[rows] - rows)  # steps that were still to come
    most_groups = 1.0 / (1.0 - axis.gamma**axis.width)
    left = min(most_groups, max(length / axis.width, 1.0)) * axis.discounts[-1]
    paid = groups[rows]  # [K, C]
    middle = np.column_stack([mean, left * paid.mean(axis=0)])
    scale = np.column_stack([deviation, left * np.abs(paid).mean(axis=0)])
    most = np.abs(groups[experience.steps]).max(axis=0)  # [C]
    least = np.maximum(_RARE * most[:, None] * axis.discounts, 1e-30)  # [C, N+1]
    return middle, np.asarray(np.maximum(scale, least))


def within(channels: Channels, components: FloatArray, possible: FloatArray) -> FloatArray:
    """Returns components `[..., C, N+1]` cut to what is possible `[2, C, N+1]`.

    The chances of several rewards are at most one together.
    """
    cut = np.clip(components, *possible.astype(components.dtype))
    are_chances = [channel.kind == "value" for channel in channels]
    if any(are_chances):
        chances = cut[..., are_chances, :]  # [..., V, N+1]
        most = possible[1, are_chances].max(axis=0).astype(cut.dtype)  # [N+1]
        together = np.maximum(chances.sum(axis=-2, keepdims=True), most)
        cut[..., are_chances, :] = chances * (most / np.where(together > 0.0, together, 1.0))
    return np.asarray(cut)


def reward_of(channels: Channels, components: FloatArray) -> FloatArray:
    """Returns the components of the reward `[..., N+1]` from those of all channels `[..., C, N+1]`.

    It is the sum of what it is made of, so parts add up to it whatever was learned.
    """
    weights = np.array([channel.weight for channel in channels], dtype=components.dtype)
    return np.asarray(weights @ components)


def outlook_of(
    channels: Channels, components: FloatArray, axis: TimeAxis, reach: Sequence[int] = ()
) -> Outlook:
    """Returns what all channels `[..., C, N+1]` say beside the mean of the reward.

    Args:
        channels: what they are, C of them.
        components: of each.
        axis: γ, N and w.
        reach: how many components of each were told better than by a constant guess, if that has
            been judged.
    """
    discounts = axis.discounts[:-1]  # [N]
    safe = np.where(discounts > 0.0, discounts, 1.0)
    mean = reward_of(channels, components)[..., :-1]  # [..., N]
    chances: dict[float, FloatArray] = {}
    parts: dict[str, FloatArray] = {}
    events: dict[str, FloatArray] = {}
    amounts: dict[str, FloatArray] = {}
    square, alive = np.zeros_like(mean), np.ones_like(mean)
    for at, channel in enumerate(channels):
        whole = components[..., at, :]  # [..., N+1]
        chance = np.clip(whole[..., :-1] / safe, 0.0, 1.0)  # [..., N]
        match channel.kind:
            case "value":
                chances[channel.reward] = chance
                square = square + chance * (channel.reward * discounts) ** 2
            case "square":
                square = np.maximum(whole[..., :-1], 0.0) * discounts
            case "running":
                alive = np.minimum.accumulate(chance, axis=-1)
            case "part":
                parts[channel.name] = whole
            case "event" | "ending":
                events[channel.name] = chance
            case "amount":
                amounts[channel.name] = whole
    now = np.ones((*alive.shape[:-1], 1), dtype=alive.dtype)  # [..., 1]
    survival = np.concatenate([now, alive], axis=-1)  # [..., N+1]
    judged = dict(zip(channels, reach, strict=False))
    return Outlook(
        variance=np.maximum(square - mean**2, 0.0),
        survival=survival,
        chances=chances,
        parts=parts,
        events=events,
        amounts=amounts,
        survival_reach=judged.get(Channel("running"), 0),
        reach={channel.name: own for channel, own in judged.items() if channel.name},
        endings=tuple(channel.name for channel in channels if channel.kind == "ending"),
    )


def _within(experience: Experience, width: int) -> list[BoolArray]:
    """Returns w times `[M]`: whether a row is still of the future of the row j before it."""
    rows = np.arange(len(experience))
    last = np.minimum(experience.next_end, experience.last - 1)  # [M], the last that counts
    found = []
    for j in range(width):
        counts = np.zeros(len(rows), dtype=np.bool_)
        counts[j:] = rows[j:] <= last[: len(rows) - j]
        found.append(counts)
    return found
