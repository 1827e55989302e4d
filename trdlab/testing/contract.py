"""The check: everything about an Estimator that can be seen from outside."""

import warnings
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Estimator, Future
from trdlab.policies import Who
from trdlab.tabular import MDP
from trdlab.testing.asking import Asking, ContractError, difference
from trdlab.testing.audits import ExactAudit, audit_exact, audit_law, matching_model
from trdlab.testing.report import EstimatorReport
from trdlab.testing.rollout import discrete_actions, play

_STEPS = 64  # of random play, for observations
_ASKED = 16  # of those, the observations that are asked about in every way


class EstimatorWarning(UserWarning):
    """An estimator keeps the contract, and yet something about it looks like a mistake."""


def check_estimator(
    estimator: Estimator,
    env: gym.Env[Any, Any],
    *,
    policy: Who | None = None,
    reference: RewardDecomposition | None = None,
    tolerance: float | None = None,
    precision: float = 1e-4,
    seed: int = 0,
) -> EstimatorReport:
    """Checks an estimator against the contract, and against all that is known about the answer.

    The first breach of the contract is raised. What is allowed but looks like a mistake is a
    warning. How far the components are from the law and from the exact model is no part of the
    contract, for whatever learns is off by something: it is in the report, and only if a
    `tolerance` is given does an error beyond it count as a failure.

    The exact answer is that of the policy the estimator describes. Without `policy` this is its
    own greedy one: what its components claim is then held against what would really follow.

    Args:
        estimator: what to check.
        env: an environment whose observations it takes; it is reset and stepped, not closed. It
            should pay what the estimator counts, and end where its future ends.
        policy: whose future the estimator tells, from observations `[B, ...]` to action
            probabilities `[B, A]`, if that is not its own greedy policy.
        reference: `[S, A, N+1]`, what it ought to say of each state of the model, if that is not
            the future of a policy (see `trdlab.tabular.operator_table`).
        tolerance: the largest error of a component, in discounted reward, that passes.
        precision: how far rows may depend on their batch, relative to the largest component.
        seed: of the environment and of the actions in it.

    Raises:
        ContractError: the estimator breaks the contract, or an error exceeds `tolerance`.
        InputError: `env` is no environment with discrete actions, or a `tolerance` or `reference`
            is given where there is no exact model.

    >>> from trdlab.gridworld.env import GridworldEnv
    >>> from trdlab.tabular import exact
    >>> env = GridworldEnv("drone")
    >>> table = exact(env.mdp, TimeAxis(0.95, horizon=2, width=2))
    >>> report = check_estimator(table, env, tolerance=1e-12)
    >>> len(report.exact.states), report.law.windows, report.batch_difference
    (12, 219, 0.0)
    """
    actions = discrete_actions(env)
    axis, future = _nouns(estimator)
    asking = Asking(estimator, env.observation_space, int(actions.n), axis)
    rng = np.random.default_rng(seed)
    rollout = play(env, lambda _: int(rng.integers(actions.n)), _STEPS, seed)
    mdp, no_model = matching_model(env, rollout)
    _check_options(mdp, no_model, reference, tolerance, axis)

    asked = rollout.observations[:: _STEPS // _ASKED]
    said = asking.components(asked)  # [B, A, N+1]
    repeated = _repetition(asking, asked, said, precision)
    apart = _batching(asking, asked, said, precision)
    empty = _empty_batch(asking)
    _other_shapes(asking, asked)
    suspicions = tuple(_suspicions(asking, asked, said, repeated))
    for text in suspicions:
        warnings.warn(text, EstimatorWarning, stacklevel=2)

    law = audit_law(asking, env, policy, mdp, seed=seed)
    exact = None if mdp is None else audit_exact(asking, env, policy, mdp, reference)
    if exact is not None and tolerance is not None:
        _check_errors(exact, tolerance)
    return EstimatorReport(
        estimator=type(estimator).__name__,
        time_axis=axis,
        future=future,
        num_actions=asking.num_actions,
        checked=_CHECKED if isinstance(asking.batch(asked), np.ndarray) else _CHECKED[:-1],
        batch_difference=apart,
        repeat_difference=repeated,
        empty_batch=empty,
        law=law,
        exact=exact,
        no_model=no_model,
        suspicions=suspicions,
    )


_CHECKED = (
    "time_axis is a TimeAxis, future is a Future with words in it",
    "decompose gives a RewardDecomposition [B, A, N+1] on that axis: finite, floating, read-only",
    "it leaves the observations as they are",
    "the same question has the same answer, and an answer stays what it was",
    "an observation gives the same alone, in a batch, and in another order",
    "a batch of no observation is answered [0, A, N+1] or refused",
    "observations of another shape are refused, or answered entry by entry",
)


def _nouns(estimator: Any) -> tuple[TimeAxis, Future]:
    if not isinstance(estimator, Estimator):
        raise ContractError(
            f"A {type(estimator).__name__} is no Estimator.",
            "It needs time_axis, future and decompose(observations).",
        )
    axis, future = estimator.time_axis, estimator.future
    if not isinstance(axis, TimeAxis):
        raise ContractError(f"time_axis is {axis!r}.", "It must be a trdlab.TimeAxis.")
    if not isinstance(future, Future):
        raise ContractError(f"future is {future!r}.", "It must be a trdlab.Future.")
    if not future.policy.strip():
        raise ContractError(
            f"The policy of its future is {future.policy!r}.", "Say in words whose future it is."
        )
    return axis, future


def _check_options(
    mdp: MDP | None,
    no_model: str,
    reference: RewardDecomposition | None,
    tolerance: float | None,
    axis: TimeAxis,
) -> None:
    if mdp is None and (reference is not None or tolerance is not None):
        raise InputError(
            f"There is nothing exact to compare with. {no_model}",
            "Leave out tolerance and reference, or give the environment as the model knows it.",
        )
    if reference is not None and reference.time_axis != axis:
        raise InputError(
            f"The reference is on {reference.time_axis}, the estimator on {axis}.",
            "Solve it for the axis of the estimator.",
        )
    if mdp is not None and reference is not None and reference.shape != mdp.shape:
        raise InputError(
            f"The reference is of shape {reference.shape}, the model has {mdp.num_states} states "
            f"and {mdp.num_actions} actions.",
            "Give [S, A, N+1].",
        )
    if tolerance is not None and not tolerance >= 0.0:
        raise InputError(f"The tolerance is {tolerance}.", "It must be at least 0.")


def _repetition(asking: Asking, asked: Sequence[Any], said: FloatArray, precision: float) -> float:
    """Asks the same again, after another question; what was said first must stand."""
    kept = said.copy()
    asking.components(asked[::-1])
    if difference(said, kept) > 0.0:
        raise ContractError(
            "An answer changed when decompose was called again.",
            "Do not write into what has been returned.",
        )
    apart = difference(asking.components(asked), kept)
    if apart > precision:
        raise ContractError(
            f"The same observations gave other components when asked about again: "
            f"{apart:.3g} of the largest component apart.",
            "The answer must not depend on chance, nor on what was asked before.",
        )
    return apart


def _batching(asking: Asking, asked: Sequence[Any], said: FloatArray, precision: float) -> float:
    """Asks about each observation alone, in pairs, and about all in another order."""
    count = len(asked)
    order = np.random.default_rng(count).permutation(count)
    ways = {
        "alone": np.concatenate([asking.components([one]) for one in asked]),
        "in a batch of two": np.concatenate(
            [asking.components(asked[i : i + 2]) for i in range(0, count, 2)]
        ),
        "in another order": asking.components([asked[i] for i in order])[np.argsort(order)],
    }
    apart = {way: difference(answer, said) for way, answer in ways.items()}
    for way, how_far in apart.items():
        if how_far > precision:
            raise ContractError(
                f"Asked {way}, observations give other components than in a batch of {count}: "
                f"{how_far:.3g} of the largest component apart.",
                "No row may depend on the others (is a normalisation still in training mode?); "
                "or allow more through precision=.",
            )
    return max(apart.values())


def _empty_batch(asking: Asking) -> bool:
    """Returns whether a batch of no observation is answered."""
    answer = asking.answer(asking.batch([]))
    expected = (0, asking.num_actions, asking.time_axis.num_components)
    if answer is not None and answer.shape != expected:
        raise ContractError(
            f"A batch of no observation was answered with shape {answer.shape}.",
            f"Answer {expected}, or refuse it.",
        )
    return answer is not None


def _other_shapes(asking: Asking, asked: Sequence[Any]) -> None:
    """Gives what is no batch; a table may answer each entry of an array of any shape."""
    batch = asking.batch(asked)
    if not isinstance(batch, np.ndarray):
        return
    others = {"without the batch axis": batch[0], "with a second batch axis": batch[None]}
    if batch.ndim > 1:
        others["one entry too long"] = np.concatenate([batch, batch[..., -1:]], axis=-1)
    for how, other in others.items():
        answer = asking.answer(other)
        leading = np.shape(other)[: np.ndim(other) - batch.ndim + 1]
        entry_by_entry = (*leading, asking.num_actions, asking.time_axis.num_components)
        fits = answer is not None and answer.shape == entry_by_entry
        if answer is not None and not (fits and how != "one entry too long"):
            raise ContractError(
                f"Observations {how}, of shape {np.shape(other)} instead of {batch.shape}, were "
                f"answered with shape {answer.shape}.",
                "Refuse what is no batch [B, ...] of observations.",
            )


def _suspicions(
    asking: Asking, asked: Sequence[Any], said: FloatArray, repeated: float
) -> list[str]:
    """Returns what is allowed, and yet looks like a mistake."""
    found = []
    batch = asking.batch(asked)
    several = len(np.unique(batch, axis=0)) if isinstance(batch, np.ndarray) else 1
    if several > 1 and not np.ptp(said, axis=0).any():
        found.append(f"It says the same of {several} different observations.")
    if asking.num_actions > 1 and not np.ptp(said, axis=1).any():
        found.append(f"It says the same of all {asking.num_actions} actions.")
    if repeated > 0.0:
        found.append(f"Asked again, it is {repeated:.1g} of the largest component off.")
    if said.dtype == np.float16:
        found.append("Its components are float16, which keeps three digits.")
    space = asking.space
    if isinstance(space, gym.spaces.Discrete):
        outside = [int(space.start) - 1, int(space.start + space.n)]
        taken = [i for i in outside if asking.answer(np.array([i], dtype=space.dtype)) is not None]
        if taken:
            found.append(f"It answers for the observation {taken[0]}, which {space} does not have.")
    return found


def _check_errors(exact: ExactAudit, tolerance: float) -> None:
    row, action, i = np.unravel_index(np.abs(exact.errors).argmax(), exact.errors.shape)
    error = float(exact.errors[row, action, i])
    if abs(error) > tolerance:
        raise ContractError(
            f"Component {i} of action {action} in state {exact.states[row]} is {abs(error):.4g} "
            f"too {'high' if error > 0 else 'low'}, against {exact.whose}; the tolerance is "
            f"{tolerance:g}.",
            "The largest error of each component is in the report, without a tolerance.",
        )
