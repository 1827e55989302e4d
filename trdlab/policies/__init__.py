"""Policies: who acts, with memory where there is some."""

from trdlab.policies.protocol import Policy, ask, rows
from trdlab.policies.ready import EpsilonGreedy, Greedy, Memoryless, Who, acting, greedy

__all__ = [
    "EpsilonGreedy",
    "Greedy",
    "Memoryless",
    "Policy",
    "Who",
    "acting",
    "ask",
    "greedy",
    "rows",
]
