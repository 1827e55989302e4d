"""Exact tables judged by what comes: how often are they told to be wrong?

Of random slippery maps and three environments, two actions are tried with as many seeds as asked
for, fifty times each, and each table is judged by its episodes. All that is forecast is exact, so
every verdict against it is a false one, and an interval of 95 % allows one in twenty of them.

    python benchmarks/evidence.py                       # 200 maps, 28 seeds: about eight minutes
    python benchmarks/evidence.py --maps 20 --seeds 8
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from trdlab.agents import Agent, gridworld_agent, tabular_agent
from trdlab.decomposition import TimeAxis
from trdlab.errors import TrdlabError
from trdlab.explanations.assessment import assess, moment_at
from trdlab.explanations.calibration.faults import faults
from trdlab.explanations.explanation import explain
from trdlab.explanations.moment import outcome

ENVIRONMENTS = {"FrozenLake-v1": 8, "Taxi-v4": 14, "CliffWalking-v1": 14}
CELLS, CHANCES = list(".#chHTC"), [0.55, 0.15, 0.08, 0.06, 0.06, 0.06, 0.04]
WRONG = ("against-the-forecast", "no-difference")
OFF = ("by-another-amount", "less-than-forecast")
OPEN = ("too-few-tries", "too-close-to-tell")
OUTCOMES = (*WRONG, *OFF, *OPEN, "came-as-forecast", "came-exactly")


def maps(count: int, folder: Path) -> Iterator[Agent]:
    """Yields exact tables of random slippery maps."""
    rng = np.random.default_rng(0)
    while count:
        rows = rng.choice(CELLS, p=CHANCES, size=rng.integers((2, 4), (5, 7)))
        rows[rng.integers(len(rows)), rng.integers(rows.shape[1])] = "S"
        path = folder / f"{count}.txt"
        slip = rng.choice([0.02, 0.1, 0.3])
        path.write_text(f"slip: {slip}\n---\n" + "\n".join("".join(row) for row in rows))
        try:
            agent = gridworld_agent(str(path), TimeAxis(0.95, 4))
            pair(agent)
        except TrdlabError:  # nowhere to go, or no end
            continue
        count -= 1
        yield agent


def environments() -> Iterator[Agent]:
    """Yields exact tables of environments."""
    for name, horizon in ENVIRONMENTS.items():
        yield tabular_agent(name, TimeAxis(0.95, horizon))


def pair(agent: Agent) -> tuple[str, str]:
    """Returns what the table would do, and the best other action, or any."""
    choice = moment_at(agent).choice()
    others = (name for name in agent.action_names if name != choice.action)
    return choice.action, choice.foil or next(others)


def tally(agent: Agent, seeds: int) -> Counter[str]:
    """Returns how much was told of a table, and how much of that was false."""
    report = assess(agent, episodes=300, effort=agent.effort)
    action, foil = pair(agent)
    told = Counter(
        components=sum(status != "not tested" for status in report.calibration.status),
        bad=sum(status == "bad" for status in report.calibration.status),
        reports=1,
        faults=bool(faults(report)),
    )
    for seed in range(seeds):
        asked = {"action": action, "foil": foil, "seed": seed, "report": report}
        trial = explain(agent, ("contrast",), **asked).trial
        (section,) = outcome.sections(trial)
        kinds = [claim.kind for claim in section.claims if claim.kind in OUTCOMES]
        told.update(
            contrasts=bool(kinds),
            against=any(kind in WRONG for kind in kinds),
            off=any(kind in OFF for kind in kinds),
            sentences=len(kinds),
            open=sum(kind in OPEN for kind in kinds),
        )
    return told


def show(name: str, told: Counter[str]) -> None:
    """Prints the shares."""
    parts = [
        f"{share} {100 * told[share] / max(told[of], 1):4.1f} % of {told[of]} {of}"
        for share, of in (
            ("against", "contrasts"),
            ("off", "contrasts"),
            ("open", "sentences"),
            ("bad", "components"),
            ("faults", "reports"),
        )
    ]
    print(f"{name:>16}: {' · '.join(parts)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--maps", type=int, default=200)
    parser.add_argument("--seeds", type=int, default=28)
    options = parser.parse_args()
    began, everything = time.perf_counter(), Counter[str]()
    for agent in environments():
        told = tally(agent, options.seeds)
        show(agent.name, told)
        everything += told
    with TemporaryDirectory() as folder:
        told = Counter[str]()
        for agent in maps(options.maps, Path(folder)):
            told += tally(agent, options.seeds)
        show("random maps", told)
    show("all", everything + told)
    print(f"{time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main()
