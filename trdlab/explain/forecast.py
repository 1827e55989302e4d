"""Forecast: what one action is expected to pay, and when."""

import numpy as np

from trdlab.explain.findings import (
    AllBeyond,
    CentreOfMass,
    EarnsNothing,
    Finding,
    FirstCost,
    FirstReward,
    FirstStepCost,
    FirstStepReward,
    Peak,
    ShareBeyond,
    one_sign,
)
from trdlab.explain.moment import Moment


def forecast(moment: Moment, action: str) -> tuple[Finding, ...]:
    """Returns when an action's first reward comes, its peak, its centre and what lies beyond N.

    Shares and centres are defined only where all components have one sign, and the centre only
    for w = 1; where they are not defined there is no finding.

    Args:
        moment: the decompositions of every action.
        action: the name of one.

    Raises:
        InputError: there is no such action.
    """
    axis, row = moment.time_axis, moment.components(action)
    explicit, value = row[:-1], float(row.sum())
    if not row.any():
        return (EarnsNothing(action),)
    if axis.horizon == 0:
        return ()
    if not explicit.any():
        return (AllBeyond(action, value, axis.horizon),)
    first = int(np.flatnonzero(explicit)[0])
    discounted = float(explicit[first])
    findings: list[Finding] = []
    if axis.width == 1 and axis.gamma > 0.0:
        reward = discounted / axis.gamma**first
        kind = FirstStepReward if discounted > 0.0 else FirstStepCost
        findings.append(kind(action, first, discounted, reward))
    else:
        findings.append((FirstReward if discounted > 0.0 else FirstCost)(action, first, discounted))
    if np.count_nonzero(explicit) > 1:
        peak = int(explicit.argmax())
        if explicit[peak] > 0.0:
            findings.append(Peak(action, peak, float(explicit[peak])))
        if axis.width == 1 and one_sign(explicit):
            centre = explicit @ np.arange(axis.horizon) / explicit.sum()
            findings.append(CentreOfMass(action, float(centre)))
    if one_sign(row) and row[-1] != 0.0:
        findings.append(ShareBeyond(action, float(row[-1] / value), axis.horizon))
    return tuple(findings)
