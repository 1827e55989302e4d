"""Archives and loaded models act as the libraries that made them say: the same to the last action.

Needs the extra `interop`, which `make test` installs; without it these tests are skipped.
"""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore")  # of those libraries
sb3 = pytest.importorskip("stable_baselines3", reason="needs pip install 'trdlab[interop]'")
contrib = pytest.importorskip("sb3_contrib", reason="needs pip install 'trdlab[interop]'")

import torch  # noqa: E402
from sb3_contrib.common.recurrent.type_aliases import RNNStates  # noqa: E402

import trdlab  # noqa: E402
from doors import Doors  # noqa: E402
from trdlab.agents import given  # noqa: E402
from trdlab.environments.spaces import frame_space  # noqa: E402
from trdlab.explanations import assessment  # noqa: E402
from trdlab.explanations import explanation as explaining  # noqa: E402
from trdlab.policies import Likeliest, ask  # noqa: E402
from trdlab.policies.files import Options  # noqa: E402
from trdlab.policies.live import adapt as adapt_live  # noqa: E402
from trdlab.policies.registry import read_policy  # noqa: E402
from trdlab.rollouts.branches import Effort  # noqa: E402


class Seen(gym.Env):
    """Shows whatever is drawn from its space."""

    def __init__(self, space: gym.Space[Any], actions: gym.Space[Any]) -> None:
        self.observation_space, self.action_space = space, actions

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.observation_space.sample(), {}

    def step(self, action):
        return self.observation_space.sample(), 1.0, False, False, {}

    def action_masks(self):
        return [True] * gym.spaces.flatdim(self.action_space)


