"""Makes of a run what comes with trdlab: its agent and its fit, without what training needs.

Weights are kept in half precision. What comes out is played and judged, and that stands in a card
beside it; so do the components as they were learned with the policy. Of the teacher the name of its
file stays, its sha256, and where it is from. It takes some minutes for a game.

    python benchmarks/ship.py runs/breakout --origin "greydanus/baby-a3c, MIT"
    python benchmarks/ship.py --plot skills.png  # a table of all that comes with trdlab
"""

import argparse
import json
import platform
import re
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import trdlab
from trdlab.agents.agent import Agent
from trdlab.agents.naming import find_agent
from trdlab.atari.published import human_normalised
from trdlab.errors import InputError
from trdlab.runs import RunFolder, load_checkpoint, read_metrics, save_checkpoint, to_toml
from trdlab.runs.fits import fit_path
from trdlab.runs.folder import CONFIG, MANIFEST
from trdlab.runs.pretrained import SHIPPED
from trdlab.show.plots import style
from trdlab.training.loading import chosen_step, evaluate_run, own_fit, run_settings
from trdlab.training.teaching import levels_noted

CARD = "card.json"
SHOWN = (0, 5, 20, 39)


def main() -> None:
    options = _options()
    if options.run is None:
        print(table(options.out))
        if options.plot:
            style.save(skills(options.out), options.plot)
        return
    folder = RunFolder.open(options.run)
    game, step = run_settings(folder).env, chosen_step(folder)
    fit = own_fit(options.run, step)
    if fit is None:
        raise InputError(f"'{options.run}' has no fit yet.", f"Run: trdlab resume {options.run}")
    out = options.out / game
    shutil.rmtree(out, ignore_errors=True)
    shipped(folder, out, step, ("q_network",), options.origin)
    shipped(RunFolder.open(fit), fit_path(out, step), None, (), None)
    for path in sorted(out.rglob("*.safetensors")):
        print(f"{path.relative_to(options.out)}: {path.stat().st_size / 1e6:.2f} MB", flush=True)
    (out / CARD).write_text(json.dumps(card(out, options.run), indent=1) + "\n", encoding="utf-8")
    print(table(options.out))


