"""`trdlab agent` as its users see it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from archives import (
    box,
    cartpole_dqn,
    cartpole_ppo,
    data,
    drawn,
    layers,
    ppo_shapes,
    save_archive,
    several,
    tensors,
    torch_bytes,
)

CARTPOLE = ("--env", "CartPole-v1")


class Mark:
    """Pickled code: whoever executes it leaves a mark."""

    def __reduce__(self):
        return os.system, ("touch mark",)


def test_actions_are_called_as_the_user_says(trdlab, tmp_path):
    cartpole_ppo(tmp_path / "mine.zip")
    names = ("--action-names", "west,east")
    _, out, _ = trdlab("agent", "mine.zip", *CARTPOLE, *names, "--episodes", 1)
    assert "2 actions (west, east)" in " ".join(out.split())


def test_an_archive_is_shown_checked_and_played(trdlab, tmp_path):
    cartpole_ppo(tmp_path / "mine.zip")
    code, out, err = trdlab("agent", "mine.zip", *CARTPOLE, "--episodes", 6, "--seed", 3)
    assert (code, err) == (0, "")
    words = " ".join(out.split())
    for said in (
        "agent PPO of Stable-Baselines3 2.3.0",
        "sees 4 float32",
        "does 2 actions",
        "network 4 → 5 → 2, Tanh",
        "gamma 0.9",
        "acts draws its actions, each as likely as it says",
        "expects nobody knows yet: fit it",
        "6 episodes, sampled, seed 3; raw rewards, undiscounted",
        "95 % interval",
    ):
        assert said in words
    _, out, _ = trdlab("agent", "mine.zip", *CARTPOLE, "--episodes", 6, "--greedy")
    assert "6 episodes, greedy, seed 0" in out
    assert "takes the action that it holds for the best" in out
    _, again, _ = trdlab("agent", "mine.zip,greedy=true", *CARTPOLE, "--episodes", 6)
    assert again == out


def test_json_says_the_same(trdlab, tmp_path):
    cartpole_dqn(tmp_path / "mine.zip")
    code, out, _ = trdlab("agent", "mine.zip", *CARTPOLE, "--episodes", 3, "--json")
    told = json.loads(out)
    assert code == 0
    assert told["schema"] == "trdlab.agent/1"
    assert told["about"]["algorithm"] == "DQN"
    assert (told["about"]["seen"], told["about"]["layers"]) == ([4], "4 → 5 → 2")
    assert (told["acts"], told["is_fitted"]) == ("greedy", False)
    assert len(told["evaluation"]["returns"]) == 3
    assert told["environment"]["observation"] == {"shape": [4], "dtype": "float32"}


def test_any_other_agent_is_shown_and_played_too(trdlab, trained):
    code, out, _ = trdlab("agent", "gridworld:drone", "--episodes", 2)
    assert code == 0
    assert "agent drone" in " ".join(out.split())
    assert "nobody knows" not in out
    code, out, _ = trdlab("agent", trained, "--episodes", 2, "--json")
    assert code == 0
    assert json.loads(out)["about"] is None


def test_a_file_of_python_and_plain_layers(trdlab, tmp_path):
    (tmp_path / "mine.py").write_text("def make():\n    return lambda seen: int(seen[2] > 0)\n")
    code, out, _ = trdlab("agent", "python:mine.py:make", *CARTPOLE, "--episodes", 3)
    assert code == 0
    (tmp_path / "a.pth").write_bytes(torch_bytes(tensors(drawn(layers("", 16, 4)))))
    lake = ("--env", "FrozenLake-v1")
    code, out, _ = trdlab("agent", "a.pth", *lake, "--episodes", 3)
    assert code == 0
    assert "network 16 → 4" in " ".join(out.split())


def test_parts_and_forbidden_actions_are_the_environments(trdlab, tmp_path):
    source = Path(__file__).parents[1] / "shared" / "doors.py"
    registered = f'{source.read_text(encoding="utf-8")}\n\ngym.register("Doors-v0", Doors)\n'
    (tmp_path / "cli_doors.py").write_text(registered, encoding="utf-8")
    said = several("{'open': MultiBinary(3), 'time': Box(0.0, 1.0, (1,), float32)}")
    beside = data("sb3_contrib.common.maskable.policies", said, actions=3, clip_range=1)
    save_archive(tmp_path / "mine.zip", drawn(ppo_shapes(actions=3)), beside)
    words = ("agent", "mine.zip", "--env", "cli_doors:Doors-v0")
    for more in ((), ("--greedy",)):  # a closed door would be an error
        code, out, err = trdlab(*words, "--episodes", 10, *more)
        assert (code, err) == (0, "")
        assert "agent MaskablePPO of Stable-Baselines3 2.3.0" in " ".join(out.split())
        assert "mean length 6.0 agent steps" in " ".join(out.split())
    code, _, err = trdlab("agent", "mine.zip", "--env", "Blackjack-v1")
    assert (code, err) == (
        2,
        "error: 'Blackjack-v1' does not fit 'mine': it has 45 float32 to see and 2 actions. This "
        "MaskablePPO needs a Dict of 'open' (3,), 'time' (1,) and 3 actions.\n",
    )


@pytest.mark.parametrize("command", ["explain", "compare"])
def test_who_asks_what_it_expects_is_told_to_fit_it(trdlab, tmp_path, command):
    cartpole_ppo(tmp_path / "mine.zip")
    names = ["mine.zip"] * (2 if command == "compare" else 1)
    code, out, err = trdlab(command, *names, *CARTPOLE)
    assert (code, out) == (2, "")
    assert err == (
        "error: Nobody knows yet what this agent expects. Fit it first: trdlab.fit(agent), or "
        "trdlab fit.\n"
    )
    assert not Path("explanations").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("mine.zip",),
         "Nothing says where 'mine.zip' acts: it is a PPO of Stable-Baselines3 2.3.0. Give its "
         "--env: it needs observations of shape (4,) and 2 actions."),
        (("mine.zip", "--env", "Acrobot-v1"),
         "'Acrobot-v1' does not fit 'mine': it has 6 float32 to see and 3 actions (torque -1, "
         "torque 0, torque +1). This PPO needs observations of shape (4,) and 2 actions."),
        (("mine.zip", "--env", "FrozenLake-v1"), "it has 16 states to see and 4 actions"),
        (("mine.zip", "--env", "CartPol-v1"), "Did you mean 'CartPole-v1'"),
        (("mine.zip,tanh=1", *CARTPOLE), "An agent's file takes no argument 'tanh'"),
        (("mine.zip,activation=wave", *CARTPOLE), "There is no activation 'wave'"),
        (("hostile.zip", *CARTPOLE), "'hostile.zip: policy.pth' holds code (posix.system)"),
        (("hostile.pt", *CARTPOLE), "'hostile.pt' holds code (posix.system)"),
        (("torn.zip", *CARTPOLE), "'torn.zip' is torn"),
        (("unknown.zip", *CARTPOLE), "'unknown.zip' holds an agent of TD3. Those of DQN, PPO"),
        (("python:none.py:make", *CARTPOLE), "There is no file 'none.py'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(trdlab, tmp_path, words, message):
    whole = cartpole_ppo(tmp_path / "mine.zip").read_bytes()
    (tmp_path / "torn.zip").write_bytes(whole[: len(whole) // 2])
    cartpole_ppo(tmp_path / "hostile.zip", policy=torch_bytes({"a": Mark()}))
    (tmp_path / "hostile.pt").write_bytes(torch_bytes({"a": Mark()}))
    other = data("stable_baselines3.td3.policies", box(4))
    save_archive(tmp_path / "unknown.zip", drawn(layers("actor.mu.", 4, 1)), other)
    code, out, err = trdlab("agent", *words)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert not (tmp_path / "mark").exists()


def test_the_command_line_imports_no_torch_for_an_agent_of_ones_own(tmp_path):
    (tmp_path / "mine.py").write_text("def make():\n    return lambda seen: 0\n")
    source = """
import sys
from trdlab.cli import main
try:
    main(["agent", "python:mine.py:make", "--env", "CartPole-v1", "--episodes", "2"])
except SystemExit as end:
    assert not end.code, end.code
assert "torch" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", source], check=True, cwd=tmp_path, stdout=subprocess.PIPE)
