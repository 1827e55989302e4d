"""Testing an estimator of one's own: against the contract, the law, and right answers."""

from trdlab.testing.asking import ContractError
from trdlab.testing.audits import ExactAudit, LawAudit
from trdlab.testing.cases import (
    GOLDEN_SCHEMA,
    Golden,
    check_against_golden,
    golden,
    golden_names,
)
from trdlab.testing.contract import EstimatorWarning, check_estimator
from trdlab.testing.report import EstimatorReport

__all__ = [
    "GOLDEN_SCHEMA",
    "ContractError",
    "EstimatorReport",
    "EstimatorWarning",
    "ExactAudit",
    "Golden",
    "LawAudit",
    "check_against_golden",
    "check_estimator",
    "golden",
    "golden_names",
]
