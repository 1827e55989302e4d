"""Named settings to begin from, each a few lines of a configuration. No torch here."""

from typing import Any

from trdlab.deep.settings import Kind, TrainSettings
from trdlab.errors import InputError, closest

Config = dict[str, Any]

PRESETS: dict[Kind, dict[str, tuple[str, Config]]] = {
    "gym": {
        "classic": (
            "small control tasks, such as CartPole, in minutes",
            {
                "num_envs": 8,
                "epsilon_end": 0.04,
                "epsilon_steps": 20_000,
                "update_every": 2,
                "batch_size": 64,
                "learning_rate_end": 0.0,
                "target_sync_updates": 128,  # each is one Bellman step: 387 of them reach far
                "hidden": [256, 256],
            },
        ),
        "smoke": (
            "seconds, to see that everything works",
            {"agent_steps": 5_000, "log_every": 500, "evaluate_episodes": 10},
        ),
    },
    "atari": {
        "paper": (
            "DQN's settings as the paper uses them: 4 million steps, days on a CPU",
            {
                "agent_steps": 4_000_000,
                "N": 40,
                "epsilon_end": 0.01,
                "epsilon_steps": 1_000_000,
                "learning_starts": 80_000,
                "learning_rate": 1e-4,
                "target_sync_updates": 250,
                "capacity": 1_000_000,
                "clip_rewards": True,
                "life_loss_ends": True,
                "evaluate_epsilon": 0.01,
                "fit": True,
                "checkpoint_every": 50_000,
                "log_every": 10_000,
            },
        ),
    },
}
"""By kind and name: what it is for, and the lines."""
_PAPER = PRESETS["atari"]["paper"][1]
PRESETS["atari"]["cpu"] = (
    "what a CPU can do: from an agent that comes with trdlab, or else a million steps",
    _PAPER
    | {
        "agent_steps": 1_000_000,
        "num_envs": 8,
        "epsilon_steps": 250_000,
        "learning_starts": 20_000,
        "capacity": 200_000,
        "precision": "auto",
        "fit_steps": 120_000,
    },
)
PRESETS["atari"]["gpu"] = (
    "the paper's four million steps with 64 games side by side, for a GPU",
    _PAPER
    | {
        "num_envs": 64,
        "update_every": 64,
        "batch_size": 512,  # as many windows a step as DQN
        "target_sync_updates": 62,  # as many steps as in the paper, nearly
        "fit_steps": 120_000,
        "precision": "auto",
    },
)
PRESETS["atari"]["smoke"] = (
    "about a minute, to see that everything works",
    _PAPER
    | {
        "agent_steps": 4_000,
        "num_envs": 4,
        "epsilon_steps": 4_000,
        "learning_starts": 1_000,
        "capacity": 10_000,
        "precision": "auto",
        "evaluate_episodes": 5,
        "evaluate_epsilon": 0.05,
        "fit_steps": 2_000,
        "checkpoint_every": 1_000,
        "log_every": 500,
    },
)
PRESETS["gym"] |= {
    "acrobot": (
        "for Acrobot, whose goal random play seldom reaches",
        {
            "agent_steps": 80_000,
            "num_envs": 8,
            "learning_starts": 2_000,
            "epsilon_end": 0.1,
            "epsilon_steps": 30_000,
            "epsilon_hold": 4,
            "update_every": 1,
            "batch_size": 64,
            "learning_rate": 6.3e-4,
            "learning_rate_end": 0.0,
            "target_sync_updates": 100,  # the goal is 80 steps away: so many copies to hear of it
            "double": True,
            "loss": "huber",
            "max_grad_norm": 10.0,
            "hidden": [256, 256],
            "checkpoint_every": 5_000,
            "checkpoint_episodes": 100,  # good agents differ by little, and episodes by much
        },
    ),
    "mountain-car": (
        "for MountainCar, whose goal random play never reaches",
        {
            "agent_steps": 80_000,
            "num_envs": 8,
            "learning_starts": 2_000,
            "gamma": 0.98,
            "epsilon_end": 0.05,
            "epsilon_steps": 30_000,
            "epsilon_hold": 30,  # a car that is pushed to and fro at random stays where it is
            "update_every": 2,
            "batch_size": 64,
            "learning_rate_end": 0.0,
            "target_sync_updates": 150,
            "capacity": 50_000,
            "checkpoint_every": 5_000,  # the last network may be a worse one
            "checkpoint_episodes": 20,
        },
    ),
    "lunar-lander": (
        "for LunarLander, whose single rewards are large",
        {
            "agent_steps": 300_000,
            "num_envs": 8,
            "learning_starts": 2_000,
            "gamma": 0.98,  # to hover for another step must cost more than the network errs by
            "epsilon_end": 0.1,
            "epsilon_steps": 30_000,
            "epsilon_hold": 4,
            "batch_size": 128,
            "learning_rate_end": 0.0,
            "target_sync_updates": 125,
            "double": True,
            "loss": "huber",
            "max_grad_norm": 10.0,
            "hidden": [256, 256],
            "capacity": 200_000,
            "checkpoint_every": 5_000,  # of two in a row, one may land and the other one hover
            "checkpoint_episodes": 20,
        },
    ),
}
_TAUGHT: dict[str, Config] = {
    "cpu": {
        "agent_steps": 20_000,
        "learning_starts": 5_000,
        "offline_updates": 10_000,  # three times each step: with more, it learns them by heart
        "learning_rate": 7e-4,  # what a teacher does stays the same, and may be learned fast
        "learning_rate_end": 1e-5,
        "standardise": True,  # of a bright screen nothing would be learned for long
        "averaging": 0.998,
        "fit_steps": 40_000,  # 120,000 took 14 minutes after 19 of training
    },
    "paper": {"teacher_steps": 1_000_000, "offline_updates": 1_000_000},
}
"""By preset: what else is other where there is a teacher."""
DEFAULT_PRESETS: dict[Kind, str] = {"gym": "classic", "atari": "cpu"}
_TRIED = {
    "CartPole": "classic",
    "Acrobot": "acrobot",
    "MountainCar": "mountain-car",
    "LunarLander": "lunar-lander",
}
"""The presets that were found for an environment, by its name without the version."""


