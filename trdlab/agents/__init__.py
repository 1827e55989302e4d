"""Agents: who acts, where, and what it expects; and what their names mean."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.agents.agent import Agent
    from trdlab.agents.exact import gridworld_agent, model_agent, tabular_agent
    from trdlab.agents.naming import find_agent, find_pair
    from trdlab.agents.runs import run_agent

__all__ = [
    "Agent",
    "find_agent",
    "find_pair",
    "gridworld_agent",
    "model_agent",
    "run_agent",
    "tabular_agent",
]

_HOMES = {
    "Agent": "agent",
    "find_agent": "naming",
    "find_pair": "naming",
    "gridworld_agent": "exact",
    "model_agent": "exact",
    "run_agent": "runs",
    "tabular_agent": "exact",
}

__getattr__ = lazily(__name__, _HOMES)
