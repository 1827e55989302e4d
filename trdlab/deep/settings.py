"""What a training run is told: every option once, with its help, for files and commands alike.

No torch here: options are read, listed and refused before anything heavy is imported.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, Self, get_args

from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError, closest

Kind = Literal["gym", "atari"]
Reduction = Literal["sum", "mean"]


@dataclass(frozen=True)
class UpdateSettings:
    """How to learn; the defaults are the paper's (Appendix B).

    Args:
        learning_rate: of Adam.
        target_sync_updates: the updates, not agent steps, between two copies of the network to
            the target network (errata C6).
        reduction: over components, see `td_loss`.
        double: whether the online network chooses the next action (double DQN).
        bf16: whether the networks compute in bfloat16, which keeps two or three digits; weights,
            targets and the loss stay float32.

    Raises:
        InputError: a value is out of its range.
    """

    learning_rate: float = 1e-4
    target_sync_updates: int = 1000
    reduction: Reduction = "sum"
    double: bool = False
    bf16: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.learning_rate < float("inf"):
            raise InputError(f"The learning rate is {self.learning_rate}.", "Choose one above 0.")
        if self.target_sync_updates < 1:
            raise InputError(
                f"target_sync_updates is {self.target_sync_updates}.",
                "Copy the network every 1 or more updates.",
            )
        if self.reduction not in get_args(Reduction):
            raise InputError(f"The reduction is {self.reduction!r}.", "Use 'sum' or 'mean'.")


def _option(
    default: Any,
    about: str,
    panel: str,
    *,
    key: str | None = None,
    kind: type | None = None,
    metavar: str | None = None,
) -> Any:
    """Returns a field that is an option of the commands, and a line of the configuration.

    Args:
        default: its value where nothing is said.
        about: the help.
        panel: under which heading the help stands.
        key: what it is called outside, if not like the field.
        kind: the type of its values, or of their elements; by default that of the default.
        metavar: what the help calls a value, if not by its type.
    """
    metadata = {"help": about, "panel": panel, "key": key, "metavar": metavar}
    return field(default=default, metadata={**metadata, "kind": kind or type(default)})


@dataclass(frozen=True)
class TrainSettings:
    """Everything that decides what a run computes.

    The fields, but for the first two, are the options of `trdlab train` and the lines of
    `config.toml`; `horizon` and `width` are called `N` and `w` there.

    Args:
        kind: where the environment comes from.
        env: its id, or the name of the game.

    Raises:
        InputError: a value is out of its range, or two do not go together.

    >>> TrainSettings("gym", "CartPole-v1", horizon=40).time_axis.num_components
    41
    """

    kind: Kind
    env: str
    env_arg: tuple[str, ...] = _option(
        (), "To make the environment with.", "Run", kind=str, metavar="KEY=VALUE"
    )
    seed: int = _option(1, "Of the weights, the environments and every choice.", "Run")
    agent_steps: int = _option(100_000, "Steps to take, of all environments together.", "Run")
    num_envs: int = _option(1, "Environments side by side.", "Run")
    gamma: float = _option(0.99, "Discount factor of a step, in [0, 1).", "Time axis")
    horizon: int = _option(10, "Number of explicit components; 0 is DQN.", "Time axis", key="N")
    width: int = _option(1, "Steps in each component.", "Time axis", key="w")
    epsilon_start: float = _option(1.0, "Chance of a random action at first.", "Acting")
    epsilon_end: float = _option(0.05, "… and in the end.", "Acting")
    epsilon_steps: int = _option(10_000, "Agent steps from the one to the other.", "Acting")
    learning_starts: int = _option(
        1_000, "Agent steps, at random, before the first update.", "Learning"
    )
    update_every: int = _option(4, "Agent steps for each update.", "Learning")
    batch_size: int = _option(32, "Windows in each update.", "Learning")
    learning_rate: float = _option(1e-3, "Adam's, at first.", "Learning")
    learning_rate_end: float | None = _option(
        None, "… and in the end, falling evenly; without it, the same.", "Learning", kind=float
    )
    target_sync_updates: int = _option(
        250, "Updates (not steps) between copies to the target network.", "Learning"
    )
    reduction: Literal["sum", "mean"] = _option(
        "sum", "Over components: sum, or the paper's mean.", "Learning"
    )
    double: bool = _option(False, "Double DQN: the online network chooses.", "Learning")
    bf16: bool = _option(False, "Compute in bfloat16: quicker, less exact.", "Learning")
    hidden: tuple[int, ...] = _option(
        (128, 128), "Layers of the MLP, for vectors.", "Learning", kind=int, metavar="SIZE,SIZE"
    )
    weights: str | None = _option(
        None,
        "Begin with these weights instead of random ones.",
        "Learning",
        kind=str,
        metavar="FILE",
    )
    capacity: int = _option(100_000, "Transitions that the replay memory holds.", "Learning")
    clip_rewards: bool = _option(False, "Learn from the sign of each reward.", "Reward and ending")
    life_loss_ends: bool = _option(
        False, "Learn as if a lost life ended the episode.", "Reward and ending"
    )
    evaluate_episodes: int = _option(30, "Episodes of the final evaluation; 0: none.", "Evaluation")
    evaluate_epsilon: float = _option(0.0, "Chance of a random action in it.", "Evaluation")
    checkpoint_every: int = _option(20_000, "Agent steps between two checkpoints.", "Running")
    log_every: int = _option(1_000, "Agent steps between two lines of metrics.", "Running")
    tensorboard: bool = _option(False, "Write metrics for TensorBoard, too.", "Running")
    device: str = _option("auto", "cpu, cuda, mps, or auto: what is there.", "Running")
    threads: int = _option(0, "Of PyTorch on the CPU; 0: what suits the network.", "Running")

    def __post_init__(self) -> None:
        for name in _POSITIVE:
            _require(getattr(self, name) >= 1, name, getattr(self, name), "1 or more")
        for name in _NOT_NEGATIVE:
            _require(getattr(self, name) >= 0, name, getattr(self, name), "0 or more")
        for name in ("epsilon_start", "epsilon_end", "evaluate_epsilon"):
            _require(0 <= getattr(self, name) <= 1, name, getattr(self, name), "from 0 to 1")
        _require(self.seed < 2**63, "seed", self.seed, "less than 2**63")
        end = self.learning_rate_end
        _require(end is None or 0 <= end < float("inf"), "learning_rate_end", end, "0 or more")
        _require(all(size >= 1 for size in self.hidden), "hidden", self.hidden, "sizes above 0")
        self.time_axis  # noqa: B018  checks γ, N and w
        self.update_settings  # noqa: B018  checks the rest
        if self.learning_starts < self.width * self.num_envs:
            raise InputError(
                f"`learning_starts` is {self.learning_starts}: not one window of w = {self.width} "
                f"steps is full by then.",
                f"Choose {self.width * self.num_envs} or more.",
            )

    @property
    def time_axis(self) -> TimeAxis:
        """γ, N and w."""
        return TimeAxis(self.gamma, self.horizon, self.width)

    @property
    def update_settings(self) -> UpdateSettings:
        """What an update is told."""
        return UpdateSettings(**{f.name: getattr(self, f.name) for f in fields(UpdateSettings)})

    def epsilon(self, agent_steps: int) -> float:
        """Returns the chance of a random action after so many agent steps."""
        if agent_steps < self.learning_starts:
            return 1.0
        part = min(1.0, agent_steps / max(1, self.epsilon_steps))
        return (1.0 - part) * self.epsilon_start + part * self.epsilon_end

    def learning_rate_at(self, agent_steps: int) -> float:
        """Returns Adam's learning rate after so many agent steps."""
        if self.learning_rate_end is None:
            return self.learning_rate
        part = min(1.0, agent_steps / self.agent_steps)
        return (1.0 - part) * self.learning_rate + part * self.learning_rate_end

    def updates_due(self, agent_steps: int) -> int:
        """Returns the updates that should have been made after so many agent steps."""
        return max(0, agent_steps - self.learning_starts) // self.update_every

    def to_config(self) -> dict[str, Any]:
        """Returns the lines of a configuration file, in the order of the options."""
        config = {key: getattr(self, name) for key, name in _names().items()}
        return {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in config.items()
            if value is not None
        }

    @classmethod
    def from_config(cls, config: Mapping[str, Any], where: str = "The configuration") -> Self:
        """Returns the settings that `to_config` wrote, or a user.

        Args:
            config: values by key; what is missing has its default.
            where: what to call it in errors.

        Raises:
            InputError: a key is unknown, or a value has another type or is out of its range.
        """
        given = checked(config, where)
        if missing := [key for key in ("kind", "env") if key not in given]:
            raise InputError(f"{where} does not say '{missing[0]}'.", "Add it.")
        return cls(**given)

    def changed(self, config: Mapping[str, Any], where: str = "The configuration") -> Self:
        """Returns these settings with some of them replaced, given by key."""
        return replace(self, **checked(config, where))


