"""Runs on a terminal: what one will take, what it has reached, and all of them at a glance."""

from collections.abc import Sequence
from pathlib import Path
from shlex import quote

import numpy as np
from rich.text import Text

from trdlab.atari.published import HUMAN, human_normalised
from trdlab.deep.lessons import Levels
from trdlab.deep.metrics import Standing
from trdlab.deep.settings import TrainSettings
from trdlab.errors import InputError
from trdlab.explanations.words import counted
from trdlab.formatting import decimals_for
from trdlab.rollouts.evaluation import Evaluation
from trdlab.runs import RunSummary, to_toml
from trdlab.runs.metrics import step_of
from trdlab.show.tables import Row, Table
from trdlab.show.text import columns, table_lines, wrapped
from trdlab.statistics import Estimate, bootstrap
from trdlab.training.setup import Plan


def plan_page(plan: Plan, origin: str = "") -> Text:
    """Returns the resolved configuration, where it is from, and what it will take."""
    lines = [
        to_toml(plan.settings.to_config()),
        *([origin] if origin else []),
        memory_line(plan.memory, plan.available),
        *updates_lines(plan.settings),
        f"Time: about {duration(plan.seconds)}, at {plan.steps_per_second:,.0f} agent steps a "
        f"second while learning (measured here, in a few seconds).",
        "Nothing was written: leave out --dry-run to train.",
    ]
    return Text("\n".join(lines))


def evaluation_page(
    evaluation: Evaluation, *, how: str = "greedy", width: int | None = None
) -> Text:
    """Returns what an agent reached: means, intervals if episodes differ, and how they ended.

    Args:
        evaluation: its episodes.
        how: it chose its actions.
        width: of the page; by default that of the terminal.
    """
    low, high = float(evaluation.returns.min()), float(evaluation.returns.max())
    decimals = _decimals(low, high)

    def estimate(name: str, of: Estimate) -> Row:
        interval = f"95 % interval {_span(of.low, of.high, decimals)}" if low < high else ""
        return name, _number(of.value, decimals), interval

    rows = (
        estimate("mean return", evaluation.mean),
        estimate("interquartile mean", evaluation.interquartile_mean),
        ("least and most", _span(low, high, decimals), ""),
        ("mean length", f"{evaluation.lengths.mean():,.1f} agent steps", _cut_off(evaluation)),
    )
    table, width = Table(("", "", ""), rows, "<<<"), width or columns()
    random = f", {evaluation.epsilon:.1%} random actions" if evaluation.epsilon else ""
    count = counted(len(evaluation.returns), "episode")
    head = f"{count}, {how}{random}, seed {evaluation.seed}"
    lines = wrapped(f"{head}; raw rewards, undiscounted", width)
    return Text("\n").join([*lines, *table_lines(table, width)])


def acts(settings: TrainSettings) -> str:
    """Returns how the agent of a run chooses its actions.

    >>> acts(TrainSettings("gym", "CartPole-v1"))
    'greedy'
    """
    if settings.distil != "policy":
        return "greedy"
    return "drawing from its policy head" if settings.draw else "by its policy head"


def _cut_off(evaluation: Evaluation) -> str:
    """Returns how many episodes were cut off, and after how many steps where all were alike."""
    cut, limit = evaluation.lengths[evaluation.truncated], evaluation.max_steps
    at = f" at step {limit:,}" if limit is not None and (cut == limit).all() else ""
    return f"{len(cut)} of {len(evaluation.lengths)} were cut off{at}" if len(cut) else ""


def runs_page(runs: Sequence[RunSummary], *, width: int | None = None) -> Text:
    """Returns a row for each run: what it learns, how far it is, its score; then what is wrong."""
    width = width or columns()
    heading = ("run", "environment", "N", "w", "steps", "score", "status")
    rows = [_row(run) for run in runs]
    lines = table_lines(Table(heading, tuple(cells for cells, _ in rows), "<<>>>><"), width)
    for (name, *_), fault in rows:
        lines += [Text(), *wrapped(f"{name}: {fault}", width)] if fault else []
    return Text("\n").join(lines)


