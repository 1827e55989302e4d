"""Runs on a terminal: what one will take, what it has reached, and all of them at a glance."""

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from trdlab.evaluation import Evaluation
from trdlab.runs import RunSummary, to_toml
from trdlab.show.text import fit
from trdlab.statistics import Estimate
from trdlab.training.setup import Plan


def plan_page(plan: Plan, *, ascii_only: bool = False) -> RenderableType:
    """Returns the resolved configuration, and the memory and time that it will take."""
    lines = [
        to_toml(plan.settings.to_config()),
        memory_line(plan.memory, plan.available),
        f"Time: about {duration(plan.seconds)}, at {plan.steps_per_second:,.0f} agent steps a "
        f"second while learning (measured here, in a few seconds).",
        "Nothing was written: leave out --dry-run to train.",
    ]
    return Text(fit("\n".join(lines), ascii_only=ascii_only))


def evaluation_page(evaluation: Evaluation, *, ascii_only: bool = False) -> RenderableType:
    """Returns what an agent reached: means with intervals, and how the episodes ended."""
    count, cut = len(evaluation.returns), int(evaluation.truncated.sum())
    table = Table(box=None, padding=(0, 3, 0, 0), show_header=False, pad_edge=False)
    for name, of in (
        ("mean return", evaluation.mean),
        ("interquartile mean", evaluation.interquartile_mean),
    ):
        interval = f"95 % interval {_interval(of)}"
        table.add_row(name, _number(of.value), fit(interval, ascii_only=ascii_only))
    low, high = evaluation.returns.min(), evaluation.returns.max()
    span = f"{_number(low)} … {_number(high)}"
    table.add_row("least and most", fit(span, ascii_only=ascii_only), "")
    length = f"{evaluation.lengths.mean():,.1f} agent steps"
    table.add_row("mean length", length, f"{cut} of {count} were cut off" if cut else "")
    random = f", {evaluation.epsilon:.1%} random actions" if evaluation.epsilon else ""
    head = f"{count} episodes, greedy{random}, seed {evaluation.seed}; raw rewards, undiscounted"
    return Group(Text(fit(head, ascii_only=ascii_only)), table)


def runs_table(runs: Sequence[RunSummary], *, ascii_only: bool = False) -> RenderableType:
    """Returns a row for each run: what it learns, how far it is, and its score."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold", pad_edge=False)
    for column in ("run", "environment", "N", "w", "steps", "score", "status"):
        table.add_column(
            column, justify="right" if column in ("N", "w", "steps", "score") else "left"
        )
    for run in runs:
        if run.fault is not None:
            row = [run.path.name, "", "", "", "", "", run.fault]
        else:
            config, score = run.config, run.metrics.get("score")
            steps = max(run.step or 0, run.metrics.get("agent_steps", 0))
            row = [
                run.path.name,
                str(config.get("env", "")),
                str(config.get("N", "")),
                str(config.get("w", "")),
                f"{steps:,}",
                "" if score is None else _number(score),
                status(run),
            ]
        table.add_row(*(Text(fit(cell, ascii_only=ascii_only)) for cell in row))
    return table


def status(run: RunSummary) -> str:
    """Returns how a run stands, in a few words."""
    total = run.config.get("agent_steps", 0)
    if run.pid is not None:
        return f"training (process {run.pid})" if run.pid else "training"
    if run.step is None:
        return "no checkpoint yet"
    if run.step >= total:
        return "done"
    return f"stopped at {run.step:,} of {total:,}"


def memory_line(needed: int, available: int | None) -> str:
    """Returns what a replay memory takes.

    >>> memory_line(2_100_000_000, 24_000_000_000)
    'Replay memory: up to 2.10 GB, of 24.00 GB that are free.'
    """
    free = "" if available is None else f", of {_gigabytes(available)} that are free"
    return f"Replay memory: up to {_gigabytes(needed)}{free}."


def duration(seconds: float) -> str:
    """Returns a time as people say it.

    >>> duration(42), duration(600), duration(20_000), duration(400_000)
    ('42 seconds', '10 minutes', '5.6 hours', '4.6 days')
    """
    for unit, name in ((86_400, "days"), (3_600, "hours"), (60, "minutes")):
        if seconds >= 1.5 * unit:
            return f"{seconds / unit:.2g} {name}"
    return "1 second" if seconds < 1.5 else f"{round(seconds)} seconds"


def _gigabytes(nbytes: float) -> str:
    return f"{nbytes / 1e9:.2f} GB" if nbytes >= 5e6 else f"{nbytes / 1e6:.2f} MB"


def _interval(of: Estimate) -> str:
    return f"{_number(of.low)} … {_number(of.high)}"


def _number(value: float) -> str:
    return f"{value:,.1f}" if abs(value) < 1e6 else f"{value:.3e}"
