"""What a teacher weighs, is asked, is shown and remembers."""

from typing import Any

import numpy as np
import pytest

from trdlab.arrays import BoolArray
from trdlab.deep.lessons import TAUGHT, Lessons, Levels
from trdlab.deep.settings import TrainSettings
from trdlab.deep.trainer import Trainer
from trdlab.environments import GymEnvironments, NotReproducible
from trdlab.errors import InputError
from trdlab.policies import Memoryless
from trdlab.policies.teacher import Teacher
from trdlab.runs.state import pack, unpack

EVENLY = Memoryless(lambda seen: np.full((len(seen), 2), 0.5))


class Counting:
    """Remembers how many steps it has seen of each episode; it is likely to act by that.

    Args:
        asked: where it notes what it was given: observations, state, begins.
    """

    def __init__(self) -> None:
        self.asked: list[tuple[Any, Any, list[bool]]] = []

    def act(self, observations: Any, state: Any, begins: BoolArray) -> Any:
        self.asked.append((np.array(observations), state, begins.tolist()))
        before = np.zeros(len(begins)) if state is None else state[0]["steps"]
        steps = np.where(begins, 0, before) + 1
        likely = 1.0 / (1.0 + steps)
        return np.stack([likely, 1.0 - likely], axis=1), ({"steps": steps}, [None])


def settings(**lines: Any) -> TrainSettings:
    few = {
        "device": "cpu",
        "N": 2,
        "hidden": [8],
        "batch_size": 4,
        "learning_starts": 4,
        "capacity": 60,
        "teacher": "somebody",
        "teacher_steps": 40,
        "offline_updates": 6,
        "num_envs": 2,
        "distil": "policy",
    }
    return TrainSettings("gym", "CartPole-v1").changed(few | lines)


USUAL = Levels(500.0, 20.0)


def trainer(policy: Any, levels: Levels = USUAL, **lines: Any) -> Trainer:
    told = settings(**lines)
    environments = GymEnvironments("CartPole-v1", told.num_envs, seed=1)
    return Trainer(told, environments, (Teacher(policy), levels))


# ---- λ -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("teacher", "chance", "student", "weight"),
    [
        (500.0, 20.0, None, 1.0),  # before the first score
        (500.0, 20.0, 20.0, 1.0),
        (500.0, 20.0, 260.0, 0.5),
        (500.0, 20.0, 600.0, 0.0),
        (18.0, -21.0, -21.0, 1.0),  # Pong, where 1 − student/teacher would be 2.2
        (18.0, -21.0, 8.25, 0.25),
        (-5.0, -20.0, -25.0, 1.0),  # worse than chance
        (-5.0, -20.0, -8.0, 0.2),
        (0.0, -200.0, -50.0, 0.25),  # a teacher of score 0, which nothing can be divided by
    ],
)
def test_the_teacher_weighs_less_the_nearer_the_student_comes(teacher, chance, student, weight):
    assert Levels(teacher, chance).weight(student) == pytest.approx(weight)


@pytest.mark.parametrize("teacher", [20.0, -3.0])
def test_a_teacher_at_the_level_of_chance_or_below_has_no_weight(teacher):
    with pytest.raises(InputError, match="Choose a teacher that is better than chance"):
        Levels(teacher, 20.0)


@pytest.mark.parametrize("distil", ["values", "policy"])
def test_it_weighs_all_in_the_first_phases_and_by_the_mean_score_online(distil):
    run = trainer(EVENLY, Levels(40.0, 10.0), distillation=3.0, epsilon_start=1.0, distil=distil)
    while run.phase != "online":
        assert run.lessons.weight(35.0) == 3.0
        run.step()
    assert run.scores.num_episodes == 0  # those of the teacher do not count as the student's
    assert run.metrics().teaching.weight == 3.0
    while run.scores.num_episodes < 3:
        run.step()
    told = run.metrics()
    expected = 3.0 * min(1.0, max(0.0, 1.0 - (told.score - 10.0) / 30.0))
    assert 0.0 < expected < 3.0
    if distil == "policy":  # nobody else teaches a policy head
        expected = 3.0
    assert told.teaching.weight == pytest.approx(expected)


# ---- phases --------------------------------------------------------------------------------------


def test_the_phases_follow_each_other_and_the_clock_counts_all():
    run, seen = trainer(EVENLY), []
    while run.agent_steps < 12:
        seen.append((run.phase, run.clock, run.learner.num_updates))
        run.step()
    assert seen[0] == ("teacher", 0, 0)
    assert seen[19] == ("teacher", 38, 0)
    assert seen[20] == ("offline", 40, 0)
    assert seen[25] == ("offline", 45, 5)
    assert seen[26] == ("online", 46, 6)
    assert [phase for phase, *_ in seen[26:]] == ["online"] * 6
    assert run.learner.num_updates == 6 + (12 - 4) // 4
    assert len(run.memory) == 12  # of its own: what the teacher did is gone


