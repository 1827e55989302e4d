"""Asking an agent at a moment what matters, and trying out whether the answer can be believed."""

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from trdlab.agents.agent import Agent
from trdlab.agents.models import World
from trdlab.arrays import FloatArray
from trdlab.environments.flat import FlatSpace
from trdlab.errors import InputError
from trdlab.estimator import MapMethod
from trdlab.explanations.saliency.checks import DRAWS, hidden_patches
from trdlab.explanations.saliency.groups import parse_groups, usual_groups
from trdlab.explanations.saliency.maps import SaliencyMaps
from trdlab.explanations.saliency.saliency import Entries, Places, Saliency
from trdlab.formatting import said
from trdlab.gridworld import Gridworld
from trdlab.rollouts.playing import Playing
from trdlab.tabular import ExactTable

PATCHES = 12
"""So many patches a side of an image is cut into."""
MET = 64
"""So many observations a vector is held against."""

_MOST_TRIED = 20_000  # observations that are tried out at once
_MOST_STEPS = 500  # that are played to meet some


def saliency_at(
    agent: Agent,
    playing: Playing,
    action: str,
    foil: str | None = None,
    *,
    components: str | None = None,
    layer: int = 0,
    method: MapMethod = "gradcam",
    seed: int = 0,
) -> Saliency:
    """Returns what matters for the reward that an agent expects where its first episode stands.

    Images are asked by maps of a convolution, vectors by gradients that are integrated from the
    mean of what the agent meets, the states of a solved model by exchanging their coordinates. What
    a learned answer is worth is tried out: with new weights, and by hiding.

    Args:
        agent: whom to ask.
        playing: where it stands.
        action: the name of one.
        foil: of the one that it is held against; None for none.
        components: which, as `parse_groups` reads them; by default near and far.
        layer: which convolution of a network to look at, from 0.
        method: how its maps are made.
        seed: of the episode.

    Raises:
        InputError: there are no such components, no such convolution, or the agent sees nothing
            that has parts.
    """
    axis = agent.estimator.time_axis
    groups = usual_groups(axis) if components is None else parse_groups(components, axis)
    rows = [agent.action_names.index(name) for name in (action, foil) if name is not None]
    seen: Any = playing.stack.observations[0]
    found: Places | Entries
    if agent.world is not None and isinstance(agent.estimator, ExactTable):
        found = _coordinates(agent.estimator, agent.world, int(seen), rows)
    elif seen.ndim == 3 and seen.dtype == np.uint8 and hasattr(agent.estimator, "saliency"):
        screens = getattr(playing.environments, "screens", None)
        screen = None if screens is None else np.array(screens[0])
        found = _places(agent.estimator, seen, rows, layer, method, screen)
    elif seen.ndim:
        found = _entries(agent, seen, rows, seed)
    else:
        raise InputError(
            "The agent sees only the number of a state, which has no parts.",
            "Ask an exact table, or an agent that sees images or vectors.",
        )
    return Saliency(agent, seed, playing.steps, action, foil, groups, found)


