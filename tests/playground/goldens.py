"""Makes tests/playground/goldens.json, what the exact solver says of many maps.

`python tests/playground/goldens.py` tells whether it differs by more than rounding, `--write`
writes it. The playground's own solver has to say the same.
"""

import json
import math
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.bellman import target
from trdlab.decomposition import TimeAxis
from trdlab.errors import MapError
from trdlab.explanations.moment import contrast, telling
from trdlab.explanations.moment.exact import gamma_what_if, tabular_moment
from trdlab.explanations.moment.moment import Choice
from trdlab.explanations.moment.sensitivity import find_flips, flips
from trdlab.explanations.rules import every, first
from trdlab.explanations.sections import at_first
from trdlab.gridworld import Gridworld, map_names, parse_map
from trdlab.gridworld.gridmap import map_text
from trdlab.tabular import MDP, exact

FILE = Path(__file__).with_name("goldens.json")

SHIPPED = [
    {"gamma": 0.95, "N": 2, "w": 2},
    {"gamma": 0.9, "N": 6, "w": 1, "slip": 0.2},
    {"gamma": 0.5, "N": 0, "w": 1, "treasure": 5.0},
    {"gamma": 0.99, "N": 3, "w": 4, "treasure": -2.0, "slip": 0.05},
]
RANDOM = 40
MOST_STATES = 300
LETTERS = ".....cCtThHfE^v<>##"
Settings = dict[str, Any]


def cases() -> list[dict[str, Any]]:
    """Returns what the solver says of all maps that are shipped, and of random ones."""
    known = [case(map_text(name), settings) for name in map_names() for settings in SHIPPED]
    rng = np.random.default_rng(14)
    while len(known) < len(map_names()) * len(SHIPPED) + RANDOM:
        text, settings = random_map(rng), random_settings(rng)
        try:
            world = Gridworld(parse_map(text))
        except MapError:
            continue
        if len(world.states) <= MOST_STATES:
            known.append(case(text, settings))
    return known


def random_map(rng: np.random.Generator) -> str:
    """Returns the text of a map with anything that maps can have."""
    rows, columns = rng.integers(1, 6), rng.integers(2, 7)
    cells = rng.choice(list(LETTERS), size=(rows, columns))
    cells[rng.integers(rows), rng.integers(columns)] = "S"
    head = ["f = fountain -0.5", "T = treasure 2.5 terminal"]
    head += ["step_cost: 0.1"] * int(rng.random() < 0.2)
    head += [f"slip: {rng.choice([0.1, 0.25])}"] * int(rng.random() < 0.3)
    if rng.random() < 0.2:
        strengths = " ".join(map(str, rng.integers(0, 3, size=columns)))
        head.append(f"wind: {rng.choice(['up', 'down'])} {strengths}")
    return "\n".join([*head, "---", *("".join(row) for row in cells), ""])


def random_settings(rng: np.random.Generator) -> Settings:
    """Returns γ, N and w."""
    gamma = round(float(rng.choice([0.3, 0.8, 0.95, 0.99, rng.random()])), 3)
    return {"gamma": gamma, "N": int(rng.integers(0, 6)), "w": int(rng.integers(1, 4))}


def case(text: str, settings: Settings) -> dict[str, Any]:
    """Returns what is exactly expected on one map: in its first state, and in a few others."""
    axis = TimeAxis(settings["gamma"], settings["N"], settings["w"])
    grid = parse_map(text).changed(slip=settings.get("slip"))
    has_treasure = any(grid.legend[symbol].kind == "treasure" for symbol in "".join(grid.rows))
    settings = {k: v for k, v in settings.items() if k != "treasure" or has_treasure}
    world = Gridworld(grid.changed(treasure=settings.get("treasure")))
    table = exact(world.mdp, axis)
    count = len(world.states)
    shown = sorted({0, *np.linspace(0, count - 1, 4).astype(int).tolist()})
    states = [state_of(world, table, state, with_flips=state == 0) for state in shown]
    swept = sweeps(world.mdp, axis, 5)[shown] if axis.width == 1 else None
    found = {"text": text, **settings, "num_states": count, "states": states}
    return found | ({} if swept is None else {"swept": rounded(swept)})


def state_of(world: Gridworld, table: Any, state: int, *, with_flips: bool) -> dict[str, Any]:
    """Returns the components, the choice and its sentences in one state."""
    gamma = table.time_axis.gamma
    what_ifs = [gamma_what_if(world.mdp, gamma, state)] if with_flips else []
    choice = tabular_moment(table, state, world.action_names, what_ifs).choice()
    moment, [row, column] = choice.moment, world.states[state].place
    found = {
        "state": state,
        "place": f"{row},{column},{len(world.states[state].collected)}",
        "components": rounded(moment.decomposition.components),
        "totals": rounded(moment.totals),
        "pair": [choice.action, choice.foil],
        "sentences": sentences(choice),
    }
    if with_flips and choice.foil is not None:
        [of], pair = what_ifs, [moment.index(name) for name in (choice.action, choice.foil)]
        roots = find_flips(partial(of.gap, *pair), of.low, of.high)
        found |= {"flips": rounded(roots), "flip_sentences": [c.sentence for c in flips(choice)]}
    return found


def sentences(choice: Choice) -> list[str]:
    """Returns the sentences that matter most, but for those of the forecast and the flips."""
    if choice.moment.is_over or choice.foil is None:
        told = every(choice, telling.episode_is_over, telling.no_alternative)[:1]
    else:
        told = contrast.in_brief(choice) + first(choice, *telling.ties)
    return [claim.sentence for claim in at_first(told)]


def sweeps(mdp: MDP, axis: TimeAxis, count: int) -> FloatArray:
    """Returns `[S, A, N+1]`: zeros after some sweeps of the one equation over all of the table."""
    table = np.zeros((*mdp.shape, axis.num_components))
    for _ in range(count):
        q_values = table.sum(axis=-1)
        near = q_values >= q_values.max(axis=1, keepdims=True) - 1e-11
        following = table[np.arange(mdp.num_states), near.argmax(axis=1)][mdp.next_states]
        targets = target(mdp.rewards, axis.gamma * ~mdp.terminated, following)  # [K, N+1]
        weighted = mdp.probabilities[:, None] * targets
        table = np.add.reduceat(weighted, mdp.offsets[:-1]).reshape(table.shape)
    return table


def rounded(values: Any) -> Any:
    """Returns numbers to 13 digits as plain lists; NaN is None."""
    if isinstance(values, np.ndarray | list | tuple):
        return [rounded(value) for value in values]
    return None if math.isnan(values) else float(f"{values:.13g}")


def same(one: Any, other: Any) -> bool:
    """Returns whether two pieces of plain data are equal, numbers up to rounding."""
    if isinstance(one, dict) and isinstance(other, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-12)
    return bool(one == other)


def main() -> None:
    """Tells whether the file differs, and writes it if asked to."""
    found = cases()
    if FILE.exists() and same(json.loads(FILE.read_bytes()), found):
        return
    if "--write" in sys.argv[1:]:
        lines = ",\n".join(json.dumps(of, ensure_ascii=False) for of in found)
        FILE.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    print(f"{FILE.name} {'written' if '--write' in sys.argv[1:] else 'differs'}")


if __name__ == "__main__":
    main()
