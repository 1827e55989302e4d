"""Settings: every option once, told in one line what is wrong, the same from file and command."""

import re
import subprocess
import sys
from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trdlab.deep.presets import DEFAULT_PRESETS, PRESETS, preset, preset_line
from trdlab.deep.settings import TEACHING, TrainSettings, UpdateSettings
from trdlab.errors import InputError

GYM = TrainSettings("gym", "CartPole-v1")


@given(
    st.fixed_dictionaries(
        {"kind": st.sampled_from(["gym", "atari"]), "env": st.text()},
        optional={
            "env_arg": st.lists(st.text(), max_size=2),
            "seed": st.integers(0, 2**63 - 1),
            "N": st.integers(0, 50),
            "w": st.integers(1, 9),
            "learning_starts": st.integers(10, 1000),
            "learning_rate_end": st.floats(0, 1),
            "reduction": st.sampled_from(["sum", "mean"]),
            "loss": st.sampled_from(["squared", "huber"]),
            "max_grad_norm": st.floats(0.1, 10),
            "action_names": st.lists(st.sampled_from("abc"), max_size=3, unique=True),
            "double": st.booleans(),
            "hidden": st.lists(st.integers(1, 512), max_size=3),
            "weights": st.text(),
            "device": st.text(),
        },
    )
)
def test_settings_come_back_from_their_configuration(config):
    settings = TrainSettings.from_config(config)
    told = settings.to_config()
    assert told.items() >= config.items()
    assert TrainSettings.from_config(told) == settings


def test_what_is_not_said_has_the_default_and_what_is_not_set_is_not_told():
    told = GYM.to_config()
    assert (told["N"], told["w"], told["hidden"]) == (10, 1, [128, 128])
    unset = {"learning_rate_end", "max_grad_norm", "weights"}
    keys = {of.metadata.get("key") or of.name for of in fields(TrainSettings)}
    of_teacher = {of.name for of in fields(TrainSettings) if of.metadata.get("panel") == TEACHING}
    assert keys - told.keys() == unset | of_teacher
    assert keys - GYM.changed({"teacher": "ppo.zip"}).to_config().keys() == unset


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ({"teacher_steps": 5}, "`teacher_steps` is for learning from a teacher. Name one."),
        ({"draw": True}, "`draw` is for learning from a teacher. Name one."),
        (
            {"teacher": "a", "teacher_steps": 31},
            "`teacher_steps` is 31: too few for 5000 `offline_updates` in batches. Choose 32 or "
            "more, or no offline updates.",
        ),
        (
            {"teacher": "a", "offline_updates": 0},
            "`offline_updates` is 0: nothing would learn from 20000 steps of the teacher. Choose "
            "more, or set `teacher_steps` to 0, too.",
        ),
        (
            {"teacher": "a", "distil": "all"},
            "`distil` is 'all'. Use one of: auto, values, policy.",
        ),
        ({"teacher": "a", "temperature": 0.0}, "The temperature is 0.0. Choose one above 0."),
    ],
)
def test_what_does_not_go_together_with_a_teacher(lines, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        GYM.changed(lines)


def test_with_a_teacher_nothing_begins_at_random():
    alone, taught = GYM, GYM.changed({"teacher": "a", "epsilon_start": 0.25})
    assert alone.epsilon(0) == 1.0
    assert taught.epsilon(0) == 0.25
    assert (alone.clock_end, taught.clock_end) == (100_000, 125_000)


def test_whole_numbers_may_be_written_like_1e6():
    changed = GYM.changed({"agent_steps": 1e6, "gamma": 0, "hidden": [64.0]})
    assert (changed.agent_steps, changed.gamma, changed.hidden) == (1_000_000, 0.0, (64,))
    assert isinstance(changed.agent_steps, int)
    assert isinstance(changed.hidden[0], int)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ({"learning_rat": 1}, "unknown key 'learning_rat'. Did you mean 'learning_rate'?"),
        ({"horizon": 4}, "unknown key 'horizon'. Known: N, action_names"),
        ({"seed": "one"}, "has seed = 'one'. It must be a whole number."),
        ({"seed": 1.5}, "has seed = 1.5. It must be a whole number."),
        ({"seed": True}, "has seed = True. It must be a whole number."),
        ({"agent_steps": float("inf")}, "has agent_steps = inf. It must be a whole number."),
        ({"gamma": 10**400}, f"has gamma = {10**400}. It must be a number."),
        ({"gamma": "0.9"}, "has gamma = '0.9'. It must be a number."),
        ({"learning_rate_end": [1]}, "has learning_rate_end = [1]. It must be a number."),
        ({"double": 1}, "has double = 1. It must be true or false."),
        ({"device": 0}, "has device = 0. It must be a text."),
        ({"weights": 0}, "has weights = 0. It must be a text."),
        ({"hidden": 64}, "has hidden = 64. It must be a list of whole numbers."),
        ({"hidden": ["64"]}, "has hidden = ['64']. It must be a list of whole numbers."),
        ({"hidden": [64, [64]]}, "It must be a list of whole numbers."),
        ({"env_arg": [1]}, "has env_arg = [1]. It must be a list of texts."),
        ({"kind": "dm"}, "has kind = 'dm'. Use 'gym' or 'atari'."),
    ],
)
def test_a_line_that_cannot_be_used_is_named(lines, message):
    for refused in (
        lambda: GYM.changed(lines, "'run.toml'"),
        lambda: TrainSettings.from_config({"kind": "gym", "env": "x"} | lines, "'run.toml'"),
    ):
        with pytest.raises(InputError, match=re.escape(message)) as refusal:
            refused()
        assert str(refusal.value).startswith("'run.toml' has ")