def _places(
    estimator: Any,
    seen: NDArray[np.uint8],
    rows: list[int],
    layer: int,
    method: MapMethod,
    screen: NDArray[np.uint8] | None,
) -> Places:
    """Returns which places of an image `[C, H, W]` matter."""
    axis, twice = estimator.time_axis, np.repeat(seen[None], len(rows), axis=0)

    def maps_of(who: Any) -> FloatArray:
        return _apart(who.saliency(twice, rows, layer=layer, method=method))

    maps = maps_of(estimator)  # [N+1, h, w]
    others = [maps_of(estimator.redrawn(draw, layer=layer)) for draw in range(DRAWS)]
    side = max(1, max(seen.shape[-2:]) // PATCHES)
    hidden = hidden_patches(seen, side)  # [P, C, H, W]
    grid = -(-seen.shape[-2] // side), -(-seen.shape[-1] // side)
    told = _told(estimator, np.concatenate([seen[None], hidden]), rows)  # [P + 1, N+1]
    lost = (told[0] - told[1:]).T.reshape(-1, *grid)  # [N+1, rows, columns]
    shown = (hidden != seen).any(axis=(1, 2, 3)).reshape(grid)
    return Places(
        method=method,
        maps=SaliencyMaps(maps, axis),
        layer=layer,
        hidden=SaliencyMaps(lost, axis),
        shown=shown,
        redrawn=np.stack(others),
        side=side,
        seen=seen.copy(),
        screen=screen,
    )


def _entries(agent: Agent, seen: FloatArray, rows: list[int], seed: int) -> Entries:
    """Returns which entries of a vector `[...]` matter."""
    estimator: Any = agent.estimator
    met, names = _met(agent, seed + 1), entry_names(agent.interface.space)
    hidden, shown = _hidden(estimator, seen, met, rows)
    redrawn = np.zeros((0, *hidden.shape))
    has_gradients = hasattr(estimator, "attributions")
    if has_gradients:
        twice, mean = np.repeat(seen[None], len(rows), axis=0), met.mean(axis=0, dtype=np.float64)

        def added(who: Any) -> FloatArray:
            return _apart(who.attributions(twice, rows, baseline=mean))

        redrawn = np.stack([added(estimator.redrawn(draw)) for draw in range(DRAWS)])
    return Entries(
        method="gradients" if has_gradients else "hiding",
        names=names,
        values=tuple(said(float(value)) for value in seen.ravel()),
        signed=added(estimator) if has_gradients else hidden,
        hidden=hidden,
        shown=shown,
        redrawn=redrawn,
        time_axis=estimator.time_axis,
        met=len(met),
    )


def _hidden(
    estimator: Any, seen: FloatArray, met: FloatArray, rows: list[int]
) -> tuple[FloatArray, Any]:
    """Returns what each entry adds beyond one that was met `[N+1, F]`, and which could be other.

    Args:
        estimator: what is asked.
        seen: `[...]`, of F entries.
        met: `[M, ...]`.
        rows: the actions.
    """
    flat, size = seen.ravel(), seen.size
    some = met.reshape(len(met), -1)[: max(1, _MOST_TRIED // size)]  # [M', F]
    tried = np.repeat(flat[None, None], size, axis=0).repeat(len(some), axis=1)  # [F, M', F]
    every = np.arange(size)
    tried[every, :, every] = some.T
    own = _told(estimator, seen[None], rows)[0]  # [N+1]
    told = _told(estimator, tried.reshape(-1, *seen.shape), rows)  # [F·M', N+1]
    without = told.reshape(size, len(some), -1).mean(axis=1)  # [F, N+1]
    return (own - without).T, (some != flat).any(axis=0)


def _coordinates(table: ExactTable, world: World, state: int, rows: list[int]) -> Entries:
    """Returns which coordinates of a state of a solved model matter."""
    names, places, words, visited = coordinates_of(world)
    if len(names) < 2:
        raise InputError(
            "A state of this model has no coordinates that could be exchanged.",
            "Ask for its forecast; a map, or a model with coordinates, has some.",
        )
    components = table.decomposition.components[:, rows]  # [S, 1 or 2, N+1]
    told = _apart(np.moveaxis(components, 1, 0))  # [S, N+1]
    signed, shown = np.zeros((told.shape[1], len(names))), np.zeros(len(names), dtype=np.bool_)
    most = 0
    for i in range(len(names)):
        others = np.delete(places, i, axis=1)
        is_alike = (others == others[state]).all(axis=1) & visited
        apart = is_alike & (places[:, i] != places[state, i])
        if apart.any():
            signed[:, i], shown[i] = told[state] - told[apart].mean(axis=0), True
            most = max(most, int(apart.sum()))
    return Entries(
        method="exchange",
        names=names,
        values=words[state],
        signed=signed,
        hidden=signed,
        shown=shown,
        redrawn=np.zeros((0, *signed.shape)),
        time_axis=table.time_axis,
        met=most,
    )


def coordinates_of(
    world: World,
) -> tuple[tuple[str, ...], NDArray[np.int64], list[tuple[str, ...]], NDArray[np.bool_]]:
    """Returns the K coordinates of a model's states.

    Returns:
        Their names; `[S, K]`, what they are in each state, as numbers; the same in words; and
        `[S]`, the states that an episode can be in and go on.
    """
    ends = world.mdp.terminal_states
    if isinstance(world, Gridworld):
        names: tuple[str, ...] = ("row", "column")
        kept = sorted({place for state in world.states for place in state.collected})
        names += tuple(f"taken at {row},{column}" for row, column in kept)
        numbers = [
            (state.row, state.column, *(int(place in state.collected) for place in kept))
            for state in world.states
        ]
        words = [
            (*map(str, found[:2]), *("yes" if taken else "no" for taken in found[2:]))
            for found in numbers
        ]
        return names, np.array(numbers), words, ~ends
    states, of = range(world.mdp.num_states), world.coordinates
    places = [world.place(state) for state in states]
    names = tuple(coordinate.name for coordinate in of)
    words = [
        tuple(c.values[i] if c.values else str(i) for c, i in zip(of, place, strict=True))
        for place in places
    ]
    return names, np.array(places, dtype=np.int64), words, world.visited & ~ends


def entry_names(space: gym.spaces.Space[Any]) -> tuple[str, ...]:
    """Returns the names of the F entries of vectors, by the parts that they stand for.

    >>> entry_names(FlatSpace(gym.spaces.Dict(at=gym.spaces.Box(-1, 1, (2,)),
    ...     fuel=gym.spaces.Box(0, 1, (1,)))))
    ('at 0', 'at 1', 'fuel')
    >>> entry_names(gym.spaces.Box(-1, 1, (2,)))
    ('entry 0', 'entry 1')
    """
    parts = space.parts if isinstance(space, FlatSpace) else {}
    named = parts or {"entry": tuple(space.shape or ())}
    names: list[str] = []
    for part, shape in named.items():
        count = int(np.prod(shape))
        alone = count == 1 and bool(parts)
        names += [part] if alone else [f"{part} {i}" for i in range(count)]
    size = int(np.prod(space.shape or ()))
    return tuple(names) if len(names) == size else tuple(f"entry {i}" for i in range(size))


def _met(agent: Agent, seed: int) -> FloatArray:
    """Returns observations `[M, ...]` that the agent meets in an episode, evenly far apart."""
    found = []
    with agent.begin(seed=seed, max_steps=_MOST_STEPS) as recording:
        while recording.playing.running.any():
            found.append(np.array(recording.playing.stack.observations[0]))
            recording.play(recording.playing.steps + 1)
    every = np.linspace(0, len(found) - 1, min(MET, len(found))).astype(np.int64)
    return np.stack([found[i] for i in every])


def _told(estimator: Any, seen: Any, rows: list[int]) -> FloatArray:
    """Returns what is expected of an action, or of how it differs from another: `[B, N+1]`."""
    components = estimator.decompose(seen).components[:, rows].astype(np.float64)
    return _apart(np.moveaxis(components, 1, 0))


def _apart(of: FloatArray) -> FloatArray:
    """Returns the first of one, or of two the first minus the second: `[...]`."""
    return np.asarray(of[0] - of[1] if len(of) == 2 else of[0])