VECTOR = gym.spaces.Box(-3, 3, (5,))
IMAGE = gym.spaces.Box(0, 255, (36, 40, 3), np.uint8)
BOARD = gym.spaces.Box(-3, 3, (2, 3))
STATES = gym.spaces.Discrete(7)
PARTS = gym.spaces.Dict(
    {
        "of": gym.spaces.MultiDiscrete([2, 3]),
        "at": gym.spaces.Box(-3, 3, (2, 2), np.float64),
        "on": gym.spaces.MultiBinary(3),
        "state": STATES,
    }
)
PICTURED = gym.spaces.Dict({"seen": IMAGE, "at": VECTOR, "act": VECTOR})
BACKWARDS = gym.spaces.Dict([("z", VECTOR), ("it's, Box(", IMAGE), ("a", STATES)])
TURNS = gym.spaces.MultiDiscrete([2, 3], start=[0, 5])
RELU = {"activation_fn": torch.nn.ReLU, "net_arch": [8]}
OFF_POLICY = {"buffer_size": 10, "learning_starts": 1}
LSTM = {"lstm_hidden_size": 8}
CASES = {
    "DQN": (sb3.DQN, "MlpPolicy", VECTOR, OFF_POLICY),
    "DQN of a board": (sb3.DQN, "MlpPolicy", BOARD, OFF_POLICY),
    "DQN of states": (sb3.DQN, "MlpPolicy", STATES, OFF_POLICY),
    "DQN of images": (sb3.DQN, "CnnPolicy", IMAGE, OFF_POLICY),
    "DQN, tanh": (
        sb3.DQN, "MlpPolicy", VECTOR,
        OFF_POLICY | {"policy_kwargs": {"activation_fn": torch.nn.Tanh}},
    ),
    "QR-DQN": (
        contrib.QRDQN, "MlpPolicy", VECTOR, OFF_POLICY | {"policy_kwargs": {"n_quantiles": 5}}
    ),
    "QR-DQN of images": (
        contrib.QRDQN, "CnnPolicy", IMAGE, OFF_POLICY | {"policy_kwargs": {"n_quantiles": 5}}
    ),
    "PPO": (sb3.PPO, "MlpPolicy", VECTOR, {}),
    "PPO of states": (sb3.PPO, "MlpPolicy", STATES, {}),
    "PPO of images": (sb3.PPO, "CnnPolicy", IMAGE, {}),
    "PPO of images, flat": (sb3.PPO, "MlpPolicy", IMAGE, {"policy_kwargs": {"net_arch": [4]}}),
    "PPO of images, not shared": (
        sb3.PPO, "CnnPolicy", IMAGE,
        {"policy_kwargs": {"share_features_extractor": False, "normalize_images": False}},
    ),
    "PPO, relu": (sb3.PPO, "MlpPolicy", VECTOR, {"policy_kwargs": RELU}),
    "PPO, linear": (sb3.PPO, "MlpPolicy", VECTOR, {"policy_kwargs": {"net_arch": []}}),
    "PPO, uneven": (
        sb3.PPO, "MlpPolicy", VECTOR, {"policy_kwargs": {"net_arch": {"pi": [8], "vf": [4, 4]}}}
    ),
    "A2C": (sb3.A2C, "MlpPolicy", VECTOR, {}),
    "TRPO": (contrib.TRPO, "MlpPolicy", VECTOR, {}),
    "MaskablePPO": (contrib.MaskablePPO, "MlpPolicy", VECTOR, {}),
    "RecurrentPPO": (contrib.RecurrentPPO, "MlpLstmPolicy", VECTOR, {"policy_kwargs": LSTM}),
    "RecurrentPPO of two layers": (
        contrib.RecurrentPPO, "MlpLstmPolicy", VECTOR,
        {"policy_kwargs": LSTM | {"n_lstm_layers": 2, "shared_lstm": True,
                                  "enable_critic_lstm": False}},
    ),
    "RecurrentPPO of images": (
        contrib.RecurrentPPO, "CnnLstmPolicy", IMAGE, {"policy_kwargs": LSTM}
    ),
    "DQN of parts": (sb3.DQN, "MultiInputPolicy", PARTS, OFF_POLICY),
    "DQN of parts with images": (sb3.DQN, "MultiInputPolicy", PICTURED, OFF_POLICY),
    "QR-DQN of parts": (
        contrib.QRDQN, "MultiInputPolicy", PARTS, OFF_POLICY | {"policy_kwargs": {"n_quantiles": 5}}
    ),
    "PPO of parts": (sb3.PPO, "MultiInputPolicy", PARTS, {}),
    "PPO of parts with images": (sb3.PPO, "MultiInputPolicy", PICTURED, {}),
    "PPO of parts, not in order": (sb3.PPO, "MultiInputPolicy", BACKWARDS, {}),
    "PPO of parts, not divided": (
        sb3.PPO, "MultiInputPolicy", PICTURED, {"policy_kwargs": {"normalize_images": False}}
    ),
    "PPO of turns": (sb3.PPO, "MlpPolicy", VECTOR, {}),
    "MaskablePPO of turns": (contrib.MaskablePPO, "MlpPolicy", VECTOR, {}),
    "RecurrentPPO of turns": (
        contrib.RecurrentPPO, "MlpLstmPolicy", VECTOR, {"policy_kwargs": LSTM}
    ),
    "A2C of parts": (sb3.A2C, "MultiInputPolicy", PARTS, {}),
    "MaskablePPO of parts": (contrib.MaskablePPO, "MultiInputPolicy", PICTURED, {}),
    "RecurrentPPO of parts": (
        contrib.RecurrentPPO, "MultiInputLstmPolicy", PICTURED, {"policy_kwargs": LSTM}
    ),
}  # fmt: skip


@pytest.fixture(params=CASES)
def model(request) -> Any:
    kind, policy, space, how = CASES[request.param]
    actions = TURNS if "turns" in request.param else gym.spaces.Discrete(3)
    made = kind(policy, Seen(space, actions), seed=3, device="cpu", **how)
    with torch.no_grad():  # fresh networks hardly prefer anything
        for parameter in made.policy.parameters():
            parameter.mul_(3.0)
    return request.param.partition(" of ")[0].partition(",")[0], made, space


def drawn(space: gym.Space[Any], count: int) -> list[Any]:
    space.seed(4)
    return [space.sample() for _ in range(count)]


def together(observations: list[Any]) -> Any:
    """Returns a batch of observations, as the library takes it."""
    if isinstance(observations[0], dict):
        return {key: np.stack([of[key] for of in observations]) for key in observations[0]}
    return np.stack(observations)


def as_shown(space: gym.Space[Any], observations: list[Any]) -> np.ndarray:
    """Returns observations as our environments show them: images channels first, parts flat."""
    if isinstance(space, gym.spaces.Dict):
        flat = frame_space(space, "here")
        return np.stack([flat.flat(observation) for observation in observations])
    batch = np.stack(observations)
    return np.moveaxis(batch, -1, 1) if batch.ndim == 4 else batch