def checked(config: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Returns arguments of `TrainSettings` from lines of a configuration.

    Raises:
        InputError: a key is unknown, or a value has another type.
    """
    names, options = _names(), {of.name: of for of in fields(TrainSettings)}
    given = {}
    for key, value in config.items():
        if key not in names:
            raise InputError(f"{where} has an unknown key '{key}'.", closest(key, names))
        of = options[names[key]]
        listed = isinstance(of.default, tuple)
        given[of.name] = _typed(value, of.metadata.get("kind", str), listed, key, where)
    if given.get("kind", "gym") not in get_args(Kind):
        raise InputError(f"{where} has kind = '{given['kind']}'.", "Use 'gym' or 'atari'.")
    return given


def _typed(value: Any, kind: type, listed: bool, key: str, where: str) -> Any:
    """Returns a value of a configuration as the type of the option."""
    values = value if listed and isinstance(value, list | tuple) else [value]
    if isinstance(value, list | tuple) != listed or not all(_fits(of, kind) for of in values):
        wanted = f"a list of {_PLURAL[kind]}" if listed else _SINGULAR[kind]
        raise InputError(f"{where} has {key} = {value!r}.", f"It must be {wanted}.")
    return tuple(kind(of) for of in values) if listed else kind(value)


def _fits(value: Any, kind: type) -> bool:
    """Returns whether a value is of a type; whole numbers may be written like 1e6."""
    if kind in (bool, str):
        return isinstance(value, kind)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and (kind is float or value % 1 == 0)


def _names() -> dict[str, str]:
    """Returns the name of the field of each key of a configuration."""
    return {f.metadata.get("key") or f.name: f.name for f in fields(TrainSettings)}


_POSITIVE = (
    "agent_steps", "num_envs", "update_every", "batch_size", "capacity", "learning_starts",
    "checkpoint_every", "log_every",
)  # fmt: skip
_NOT_NEGATIVE = ("seed", "epsilon_steps", "evaluate_episodes", "threads")


_SINGULAR = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
_PLURAL = {int: "whole numbers", str: "texts"}


def _require(holds: bool, name: str, value: object, range_: str) -> None:
    if not holds:
        raise InputError(f"`{name}` is {value}.", f"It must be {range_}.")
