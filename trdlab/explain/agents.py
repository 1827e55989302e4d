"""The agent that is explained: an estimator, the policy it describes, and where it acts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trdlab.decomposition import TimeAxis
from trdlab.environments import Environments
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.explain.copies import CopyableGymEnvironments, ModelEnvironments
from trdlab.explain.counterfactual import play_to
from trdlab.explain.episodes import AS_PAID, Counting, Policy, decide
from trdlab.explain.moment import Moment, moment_of
from trdlab.explain.tabular import gridworld_moment
from trdlab.gridworld import Gridworld, load_map, map_names
from trdlab.runs.folder import RunFolder, is_run
from trdlab.tabular import ExactTable, exact

if TYPE_CHECKING:
    from trdlab.deep.settings import TrainSettings

GRIDWORLD = "gridworld:"
"""What stands before the name of a map, or its file, where an agent is named."""

Make = Callable[[int, int], Environments]
"""From the number of environments and their seed to the environments."""


@dataclass(frozen=True, eq=False)
class Agent:
    """What is explained.

    Args:
        name: what people call it.
        estimator: what it expects.
        action_names: A names.
        make: makes the environments that it acts in.
        policy: what the estimator describes, where that is not its own greedy policy.
        counting: which rewards it counts, and what ends its future.
        world: the gridworld that it is the exact table of; None if it was learned.
        seconds_per_step: how long one of its steps takes as people play, if that is known.
    """

    name: str
    estimator: Estimator
    action_names: tuple[str, ...]
    make: Make
    policy: Policy | None = None
    counting: Counting = AS_PAID
    world: Gridworld | None = None
    seconds_per_step: float | None = None

    def action(self, name: str) -> str:
        """Returns the name of an action that is given by its name or its number."""
        known = self.action_names
        is_number = name not in known and name.isdecimal() and int(name) < len(known)
        return known[int(name)] if is_number else name

    def moment(self, *, seed: int = 0, step: int = 0) -> Moment:
        """Returns what the agent expects at a step of an episode that its policy plays.

        Args:
            seed: of the episode.
            step: how many steps have been taken.

        Raises:
            InputError: the episode is over by then, or the step is negative.
        """
        if step < 0:
            raise InputError(f"The step is {step}.", "Steps are counted from 0.")
        environments = self.make(1, seed)
        try:
            stack = play_to(self.estimator, environments, step, policy=self.policy, seed=seed)
        finally:
            environments.close()
        if self.world is not None and isinstance(self.estimator, ExactTable):
            return gridworld_moment(self.world, self.estimator, int(stack.observations[0]))
        chosen = decide(self.estimator, stack.observations, self.policy).probabilities[0]
        moment = moment_of(self.estimator, stack.observations[0], self.action_names)
        policy = np.asarray(chosen, dtype=np.float64)
        return replace(moment, policy=policy, seconds_per_step=self.seconds_per_step)


def gridworld_agent(map_name: str, time_axis: TimeAxis, *, env: str | None = None) -> Agent:
    """Returns the exact table of a gridworld as an agent that acts optimally in it.

    Args:
        map_name: the name of a built-in map, or a file; `gridworld:` may stand before it.
        time_axis: γ, N and w.
        env: another map to act in instead, with as many states.

    Raises:
        InputError: a map cannot be read, or the other one does not fit.
    """
    world = Gridworld(load_map(map_name.removeprefix(GRIDWORLD)))
    table = exact(world.mdp, time_axis)
    there = world if env is None else _other_map(world, env)
    rows, columns = there.grid.shape
    limit = max(100, 4 * rows * columns, 4 * time_axis.num_steps)

    def make(num_envs: int, seed: int) -> Environments:
        names = there.action_names
        return ModelEnvironments(
            there.mdp, num_envs, seed=seed, time_limit=limit, action_names=names
        )

    return Agent(
        name=world.grid.name,
        estimator=table,
        action_names=world.action_names,
        make=make,
        policy=lambda states: table.solution.policy[states],
        world=world,
    )


def _other_map(world: Gridworld, env: str) -> Gridworld:
    if not env.startswith(GRIDWORLD) and not Path(env).is_file():
        raise InputError(
            f"'{env}' is no gridworld, and the agent is the exact table of one.",
            f"Give {GRIDWORLD}NAME, or a map file.",
        )
    other = Gridworld(load_map(env.removeprefix(GRIDWORLD)))
    if other.mdp.shape != world.mdp.shape:
        raise InputError(
            f"'{env}' does not fit the agent: it has {other.mdp.num_states} states, and the agent "
            f"knows {world.mdp.num_states}.",
            "Give a map with the same states, such as the same one with another slip.",
        )
    return other


def run_agent(
    path: Path,
    *,
    step: int | None = None,
    env: str | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns the agent of a run, with the environments it was trained in or others that fit.

    Args:
        path: the run's folder.
        step: of an older checkpoint, in agent steps.
        env: another environment to act in, of the same kind.
        env_arguments: what to make the other one with, as `KEY=VALUE`.

    Raises:
        InputError: there is no run or no such checkpoint, or the environment does not fit.
        TrdlabError: something is torn.
    """
    from trdlab.deep.settings import TrainSettings
    from trdlab.training.loading import load
    from trdlab.training.setup import use_threads

    folder = RunFolder.open(path)
    settings = TrainSettings.from_config(folder.config, f"'{folder.path / 'config.toml'}'")
    if env is not None:
        settings = replace(settings, env=env, env_arg=tuple(env_arguments))
    elif env_arguments:
        raise InputError("The run says what its environment is made with.", "Give --env too.")
    use_threads(settings)
    estimator = load(path, step)

    def make(num_envs: int, seed: int) -> Environments:
        return _environments(settings, num_envs, seed)

    environments = make(1, 0)
    try:
        told = _fitting(environments, folder.manifest["environment"], settings.env)
    finally:
        environments.close()
    names = tuple(told["action_names"])
    per_second = told["frames_per_second"]
    return Agent(
        name=folder.path.name,
        estimator=estimator,
        action_names=names or tuple(f"action {i}" for i in range(told["num_actions"])),
        make=make,
        counting=Counting(settings.clip_rewards, settings.life_loss_ends),
        seconds_per_step=told["frame_skip"] / per_second if per_second else None,
    )