def shipped(
    folder: RunFolder, out: Path, step: int | None, only: tuple[str, ...], origin: str | None
) -> None:
    """Copies a run or a fit with one checkpoint, its weights in half precision.

    Args:
        folder: of it.
        out: of the copy.
        step: of the checkpoint; by default the newest.
        only: what is copied of its state; by default all.
        origin: of its teacher.
    """
    checkpoint = load_checkpoint(folder, step)
    config, manifest = dict(folder.config), dict(folder.manifest)
    if "teacher" in config:
        config["teacher"] = Path(config["teacher"]).name
        noted = manifest["teacher"]
        manifest["teacher"] = {**noted, "name": Path(noted["name"]).name, "origin": origin}
    manifest["command"] = re.sub(r"\S*/", "", manifest["command"])
    manifest["platform"] = platform.system()
    manifest["config"] = config
    for name in ("checkpoints", "evaluations"):
        (out / name).mkdir(parents=True)
    (out / CONFIG).write_text(to_toml(config), encoding="utf-8")
    (out / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    shutil.copy(folder.metrics, out / folder.metrics.name)
    state = {name: of for name, of in checkpoint.state.items() if not only or name in only}
    state["q_network"] = {name: _half(of) for name, of in state["q_network"].items()}
    save_checkpoint(RunFolder.open(out), checkpoint.step, state)
    for empty in ("evaluations", "replay"):
        shutil.rmtree(out / empty, ignore_errors=True)


def _half(weights: Any) -> Any:
    """Returns matrices in half precision; a single row takes little, and may be large or small."""
    return weights.astype(np.float16) if weights.ndim > 1 else weights


def card(path: Path, run: Path) -> dict[str, Any]:
    """Plays and judges what is shipped, and returns all that is to be known of it.

    Args:
        path: what is shipped.
        run: of which it was made.
    """
    folder = RunFolder.open(path)
    result, _ = evaluate_run(path, episodes=30)
    settings, levels = run_settings(folder), levels_noted(folder)[0]
    fitted = find_agent(str(path))
    joint = find_agent(str(run), joint=True)  # as it was; the fit's agent acts in both
    rows = read_metrics(folder.metrics)
    return {
        "game": settings.env,
        "command": folder.manifest["command"],
        "trdlab": folder.manifest["trdlab"],
        "torch": folder.manifest["packages"]["torch"],
        "seconds": rows[-1]["seconds"],
        "teacher": folder.manifest.get("teacher"),
        "episodes": len(result.returns),
        "mean": asdict(result.mean),
        "interquartile mean": asdict(result.interquartile_mean),
        "teacher-normalised": levels.share(result.interquartile_mean.value),
        "human-normalised": human_normalised(settings.env, result.mean.value),
        "fitted": judged(fitted),
        "joint": judged(replace(fitted, estimator=joint.estimator)),
    }


def judged(agent: Agent) -> dict[str, Any]:
    """Returns how far an agent's forecasts can be trusted, and the skill of each component."""
    found = trdlab.calibrate(agent).calibration
    skill = {name: of[:-1].round(4).tolist() for name, of in asdict(found.skill).items()}
    return {"trusted to": found.trust.last_step, "skill": skill}


def table(folder: Path) -> str:
    """Returns a row for each agent that comes with trdlab, in Markdown."""
    lines = [
        "| game | teacher | its score | score of 30 games | teacher-normalised | trusted to | skill"
        " at t, t+5, t+20, t+39 | learned with the policy |",
        "|---|---|--:|--:|--:|--:|---|---|",
    ]
    for of in cards_in(folder):
        cells = [of["game"], of["teacher"]["origin"], f"{of['teacher']['score']:.1f}"]
        cells += ["{value:.1f} ({low:.1f} … {high:.1f})".format(**of["mean"])]
        cells += [f"{of['teacher-normalised']:.2f}", f"t+{of['fitted']['trusted to']}"]
        for which in ("fitted", "joint"):
            skill = of[which]["skill"]["value"]
            cells.append(" · ".join(f"{skill[k]:.2f}" for k in SHOWN if k < len(skill)))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


@style.settings()
def skills(folder: Path) -> Figure:
    """Returns a picture of how good forecasts are, step by step: a panel for each game."""
    cards = cards_in(folder)
    figure = style.new_figure(0.9 + 1.9 * len(cards))
    for ax, of in zip(figure.subplots(len(cards), 1, squeeze=False).flat, cards, strict=True):
        for which, colour in zip(("fitted", "joint"), style.AGENTS, strict=True):
            skill = of[which]["skill"]
            steps = range(len(skill["value"]))
            ax.plot(steps, skill["value"], color=colour)
            ax.fill_between(steps, skill["low"], skill["high"], color=colour, alpha=0.2, lw=0)
        ax.axhline(0.0, color=style.MUTED, lw=0.8)
        ax.set(title=of["game"], ylim=(-0.3, 1.0), ylabel="skill")
    ax.set_xlabel("steps from the action")
    told = zip(style.AGENTS, ("fitted afterwards", "learned with the policy"), strict=True)
    marks = [Line2D([], [], color=colour, label=label) for colour, label in told]
    style.add_legend(figure, marks, "1: perfect, 0: no better than a guess; with 95 % intervals")
    return figure


def cards_in(folder: Path) -> list[dict[str, Any]]:
    """Returns the cards of all agents in a folder, by the names of their games."""
    paths = sorted(folder.glob(f"*/{CARD}"))
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, nargs="?")
    parser.add_argument("--origin", help="Of its teacher: where from, and under which licence.")
    parser.add_argument("--plot", type=Path, help="Draw the skill of each step of all of them.")
    parser.add_argument("--out", type=Path, default=SHIPPED)
    return parser.parse_args()


if __name__ == "__main__":
    main()