def test_each_phase_can_be_left_out():
    run = trainer(EVENLY, teacher_steps=0, offline_updates=0)
    assert run.phase == "online"
    run.step()
    assert (run.clock, run.agent_steps) == (2, 2)


# ---- what is asked and stored --------------------------------------------------------------------


def test_what_is_stored_is_what_the_teacher_said_in_both_memories():
    def said(seen: Any) -> Any:
        left = 1.0 / (1.0 + np.exp(-5.0 * seen[:, 2:3]))
        return np.concatenate([left, 1.0 - left], axis=1)

    run = trainer(Memoryless(said))
    for steps in (15, 40):
        while run.clock < steps or run.agent_steps < (steps == 40) * 30:
            run.step()
        batch = run.memory.sample(100, np.random.default_rng(0))
        stored = batch.extras[TAUGHT]
        assert stored.dtype == np.float32
        np.testing.assert_allclose(stored, said(batch.observations), atol=1e-6)
        assert np.ptp(stored) > 0.1


def test_a_teacher_with_memory_follows_the_episodes_whoever_acts():
    policy = Counting()
    run = trainer(policy, epsilon_start=1.0)
    ended = []
    while run.agent_steps < 60:
        before, offline = len(policy.asked), run.phase == "offline"
        run.step()
        assert len(policy.asked) == before + (not offline)  # no update asks
        if not offline:
            ended.append(run.lessons._begins.tolist())
    assert policy.asked[0][1] is None
    assert policy.asked[0][2] == [True, True]
    assert policy.asked[20][2] == [True, True]  # online, in episodes of its own
    assert [begins for *_, begins in policy.asked[1:20]] == ended[:19]
    assert [begins for *_, begins in policy.asked[21:]] == ended[20:-1]
    batch = run.memory.sample(200, np.random.default_rng(0))
    first = policy.asked[20][0][0]
    at = (batch.observations == first).all(axis=1)
    np.testing.assert_allclose(batch.extras[TAUGHT][at], 0.5)


def test_a_temperature_evens_out_what_is_taught_and_not_what_is_done():
    policy = Memoryless(lambda seen: np.tile([0.2, 0.8], (len(seen), 1)))
    told, _ = Teacher(policy, temperature=2.0).ask(np.zeros((1, 4)), None, np.array([True]))
    assert told.likely.tolist() == [[0.2, 0.8]]
    np.testing.assert_allclose(told.taught, [[1 / 3, 2 / 3]])


# ---- the same again ------------------------------------------------------------------------------


@pytest.mark.parametrize("clock", [0, 6, 40, 43, 46, 80])
def test_it_goes_on_to_the_bit_wherever_it_was_saved(clock):
    def flat(state: Any) -> Any:
        tree, arrays = pack(state)
        del tree["memory"]["frames"]
        kept = {f"{key}/{name}": (of.dtype.str, of.shape, of.tobytes())
                for key, held in arrays.items() for name, of in held.items()
                if not name.startswith("frames")}  # fmt: skip
        return tree, kept

    whole, first, second = (trainer(Counting(), draw=True, clip_rewards=True) for _ in range(3))
    while first.clock < clock:
        first.step()
    second.load_state_dict(unpack(*pack(first.state_dict())))
    for run in (whole, second):
        while run.agent_steps < 60:
            run.step()
    assert flat(second.state_dict()) == flat(whole.state_dict())


class Wayward(GymEnvironments):
    """Cannot be put back to where it was."""

    def load_state_dict(self, state: Any) -> Any:
        raise NotReproducible("It does something else.", "Begin anew.")


def test_where_episodes_cannot_be_restored_the_teacher_begins_new_ones_too():
    policy, told = Counting(), settings()
    first = trainer(Counting())
    for _ in range(10):
        first.step()
    run = Trainer(told, Wayward("CartPole-v1", 2, seed=1), (Teacher(policy), USUAL))
    assert run.load_state_dict(first.state_dict()) is not None
    run.step()
    assert policy.asked[0][1] is None
    assert policy.asked[0][2] == [True, True]
    assert run.lessons.teacher_steps == 22


def test_what_any_policy_remembers_can_be_kept():
    for memory in (
        None,
        np.arange(2.0),
        (np.arange(2.0), None),
        {"a": [np.zeros((2, 1))], "b": ()},
    ):
        lessons, again = (Lessons(Teacher(EVENLY), Levels(1, 0), settings(), 2) for _ in range(2))
        lessons._remembered = memory
        again.load_state_dict(unpack(*pack({"lessons": lessons.state_dict()}))["lessons"])
        assert str(again._remembered) == str(memory)
