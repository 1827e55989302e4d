"""Draws moments of an agent in the manner of the paper's figures 4, 5 and 7.

The screen stands on the left, and on the right the reward that is expected at each step, of one
action or of two and their difference. The agent is judged first, by other episodes, so that what
cannot be trusted is pale.

    python benchmarks/figures.py pretrained:Breakout 151 151:LEFT:RIGHT --out pictures
"""

import argparse
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

import trdlab
from trdlab.agents.naming import find_agent
from trdlab.explanations.calibration.claims import in_brief
from trdlab.explanations.explanation import Explanation
from trdlab.show.plots.seen import seen_figure
from trdlab.show.plots.style import save
from trdlab.show.video.sights import sights
from trdlab.time_axis import step_label


def main() -> None:
    options = _options()
    agent, report = find_agent(options.agent, env=options.env), None
    for moment in options.moments:
        step, action, foil = (*moment.split(":"), "", "")[:3]
        explained = trdlab.explain(
            agent,
            parts="forecast,episode",
            seed=options.seed,
            step=int(step),
            action=action or None,
            foil=foil or None,
            episodes=options.episodes if report is None else None,
            report=report,
            max_steps=options.max_steps,
        )
        if report is None and (report := explained.report) is not None:
            print(*(claim.sentence for claim in in_brief(report)), sep="\n")
        path = options.out / f"{options.name}-{moment.replace(':', '-')}.png".lower()
        draw(explained, path, is_alone=not foil)


def draw(explained: Explanation, path: Path, *, is_alone: bool) -> None:
    """Draws the moment of an explanation, and prints where."""
    choice, story = explained.choice, explained.story
    if choice is None or story is None:
        raise SystemExit("There is no such moment.")
    choice = replace(choice, foil=None) if is_alone else choice
    seen = sights(explained.agent, story.played.episode, explained.seed)
    picture = next(islice(seen, explained.step, None)).picture
    title = f"{explained.agent.name}, step {explained.step} of the episode with seed "
    path.parent.mkdir(parents=True, exist_ok=True)
    save(seen_figure(choice, picture, f"{title}{explained.seed}"), path)
    ahead = story.played.episode.rewards[explained.step :][: choice.time_axis.num_steps]
    came = ", ".join(step_label(step) for step in np.flatnonzero(ahead).tolist()) or "no step"
    print(f"{path.name}: reward came at {came}")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("agent")
    parser.add_argument("moments", nargs="+", metavar="STEP[:ACTION[:FOIL]]")
    parser.add_argument("--env")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=16)
    parser.add_argument("--max-steps", type=int, help="of these episodes, and of the one drawn")
    parser.add_argument("--name", default="moment", help="what the files begin with")
    parser.add_argument("--out", type=Path, default=Path("pictures"))
    return parser.parse_args()


if __name__ == "__main__":
    main()
