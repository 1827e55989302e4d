"""What an agent is: who trained it, what it sees and does, and what it computes."""

from rich.text import Text

from trdlab.agents.agent import Agent
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
    about, there = getattr(agent.policy, "about", None), agent.interface
    rows = [
        ("agent", about.title if about else agent.name),
        ("sees", there.seen),
        ("does", there.done),
        ("network", ", ".join(filter(None, (about.layers, about.activation))) if about else ""),
        ("memory", f"{about.memory} numbers" if about and about.memory else ""),
        ("gamma", f"{about.gamma:g}" if about and about.gamma is not None else ""),
        ("acts", _ACTS[how]),
        ("expects", "" if agent.is_fitted else "nobody knows yet: fit it"),
    ]
    told = tuple(row for row in rows if row[1])
    return Text("\n").join(table_lines(Table(("", ""), told, "<<"), width or columns()))