def _row(run: RunSummary) -> tuple[Row, str]:
    """Returns the cells of a run, and what is wrong with it, if anything is."""
    name = run.path.name
    unreadable = (name, "", "", "", "", "", "cannot be read")
    if run.fault:
        return unreadable, run.fault
    if run.is_fit:
        cells = [str(run.config.get(of, "")) for of in ("N", "w", "steps")]
        env = run.config.get("env") or run.config.get("agent", "")
        status = f"a fit, {run.step or 0:,} updates" if run.pid is None else "fitting"
        return (name, env, *cells, "", status), ""
    try:
        settings = TrainSettings.from_config(run.config, "Its config.toml")
    except InputError as error:
        return unreadable, str(error)
    score = run.metrics.get("score")
    steps = max(run.step or 0, step_of(run.metrics) if run.metrics else 0)
    told = "" if score is None else _number(score, _decimals(score))
    axis = (str(settings.horizon), str(settings.width))
    status = _status(run, settings.clock_end)
    return (name, settings.env, *axis, f"{steps:,}", told, status), ""


def _status(run: RunSummary, total: int) -> str:
    """Returns how a run stands, in a few words."""
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


def teacher_line(settings: TrainSettings, levels: Levels) -> str:
    """Returns whom a run learns from, what that one reaches, and what is learned of it.

    >>> settings = TrainSettings("gym", "CartPole-v1", teacher="agents/ppo.zip", distil="policy")
    >>> teacher_line(settings, Levels(teacher=500.0, chance=22.5))
    'Teacher: ppo.zip reaches 500.0, random actions 22.5. A policy head learns what it does.'
    """
    decimals = _decimals(levels.teacher, levels.chance)
    reached = f"reaches {_number(levels.teacher, decimals)}"
    how = "A policy head learns what it does."
    if settings.distil == "values":
        how = "The components learn what it thinks actions are worth."
    return (
        f"Teacher: {Path(settings.teacher or '').name} {reached}, random actions "
        f"{_number(levels.chance, decimals)}. {how}"
    )


def reached_line(mean: float, middle: float, levels: Levels) -> str:
    """Returns how far an agent has come on the way from chance to its teacher.

    Args:
        mean: its mean return.
        middle: its interquartile mean.
        levels: chance and teacher.

    >>> reached_line(380.0, 404.0, Levels(teacher=500.0, chance=20.0))[-73:]
    'to its teacher (500.0) it has come 75 % (by the interquartile mean 80 %).'
    """
    ends = (_number(of, _decimals(of)) for of in (levels.chance, levels.teacher))
    way = "Of the way from random actions ({}) to its teacher ({}) it has come".format(*ends)
    come = (f"{100.0 * levels.share(of):.0f} %" for of in (mean, middle))
    return "{} {} (by the interquartile mean {}).".format(way, *come)


def human_line(game: str, mean: float) -> str:
    """Returns what a score is beside that of a person; empty where none was published.

    >>> human_line("Breakout", 110.5)
    'Random actions reach 1.7, a person 31.8 (Mnih et al., 2015): it has come 3.6 times as far.'
    >>> human_line("Tetris", 1.0)
    ''
    """
    share = human_normalised(game, mean)
    if share is None:
        return ""
    random, human = (f"{of:,g}" for of in HUMAN[game])
    much = f"{share:.2g} times as far" if share >= 1.0 else f"{max(share, 0.0):.0%} of the way"
    told = f"Random actions reach {random}, a person {human} (Mnih et al., 2015)"
    return f"{told}: it has come {much}.".replace("%", " %")


def updates_lines(settings: TrainSettings) -> list[str]:
    """Returns a line that says that a run will learn nothing; none where it will.

    >>> updates_lines(TrainSettings("gym", "CartPole-v1", agent_steps=900))
    ['Nothing will be learned: updates begin after 1,000 agent steps, and the run ends after 900.']
    """
    if settings.updates_due(settings.agent_steps) or settings.teacher is not None:
        return []
    return [
        f"Nothing will be learned: updates begin after {settings.learning_starts:,} agent steps, "
        f"and the run ends after {settings.agent_steps:,}."
    ]