def test_a_configuration_says_what_it_is_for():
    for lines, missing in (({"kind": "gym"}, "env"), ({"env": "CartPole-v1"}, "kind")):
        with pytest.raises(InputError, match=rf"^'a\.toml' does not say '{missing}'\. Add it\.$"):
            TrainSettings.from_config(lines, "'a.toml'")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ({"agent_steps": 0}, "`agent_steps` is 0. It must be 1 or more."),
        ({"num_envs": 0}, "`num_envs` is 0. It must be from 1 to 10,000."),
        ({"checkpoint_every": -1}, "`checkpoint_every` is -1. It must be 1 or more."),
        ({"seed": -1}, "`seed` is -1. It must be 0 or more."),
        ({"seed": 2**63}, "It must be less than 2**63."),
        ({"threads": -1}, "`threads` is -1. It must be 0 or more."),
        ({"epsilon_end": 1.5}, "`epsilon_end` is 1.5. It must be from 0 to 1."),
        ({"evaluate_epsilon": float("nan")}, "`evaluate_epsilon` is nan. It must be from 0 to 1."),
        ({"learning_rate": 0.0}, "learning rate is 0.0. Choose one above 0."),
        ({"learning_rate_end": -0.1}, "`learning_rate_end` is -0.1. It must be from 0 to 1."),
        ({"target_sync_updates": 0}, "`target_sync_updates` is 0. It must be 1 or more."),
        ({"reduction": "max"}, "The reduction is 'max'. Use 'sum' or 'mean'."),
        ({"loss": "hubert"}, "The loss is 'hubert'. Use 'squared' or 'huber'."),
        ({"precision": "half"}, "The precision is 'half'. Use 'float32' or 'bfloat16'."),
        ({"max_grad_norm": 0.0}, "`max_grad_norm` is 0.0. Choose a length above 0."),
        ({"max_grad_norm": float("nan")}, "`max_grad_norm` is nan. Choose a length above 0."),
        ({"action_names": ["up", "up"]}, "The action names are 'up', 'up'. Each has a name of"),
        ({"hidden": [0]}, "`hidden` is 0. It must be from 1 to 1,000,000."),
        ({"N": 10**24}, f"`horizon` is {10**24}. It must be from 0 to 10,000."),
        ({"hidden": [64, 10**7]}, "`hidden` is 10000000. It must be from 1 to 1,000,000."),
        ({"agent_steps": 2**63}, f"`agent_steps` is {2**63}. It must be less than 2**63."),
        (
            {"batch_size": 33, "capacity": 32},
            "A batch of 33 windows is larger than a replay memory "
            "of 32 transitions. Choose a smaller `batch_size` or a larger `capacity`.",
        ),
        ({"gamma": 1.0}, "gamma is 1.0. It must be at least 0 and less than 1"),
        ({"N": -1}, "`horizon` is -1. It must be from 0 to 10,000."),
        ({"w": 0}, "`width` is 0. It must be 1 or more."),
        (
            {"learning_starts": 15, "num_envs": 4, "w": 4},
            "`learning_starts` is 15: not one window of w = 4 steps is full by then. "
            "Choose 16 or more.",
        ),
    ],
)
def test_a_value_out_of_its_range_is_refused_with_its_option(lines, message):
    with pytest.raises(InputError, match=re.escape(message)):
        GYM.changed(lines)