def preset(kind: Kind, env: str, name: str | None = None) -> TrainSettings:
    """Returns the settings of a preset, by default the one for this environment.

    Raises:
        InputError: there is no such preset.

    >>> preset("atari", "Breakout").horizon
    40
    >>> preset("gym", "MountainCar-v0").gamma
    0.98
    """
    known, wanted = PRESETS[kind], name or default_preset(kind, env)
    if wanted not in known:
        raise InputError(f"There is no preset '{wanted}' for {kind}.", closest(wanted, known))
    return TrainSettings(kind, env).changed(known[wanted][1], f"The preset '{wanted}'")


def with_teacher(kind: Kind, base: TrainSettings, name: str | None = None) -> Config:
    """Returns what else suits a run that learns from a teacher, and need not begin at random.

    Args:
        kind: of the run.
        base: the settings that it would have without one.
        name: of the preset that they are from.

    >>> lines = with_teacher("atari", preset("atari", "Breakout"))
    >>> lines["epsilon_start"], lines["teacher_steps"], lines["offline_updates"]
    (0.01, 100000, 10000)
    """
    lines: Config = {
        "epsilon_start": base.epsilon_end,
        "learning_starts": min(base.learning_starts, 10_000),
    }
    if kind == "atari":
        few = {"checkpoint_every": 10_000, "log_every": 1_000}
        lines |= {name: min(value, getattr(base, name)) for name, value in few.items()}
    steps, updates = (100_000, 30_000) if kind == "atari" else (20_000, 5_000)
    steps, updates = min(steps, base.agent_steps), min(updates, base.agent_steps // 4)
    lines |= {"teacher_steps": steps, "offline_updates": updates}
    return lines | _TAUGHT.get(name or DEFAULT_PRESETS[kind], {})


def default_preset(kind: Kind, env: str) -> str:
    """Returns the name of the preset for an environment: its own, or else that of its kind."""
    return _own(kind, env) or DEFAULT_PRESETS[kind]


def preset_line(kind: Kind, env: str, name: str | None = None) -> str:
    """Returns which preset it is, and what may be expected of it.

    >>> preset_line("gym", "MountainCar-v0")
    'Settings: the preset mountain-car, made for MountainCar-v0.'
    >>> preset_line("gym", "FrozenLake-v1")
    'Settings: the preset classic. None are known for FrozenLake-v1: it may need others.'
    """
    wanted = name or default_preset(kind, env)
    if wanted == _own(kind, env):
        return f"Settings: the preset {wanted}, made for {env}."
    unknown = kind == "gym" and name is None
    more = f" None are known for {env}: it may need others." if unknown else ""
    return f"Settings: the preset {wanted}.{more}"


def _own(kind: Kind, env: str) -> str | None:
    """Returns the preset that was found for this very environment."""
    name, _, version = env.rpartition("-v")
    return _TRIED.get(name) if kind == "gym" and version.isdecimal() else None
