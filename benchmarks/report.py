"""How large a report is, and how long it takes to make: an episode of Breakout, all actions.

Plays one episode of the agent that comes with trdlab, keeps its pictures, what it expects of every
action and the sentences of every moment, and writes the page. Judging the forecasts by other
episodes is not counted: `trdlab explain` takes as long for that.

    python benchmarks/report.py                 # 1,000 steps
    python benchmarks/report.py --steps 200
"""

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import trdlab

_STEP = 90


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--agent", default="pretrained:Breakout")
    arguments.add_argument("--steps", type=int, default=1_000)
    arguments.add_argument("--others", type=int, default=0, help="more recorded episodes")
    given = arguments.parse_args()
    agent = trdlab.agent(given.agent)
    step = min(_STEP, given.steps - 1)
    explained = trdlab.explain(
        agent, step=step, max_steps=given.steps, parts="forecast", episodes=0
    )
    with TemporaryDirectory() as folder:
        out, begun = Path(folder) / "report.html", time.process_time()
        trdlab.report(
            agent,
            out=out,
            step=explained.step,
            episodes=0,
            others=given.others,
            max_steps=given.steps,
        )
        seconds, page = time.process_time() - begun, out.read_bytes()
    axis = agent.estimator.time_axis
    print(
        f"{given.agent}, {given.steps:,} steps, {len(agent.action_names)} actions, "
        f"{axis.num_components} components: {len(page) / 1e6:.1f} MB in {seconds:.0f} s of a core"
    )
    for name, piece in _pieces(page).items():
        print(f"  {name:<12} {piece / 1e6:5.2f} MB")


def _pieces(page: bytes) -> dict[str, int]:
    """Returns how many bytes the largest pieces of a page take."""
    ends = {"pictures": b'"texts":', "maps": b',"components":', "numbers": b"</script>"}
    begins = {"pictures": b'"pictures":', "maps": b'"maps":', "numbers": b'"components":'}
    sizes = {}
    for name, begin in begins.items():
        start = page.index(begin)
        sizes[name] = page.index(ends[name], start) - start
    return sizes | {"all else": len(page) - sum(sizes.values())}


if __name__ == "__main__":
    main()
