"""Agents as teachers of others, by their names."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from trdlab.agents.agent import Agent
from trdlab.agents.naming import find_agent
from trdlab.environments.arguments import parse_arguments, say_arguments
from trdlab.errors import InputError
from trdlab.policies import Policy, acting
from trdlab.policies.adapted import games_for
from trdlab.policies.functions import PYTHON
from trdlab.policies.hub import HUB, from_hub
from trdlab.runs import RunFolder, find_checkpoint
from trdlab.runs.folder import is_fit, is_run
from trdlab.runs.keeping import all_saved
from trdlab.runs.pretrained import is_shipped
from trdlab.tabular import ExactTable
from trdlab.training.loading import chosen_step
from trdlab.training.teaching import Candidate

if TYPE_CHECKING:
    from trdlab.deep.settings import TrainSettings

_WEIGHTS = "q_network.safetensors"


def find_teacher(settings: "TrainSettings") -> Candidate:
    """Returns the agent that a run's settings name as its teacher, where the run acts.

    Raises:
        InputError: there is no such agent, or it does not fit there.
    """
    name, file = _placed(str(settings.teacher))
    agent = find_agent(name, env=settings.env, env_arguments=settings.env_arg, joint=True)
    policy = acting(agent.policy or agent.estimator)
    by_estimate = agent.policy is None or isinstance(agent.estimator, ExactTable)
    if by_estimate:
        axis, future = agent.estimator.time_axis, agent.estimator.future
        on_scale = (axis.gamma, future.clip_rewards) == (settings.gamma, settings.clip_rewards)
    else:
        on_scale = getattr(policy, "gamma", None) in (None, settings.gamma)
    values = _sums(agent) if by_estimate else getattr(policy, "q_values", None)
    needs, beside = _of_games(settings, policy)
    return Candidate(name, file, policy, values, on_scale, needs, beside)


def _of_games(settings: "TrainSettings", policy: Policy) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Returns how a game is to be played for a teacher, and what is to be shown to it alone."""
    said = parse_arguments(settings.env_arg)
    wanted = {name: value for name, value in games_for(policy).items() if name not in said}
    words = {name: say_arguments({name: value}) for name, value in wanted.items()}
    beside = (words.pop("screens"),) if "screens" in words else ()
    return tuple(words.values()), beside


def _sums(agent: Agent) -> Any:
    return lambda observations: agent.estimator.decompose(observations).value


def _placed(name: str) -> tuple[str, Path | None]:
    """Returns a name that means the same agent from everywhere and for ever, and its file."""
    if name.startswith(PYTHON):
        source, _, function = name.removeprefix(PYTHON).rpartition(":")
        file = Path(source).resolve()
        return f"{PYTHON}{file}:{function}", file if file.is_file() else None
    first, comma, rest = name.partition(",")
    if first.startswith(HUB):
        return name, from_hub(first)
    if Path(first).is_file():
        file = Path(first).resolve()
        return f"{file}{comma}{rest}", file
    path, step = find_checkpoint(name)
    if not is_run(path):
        return name, None
    if is_fit(path):
        return str(path.resolve()), None
    folder = RunFolder.open(path.resolve())
    if step is None:  # it may be trained further meanwhile, and its agent become another one
        step = chosen_step(folder)
    saved = [of.folder for of in all_saved(folder) if of.step == step]
    if not saved:
        raise InputError(f"The teacher '{name}' has no checkpoint yet.", "Train it first.")
    return name if is_shipped(path) else f"{folder.path}@{step}", saved[-1] / _WEIGHTS
