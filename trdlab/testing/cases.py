"""Golden decompositions: models with their right answers, for any implementation to be held to."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from trdlab.arrays import FloatArray, IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, closest
from trdlab.estimator import Future
from trdlab.files import read_json
from trdlab.tabular import MDP
from trdlab.tabular.mdp import as_policy
from trdlab.testing.asking import ContractError

GOLDEN_SCHEMA = "trdlab.Golden/1"

_FOLDER = Path(__file__).parent / "goldens"
_COLUMNS = ("state", "action", "next_state", "probability", "reward", "terminated")


@dataclass(frozen=True, eq=False)
class Golden:
    """A model, a policy, and the right components of that policy's future.

    Args:
        name: of the case, and of its file.
        title: what it is there for.
        mdp: the model; S states, A actions.
        policy: `[S, A]`, whose future it is, also where optimal actions tie.
        future: that policy in words.
        states: `[M]`, the states that are answered for.
        decomposition: `[M, A, N+1]`, the answer, right to about 1e-12.
        environment: the id of the environment that the model was taken from, empty if none.
        arguments: what that was made with.

    Raises:
        InputError: the answer is not one of these states and actions.
    """

    name: str
    title: str
    mdp: MDP
    policy: FloatArray
    future: Future
    states: IntArray
    decomposition: RewardDecomposition
    environment: str
    arguments: Mapping[str, Any]

    def __post_init__(self) -> None:
        if self.decomposition.shape != (*self.states.shape, self.mdp.num_actions):
            raise InputError(
                f"The decomposition is of shape {self.decomposition.shape}, for "
                f"{self.states.size} states and {self.mdp.num_actions} actions.",
                "Give [M, A, N+1].",
            )

    @property
    def time_axis(self) -> TimeAxis:
        """γ, N and w."""
        return self.decomposition.time_axis

    def to_dict(self) -> dict[str, Any]:
        """Returns plain data at full precision, as it stands in the file."""
        mdp = self.mdp
        values = (
            mdp.transition_states,
            mdp.transition_actions,
            mdp.next_states,
            mdp.probabilities,
            mdp.rewards,
            mdp.terminated,
        )
        columns = {name: column.tolist() for name, column in zip(_COLUMNS, values, strict=True)}
        return {
            "schema": GOLDEN_SCHEMA,
            "name": self.name,
            "title": self.title,
            "environment": {"id": self.environment, "arguments": dict(self.arguments)}
            if self.environment
            else None,
            "model": {
                "num_states": mdp.num_states,
                "num_actions": mdp.num_actions,
                "start": mdp.start,
                "transitions": columns,
            },
            "future": self.future.to_dict(),
            "policy": self.policy.tolist(),
            "states": self.states.tolist(),
            "decomposition": self.decomposition.to_dict(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Returns the case that `to_dict` wrote.

        Raises:
            InputError: another schema, or a field is missing or holds something else.
        """
        if data.get("schema") != GOLDEN_SCHEMA:
            raise InputError(
                f"The schema is {data.get('schema')!r}.", f"This version reads {GOLDEN_SCHEMA!r}."
            )
        try:
            mdp, source = _model(data["model"]), data["environment"] or {"id": "", "arguments": {}}
            return cls(
                name=data["name"],
                title=data["title"],
                mdp=mdp,
                policy=as_policy(data["policy"], mdp.shape),
                future=Future.from_dict(data["future"]),
                states=np.array(data["states"], dtype=np.int64),
                decomposition=RewardDecomposition.from_dict(data["decomposition"]),
                environment=source["id"],
                arguments=source["arguments"],
            )
        except KeyError as error:
            raise InputError(f"The field {error} is missing.", "Write it with to_dict.") from error
        except (TypeError, ValueError, IndexError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"A field holds something else than it should: {error}.", "Write it with to_dict."
            ) from error


def golden_names() -> tuple[str, ...]:
    """Returns the names of the golden decompositions.

    >>> golden_names()[:3]
    ('chain', 'drone', 'drone-n0')
    """
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.json")))


def golden(name: str) -> Golden:
    """Returns a golden decomposition.

    Raises:
        InputError: there is none of that name.

    >>> case = golden("drone")
    >>> case.decomposition[case.mdp.start, 1].components.round(2).tolist()  # down
    [0.95, 1.76, 0.81]
    """
    if name not in golden_names():
        raise InputError(
            f"There is no golden decomposition '{name}'.", closest(name, golden_names())
        )
    return Golden.from_dict(read_json(_FOLDER / f"{name}.json"))


def check_against_golden(
    decompose: Callable[[IntArray], RewardDecomposition | npt.ArrayLike],
    name: str,
    *,
    tolerance: float = 1e-9,
) -> FloatArray:
    """Holds an implementation against a golden decomposition.

    Args:
        decompose: from states `[M]` to their components `[M, A, N+1]`, such as the `decompose` of
            an estimator made for `golden(name).mdp`, `policy` and `time_axis`.
        name: of the golden decomposition.
        tolerance: the largest error of a component that passes, in discounted reward.

    Returns:
        `[N+1]`, the largest error of each component.

    Raises:
        ContractError: an error exceeds `tolerance`, or the answer has another shape or time axis.
        InputError: there is no golden decomposition of that name.

    >>> from trdlab.tabular import exact
    >>> case = golden("drone")
    >>> table = exact(case.mdp, case.time_axis, policy=case.policy)
    >>> bool(check_against_golden(table.decompose, "drone").max() < 1e-12)
    True
    """
    case = golden(name)
    answer, expected = decompose(case.states.copy()), case.decomposition.components
    if isinstance(answer, RewardDecomposition):
        if answer.time_axis != case.time_axis:
            raise ContractError(
                f"'{name}' was answered on {answer.time_axis}.", f"It needs {case.time_axis}."
            )
        answer = answer.components
    components = np.asarray(answer, dtype=np.float64)
    if components.shape != expected.shape:
        raise ContractError(
            f"'{name}' was answered with shape {components.shape}.",
            f"It must be [M, A, N+1] = {expected.shape}.",
        )
    errors = np.abs(components - expected)
    row, action, i = np.unravel_index(errors.argmax(), errors.shape)
    if not errors[row, action, i] <= tolerance:  # NaN is no answer
        raise ContractError(
            f"'{name}', state {case.states[row]}, action {action}: component {i} is "
            f"{components[row, action, i]:.12g}, and should be {expected[row, action, i]:.12g}.",
            f"It is the future of {case.future.policy}.",
        )
    return np.asarray(errors.max(axis=(0, 1)))


def _model(data: Mapping[str, Any]) -> MDP:
    """Returns the model of a file; its transitions may stand in any order."""
    columns = {name: np.array(data["transitions"][name]) for name in _COLUMNS}
    rows = columns["state"] * data["num_actions"] + columns["action"]
    order = np.argsort(rows, kind="stable")
    counts = np.bincount(rows, minlength=data["num_states"] * data["num_actions"])
    return MDP(
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        next_states=columns["next_state"][order].astype(np.int64),
        probabilities=columns["probability"][order].astype(np.float64),
        rewards=columns["reward"][order].astype(np.float64),
        terminated=columns["terminated"][order].astype(np.bool_),
        num_actions=data["num_actions"],
        start=data["start"],
    )
