"""Making a Gymnasium environment by its id, and saying in one line why it cannot be made."""

import inspect
import sys
import warnings
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator

from trdlab.environments.arguments import say_arguments
from trdlab.environments.aside import aside
from trdlab.errors import InputError, NotImported, TrdlabError, closest

# By its name, as Gymnasium finds entry points: what registers our maps stands above this layer.
_REGISTERED_BY = {"trdlab": "trdlab.envs", "ALE": "ale_py"}
_EXTRAS = {"box2d": "trdlab[box2d]"}
_LISTED = 'python -c "import gymnasium; gymnasium.pprint_registry()" lists those that there are.'


@aside()
def make_environment(
    env_id: str,
    arguments: Mapping[str, Any] | None = None,
    *,
    known: Iterable[str] | None = None,
) -> gym.Env[Any, Any]:
    """Makes an environment by its Gymnasium id; what it prints goes to stderr.

    Args:
        env_id: such as `CartPole-v1`, or `module:id` to import a module first; trdlab's own maps,
            such as `trdlab/DroneGridworld-v0`, need no module.
        arguments: what to make it with, such as `{"is_slippery": False}`; `max_episode_steps`
            replaces the time limit that it was registered with.
        known: the ids that are suggested in place of a misspelt one; by default all there are.

    Raises:
        InputError: there is no such environment, it does not take the arguments, or something it
            needs is not installed.

    >>> make_environment("FrozenLake-v1", {"is_slippery": False}).observation_space
    Discrete(16)
    """
    given = dict(arguments or {})
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an old version was asked for by its number
            spec = _find(env_id, known)
            _check_arguments(spec, given)
            return gym.make(spec, disable_env_checker=True, **given)
    except TrdlabError:
        raise
    except gym.error.DependencyNotInstalled as error:
        raise InputError(*_missing(env_id, error)) from error
    except ImportError as error:
        raise InputError(
            f"{env_id} cannot be imported: {error}.", "Install what it needs, or check the id."
        ) from error
    except Exception as error:  # whatever can be raised in another's code
        made = f" with {say_arguments(given)}" if given else ""
        reason = str(error).partition(" was raised from the environment creator")[0]
        raise InputError(
            f"{env_id} cannot be made{made} ({type(error).__name__}: {reason}).",
            "Its documentation says what each argument takes.",
        ) from error


def import_named(module: str) -> None:
    """Imports a module that the user has named, also from the present folder.

    Raises:
        ImportError: there is none, or it cannot be imported.
    """
    here = str(Path.cwd())
    if here not in sys.path:  # as it is not for an installed command
        sys.path.append(here)  # last: nothing in it hides what is installed
    import_module(module)


def check_imported(env_id: str) -> None:
    """Refuses the environment of a run whose module has not been imported: it is code.

    Args:
        env_id: as the run's configuration has it; `MODULE:ENV_ID` needs a module.

    Raises:
        NotImported: it has not.

    >>> check_imported("CartPole-v1")
    >>> check_imported("mine:Maze-v0")
    Traceback (most recent call last):
    trdlab.errors.NotImported: The environment 'mine:Maze-v0' needs code that the run does not \
hold: the module 'mine'. If you trust it, import mine first.
    """
    module = env_id.rpartition(":")[0]
    if module and module not in sys.modules:
        raise NotImported(
            f"The environment '{env_id}' needs code that the run does not hold: the module "
            f"'{module}'.",
            module,
        )


def _find(env_id: str, known: Iterable[str] | None) -> Any:
    module, _, name = env_id.rpartition(":")
    if module:
        import_named(module)
    elif ours := _REGISTERED_BY.get(name.partition("/")[0]):
        import_module(ours)
    try:
        return gym.spec(name)
    except gym.error.Error as error:
        cause = f"There is no environment '{env_id}'."
        raise InputError(cause, _suggestion(env_id, known)) from error


def _suggestion(env_id: str, known: Iterable[str] | None) -> str:
    if known is not None:
        return closest(env_id, known)
    cure = closest(env_id, [spec.id for spec in gym.registry.values() if not _is_atari(spec)])
    return cure if cure.startswith("Did you mean") else f"{_LISTED} MODULE:ENV_ID imports others."


def _is_atari(spec: Any) -> bool:
    return str(spec.entry_point).startswith("ale_py")


def _missing(env_id: str, error: Exception) -> tuple[str, str]:
    """Returns cause and cure where something is not installed; Gymnasium's messages are long."""
    spec = gym.registry.get(env_id.rpartition(":")[2])
    parts = str(spec.entry_point).partition(":")[0].split(".") if spec is not None else []
    if parts[:2] != ["gymnasium", "envs"]:
        return f"{env_id} cannot be made: {error}.", "Install what it needs."
    extra = _EXTRAS.get(parts[2], f"gymnasium[{parts[2]}]")
    return f"{env_id} needs a package that is not installed.", f"Run: pip install '{extra}'"


def _check_arguments(spec: Any, given: Mapping[str, Any]) -> None:
    creator = spec.entry_point
    function = load_env_creator(creator) if isinstance(creator, str) else creator
    parameters = inspect.signature(function).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return
    for name, value in given.items():
        if name == "max_episode_steps":
            continue
        if name not in parameters:
            names = [known for known in parameters if known != "render_mode"]
            raise InputError(f"{spec.id} takes no argument '{name}'.", closest(name, names))
        if isinstance(parameters[name].default, bool) and not isinstance(value, bool):
            raise InputError(f"The argument {name} is '{value}'.", "It must be true or false.")
