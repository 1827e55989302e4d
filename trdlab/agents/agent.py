"""The agent that is explained: an estimator, the policy it describes, and where it acts."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trdlab.agents.models import (
    GRIDWORLD,
    TABULAR,
    Model,
    World,
    gridworld_model,
    is_model,
    tabular_model,
)
from trdlab.agents.places import Make, Place, check_fits, find_place, refuse_arguments
from trdlab.decomposition import TimeAxis
from trdlab.environments.making import check_imported
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.gridworld import map_names
from trdlab.policies import Memoryless, Policy
from trdlab.rollouts.branches import Copying
from trdlab.rollouts.episodes import Episode, Recording
from trdlab.rollouts.playing import Watch, unwatched
from trdlab.runs.checkpoint import checkpoint_steps
from trdlab.runs.folder import RunFolder
from trdlab.tabular import exact
from trdlab.tabular.toytext import toy_text_ids

if TYPE_CHECKING:
    from trdlab.deep.settings import TrainSettings

AXIS = TimeAxis(0.95, 4)
"""Of an exact table, where nothing is said."""

_OF_TABLES, _OF_OTHERS = Copying(episodes=100), Copying()
_OF_GAMES = Copying(episodes=12, moments=2, copies=2, tries=10)  # a copy plays all of a game again
_DIGITS = 19  # more are no number of steps


@dataclass(frozen=True, eq=False)
class Agent:
    """What is explained.

    Args:
        name: what people call it.
        estimator: what it expects.
        action_names: A names.
        make: makes the environments that it acts in.
        policy: who acts, where that is not the estimator's greedy policy.
        world: what it is the exact table of; None if it was learned.
        seconds_per_step: how long one of its steps takes as people play, if that is known.
        words: what names it on the command line, and what `make` makes if that is not its own.
        place: the options that name what `make` makes.
        copying: how much is copied of its states, where nothing else is said.
    """

    name: str
    estimator: Estimator
    action_names: tuple[str, ...]
    make: Make
    policy: Policy | None = None
    world: World | None = None
    seconds_per_step: float | None = None
    words: tuple[str, ...] = ()
    place: tuple[str, ...] = ()
    copying: Copying = _OF_OTHERS

    @contextmanager
    def begin(self, count: int = 1, *, seed: int, **how: Any) -> Iterator[Recording]:
        """Begins episodes of the agent, to be played and paused as one likes, then closes them.

        Args:
            count: of the episodes, each in an environment of its own.
            seed: of the environments, and of the actions.
            how: as for `Recording`.
        """
        environments = self.make(count, seed)
        try:
            yield Recording(self.estimator, environments, policy=self.policy, seed=seed, **how)
        finally:
            environments.close()

    def play(
        self, count: int, *, watch: Watch = unwatched, what: str = "episodes", **how: Any
    ) -> tuple[Episode, ...]:
        """Returns whole episodes that the agent plays, each in an environment of its own.

        Args:
            count: of the episodes.
            watch: told how far they are, after every step.
            what: they are called then.
            how: as for `begin`.
        """
        with self.begin(count, **how) as recording:
            recording.play(watch=watch, what=what)
            return recording.episodes()

    def action(self, name: str) -> str:
        """Returns the name of an action that is given by its name or its number."""
        known = self.action_names
        is_number = name not in known and name.isdecimal() and int(name) < len(known)
        return known[int(name)] if is_number else name


def gridworld_agent(
    map_name: str,
    time_axis: TimeAxis,
    *,
    env: str | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns the exact table of a gridworld as an agent that acts optimally in it.

    Args:
        map_name: a built-in map, or a file, and after commas what to make it with, such as
            `ledge,slip=0.2`; `gridworld:` may stand before it.
        time_axis: γ, N and w.
        env: an environment to act in instead, with the same states (see `find_place`).
        env_arguments: what to make that one with.

    Raises:
        InputError: a map cannot be read, or the other environment does not fit.
    """
    called = GRIDWORLD + map_name.removeprefix(GRIDWORLD)
    return _exact_agent(called, gridworld_model(map_name), time_axis, env, env_arguments)


