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
            "DQN's settings as the paper uses them: 10 million steps, days on a CPU",
            {
                "agent_steps": 10_000_000,
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
                "checkpoint_every": 50_000,
                "log_every": 10_000,
            },
        ),
    },
}
"""By kind and name: what it is for, and the lines."""
PRESETS["atari"]["smoke"] = (
    "about a minute, to see that everything works",
    PRESETS["atari"]["paper"][1]
    | {
        "agent_steps": 4_000,
        "num_envs": 4,
        "epsilon_steps": 4_000,
        "learning_starts": 1_000,
        "capacity": 10_000,
        "precision": "auto",
        "evaluate_episodes": 5,
        "evaluate_epsilon": 0.05,
        "checkpoint_every": 1_000,
        "log_every": 500,
    },
)
DEFAULT_PRESETS: dict[Kind, str] = {"gym": "classic", "atari": "paper"}


def preset(kind: Kind, env: str, name: str | None = None) -> TrainSettings:
    """Returns the settings of a preset, by default the first of its kind.

    Raises:
        InputError: there is no such preset.

    >>> preset("atari", "Breakout").horizon
    40
    """
    known, wanted = PRESETS[kind], name or DEFAULT_PRESETS[kind]
    if wanted not in known:
        raise InputError(f"There is no preset '{wanted}' for {kind}.", closest(wanted, known))
    return TrainSettings(kind, env).changed(known[wanted][1], f"The preset '{wanted}'")
