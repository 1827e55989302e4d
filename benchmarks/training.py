"""How fast a run goes: agent steps with a teacher, offline updates, and what a decomposition adds.

Whole steps of a run are timed, as `trdlab train` makes them: acting, the emulator, the teacher's
opinion, remembering, drawing windows, and the updates that are due. N = 40 and N = 0 take turns,
and the medians over rounds are told: machines drift, ratios hold.

    python benchmarks/training.py                          # the paper's settings, from a teacher
    python benchmarks/training.py --preset gpu --scratch   # on a graphics card: 64 games at once
    python benchmarks/training.py --preset gpu --scratch num_envs=128 update_every=128
"""

import argparse
import time
from dataclasses import replace

import numpy as np

from trdlab.agents.teachers import find_teacher
from trdlab.deep.lessons import Levels
from trdlab.deep.presets import preset, with_teacher
from trdlab.deep.settings import TrainSettings
from trdlab.deep.trainer import Trainer
from trdlab.training.machine import resolved
from trdlab.training.setup import make_environments, new_trainer

WARM_UP, ROUNDS, MANY = 5_000, 7, 10**9


def settings_of(game: str, name: str, teacher: str | None, given: list[str]) -> TrainSettings:
    """Returns the settings of a run that never ends, and learns at once."""
    base = preset("atari", game, name)
    if teacher is not None:
        base = base.changed({"teacher": teacher} | with_teacher("atari", base, name))
    base = base.changed(dict(line.split("=", 1) for line in given))
    short = {"agent_steps": MANY, "learning_starts": WARM_UP, "capacity": 20 * WARM_UP}
    return base.changed(short | ({"teacher_steps": WARM_UP} if teacher else {}))


def trainer_of(settings: TrainSettings) -> Trainer:
    """Returns the trainer of a run that is about to learn: offline, if it has a teacher."""
    taught, make = None, make_environments
    if settings.teacher is not None:
        candidate = find_teacher(settings)
        settings = replace(candidate.settled(settings), offline_updates=MANY)
        taught, make = (candidate.teacher(settings), Levels(1.0, 0.0)), candidate.make
    environments = make(settings)
    trainer = new_trainer(resolved(settings, environments), environments, taught)
    while trainer.clock < WARM_UP or trainer.learner.num_updates < 20:
        trainer.step()
    return trainer


def go_online(trainer: Trainer) -> None:
    """Ends the offline phase, and takes steps until updates are made again; ε is what it ends at.

    At first it acts at random: what acts by its network has to look at the screen.
    """
    end = trainer.settings.epsilon_end
    trainer.settings = replace(trainer.settings, epsilon_start=end)
    if trainer.lessons:
        done = trainer.lessons.offline_updates + 1
        trainer.lessons.settings = replace(trainer.lessons.settings, offline_updates=done)
    updates = trainer.learner.num_updates + 20
    while trainer.agent_steps < WARM_UP or trainer.learner.num_updates < updates:
        trainer.step()


def speed(trainer: Trainer, seconds: float) -> float:
    """Returns how many steps, or updates, are made in a second."""
    begun, before = time.perf_counter(), trainer.clock
    while (passed := time.perf_counter() - begun) < seconds:
        trainer.step()
    return (trainer.clock - before) / passed


def told(what: str, trainers: dict[int, Trainer], seconds: float) -> None:
    """Prints the speeds of runs that differ in N, which take turns."""
    rounds = [[speed(of, seconds) for of in trainers.values()] for _ in range(ROUNDS)]
    medians = np.median(rounds, axis=0)
    each = ", ".join(f"N = {n}: {of:,.0f}/s" for n, of in zip(trainers, medians, strict=True))
    ratio = float(np.median([whole / plain for whole, plain in rounds]))
    print(f"{what}: {each}; N = 40 has {ratio:.2f} of the speed of N = 0", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--game", default="Breakout")
    parser.add_argument("--preset", default="paper")
    parser.add_argument("--teacher", default="pretrained:Breakout")
    parser.add_argument("--scratch", action="store_true", help="Without a teacher.")
    parser.add_argument("--seconds", type=float, default=6.0, help="Of each of the rounds.")
    parser.add_argument("settings", nargs="*", help="Such as num_envs=8.")
    options = parser.parse_args()
    teacher = None if options.scratch else options.teacher
    settings = settings_of(options.game, options.preset, teacher, options.settings)
    trainers = {n: trainer_of(replace(settings, horizon=n)) for n in (40, 0)}
    one = trainers[40].settings
    print(
        f"{options.game}, preset {options.preset}, {one.device}, {one.threads} threads, "
        f"{one.num_envs} games, batch {one.batch_size}, an update every {one.update_every} steps"
    )
    if teacher is not None:
        told("offline updates", trainers, options.seconds)
    for trainer in trainers.values():
        go_online(trainer)
    told("agent steps", trainers, options.seconds)
    for trainer in trainers.values():
        trainer.environments.close()


if __name__ == "__main__":
    main()
