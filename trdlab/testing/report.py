"""What a check has found out."""

from dataclasses import dataclass

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.estimator import Future
from trdlab.testing.audits import ExactAudit, LawAudit


@dataclass(frozen=True, eq=False)
class EstimatorReport:
    """What was found out about an estimator that keeps the contract.

    Args:
        estimator: the name of its class.
        time_axis: what its components mean.
        future: whose future it tells.
        num_actions: A.
        checked: what was checked, in order.
        batch_difference: how far an observation alone, in a batch and in another order gives other
            components, relative to the largest component.
        repeat_difference: how far the same question gives another answer, likewise.
        empty_batch: whether a batch of no observation is answered, rather than refused.
        law: its own word now against its own word w steps later.
        exact: every state against the exact model; None where there is none.
        no_model: why there is none.
        suspicions: what it was warned about.
    """

    estimator: str
    time_axis: TimeAxis
    future: Future
    num_actions: int
    checked: tuple[str, ...]
    batch_difference: float
    repeat_difference: float
    empty_batch: bool
    law: LawAudit
    exact: ExactAudit | None
    no_model: str
    suspicions: tuple[str, ...]

    def __str__(self) -> str:
        axis, law = self.time_axis, self.law
        chance = "without chance" if law.without_chance else "chance included"
        said = [
            f"{self.estimator}: γ = {axis.gamma:g}, N = {axis.horizon}, w = {axis.width}, "
            f"{self.num_actions} actions, the future of {self.future.policy}",
            f"contract: kept ({len(self.checked)} points); alone or in a batch: "
            f"{self.batch_difference:.1g} apart",
            f"law, on {law.windows} windows of a rollout, {chance}: "
            + (f"off by up to {_listed(law.largest_error)}" if law.windows else "not compared"),
        ]
        if self.exact is None:
            said.append(f"exact: not compared. {self.no_model}")
        else:
            said.append(
                f"exact, in {len(self.exact.states)} states, against {self.exact.whose}: off by "
                f"up to {_listed(self.exact.largest_error)}"
            )
        return "\n".join([*said, *(f"suspicious: {text}" for text in self.suspicions)])


def _listed(errors: FloatArray) -> str:
    """Returns one number per component, the first few where there are many."""
    shown = ", ".join(f"{error:.2g}" for error in errors[:6])
    return shown if len(errors) <= 6 else f"{shown}, … (most: {errors.max():.2g})"
