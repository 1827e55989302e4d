"""What a training run is told: every option once, with its help, for files and commands alike.

No torch here: options are read, listed and refused before anything heavy is imported.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Self, get_args

from trdlab.decomposition import TimeAxis
from trdlab.deep.options import check_range, given_options, key_of, option
from trdlab.deep.update_settings import Precision as Precision
from trdlab.deep.update_settings import UpdateSettings as UpdateSettings
from trdlab.errors import InputError

Kind = Literal["gym", "atari"]
Distil = Literal["auto", "values", "policy"]
TEACHING = "Learning from a teacher"
"""Under which heading the options stand that mean nothing without one."""


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
    env_arg: tuple[str, ...] = option(
        (), "To make the environment with.", "Run", kind=str, metavar="KEY=VALUE"
    )
    action_names: tuple[str, ...] = option(
        (),
        "What to call the actions; without it, as the environment does.",
        "Run",
        kind=str,
        metavar="NAME,NAME",
    )
    seed: int = option(1, "Of the weights, the environments and every choice.", "Run", least=0)
    agent_steps: int = option(
        100_000, "Steps to take, of all environments together.", "Run", least=1
    )
    num_envs: int = option(1, "Environments side by side.", "Run", least=1, most=10_000)
    gamma: float = option(0.99, "Discount factor of a step, in [0, 1).", "Time axis")
    horizon: int = option(
        10, "Number of explicit components; 0 is DQN.", "Time axis", key="N", least=0, most=10_000
    )
    width: int = option(1, "Steps in each component.", "Time axis", key="w", least=1)
    epsilon_start: float = option(
        1.0, "Chance of a random action at first.", "Acting", least=0, most=1
    )
    epsilon_end: float = option(0.05, "… and in the end.", "Acting", least=0, most=1)
    epsilon_steps: int = option(10_000, "Agent steps from the one to the other.", "Acting", least=0)
    epsilon_hold: int = option(
        1, "Steps to hold a random action: 1 to so many, drawn evenly.", "Acting", least=1
    )
    learning_starts: int = option(
        1_000,
        "Agent steps before the first update; at random, unless there is a teacher.",
        "Learning",
        least=1,
    )
    update_every: int = option(4, "Agent steps for each update.", "Learning", least=1)
    batch_size: int = option(32, "Windows in each update.", "Learning", least=1)
    learning_rate: float = option(1e-3, "Adam's, at first.", "Learning")
    learning_rate_end: float | None = option(
        None,
        "… and in the end, falling evenly; without it, the same.",
        "Learning",
        kind=float,
        least=0,
        most=1,
    )
    target_sync_updates: int = option(
        250, "Updates (not steps) between copies to the target network.", "Learning", least=1
    )
    reduction: Literal["sum", "mean"] = option(
        "sum", "Over components: sum, or the paper's mean.", "Learning"
    )
    loss: Literal["squared", "huber"] = option(
        "squared",
        "squared learns averages; huber minds rare large errors less, as most DQNs do.",
        "Learning",
    )
    max_grad_norm: float | None = option(
        None,
        "Cut longer gradients to this length; without it, they are left.",
        "Learning",
        kind=float,
    )
    averaging: float = option(
        0.0, "Weight of past networks in a mean that acts; 0: the newest acts.", "Learning", least=0
    )
    standardise: bool = option(
        False,
        "By what was seen before the first update: images less their mean, vectors scaled, too.",
        "Learning",
    )
    double: bool = option(
        False, "Double DQN: the online network chooses; not with a policy head.", "Learning"
    )
    precision: Literal["auto", "float32", "bfloat16"] = option(
        "float32",
        "float32; bfloat16, less exact and often quicker; or auto: the quicker one here.",
        "Learning",
    )
    hidden: tuple[int, ...] = option(
        (128, 128),
        "Layers of the MLP, for vectors.",
        "Learning",
        kind=int,
        metavar="SIZE,SIZE",
        least=1,
        most=1_000_000,
    )
    weights: str | None = option(
        None,
        "Begin with these weights instead of random ones.",
        "Learning",
        kind=str,
        metavar="FILE",
    )
    capacity: int = option(
        100_000, "Transitions that the replay memory holds.", "Learning", least=1
    )
    teacher: str | None = option(
        None,
        "Learn from this agent, whatever `trdlab agent` can name.",
        TEACHING,
        kind=str,
        metavar="AGENT",
    )
    teacher_steps: int = option(
        20_000, "Steps that the teacher takes first, of all environments.", TEACHING, least=0
    )
    teacher_epsilon: float = option(
        0.05, "Chance of a random action in them.", TEACHING, least=0, most=1
    )
    offline_updates: int = option(
        5_000, "Updates on these steps, before the agent takes its own.", TEACHING, least=0
    )
    distillation: float = option(
        1.0,
        "Weight of the teacher in the loss; that of values falls to 0 as the score comes to its.",
        TEACHING,
        least=0,
    )
    distil: Literal["auto", "values", "policy"] = option(
        "auto",
        "What to take over: values, into the components; or policy, by a head of its own, whose "
        "future the components tell; auto: values where the teacher has some.",
        TEACHING,
    )
    temperature: float = option(
        1.0,
        "Of the probabilities that are compared: above 1 evens them out, below sharpens them.",
        TEACHING,
    )
    draw: bool = option(
        False, "With a policy head: draw actions, rather than take the likeliest.", TEACHING
    )
    clip_rewards: bool = option(False, "Learn from the sign of each reward.", "Reward and ending")
    life_loss_ends: bool = option(
        False, "Learn as if a lost life ended the episode.", "Reward and ending"
    )
    evaluate_episodes: int = option(
        30, "Episodes of the final evaluation; 0: none.", "Evaluation", least=0, most=100_000
    )
    evaluate_epsilon: float = option(
        0.0, "Chance of a random action in it.", "Evaluation", least=0, most=1
    )
    checkpoint_episodes: int = option(
        0,
        "Episodes likewise at each checkpoint, of which the best is the agent; 0: the newest is.",
        "Evaluation",
        least=0,
        most=100_000,
    )
    fit: bool = option(
        False,
        "When training is over, fit what the agent can expect, as it acts in an evaluation; "
        "without it, the components are those learned with the policy.",
        "Evaluation",
    )
    fit_steps: int = option(100_000, "Steps that it plays for that.", "Evaluation", least=1)
    checkpoint_every: int = option(
        20_000, "Agent steps between two checkpoints.", "Running", least=1
    )
    log_every: int = option(1_000, "Agent steps between two lines of metrics.", "Running", least=1)
    tensorboard: bool = option(False, "Write metrics for TensorBoard, too.", "Running")
    device: str = option("auto", "cpu, cuda, mps, or auto: what is there.", "Running")
    threads: int = option(
        0, "Of PyTorch on the CPU; 0: what suits the network.", "Running", least=0
    )

    def __post_init__(self) -> None:
        for of in fields(self):
            check_range(of, getattr(self, of.name))
        self.time_axis  # noqa: B018  checks γ, N and w
        self.update_settings  # noqa: B018  checks the rest
        self._check_together()

    def _check_together(self) -> None:
        names = self.action_names
        if len(set(names)) < len(names) or not all(name.strip() for name in names):
            raise InputError(
                f"The action names are {', '.join(map(repr, names))}.",
                "Each has a name of its own.",
            )
        windows = self.width * self.num_envs
        if self.learning_starts < windows:
            raise InputError(
                f"`learning_starts` is {self.learning_starts}: not one window of "
                f"w = {self.width} steps is full by then.",
                f"Choose {windows} or more.",
            )
        if self.batch_size > self.capacity:
            raise InputError(
                f"A batch of {self.batch_size} windows is larger than a replay memory of "
                f"{self.capacity} transitions.",
                "Choose a smaller `batch_size` or a larger `capacity`.",
            )
        if self.distil not in get_args(Distil):
            known = ", ".join(get_args(Distil))
            raise InputError(f"`distil` is '{self.distil}'.", f"Use one of: {known}.")
        self._check_teaching(max(windows, self.batch_size))

    def _check_teaching(self, needed: int) -> None:
        """Refuses options of a teacher where there is none, and phases that do not fit together."""
        if self.teacher is None:
            for of in fields(self):
                if of.metadata.get("panel") == TEACHING and getattr(self, of.name) != of.default:
                    raise InputError(f"`{of.name}` is for learning from a teacher.", "Name one.")
            return
        steps, updates = self.teacher_steps, self.offline_updates
        if updates and steps < needed:
            raise InputError(
                f"`teacher_steps` is {steps}: too few for {updates} `offline_updates` in batches.",
                f"Choose {needed} or more, or no offline updates.",
            )
        if steps and not updates:
            raise InputError(
                f"`offline_updates` is 0: nothing would learn from {steps} steps of the teacher.",
                "Choose more, or set `teacher_steps` to 0, too.",
            )

    @property
    def time_axis(self) -> TimeAxis:
        """γ, N and w."""
        return TimeAxis(self.gamma, self.horizon, self.width)

    @property
    def clock_end(self) -> int:
        """What a run does in all: the teacher's steps, the offline updates, and its own steps."""
        taught = self.teacher_steps + self.offline_updates if self.teacher is not None else 0
        return taught + self.agent_steps

    @property
    def update_settings(self) -> UpdateSettings:
        """What an update is told; in float32 as long as the precision is `auto`."""
        told = {of.name: getattr(self, of.name) for of in fields(UpdateSettings)}
        exact = {"precision": "float32"} if self.precision == "auto" else {}
        return UpdateSettings(**told | exact)

    def epsilon(self, agent_steps: int) -> float:
        """Returns the chance of a random action after so many agent steps.

        Whoever learns from a teacher knows something by then, and need not begin at random.
        """
        if agent_steps < self.learning_starts and self.teacher is None:
            return 1.0
        part = min(1.0, agent_steps / max(1, self.epsilon_steps))
        return (1.0 - part) * self.epsilon_start + part * self.epsilon_end

    def learning_rate_at(self, agent_steps: int, offline_updates: int | None = None) -> float:
        """Returns Adam's learning rate; by default all offline updates have been made."""
        if self.learning_rate_end is None:
            return self.learning_rate
        whole = 0 if self.teacher is None else self.offline_updates
        offline = whole if offline_updates is None else offline_updates
        done = self.update_every * offline + agent_steps  # in agent steps
        part = min(1.0, done / (self.update_every * whole + self.agent_steps))
        return (1.0 - part) * self.learning_rate + part * self.learning_rate_end

    def updates_due(self, agent_steps: int) -> int:
        """Returns the updates that should have been made after so many agent steps."""
        return max(0, agent_steps - self.learning_starts) // self.update_every

    def to_config(self) -> dict[str, Any]:
        """Returns the lines of a configuration file, in the order of the options."""
        config = {key_of(of): getattr(self, of.name) for of in fields(self)}
        if self.teacher is None:  # the rest would mean nothing
            idle = {of.name for of in fields(self) if of.metadata.get("panel") == TEACHING}
            config = {key: value for key, value in config.items() if key not in idle}
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
    given = given_options(fields(TrainSettings), config, where)
    if given.get("kind", "gym") not in get_args(Kind):
        raise InputError(f"{where} has kind = '{given['kind']}'.", "Use 'gym' or 'atari'.")
    return given
