"""Totals without a discount, which need not exist."""

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP, as_policy
from trdlab.tabular.reach import reached
from trdlab.tabular.solve import solve_chain, transition_weights

_LONGEST = 1e12  # expected steps, beyond which rounding decides a total


def undiscounted_totals(mdp: MDP, policy: FloatArray) -> FloatArray:
    """Returns `[S, A]`: the expected total reward with γ = 1, NaN where no total exists.

    It is the total of the given policy, as that was chosen under γ < 1 (errata P9). A total
    exists where the policy, with probability 1, ends the episode or comes to where it is no
    longer paid. Where that is 10¹² steps away or more, rounding would decide: NaN as well.
    """
    weights = transition_weights(mdp, as_policy(policy, mdp.shape))
    rewards = mdp.per_state(weights * mdp.rewards)
    edge = (weights > 0.0) & ~mdp.terminated
    sources, targets = mdp.transition_states[edge], mdp.next_states[edge]
    terminates = mdp.per_state(weights * mdp.terminated) > 0.0
    pays = mdp.per_state(weights * np.abs(mdp.rewards)) > 0.0  # even if it is 0 on average
    paid = reached(pays, targets, sources)
    comes_to_an_end = reached(terminates | ~paid, targets, sources)
    endless = reached(~comes_to_an_end, targets, sources)
    values = np.where(endless, np.nan, 0.0)
    active = paid & ~endless
    if active.any():
        chain = weights * ~mdp.terminated
        try:
            steps = solve_chain(mdp, chain, np.ones(mdp.num_states), active)
            totals = solve_chain(mdp, chain, rewards, active)
            values[active] = np.where((steps >= 0.99) & (steps < _LONGEST), totals, np.nan)
        except InputError:
            values[active] = np.nan
    follows = np.where(mdp.continuation > 0.0, mdp.continuation * values[mdp.next_states], 0.0)
    return mdp.expected_rewards + mdp.per_action(follows)
