"""Makes of a run what comes with trdlab: its agent and its fit, without what training needs.

Weights are kept in half precision. What comes out is played and judged, and that stands in a card
beside it; so do the components as they were learned with the policy. Of the teacher the name of its
file stays, its sha256, and where it is from. It takes some minutes for a game.

    python benchmarks/ship.py runs/breakout --origin "greydanus/baby-a3c, MIT"
    python benchmarks/ship.py                   # a table of all that comes with trdlab
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

import trdlab
from trdlab.agents.agent import Agent
from trdlab.agents.naming import find_agent
from trdlab.atari.published import human_normalised
from trdlab.errors import InputError
from trdlab.runs import RunFolder, load_checkpoint, read_metrics, save_checkpoint, to_toml
from trdlab.runs.folder import CONFIG, MANIFEST
from trdlab.runs.pretrained import SHIPPED
from trdlab.training.fitted import fit_path
from trdlab.training.loading import chosen_step, evaluate_run, own_fit, run_settings
from trdlab.training.teaching import levels_noted

CARD = "card.json"
SHOWN = (0, 5, 20, 39)


def main() -> None:
    options = _options()
    if options.run is None:
        print(table(options.out))
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
    """Returns how far an agent's forecasts can be trusted, and the skill of single ones."""
    found = trdlab.calibrate(agent).calibration
    skill = found.skill
    shown = [k for k in SHOWN if k < len(skill.value)]
    return {
        "trusted to": found.trust.last_step,
        "above zero": [bool(low > 0.0) for low in skill.low[: agent.estimator.time_axis.horizon]],
        "skill": {
            f"t+{k}": [float(of[k]) for of in (skill.value, skill.low, skill.high)] for k in shown
        },
    }


def table(folder: Path) -> str:
    """Returns a row for each agent that comes with trdlab, in Markdown."""
    lines = [
        "| game | teacher | its score | score of 30 games | teacher-normalised | trusted to | skill"
        " at t, t+5, t+20, t+39 | learned with the policy |",
        "|---|---|--:|--:|--:|--:|---|---|",
    ]
    for game in sorted(path.parent.name for path in folder.glob(f"*/{CARD}")):
        of = json.loads((folder / game / CARD).read_text(encoding="utf-8"))
        cells = [game, of["teacher"]["origin"], f"{of['teacher']['score']:.1f}"]
        cells += ["{value:.1f} ({low:.1f} … {high:.1f})".format(**of["mean"])]
        cells += [f"{of['teacher-normalised']:.2f}", f"t+{of['fitted']['trusted to']}"]
        for which in ("fitted", "joint"):
            cells.append(" · ".join(f"{value:.2f}" for value, _, _ in of[which]["skill"].values()))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, nargs="?")
    parser.add_argument("--origin", help="Of its teacher: where from, and under which licence.")
    parser.add_argument("--out", type=Path, default=SHIPPED)
    return parser.parse_args()


if __name__ == "__main__":
    main()
