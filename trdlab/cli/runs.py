"""`trdlab runs`: what lies in a folder of runs, at a glance."""

from pathlib import Path
from typing import Annotated

import typer

from trdlab.cli import common


def runs(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where runs are kept.")] = Path(
        "runs"
    ),
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Draw their scores: .png, .pdf or .svg.")
    ] = None,
    overwrite: common.Overwrite = False,
    verbose: common.Verbose = False,
) -> None:
    """List the runs in a folder: what they learn, how far they are, and their score."""
    from trdlab.runs import list_runs
    from trdlab.show.training import runs_page

    if plot is not None:
        from trdlab.show.plots.style import check_picture

        check_picture(plot, overwrite=overwrite)
    found = list_runs(folder)
    if not found:
        common.new_console()[0].print(
            f"There are no runs in '{folder}'.", soft_wrap=True, markup=False
        )
        return
    common.print_text(runs_page(found))
    if plot is not None:
        from trdlab.show.plots.training import curves_figure

        common.save_picture(curves_figure([run.path for run in found if run.fault is None]), plot)