def _environments(settings: "TrainSettings", num_envs: int, seed: int) -> Environments:
    """Returns the environments of a run, such that their states can be copied where possible."""
    from trdlab.environments.arguments import parse_arguments
    from trdlab.training.setup import make_environments

    if settings.kind == "atari":
        return make_environments(settings, num_envs=num_envs, seed=seed)
    arguments = parse_arguments(settings.env_arg)
    return CopyableGymEnvironments(settings.env, num_envs, seed=seed, env_arguments=arguments)


def _fitting(
    environments: Environments, learned: Mapping[str, Any], name: str
) -> Mapping[str, Any]:
    """Returns what is known of environments, if an agent sees and can do there what it learned."""
    from trdlab.training.setup import describe

    found = describe(environments)
    for what, key, say in (
        ("observations", "observation", _say_observation),
        ("actions", "num_actions", str),
    ):
        if found[key] != learned[key]:
            raise InputError(
                f"'{name}' does not fit the agent: its {what} are {say(found[key])}, those of the "
                f"agent {say(learned[key])}.",
                "Give an environment with the same ones.",
            )
    return found


def _say_observation(observation: Mapping[str, Any]) -> str:
    if "states" in observation:
        return f"{observation['states']} states"
    return f"{'×'.join(map(str, observation['shape'])) or '1'} {observation['dtype']}"


def find_agent(
    name: str,
    *,
    time_axis: TimeAxis | None = None,
    step: int | None = None,
    env: str | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns an agent by its name: a run's folder, `gridworld:NAME`, or a map file.

    Args:
        name: of the agent.
        time_axis: of an exact table, by default γ = 0.95, N = 4, w = 1; a run has its own.
        step: of an older checkpoint of a run.
        env: an environment to act in instead of its own.
        env_arguments: what to make that one with.

    Raises:
        InputError: there is no such agent, or something does not fit it.
        TrdlabError: a run is torn.
    """
    path = Path(name)
    if name.startswith(GRIDWORLD) or (path.is_file() and not is_run(path)):
        if step is not None or env_arguments:
            given = "--checkpoint" if step is not None else "--env-arg"
            raise InputError(f"{given} is for runs, and '{name}' is a map.", "Leave it out.")
        return gridworld_agent(name, time_axis or TimeAxis(0.95, 4), env=env)
    if name in map_names() and not path.exists():
        raise InputError(f"There is no run '{name}'.", f"For the map: {GRIDWORLD}{name}")
    if time_axis is not None:
        raise InputError("A run has its own γ, N and w.", "Leave out --gamma, --N and --w.")
    return run_agent(path, step=step, env=env, env_arguments=env_arguments)
