"""Agents: who acts, where, and what it expects; and what their names mean."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.agents.agent import Agent, find_agent, gridworld_agent, run_agent, tabular_agent

__all__ = [
    "Agent",
    "find_agent",
    "gridworld_agent",
    "run_agent",
    "tabular_agent",
]

_HOMES = {
    "Agent": "agent",
    "find_agent": "agent",
    "gridworld_agent": "agent",
    "run_agent": "agent",
    "tabular_agent": "agent",
}

__getattr__ = lazily(__name__, _HOMES)
