"""Makes of a run what comes with trdlab: its agent and its fit, without what training needs.

Weights are kept in half precision, so evaluate and calibrate what comes out, not what went in. Of
the teacher the name of its file stays, its sha256, and where it is from.

    python benchmarks/ship.py runs/breakout --origin "greydanus/baby-a3c, MIT"
"""

import argparse
import json
import platform
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from trdlab.errors import InputError
from trdlab.runs import RunFolder, load_checkpoint, save_checkpoint, to_toml
from trdlab.runs.folder import CONFIG, MANIFEST
from trdlab.runs.pretrained import SHIPPED
from trdlab.training.fitted import fit_path
from trdlab.training.loading import chosen_step, own_fit, run_settings


def main() -> None:
    options = _options()
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
        print(f"{path.relative_to(options.out)}: {path.stat().st_size / 1e6:.2f} MB")


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
        manifest["teacher"] = {**manifest["teacher"], "origin": origin}
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


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("--origin", help="Of its teacher: where from, and under which licence.")
    parser.add_argument("--out", type=Path, default=SHIPPED)
    return parser.parse_args()


if __name__ == "__main__":
    main()
