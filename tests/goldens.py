"""Makes the golden decompositions in trdlab/testing/goldens from the exact solver.

`python tests/goldens.py` tells which files differ by more than rounding, `--write` writes those.
"""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import trdlab.envs  # noqa: F401  registers the maps
from trdlab.decomposition import TimeAxis
from trdlab.files import write_whole
from trdlab.tabular import MDP, exact, from_environment
from trdlab.testing import Golden

FOLDER = Path(__file__).parents[1] / "trdlab" / "testing" / "goldens"

GO, LEAVE = range(2)
CHAIN = MDP.from_transitions(
    [[[(1.0, s + 1, s + 1.0, False)], [(1.0, s, 0.5, True)]] for s in range(5)]
    + [[[(1.0, 5, 6.0, True)], [(1.0, 5, 0.5, True)]]]
)
SURVIVAL = MDP.from_transitions([[[(0.75, 0, 1.0, False), (0.25, 0, 1.0, True)]]])
ENDING = MDP.from_transitions(  # action 0 ends the episode in a state that action 1 goes on from
    [
        [[(1.0, 1, 1.0, True)], [(1.0, 1, 0.0, False)]],
        [[(1.0, 0, 3.0, True)], [(0.5, 1, -1.0, False), (0.5, 0, -1.0, True)]],
    ]
)


def case(
    name: str,
    title: str,
    source: MDP | tuple[str, dict[str, Any]],
    axis: TimeAxis,
    *,
    policy: np.ndarray | None = None,
    whose: str = "",
    ties: Any = "lowest",
) -> Golden:
    """Returns a golden decomposition of all states of a model, or of an environment's."""
    environment, arguments = ("", {}) if isinstance(source, MDP) else source
    mdp = (
        source if isinstance(source, MDP) else from_environment(gym.make(environment, **arguments))
    )
    table = exact(mdp, axis, policy=policy, ties=ties)
    return Golden(
        name=name,
        title=title,
        mdp=mdp,
        policy=table.solution.policy,
        future=replace(table.future, policy=whose) if whose else table.future,
        states=np.arange(mdp.num_states),
        decomposition=table.decomposition,
        environment=environment,
        arguments=arguments,
    )


def goldens() -> list[Golden]:
    """Returns all of them, freshly solved."""
    drone, tie = ("trdlab/DroneGridworld-v0", {}), ("trdlab/TieGridworld-v0", {})
    windy = ("trdlab/WindyGridworld-v0", {"slip": 0.2})
    lake = ("FrozenLake-v1", {"map_name": "4x4", "is_slippery": True})
    drawn = np.tile([0.1, 0.4, 0.4, 0.1], (16, 1))
    return [
        case("drone", "The paper's example, two groups of two steps", drone, TimeAxis(0.95, 2, 2)),
        case("drone-n0", "N = 0: the residual alone, which is Q", drone, TimeAxis(0.95, 0)),
        case("drone-n1", "N = 1: the reward now, and all that is later", drone, TimeAxis(0.95, 1)),
        case("drone-n4", "The paper's example, step by step", drone, TimeAxis(0.95, 4)),
        case("windy-slippery", "Chance, wind and a cost of each step", windy, TimeAxis(0.95, 4, 3)),
        case(
            "frozen-lake",
            "Slippery ice; two actions tie in one state, with the same future",
            lake,
            TimeAxis(0.99, 10),
        ),
        case(
            "frozen-lake-drawn",
            "A policy that draws its actions",
            lake,
            TimeAxis(0.9, 6, 2),
            policy=drawn,
            whose="a policy that goes left, down, right, up with 0.1, 0.4, 0.4, 0.1",
        ),
        case(
            "chain",
            "Closed form: in state s, component i is γ^i·(s + i + 1) up to state 5",
            CHAIN,
            TimeAxis(0.9, 3),
        ),
        case(
            "survival",
            "Closed form: 1 a step, an end with probability 1/4 at each; "
            "component i is (3γ/4)^i, and the residual (3γ/4)^N / (1 − 3γ/4)",
            SURVIVAL,
            TimeAxis(0.8, 5),
        ),
        case(
            "ending",
            "What ends is a transition, not a state: one ends where another goes on",
            ENDING,
            TimeAxis(0.5, 2),
            policy=np.array([[0.0, 1.0], [0.0, 1.0]]),
            whose="the policy that always takes action 1",
        ),
        case("tie-first", "19 now or 20 later, equal at γ = 0.95", tie, TimeAxis(0.95, 4)),
        case(
            "tie-even",
            "19 now or 20 later: the same Q as tie-first, other components",
            tie,
            TimeAxis(0.95, 4),
            ties="mixed",
        ),
    ]


def text_of(golden: Golden) -> str:
    """Returns the file of a golden decomposition, each innermost list on a line of its own."""
    text = json.dumps(golden.to_dict(), indent=1, allow_nan=False, ensure_ascii=False)
    flat = re.sub(r"\[([^][{}]*)\]", lambda m: "[" + " ".join(m[1].split()) + "]", text)
    return flat + "\n"


def same(one: Any, other: Any, tolerance: float = 1e-12) -> bool:
    """Returns whether two pieces of plain data are equal, numbers up to rounding."""
    if isinstance(one, dict) and isinstance(other, dict):
        return list(one) == list(other) and all(same(one[k], other[k], tolerance) for k in one)
    if isinstance(one, list) and isinstance(other, list):
        pairs = zip(one, other, strict=False)
        return len(one) == len(other) and all(same(a, b, tolerance) for a, b in pairs)
    if isinstance(one, float) and isinstance(other, float):
        return abs(one - other) <= tolerance
    return type(one) is type(other) and one == other


def main() -> None:
    """Tells which files differ, and writes them if asked to."""
    for golden in goldens():
        path = FOLDER / f"{golden.name}.json"
        text = text_of(golden)
        if path.exists() and same(json.loads(path.read_bytes()), json.loads(text)):
            continue
        if "--write" in sys.argv[1:]:
            write_whole(path, lambda new, text=text: new.write_text(text, encoding="utf-8"))
        print(f"{golden.name} {'written' if '--write' in sys.argv[1:] else 'differs'}")


if __name__ == "__main__":
    main()