def likelihoods(told: Any) -> np.ndarray:
    """Returns the probability of each action; of two parts that of each pair."""
    of = getattr(told, "distributions", None) or told.distribution
    if not isinstance(of, list):
        return of.probs.numpy()
    one, other = (part.probs.numpy() for part in of)
    return np.einsum("bi,bj->bij", one, other).reshape(len(one), -1)


def theirs(model: Any, observations: np.ndarray, state: Any, begins: np.ndarray) -> np.ndarray:
    """Returns what the library itself computes: values, or probabilities, and its memory."""
    seen, _ = model.policy.obs_to_tensor(observations)
    with torch.no_grad():
        if hasattr(model.policy, "q_net"):
            return model.policy.q_net(seen).numpy(), None
        if hasattr(model.policy, "quantile_net"):
            return model.policy.quantile_net(seen).mean(dim=1).numpy(), None
        if not hasattr(model.policy, "lstm_actor"):
            return likelihoods(model.policy.get_distribution(seen)), None
        lstm = model.policy.lstm_actor
        blank = torch.zeros(lstm.num_layers, len(begins), lstm.hidden_size)
        state = (blank, blank) if state is None else state
        told, state = model.policy.get_distribution(seen, state, torch.tensor(begins).float())
        return likelihoods(told), state


def their_values(
    model: Any, observations: Any, state: Any, begins: np.ndarray, likely: np.ndarray
) -> tuple[np.ndarray, Any]:
    """Returns what the library's critic says `[B]`; of values of actions, that of the policy's."""
    policy = model.policy
    if not hasattr(policy, "predict_values"):
        return (theirs(model, observations, None, begins)[0] * likely).sum(axis=1), None
    seen, _ = policy.obs_to_tensor(observations)
    with torch.no_grad():
        if not hasattr(policy, "lstm_actor"):
            return policy.predict_values(seen)[:, 0].numpy(), None
        lstm, starts = policy.lstm_actor, torch.tensor(begins).float()
        blank = torch.zeros(lstm.num_layers, len(begins), lstm.hidden_size)
        state = RNNStates((blank, blank), (blank, blank)) if state is None else state
        values = policy.predict_values(seen, state.vf, starts)[:, 0].numpy()
        return values, policy.forward(seen, state, starts)[3]


@pytest.mark.parametrize("live", [False, True], ids=["archive", "loaded"])
def test_every_critic_says_what_its_library_says(model, live, tmp_path):
    _, made, space = model
    with torch.no_grad():  # large weights let large numbers cancel in float32
        for parameter in made.policy.parameters():
            parameter.div_(3.0)
    made.save(tmp_path / "agent")
    policy = adapt_live(made) if live else read_policy(tmp_path / "agent.zip", Options())
    observations = drawn(space, 1000)
    starts = np.random.default_rng(5).random((50, 20)) < 0.05  # [T, B], of later episodes
    mine, their, said = None, None, []
    for step, begins in enumerate(starts):
        begins |= step == 0
        batch = observations[20 * step : 20 * step + 20]
        shown = as_shown(space, batch)
        likely = ask(policy, shown, None, begins)[0]
        told, their = their_values(made, together(batch), their, begins, likely)
        values, mine = policy.state_values(shown, mine, begins, likely)
        # sums of pixels up to 255 are rounded in another order on every kind of processor
        np.testing.assert_allclose(values, told, rtol=2e-5, atol=1e-4 * np.abs(told).max())
        said.append(values)
    assert np.ptp(said) > 1e-3
    greedy = Likeliest(policy)
    np.testing.assert_array_equal(greedy.state_values(shown, mine, begins, likely)[0],
                                  policy.state_values(shown, mine, begins, likely)[0])  # fmt: skip