def tabular_agent(
    env_id: str,
    time_axis: TimeAxis,
    *,
    env: str | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns the exact table of an environment's model as an agent that acts optimally in it.

    Args:
        env_id: a Gymnasium environment with a transition table, and after commas what to make it
            with, such as `FrozenLake-v1,is_slippery=false`; `tabular:` may stand before it.
        time_axis: γ, N and w.
        env: an environment to act in instead, with the same states (see `find_place`).
        env_arguments: what to make that one with.

    Raises:
        InputError: there is no such environment, it has no table, or the other one does not fit.
    """
    called = TABULAR + env_id.removeprefix(TABULAR)
    return _exact_agent(called, tabular_model(env_id), time_axis, env, env_arguments)


def _exact_agent(
    called: str, model: Model, time_axis: TimeAxis, env: str | None, env_arguments: Sequence[str]
) -> Agent:
    place = Place(
        lambda num_envs, seed: model.environments(num_envs, seed, time_axis), ("--env", called)
    )
    if env is not None:
        place = find_place(env, env_arguments, time_axis)
        check_fits(place, model.world)
    else:
        refuse_arguments(called, env_arguments)
    table = exact(model.world.mdp, time_axis)
    return Agent(
        name=model.name,
        estimator=table,
        action_names=model.world.action_names,
        make=place.make,
        policy=Memoryless(lambda states: table.solution.policy[states]),
        world=model.world,
        words=(called, *_axis_words(time_axis), *(() if env is None else place.words)),
        place=place.words,
        copying=_OF_TABLES,
    )


def _axis_words(axis: TimeAxis) -> tuple[str, ...]:
    """Returns the options of an exact table's axis, but for what goes without saying."""
    own = (("--gamma", axis.gamma), ("--N", axis.horizon), ("--w", axis.width))
    usual = (AXIS.gamma, AXIS.horizon, AXIS.width)
    said = (pair for pair, value in zip(own, usual, strict=True) if pair[1] != value)
    return tuple(str(word) for pair in said for word in pair)


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
        env: another environment to act in (see `find_place`).
        env_arguments: what to make that one with, as `KEY=VALUE`.

    Raises:
        InputError: there is no run or no such checkpoint, or the environment does not fit.
        TrdlabError: something is torn.
    """
    from trdlab.deep.settings import TrainSettings
    from trdlab.training.loading import fitting, load
    from trdlab.training.setup import use_threads

    folder = RunFolder.open(path)
    settings = TrainSettings.from_config(folder.config, f"'{folder.path / 'config.toml'}'")
    if env_arguments and env is None:
        raise InputError("The run says what its environment is made with.", "Give --env too.")
    use_threads(settings)
    estimator = load(path, step)
    place = _place(settings, env, env_arguments)
    environments = place.make(1, 0)
    try:
        told = fitting(environments, folder, place.words[1])
    finally:
        environments.close()
    names = tuple(told["action_names"])
    at = "" if step is None else f"@{step}"
    per_second = told["frames_per_second"]
    module = settings.env.rpartition(":")[0]
    needed = ("--import", module) if module and env is None else ()
    return Agent(
        name=f"{folder.path.name}{at}",
        estimator=estimator,
        action_names=names or tuple(f"action {i}" for i in range(told["num_actions"])),
        make=place.make,
        seconds_per_step=told["frame_skip"] / per_second if per_second else None,
        words=(f"{path}{at}", *needed, *(() if env is None else place.words)),
        place=place.words,
        copying=_OF_GAMES if _is_atari(settings, env) else _OF_OTHERS,
    )


def _is_atari(settings: "TrainSettings", env: str | None) -> bool:
    return settings.kind == "atari" and (env is None or not is_model(env))


def _place(settings: "TrainSettings", env: str | None, env_arguments: Sequence[str]) -> Place:
    """Returns where the agent of a run acts: where it was trained, or in another environment."""
    from trdlab.training.setup import make_environments

    if env is None:
        check_imported(settings.env)
    own = (settings.env, settings.env_arg) if env is None else (env, tuple(env_arguments))
    place = find_place(*own, settings.time_axis)
    if not _is_atari(settings, env):
        return place
    there = replace(settings, env=own[0], env_arg=own[1])
    return Place(lambda num, seed: make_environments(there, num_envs=num, seed=seed), place.words)


def find_agent(
    name: str,
    *,
    time_axis: TimeAxis | None = None,
    env: str | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns an agent by its name.

    That is a run's folder, or `RUN@STEP` for an older checkpoint of it; or, for the exact table of
    a model, `gridworld:NAME`, a map file, or `tabular:ENV_ID`, each with what to make it with after
    commas, such as `gridworld:ledge,slip=0.2`.

    Args:
        name: of the agent.
        time_axis: of an exact table, by default γ = 0.95, N = 4, w = 1; a run has its own.
        env: an environment to act in instead of its own (see `find_place`).
        env_arguments: what to make that one with, as `KEY=VALUE`.

    Raises:
        InputError: there is no such agent, or something does not fit it.
        TrdlabError: a run is torn.
    """
    if is_model(name):
        of = tabular_agent if name.startswith(TABULAR) else gridworld_agent
        return of(name, time_axis or AXIS, env=env, env_arguments=env_arguments)
    _refuse_model(name)
    if time_axis is not None:
        raise InputError("A run has its own γ, N and w.", "Leave out --gamma, --N and --w.")
    path, step = _checkpoint(name)
    return run_agent(path, step=step, env=env, env_arguments=env_arguments)


def _refuse_model(name: str) -> None:
    """Refuses the name of a model without its kind, where no run is called that."""
    called = name.partition(",")[0]
    if Path(name).exists():
        return
    if called in map_names():
        raise InputError(f"There is no run '{name}'.", f"For the map: {GRIDWORLD}{name}")
    if called in toy_text_ids():
        raise InputError(f"There is no run '{name}'.", f"For the exact table: {TABULAR}{name}")


def _checkpoint(name: str) -> tuple[Path, int | None]:
    """Returns the folder of a run, and the step of the checkpoint that is named after an `@`."""
    folder, at, step = name.rpartition("@")
    if not at or not folder or Path(name).exists():
        return Path(name), None
    if step.isdecimal() and len(step) < _DIGITS:
        return Path(folder), int(step)
    steps = checkpoint_steps(RunFolder.open(Path(folder)))
    raise InputError(
        f"'{step}' is no step of a checkpoint of '{folder}'.",
        f"There are: {', '.join(map(str, steps))}." if steps else "There is none yet.",
    )
