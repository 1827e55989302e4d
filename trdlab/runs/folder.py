"""The folder of a run: how it is made, opened and named."""

import json
import platform
import re
import shlex
import sys
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, Self

from trdlab.errors import InputError, OutputError, TrdlabError, closest
from trdlab.files import check_own, read_json, write_json, write_whole
from trdlab.policies.functions import PYTHON
from trdlab.runs.config import Config, read_config, to_toml
from trdlab.runs.lock import hold

FORMAT = 1
"""Of the run folder; a change that older versions cannot read raises it."""
PACKAGES = ("numpy", "torch", "gymnasium", "ale-py", "lz4", "safetensors")
CONFIG, MANIFEST = "config.toml", "manifest.json"
STEPS, EXTENDED = "agent_steps", "extended"
"""What a run can be told anew, and where the manifest lists when it was."""


@dataclass(frozen=True)
class RunFolder:
    """The folder of a run.

    Args:
        path: the folder.
        config: what the run was told to do.
        manifest: what it was made with: versions, command, start.
    """

    path: Path
    config: dict[str, Any]
    manifest: dict[str, Any]

    @classmethod
    def create(
        cls, path: Path, config: Config, manifest_extra: Mapping[str, Any] | None = None
    ) -> Self:
        """Makes the folder, all of it or nothing.

        Args:
            path: where; there may be an empty folder.
            config: what the run is told to do.
            manifest_extra: plain values to add to the manifest, such as a teacher's sha256.

        Raises:
            InputError: the configuration cannot be written as TOML.
            OutputError: there is something already, or it cannot be written.
        """
        config_text = to_toml(config)
        manifest = {**new_manifest(), **(manifest_extra or {}), "config": config}
        manifest_text = json.dumps(manifest, indent=1)
        check_free(path)

        def write(folder: Path) -> None:
            folder.mkdir()
            for name in ("checkpoints", "replay", "evaluations"):
                (folder / name).mkdir()
            (folder / CONFIG).write_text(config_text, encoding="utf-8")
            (folder / MANIFEST).write_text(manifest_text + "\n", encoding="utf-8")

        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, write)
        except OSError as error:
            reason = error.strerror or error
            raise OutputError(
                f"Cannot make '{path}': {reason}.", "Choose another `out`."
            ) from error
        except OutputError:
            check_free(path)  # another process may have made it meanwhile
            raise
        return cls.open(path)

    @classmethod
    def open(cls, path: Path) -> Self:
        """Reads a run's configuration and manifest.

        Raises:
            InputError: there is no run here, or its configuration was changed since it began.
            TrdlabError: it is torn, or was written by a version whose format is another.
        """
        if not is_run(path):
            what = f"The folder '{path}' holds no run" if path.is_dir() else f"There is no '{path}'"
            runs = [run.name for run in run_paths(path.parent)]
            cure = closest(path.name, runs) if runs else "Name the folder that `trdlab train` made."
            raise InputError(f"{what}.", cure)
        try:
            manifest = read_json(path / MANIFEST)
            _check_format(path, manifest)
            config = read_config(path / CONFIG)
        except InputError as error:  # the file is the run's, not the user's
            raise TrdlabError(error.cause, "Put it right, or begin another run.") from error
        _check_unchanged(path, config, manifest)
        return cls(path, config, manifest)

    def extended(self, agent_steps: int, at: int) -> Self:
        """Tells the run to take more agent steps than before, and its manifest that it was told.

        The manifest comes first, and `config.toml` decides: whatever happens in between, the run
        can be opened, and is as long as it was. Comments in the configuration stay.

        Args:
            agent_steps: to take in all.
            at: those taken before.

        Raises:
            OutputError: it cannot be written.
        """
        now = new_manifest()
        told = {"agent_steps": agent_steps, "at": at, "command": now["command"]}
        told["when"] = now["started"]
        before = self.manifest.get(EXTENDED, [])
        write_json(self.path / MANIFEST, {**self.manifest, EXTENDED: [*before, told]})
        config = self.path / CONFIG
        text = _with_steps(config.read_text(encoding="utf-8"), self.config, agent_steps)
        write_whole(config, lambda path: path.write_text(text, encoding="utf-8"))
        return self.open(self.path)

    @property
    def metrics(self) -> Path:
        """The file with the metrics, see `MetricsFile`."""
        return self.path / "metrics.jsonl"

    @property
    def checkpoints(self) -> Path:
        """The folder with the checkpoints."""
        return self.path / "checkpoints"

    @property
    def replay(self) -> Path:
        """The folder with the blocks that checkpoints share."""
        return self.path / "replay"

    @property
    def evaluations(self) -> Path:
        """The folder with the results of evaluations."""
        return self.path / "evaluations"

    @property
    def tensorboard(self) -> Path:
        """The folder with the metrics for TensorBoard."""
        return self.path / "tensorboard"

    @property
    def resume_command(self) -> str:
        """The command that goes on with it, which names all code that it needs."""
        module = str(self.config.get("env", "")).rpartition(":")[0]
        teacher = str(self.config.get("teacher", ""))
        words = ["trdlab", "resume", str(self.path), *(("--import", module) if module else ())]
        words += ["--teacher", teacher] if teacher.startswith(PYTHON) else []
        return shlex.join(words)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Holds the run for this process alone, to write to it (see `trdlab.runs.lock.hold`).

        Raises:
            TrdlabError: another process holds it.
            OutputError: it cannot be written; or a part of it is a link, behind which nothing is
                ever written, cut or deleted.
        """
        parts = (self.metrics, self.checkpoints, self.replay, self.evaluations, self.tensorboard)
        for part in parts:
            check_own(part)
        for checkpoint in self.checkpoints.glob("*"):
            check_own(checkpoint)
        with hold(self.path):
            yield


def new_manifest() -> dict[str, Any]:
    """Returns what a run that begins now is made with."""
    program = Path(sys.argv[0])
    name = program.parent.name if program.name == "__main__.py" else program.name
    return {
        "format": FORMAT,
        "trdlab": _version("trdlab"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": {package: _version(package) for package in PACKAGES},
        "command": shlex.join([name, *sys.argv[1:]]),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def check_free(path: Path) -> None:
    """Checks that a run can be made here.

    Raises:
        OutputError: there is something already.
    """
    if is_run(path):
        raise OutputError(
            f"'{path}' holds a run already.",
            f"Go on with it: trdlab resume {shlex.quote(str(path))}, or choose another `out`.",
        )
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        kind = "is not empty" if path.is_dir() else "is a file"
        raise OutputError(f"'{path}' {kind}.", "Choose another `out`.")


def is_run(path: Path) -> bool:
    """Returns whether this is the folder of a run, be it torn."""
    return (path / MANIFEST).exists() or (path / CONFIG).exists()


def is_fit(path: Path) -> bool:
    """Returns whether this is the folder of a fit, and not of a training run."""
    if not is_run(path):
        return False
    try:
        manifest = read_json(path / MANIFEST)
    except TrdlabError:
        return False
    return isinstance(manifest, dict) and "fit" in manifest


def run_paths(parent: Path) -> list[Path]:
    """Returns the folders of runs in a folder, by name."""
    paths = sorted(parent.iterdir()) if parent.is_dir() else []
    return [path for path in paths if path.name[0] != "." and is_run(path)]


def _check_format(path: Path, manifest: Any) -> None:
    written = manifest.get("format") if isinstance(manifest, dict) else None
    if not isinstance(written, int):
        raise TrdlabError(f"'{path / MANIFEST}' is torn: it does not say its format.")
    if written != FORMAT:
        author = manifest.get("trdlab")
        raise TrdlabError(
            f"The run '{path}' has format {written}, written by trdlab {author}; "
            f"this is trdlab {_version('trdlab')}, which reads format {FORMAT}.",
            f"Use trdlab {author}{' or newer' if written > FORMAT else ''}.",
        )


def _check_unchanged(path: Path, now: dict[str, Any], manifest: dict[str, Any]) -> None:
    """Refuses a run that was told something else than its configuration says now."""
    then = manifest.get("config")
    if not isinstance(then, dict):
        raise TrdlabError(f"'{path / MANIFEST}' is torn: it does not say what the run was told.")
    if now.get(STEPS) in _later_steps(path, manifest):
        then = then | {STEPS: now[STEPS]}
    changed = [key for key in then | now if then.get(key) != now.get(key)]
    if changed:
        key = changed[0]
        said, was = (repr(of[key]) if key in of else "nothing" for of in (now, then))
        raise InputError(
            f"'{path / CONFIG}' says {key} = {said}, and the run began with {was}.",
            "Put it back, or begin another run with that file.",
        )


def _later_steps(path: Path, manifest: dict[str, Any]) -> list[Any]:
    """Returns the agent steps that a run was told to take after it had begun."""
    try:
        return [told[STEPS] for told in manifest.get(EXTENDED, [])]
    except (TypeError, LookupError) as error:
        raise TrdlabError(
            f"'{path / MANIFEST}' is torn: its '{EXTENDED}' is no list of what was told."
        ) from error


def _with_steps(text: str, config: dict[str, Any], agent_steps: int) -> str:
    r"""Returns a configuration with other agent steps, and all else as somebody wrote it.

    >>> _with_steps("N = 4\nagent_steps = 1e5  # many\n", {"N": 4, "agent_steps": 1e5}, 200)
    'N = 4\nagent_steps = 200  # many\n'
    """
    wanted = {**config, STEPS: agent_steps}
    edited = re.sub(rf"(?m)^({STEPS}[ \t]*=[ \t]*)[^\s#]+", rf"\g<1>{agent_steps}", text, count=1)
    try:
        return edited if tomllib.loads(edited) == wanted else to_toml(wanted)
    except tomllib.TOMLDecodeError:
        return to_toml(wanted)


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
