"""What an agent is: who trained it, what it sees and does, and what it computes."""

from rich.text import Text

from trdlab.agents.agent import Agent
from trdlab.policies.adapted import About, sees_screens
from trdlab.show.tables import Table
from trdlab.show.text import columns, table_lines

_ACTS = {
    "greedy": "takes the action that it holds for the best",
    "sampled": "draws its actions, each as likely as it says",
}


def agent_page(agent: Agent, how: str, *, width: int | None = None) -> Text:
    """Returns a row for everything that is known about an agent.

    Args:
        agent: who acts, and where.
        how: it chooses its actions: `greedy` or `sampled`.
        width: of the page; by default that of the terminal.
    """
    about, there = getattr(agent.policy or agent.estimator, "about", None), agent.interface
    rows = [
        ("agent", about.title if about else agent.name),
        ("sees", _seen(agent)),
        ("does", there.done),
        ("network", ", ".join(filter(None, (about.layers, about.activation))) if about else ""),
        ("memory", f"{about.memory} numbers" if about and about.memory else ""),
        ("gamma", f"{about.gamma:g}" if about and about.gamma is not None else ""),
        ("acts", _ACTS[how]),
        ("expects", "" if agent.is_fitted else "nobody knows yet: fit it"),
    ]
    told = tuple(row for row in rows if row[1])
    return Text("\n").join(table_lines(Table(("", ""), told, "<<"), width or columns()))


def _seen(agent: Agent) -> str:
    """Returns what an agent looks at, and what a fit of it does if that is something else."""
    about: About | None = getattr(agent.policy, "about", None)
    if about is None or not sees_screens(agent.policy):
        return agent.interface.seen
    screen = "×".join(map(str, about.seen or ()))
    return f"the whole screen in colour, {screen}; a fit sees {agent.interface.seen}"
