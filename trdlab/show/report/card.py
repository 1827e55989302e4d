"""The card of an agent: who it is, where it acts, and whose future its forecasts tell."""

from trdlab.agents.agent import Agent
from trdlab.environments.arguments import parse_arguments, say_arguments
from trdlab.explanations.words import counted


def card(agent: Agent) -> list[tuple[str, str]]:
    """Returns a row for everything that is known about an agent."""
    axis, future, there = agent.estimator.time_axis, agent.estimator.future, agent.interface
    origin, about = agent.origin, getattr(agent.policy, "about", None)
    where = "" if origin is None else origin.env
    made = "" if origin is None else say_arguments(parse_arguments(origin.env_arguments))
    seconds = agent.seconds_per_step
    rows = [
        ("agent", agent.name),
        ("kind", about.title if about is not None else ""),
        ("acts in", f"{where} with {made}" if made else where),
        ("sees", there.seen),
        ("can do", there.done),
        ("a step takes", "" if seconds is None else f"{seconds:.2g} s of play"),
        ("looks ahead", _ahead(axis.horizon, axis.width)),
        ("discount", f"γ = {axis.gamma:.12g} for each step that a reward comes later"),
        ("whose future", f"after the first action, {future.policy} acts"),
        ("counts", future.reward),
        ("up to", future.ending),
    ]
    return [row for row in rows if row[1]]


def _ahead(horizon: int, width: int) -> str:
    """Returns how far ahead it tells when reward comes.

    >>> _ahead(40, 1), _ahead(1, 1), _ahead(4, 5), _ahead(0, 1)
    ('40 steps one by one, then the rest', '1 step, then the rest', \
'20 steps in groups of 5, then the rest', 'only all of it together')
    """
    if not horizon:
        return "only all of it together"
    steps = counted(horizon * width, "step")
    how = f" in groups of {width}" if width > 1 else " one by one" if horizon > 1 else ""
    return f"{steps}{how}, then the rest"
