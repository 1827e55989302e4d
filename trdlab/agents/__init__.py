"""Agents: who acts, where, and what it expects; and what their names mean."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.agents.agent import Agent as Agent
    from trdlab.agents.naming import find_agent as find_agent
    from trdlab.agents.naming import find_pair as find_pair
    from trdlab.agents.naming import gridworld_agent as gridworld_agent
    from trdlab.agents.naming import tabular_agent as tabular_agent
else:
    __getattr__ = lazily(__name__)
