"""Where on the screen rewards are decided: near and far ones step by step, or each in turn."""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.explanations.saliency.groups import Group
from trdlab.explanations.saliency.maps import SaliencyMap, SaliencyMaps
from trdlab.formatting import said
from trdlab.rollouts.episodes import Episode
from trdlab.show.plots import style
from trdlab.show.plots.saliency import LOWERS, RAISES, overlay
from trdlab.show.video import canvas
from trdlab.show.video.beside import panel_for
from trdlab.show.video.canvas import Frame, Sheet, even, letters_for, line_of, width_of, zoom_for
from trdlab.show.video.panel import Row, Span
from trdlab.show.video.sights import Sight

_BATCH = 8  # steps that are asked about together
_PANEL = 400  # pixels: how wide a panel is, as far as the size of letters is concerned
_LEGEND = (("raises it", RAISES), ("lowers it", LOWERS))  # what is expected


def overlaid(picture: Frame, shares: FloatArray) -> Frame:
    """Returns a darkened picture with a map over it.

    Args:
        picture: `[H, W, 3]`.
        shares: `[h, w]`, from −1 to 1; it covers the whole picture.
    """
    return np.asarray(np.rint(255.0 * overlay(picture, np.clip(shares, -1.0, 1.0))), dtype=np.uint8)


def saliency_frames(
    agent: Agent, episode: Episode, sights: Iterator[Sight], groups: Sequence[Group]
) -> Iterator[Frame]:
    """Yields T frames: the screen three times, with what matters near, far, and the difference.

    Each map is shown as a share of the largest strength that it has had so far.

    Args:
        agent: whose episode it is.
        episode: as it was played.
        sights: T+1 of them, in order.
        groups: near and far components.

    Raises:
        InputError: the estimator has no maps.
    """
    axis, largest = episode.time_axis, np.zeros(3)
    near, far = groups
    names, step = agent.action_names, 0
    while batch := list(islice(sights, min(_BATCH, len(episode) - step))):
        actions = episode.actions[step : step + len(batch)]
        told = _maps_of(agent.estimator, [of.observation for of in batch], actions)
        for sight, action, signed in zip(batch, actions.tolist(), told, strict=True):
            maps = SaliencyMaps(signed, axis)
            shown = [maps.of(near), maps.of(far), maps.difference(near, far)]
            largest = np.maximum(largest, [of.strength.max() for of in shown])
            yield _three(sight.seen, shown, largest, f"step {step:,} · takes {names[action]}")
            step += 1


def _three(picture: Frame, maps: Sequence[SaliencyMap], largest: FloatArray, heading: str) -> Frame:
    zoom = zoom_for(picture)
    height, width = (even(zoom * side) for side in picture.shape[:2])
    gap = 8
    whole = 3 * width + 2 * gap
    size = letters_for(whole)
    line = line_of(size)
    sheet = Sheet(even(whole), even(height + 3 * line + size // 2), size)
    sheet.write(0, 0, heading)
    for at, (one, most) in enumerate(zip(maps, largest.tolist(), strict=True)):
        said_of = f"{('near', 'far', 'far − near')[at]}: " if at < 2 else ""
        x = at * (width + gap)
        sheet.write(x, line, canvas.shortened(f"{said_of}{one.label}", width, size), bold=True)
        over = overlaid(picture, one.signed / (most or 1.0))
        sheet.paste(canvas.enlarged(over, zoom), x, 2 * line)
    _legend(sheet, 0, height + 2 * line + size // 4, "what is seen there")
    return sheet.frame


def component_frames(
    agent: Agent, observation: Any, picture: Frame, action: int, step: int
) -> Iterator[Frame]:
    """Yields N+1 frames of one step: where on the screen each component is decided.

    Each map is shown as a share of its own largest strength.

    Args:
        agent: who expects.
        observation: `[...]`.
        picture: `[H, W, 3]`, which shows the same.
        action: which is asked about.
        step: of the episode.

    Raises:
        InputError: the estimator has no maps.
    """
    axis, names = agent.estimator.time_axis, agent.action_names
    (signed,) = _maps_of(agent.estimator, [observation], np.array([action]))
    rows = agent.estimator.decompose(observation[None]).components[0]  # [A, N+1]
    zoom = zoom_for(picture)
    height, width = (even(zoom * side) for side in picture.shape[:2])
    size = letters_for(width + _PANEL)
    line = line_of(size)
    panel = panel_for(axis, names, height, size, 1)
    span = Span().over(rows[action][None])
    for component in range(axis.num_components):
        one = SaliencyMaps(signed, axis).of(Group(component, component))
        sheet = Sheet(width + panel.width, panel.height + line + size // 2, size)
        sheet.paste(canvas.enlarged(overlaid(picture, one.scaled), zoom), 0, 0)
        worth = said(float(rows[action, component]), 2)
        heading = f"step {step:,} · {one.label}: {worth}"
        row = Row(names[action], rows[action], lit=component)
        sheet.paste(panel.draw([row], span, heading), width, 0)
        _legend(sheet, size // 2, panel.height + size // 4, "what is seen there")
        yield canvas.evened(sheet.frame)


def check_looks(estimator: Any) -> None:
    """Checks that an estimator has maps.

    Raises:
        InputError: it has none.
    """
    if not hasattr(estimator, "saliency"):
        raise InputError(
            f"The {type(estimator).__name__} has no maps of where it looks.",
            "Ask for them of a network that sees images, such as pretrained:Breakout.",
        )


def _maps_of(estimator: Any, observations: Sequence[Any], actions: Any) -> FloatArray:
    """Returns the maps of all components `[B, N+1, h, w]`."""
    check_looks(estimator)
    found: FloatArray = estimator.saliency(np.stack(observations), actions)
    return found


def _legend(sheet: Sheet, x: int, y: int, about: str) -> None:
    """Explains the colours."""
    size = sheet.size
    sheet.write(x, y, f"{about}:", style.MUTED)
    x += width_of(f"{about}:", size) + size
    for text, colour in _LEGEND:
        box = (x, y + size // 4, x + size - 4, y + size)
        sheet.draw.rectangle(box, colour)
        sheet.write(x + size, y, text, style.MUTED)
        x += 2 * size + width_of(text, size)