@pytest.mark.parametrize("live", [False, True], ids=["archive", "loaded"])
def test_every_algorithm_acts_as_its_library_says(model, live, tmp_path):
    name, made, space = model
    made.save(tmp_path / "agent")
    policy = adapt_live(made) if live else read_policy(tmp_path / "agent.zip", Options())
    observations = drawn(space, 1000)
    starts = np.random.default_rng(5).random((50, 20)) < 0.05  # [T, B], of later episodes
    mine, their = None, None
    for step, begins in enumerate(starts):
        begins |= step == 0
        batch = observations[20 * step : 20 * step + 20]
        told, their = theirs(made, together(batch), their, begins)
        shown = as_shown(space, batch)
        likely, mine = ask(policy, shown, mine, begins)
        own = policy.q_values(shown) if hasattr(policy, "q_values") else likely
        np.testing.assert_allclose(own, told, rtol=2e-5, atol=5e-5)
        chosen = np.take_along_axis(told, likely.argmax(axis=1)[:, None], axis=1)[:, 0]
        np.testing.assert_allclose(chosen, told.max(axis=1), rtol=2e-5, atol=5e-5)
    assert policy.about.algorithm.replace("-", "") == name.replace("-", "")
    assert policy.about.num_actions == (3 if made.action_space != TURNS else 6)
    assert policy.about.gamma == 0.99
    outputs = 15 if name == "QR-DQN" else gym.spaces.flatdim(made.action_space)
    assert policy.about.layers.endswith(f" → {outputs}")
    assert policy.about.version
    assert (policy.about.memory > 0) == (name == "RecurrentPPO") == (mine is not None)


def test_what_the_environment_normalises_is_normalised(tmp_path):
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    inside = VecNormalize(DummyVecEnv([lambda: gym.make("CartPole-v1")]))
    model = sb3.PPO("MlpPolicy", inside, n_steps=32, batch_size=32, seed=0, device="cpu")
    model.learn(64)
    agent = trdlab.agent(model, env="CartPole-v1")
    seen = np.float32([[0.1, 0.2, -0.1, 0.3], [1.0, 0.0, 0.1, 0.0]])
    likely, _ = ask(agent.policy, seen)
    tensor, _ = model.policy.obs_to_tensor(inside.normalize_obs(seen))
    with torch.no_grad():
        told = model.policy.get_distribution(tensor).distribution.probs.numpy()
    np.testing.assert_allclose(likely, told, rtol=1e-5)
    assert agent.evaluate(3, seed=0).returns.min() > 5
    model.save(tmp_path / "a")
    inside.save(tmp_path / "a.pkl")
    read = trdlab.agent(f"{tmp_path}/a.zip,normalize={tmp_path}/a.pkl", env="CartPole-v1")
    np.testing.assert_allclose(ask(read.policy, seen)[0], told, rtol=1e-5)
    assert repr(agent) == "<Agent: PPO · not fitted · push left, push right>"
    unit = np.sqrt(inside.ret_rms.var + inside.epsilon)
    assert not 0.9 < unit < 1.1
    with torch.no_grad():
        values = model.policy.predict_values(tensor)[:, 0].numpy() * unit
    for policy in (agent.policy, read.policy):
        told, _ = policy.state_values(seen, None, np.ones(2, dtype=bool), likely)
        np.testing.assert_allclose(told, values, rtol=1e-5)


def test_what_is_normalised_of_several_parts_is_normalised(tmp_path):
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    inside = VecNormalize(DummyVecEnv([lambda: Doors("nowhere")]), norm_obs_keys=["time"])
    how = {"n_steps": 32, "batch_size": 32, "seed": 0, "device": "cpu"}
    model = sb3.PPO("MultiInputPolicy", inside, **how).learn(64)
    model.save(tmp_path / "a")
    inside.save(tmp_path / "a.pkl")
    seen = np.float32([[1, 0, 1, 0.5], [1, 1, 1, 0.0]])
    read = read_policy(tmp_path / "a.zip", Options(normalize=str(tmp_path / "a.pkl")))
    np.testing.assert_allclose(ask(read, seen)[0], ask(adapt_live(model), seen)[0], rtol=1e-5)
    plain = read_policy(tmp_path / "a.zip", Options())
    assert (ask(read, seen)[0] != ask(plain, seen)[0]).all()


def test_an_agent_that_sees_parts_acts_in_their_environment(tmp_path):
    model = sb3.PPO("MultiInputPolicy", Doors("nowhere"), n_steps=64, seed=0, device="cpu")
    model.save(tmp_path / "doors")
    agents = [
        trdlab.agent(what, env=lambda: Doors("nowhere")) for what in (model, tmp_path / "doors.zip")
    ]
    returns = [agent.evaluate(10, seed=1).returns.tolist() for agent in agents]
    assert returns[0] == returns[1]
    with pytest.raises(trdlab.errors.InputError, match=r"'CartPole-v1' does not fit 'doors': it"):
        trdlab.agent(tmp_path / "doors.zip", env="CartPole-v1")


