"""Totals without a discount, which need not exist."""

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.errors import InputError
from trdlab.tabular.chains import UNIT, chain_of
from trdlab.tabular.mdp import MDP, as_policy
from trdlab.tabular.reach import reached

_LONGEST = 1e12  # expected steps, beyond which rounding decides a total


def undiscounted_totals(mdp: MDP, policy: FloatArray) -> FloatArray:
    """Returns `[S, A]`: the expected total reward with γ = 1, NaN where no total exists.

    It is the total of the given policy, as that was chosen under γ < 1 (errata P9). A total
    exists where the policy, with probability 1, ends the episode or comes to where it is no
    longer paid. Where that is 10¹² steps away or more, rounding would decide: NaN as well.
    """
    policy = as_policy(policy, mdp.shape)
    weights = policy[mdp.transition_states, mdp.transition_actions] * mdp.probabilities  # [K]
    edge = (weights > 0.0) & ~mdp.terminated
    sources, targets = mdp.transition_states[edge], mdp.next_states[edge]
    terminates = mdp.per_state(weights * mdp.terminated) > 0.0
    pays = mdp.per_state(weights * np.abs(mdp.rewards)) > 0.0  # even if it is 0 on average
    paid = reached(pays, targets, sources)
    comes_to_an_end = reached(terminates | ~paid, targets, sources)
    endless = reached(~comes_to_an_end, targets, sources)
    values, active = np.zeros(mdp.num_states), paid & ~endless
    if active.any():
        values[active] = _totals_among(mdp, policy, active)
    values[reached(endless | np.isnan(values), targets, sources)] = np.nan
    follows = np.where(mdp.continuation > 0.0, mdp.continuation * values[mdp.next_states], 0.0)
    return mdp.expected_rewards + mdp.per_action(follows)


def _totals_among(mdp: MDP, policy: FloatArray, active: BoolArray) -> FloatArray:
    """Returns the totals of the active states, from which the others pay nothing any more."""
    chain, once = chain_of(mdp, policy, 1.0, active), np.ones(int(active.sum()))
    rewards = (policy * mdp.expected_rewards).sum(axis=1)[active]
    try:
        steps, totals = chain.solve(once), chain.solve(rewards)
    except InputError:  # the chain is singular
        return once * np.nan
    if (rewards < 0.0).any() and (rewards > 0.0).any():  # what rounding can make of 0 is 0
        size = chain.solve(chain.solve(np.abs(rewards)))
        totals = np.where(np.abs(totals) <= 8 * (4 + chain.terms) * UNIT * size, 0.0, totals)
    error = once + chain.ahead(steps) - steps  # as a share of the steps, too
    known = (np.abs(error) < 0.01) & (steps >= 0.99) & (steps < _LONGEST)
    return np.where(known, totals, np.nan)