def stopped_line(standing: Standing) -> str:
    """Returns where a run was stopped.

    >>> stopped_line(Standing(8_448, 100_000, "steps"))
    'Stopped and saved at 8,448 agent steps.'
    >>> stopped_line(Standing(300, 5_000, "offline updates"))
    'Stopped and saved at 300 offline updates.'
    """
    what = "agent steps" if standing.what == "steps" else standing.what
    return f"Stopped and saved at {standing.done:,} {what}."


def longer_line(settings: TrainSettings, agent_steps: int) -> str:
    """Returns how long a run is that was told to take more steps, and what follows from it.

    >>> longer_line(TrainSettings("gym", "CartPole-v1", learning_rate_end=0.0), 50_000)
    'It takes 100,000 agent steps now; its learning rate is 0.0005 again, and falls to 0 by then.'
    """
    line = f"It takes {settings.agent_steps:,} agent steps now"
    if settings.learning_rate_end is None:
        return f"{line}."
    rate = settings.learning_rate_at(agent_steps)
    return (
        f"{line}; its learning rate is {rate:.3g} again, and falls to "
        f"{settings.learning_rate_end:.3g} by then."
    )


def best_line(path: Path, step: int, best: int | None, *, episodes: int = 0) -> str:
    """Returns where an earlier checkpoint was better than the last; empty if none was.

    Args:
        path: of the run.
        step: of the last checkpoint.
        best: of the best one; None if no checkpoint has a score.
        episodes: that were played to score each, so that the best is the run's agent.

    >>> best_line(Path("runs/pole"), 100, 80), best_line(Path("runs/pole"), 100, 100)
    ('Its score was better at 80 agent steps: that checkpoint is kept as runs/pole@best.', '')
    >>> best_line(Path("runs/pole"), 100, 80, episodes=20)
    'Its agent is that of 80 agent steps, the best in 20 episodes; the last is runs/pole@100.'
    """
    if best is None or best == step:
        return ""
    run = quote(str(path))
    if episodes:
        return (
            f"Its agent is that of {best:,} agent steps, the best in {episodes:,} episodes; "
            f"the last is {run}@{step}."
        )
    return f"Its score was better at {best:,} agent steps: that checkpoint is kept as {run}@best."


def chance_line(agent: Evaluation, chance: Evaluation, cure: str) -> str:
    """Returns a line that says so where an agent was not better than chance; else nothing.

    Episodes that begin alike are compared, and the mean of the differences has an interval (95 %).

    Args:
        agent: how it did.
        chance: how random actions did, in episodes from the same seeds.
        cure: what may help.
    """
    differences = agent.returns - chance.returns
    gained = bootstrap(differences, rng=np.random.default_rng(agent.seed))
    if gained.low > 0.0:
        return ""
    mean = float(chance.returns.mean())
    reached = f"random actions reach {_number(mean, _decimals(mean))} in as many episodes"
    if gained.high < 0.0:
        return f"It plays worse than chance: {reached}. {cure}"
    return f"Nothing shows that it plays better than chance: {reached}. {cure}"


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
    return f"{nbytes / 1e9:.2f} GB" if nbytes >= 1e9 else f"{nbytes / 1e6:.2f} MB"


def _decimals(*values: float) -> int:
    """Returns the decimals of scores: those of CartPole need fewer than those of FrozenLake."""
    return 1 if max(map(abs, values)) >= 10.0 else decimals_for(values)


def _span(low: float, high: float, decimals: int) -> str:
    return f"{_number(low, decimals)} … {_number(high, decimals)}"


def _number(value: float, decimals: int) -> str:
    return f"{value:,.{decimals}f}" if abs(value) < 1e6 else f"{value:.3e}"