@pytest.mark.parametrize("live", [False, True], ids=["archive", "loaded"])
def test_masks_do_what_they_do_in_their_library(live, tmp_path):
    model = contrib.MaskablePPO("MultiInputPolicy", Doors(), n_steps=64, seed=0, device="cpu")
    model.learn(128)
    model.save(tmp_path / "doors")
    what = model if live else tmp_path / "doors.zip"
    agent, rng = trdlab.agent(what, env=Doors), np.random.default_rng(0)
    observations, allowed = drawn(Doors().observation_space, 200), rng.random((200, 3)) < 0.5
    allowed[:, 1] |= ~allowed.any(axis=1)
    seen, _ = model.policy.obs_to_tensor(together(observations))
    with torch.no_grad():
        told = model.policy.get_distribution(seen, action_masks=allowed).distribution.probs.numpy()
    shown = as_shown(Doors().observation_space, observations)
    likely = ask(agent.policy, shown, allowed=allowed)[0]
    np.testing.assert_allclose(likely, told, rtol=2e-5, atol=1e-6)
    for greedy in (False, True):  # a closed door would be an error
        assert agent.evaluate(20, greedy=greedy).mean.value > 3


@pytest.fixture
def quick(monkeypatch) -> None:
    """Makes what is usually played and learned less."""
    monkeypatch.setitem(trdlab.fit.__kwdefaults__, "steps", 2_000)
    monkeypatch.setitem(trdlab.fit.__kwdefaults__, "seconds", 1.0)
    for module in (assessment, explaining):
        monkeypatch.setattr(module, "usual_episodes", lambda agent: 4)
    few = Effort(episodes=2, moments=1, copies=2, tries=2)
    made = given.acting_agent
    monkeypatch.setattr(given, "acting_agent", lambda *what: replace(made(*what), effort=few))


LINES = """
import trdlab
from stable_baselines3 import PPO
agent = trdlab.agent(PPO.load("lander"), env="LunarLander-v3")
agent = trdlab.fit(agent, horizon=40)
explanation = trdlab.explain(agent, seed=3, step=120)
print(explanation)
explanation.plot(); explanation.to_html("report.html"); explanation.to_dict()
trdlab.calibrate(agent)
"""
"""What trdlab is for, as somebody would write it down."""


def test_the_lines_that_trdlab_is_for_run_as_they_stand(quick, tmp_path, monkeypatch):
    pytest.importorskip("Box2D", reason="needs pip install 'trdlab[box2d]'")
    model = sb3.PPO(
        "MlpPolicy", "LunarLander-v3", policy_kwargs={"net_arch": []}, seed=0, device="cpu"
    )
    steer = torch.zeros(4, 8)  # from position, speed, angle and turn to what it may do
    steer[2, 3], steer[3, 2:6] = -20.0, torch.tensor([3.0, 0.0, 10.0, 10.0])
    steer[1] = -steer[3]
    with torch.no_grad():
        model.policy.action_net.weight.copy_(steer)
        model.policy.action_net.bias.copy_(torch.tensor([0.0, 0.0, -4.0, 0.0]))
    model.save(tmp_path / "lander")
    monkeypatch.chdir(tmp_path)
    left: dict[str, Any] = {}
    exec(LINES, left)
    assert left["agent"].is_fitted
    assert left["agent"].estimator.time_axis == trdlab.TimeAxis(0.99, 40)
    assert str(left["explanation"]).startswith("PPO · step 120 of the episode with seed 3")


def test_what_cannot_act_here_is_refused(tmp_path):
    model = sb3.PPO("MlpPolicy", "Pendulum-v1", device="cpu")
    with pytest.raises(trdlab.errors.InputError, match="action space of this PPO is Box"):
        trdlab.agent(model, env="CartPole-v1")
    model.save(tmp_path / "box")
    with pytest.raises(trdlab.errors.InputError, match=r"actions of the agent in .* are a Box"):
        read_policy(tmp_path / "box.zip", Options())
    soft = sb3.SAC("MlpPolicy", "Pendulum-v1", buffer_size=10, device="cpu")
    soft.save(tmp_path / "soft")
    with pytest.raises(trdlab.errors.InputError, match="holds an agent of SAC"):
        read_policy(tmp_path / "soft.zip", Options())