def test_epsilon_is_one_until_learning_starts_and_then_falls_evenly():
    settings = GYM.changed(
        {
            "epsilon_start": 0.9,
            "epsilon_end": 0.1,
            "epsilon_steps": 100,
            "learning_starts": 10,
        }
    )
    assert [settings.epsilon(steps) for steps in (0, 9, 10, 50, 100, 10**9)] == pytest.approx(
        [1.0, 1.0, 0.82, 0.5, 0.1, 0.1]
    )
    at_once = settings.changed({"epsilon_steps": 0})
    assert at_once.epsilon(10) == 0.1


def test_the_learning_rate_falls_evenly_over_the_run():
    settings = GYM.changed({"learning_rate": 4e-3, "agent_steps": 1000})
    assert [settings.learning_rate_at(steps) for steps in (0, 500, 1000)] == [4e-3] * 3
    falling = settings.changed({"learning_rate_end": 0.0})
    assert [falling.learning_rate_at(steps) for steps in (0, 250, 1000, 1007)] == pytest.approx(
        [4e-3, 3e-3, 0.0, 0.0]
    )
    # 250 updates offline last as long as 1000 agent steps, at one update for every four
    taught = falling.changed({"teacher": "a.zip", "offline_updates": 250, "update_every": 4})
    told = [taught.learning_rate_at(steps, of) for steps, of in ((0, 0), (0, 125), (0, 250))]
    assert told == pytest.approx([4e-3, 3e-3, 2e-3])
    assert taught.learning_rate_at(500) == pytest.approx(1e-3)


def test_updates_that_are_due():
    settings = GYM.changed({"learning_starts": 10, "update_every": 4})
    assert [settings.updates_due(steps) for steps in (0, 10, 13, 14, 21, 22, 1010)] == [
        0, 0, 0, 1, 2, 3, 250,
    ]  # fmt: skip


def test_an_update_is_told_its_share():
    settings = GYM.changed({"learning_rate": 0.25, "double": True, "reduction": "mean"})
    assert settings.update_settings == UpdateSettings(0.25, 250, "mean", double=True)
    assert UpdateSettings() == UpdateSettings(1e-4, 1000, "sum", double=False, precision="float32")


def test_every_preset_can_be_used_and_says_what_it_is_for():
    for kind, known in PRESETS.items():
        assert DEFAULT_PRESETS[kind] in known
        assert preset(kind, "X") == preset(kind, "X", DEFAULT_PRESETS[kind])
        for name, (about, lines) in known.items():
            assert about
            assert preset(kind, "X", name).to_config().items() >= lines.items()
    with pytest.raises(InputError, match=r"no preset 'smok' for gym\. Did you mean 'smoke'\?"):
        preset("gym", "CartPole-v1", "smok")


@pytest.mark.parametrize(
    ("kind", "env", "name", "said"),
    [
        ("gym", "CartPole-v1", None, "classic, made for CartPole-v1."),
        ("gym", "Acrobot-v1", None, "acrobot, made for Acrobot-v1."),
        ("gym", "MountainCar-v0", None, "mountain-car, made for MountainCar-v0."),
        ("gym", "MountainCar-v0", "mountain-car", "mountain-car, made for MountainCar-v0."),
        ("gym", "LunarLander-v2", None, "lunar-lander, made for LunarLander-v2."),
        ("gym", "MountainCar-v0", "smoke", "smoke."),
        ("gym", "Taxi-v3", None, "classic. None are known for Taxi-v3: it may need others."),
        ("gym", "Taxi-v3", "classic", "classic."),
        ("gym", "mine:CartPole-v1", None, "classic. None are known for mine:CartPole-v1: it may "),
        ("gym", "CartPole", None, "classic. None are known for CartPole: it may need others."),
        ("atari", "Breakout", None, "cpu."),
        ("atari", "CartPole-v1", None, "cpu."),
        ("atari", "Breakout", "paper", "paper."),
    ],
)
def test_an_environment_that_is_known_has_settings_of_its_own(kind, env, name, said):
    assert preset_line(kind, env, name).startswith(f"Settings: the preset {said}")
    wanted = said.split()[0].rstrip(",.")
    assert preset(kind, env, name) == preset(kind, env, wanted)


def test_the_paper_s_settings():
    paper = preset("atari", "Breakout", "paper")
    assert (paper.horizon, paper.width, paper.gamma, paper.batch_size) == (40, 1, 0.99, 32)
    assert (paper.update_every, paper.learning_starts) == (4, 80_000)
    assert (paper.clip_rewards, paper.life_loss_ends) == (True, True)


def test_settings_and_presets_need_no_torch():
    source = "import sys, trdlab.deep.presets; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", source], check=False).returncode == 0
