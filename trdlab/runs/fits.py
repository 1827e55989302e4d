"""Where the fit of a run's agent lies: in the folder of the run, with which it moves."""

from pathlib import Path

from trdlab.runs.folder import is_run

_FITS = "fits"


def fit_path(run: Path, step: int) -> Path:
    """Returns the folder, in that of a run, for the fit of one of its checkpoints."""
    return run / _FITS / f"{step:09d}"


def run_of(fit: Path) -> tuple[Path, int] | None:
    """Returns the run in whose folder a fit lies, and which checkpoint was fitted; or None."""
    folder = fit.absolute().parent
    if folder.name == _FITS and fit.name.isdecimal() and is_run(folder.parent):
        return folder.parent, int(fit.name)
    return None
