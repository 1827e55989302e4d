"""The replay memory against a naive reading of everything that was ever recorded."""

import json
import pickle
import sys
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from trdlab.deep.frames import FrameStore
from trdlab.deep.memory import available_memory, check_memory, memory_needed
from trdlab.deep.replay import ReplayBuffer
from trdlab.errors import InputError, TrdlabError

GAMMA = 0.9
EXTRAS = {"id": ((), np.int64), "logits": ((3,), np.float32)}
IMAGE, VECTOR = ((6, 5), np.uint8), ((3,), np.float64)


@dataclass
class Step:
    """A transition as the naive reference keeps it."""

    frame: int  # index of s_t's frame in its environment's list
    reset: int  # index of the frame at the last reset
    action: int
    reward: float
    ending: str
    id: int


@dataclass
class History:
    """Everything that one environment has ever shown."""

    frames: list[np.ndarray] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    running: bool = False
    reset: int = 0


class Recorder:
    """Plays random episodes into a memory, and remembers all of it."""

    def __init__(self, seed: int, shape, dtype, num_envs: int, *, time_limit=None, **chances):
        self.rng = np.random.default_rng(seed)
        self.shape, self.dtype, self.num_envs = shape, np.dtype(dtype), num_envs
        self.time_limit = time_limit
        self.chances = {"end": 0.15, "cut": 0.1, "life": 0.0, "idle": 0.15} | chances
        self.envs = [History() for _ in range(num_envs)]
        self.ids = 0

    def frame(self) -> np.ndarray:
        if self.dtype == np.uint8:
            return self.rng.integers(1, 256, self.shape, dtype=np.uint8)
        return self.rng.normal(size=self.shape).astype(self.dtype)

    def play(self, memory: ReplayBuffer, turns: int) -> None:
        for _ in range(turns):
            memory.add(**self.step())

    def step(self) -> dict:
        """Returns the arguments of one `add`, after noting them."""
        size, chances, rng = self.num_envs, self.chances, self.rng
        active = rng.random(size) >= chances["idle"]
        life = rng.random(size) < chances["life"]
        ended = (rng.random(size) < chances["end"]) | life
        cut = rng.random(size) < chances["cut"]
        actions, rewards = rng.integers(3, size=size), rng.normal(size=size).astype(np.float32)
        observations = np.stack([self.frame() for _ in range(size)])
        following = np.stack([self.frame() for _ in range(size)])
        ids = np.arange(self.ids, self.ids + size)
        self.ids += size
        for e in np.flatnonzero(active):
            env = self.envs[e]
            if not env.running:
                env.reset, env.running = len(env.frames), True
                env.frames.append(observations[e])
            else:
                observations[e] = env.frames[-1]
            if self.time_limit and len(env.frames) - env.reset == self.time_limit:
                cut[e] = True
            ending = "end" if ended[e] else "cut" if cut[e] else ""
            step = (len(env.frames) - 1, env.reset, actions[e], rewards[e], ending, ids[e])
            env.steps.append(Step(*step))
            env.frames.append(following[e])
            env.running = not ending or bool(life[e])
        return {
            "observations": observations,
            "actions": actions,
            "rewards": rewards,
            "terminated": ended,
            "truncated": cut,
            "next_observations": following,
            "active": active,
            "goes_on": life,
            "extras": {"id": ids, "logits": np.outer(ids, [1, 2, 3]).astype(np.float32)},
        }


def stacked(env: History, frame: int, reset: int, stack: int | None, padding: str) -> np.ndarray:
    if stack is None:
        return env.frames[frame]
    zero = np.zeros_like(env.frames[0])
    before = env.frames[reset] if padding == "reset" else zero
    wanted = range(frame - stack + 1, frame + 1)
    return np.stack([env.frames[i] if i >= reset else before for i in wanted])


def expected(recorder: Recorder, memory: ReplayBuffer) -> dict[int, tuple]:
    """Returns by its id what each window must be, and nothing but those that may be sampled."""
    windows, width = {}, memory.width
    for env in recorder.envs:
        held = memory.capacity // recorder.num_envs
        for begin in range(max(0, len(env.steps) - held), len(env.steps)):
            first, steps, ending = env.steps[begin], [], ""
            for step in env.steps[begin : begin + width]:
                steps.append(step)
                ending = step.ending
                if ending:
                    break
            if len(steps) < width and ending != "end":
                continue
            limit = recorder.time_limit
            if limit and memory.time_limit and first.frame - first.reset + width > limit:
                continue
            how = (first.reset, memory.stack, memory.padding)
            windows[first.id] = (
                stacked(env, first.frame, *how),
                first.action,
                sum(GAMMA**i * float(step.reward) for i, step in enumerate(steps)),
                0.0 if ending == "end" else GAMMA**width,
                stacked(env, first.frame + len(steps), *how),
                len(steps),
            )
    return windows


def all_windows(memory: ReplayBuffer):
    """Returns every window that can be drawn, once."""
    if not memory.num_windows:
        return None
    drawn = memory.sample(25 * memory.num_windows, np.random.default_rng(0))
    return memory.windows(np.unique(drawn.indices))


def assert_same(memory: ReplayBuffer, recorder: Recorder) -> None:
    windows, batch = expected(recorder, memory), all_windows(memory)
    assert memory.num_windows == len(windows)
    if batch is None:
        return
    assert sorted(batch.extras["id"].tolist()) == sorted(windows)
    for row, name in enumerate(batch.extras["id"].tolist()):
        observation, action, reward, discount, following, steps = windows[name]
        np.testing.assert_array_equal(batch.observations[row], observation)
        np.testing.assert_array_equal(batch.next_observations[row], following)
        assert np.asarray(batch.observations).dtype == recorder.dtype
        assert batch.actions[row] == action
        assert batch.rewards[row] == pytest.approx(reward, rel=1e-6, abs=1e-6)
        assert batch.discounts[row] == np.float32(discount)
        assert batch.steps[row] == steps
        assert batch.extras["logits"][row].tolist() == [name, 2 * name, 3 * name]


DEVICES = pytest.mark.parametrize("device", [None, "cpu"])
"""Where frames lie: in the memory of the CPU; and on a device, for which it stands in."""


def make(capacity: int, kind=IMAGE, **options) -> ReplayBuffer:
    options = {"width": 1, "gamma": GAMMA, "extras": EXTRAS} | options
    return ReplayBuffer(capacity, *kind, **options)


@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    width=st.sampled_from([1, 2, 3, 5]),
    stack=st.sampled_from([None, 1, 4]),
    num_envs=st.integers(1, 3),
    padding=st.sampled_from(["reset", "zero"]),
    kind=st.sampled_from([IMAGE, VECTOR]),
    life=st.sampled_from([0.0, 0.2]),
    time_limit=st.sampled_from([None, 5, 9]),
    turns=st.integers(1, 90),
    device=st.sampled_from([None, "cpu"]),
)
def test_windows_are_those_of_the_recorded_history(
    seed, width, stack, num_envs, padding, kind, life, time_limit, turns, device
):
    recorder = Recorder(seed, *kind, num_envs, life=life, time_limit=time_limit)
    memory = make(
        20 * num_envs,
        kind,
        width=width,
        stack=stack,
        num_envs=num_envs,
        padding=padding,
        time_limit=time_limit,
        device=device,
    )
    recorder.play(memory, turns)
    assert_same(memory, recorder)


@pytest.mark.parametrize("width", [1, 3, 5])
@pytest.mark.parametrize("num_envs", [1, 3])
@DEVICES
def test_at_every_moment_of_a_long_run(width, num_envs, device):
    recorder = Recorder(1, *IMAGE, num_envs)  # into chunks of two
    memory = make(70 * num_envs, width=width, stack=4, num_envs=num_envs, device=device)
    for _ in range(60):
        recorder.play(memory, 5)
        assert_same(memory, recorder)
    assert min(len(env.steps) for env in recorder.envs) > 3 * 70  # wrapped around


def scripted(memory: ReplayBuffer, last: str, length: int) -> None:
    """Adds an episode of frames 0 … length, which all pay 1."""
    for t in range(length):
        over = t == length - 1
        now, then = (np.full((1, *IMAGE[0]), i, dtype=np.uint8) for i in (t, t + 1))
        memory.add(now, [t], [1.0], [over and last == "end"], [over and last == "cut"], then)


def numbers(batch) -> dict[int, tuple]:
    """Returns by action the discount, the steps, and the first pixels of the stack at s_(t+w)."""
    return {
        int(batch.actions[i]): (
            round(float(batch.discounts[i]), 4),
            int(batch.steps[i]),
            batch.next_observations[i, :, 0, 0].tolist(),
        )
        for i in range(len(batch))
    }


def test_truncation_keeps_the_full_window_and_its_true_last_frame_and_no_other():
    memory = make(40, width=3, stack=2, extras=None)
    scripted(memory, "cut", 4)
    scripted(memory, "cut", 2)  # too short: nothing of it may be sampled
    scripted(memory, "cut", 3)
    batch = memory.windows(np.flatnonzero(memory.state_dict()["arrays"]["valid"]))
    assert batch.actions.tolist() == [0, 1, 0]  # of the first episode two, of the third one
    assert batch.next_observations[:, :, 0, 0].tolist() == [[2, 3], [3, 4], [2, 3]]
    assert batch.discounts.tolist() == pytest.approx([GAMMA**3] * 3)


def test_termination_keeps_partial_windows_with_discount_zero():
    memory = make(40, width=3, stack=2, extras=None)
    scripted(memory, "end", 4)
    batch = all_windows(memory)
    assert numbers(batch) == {
        0: (round(GAMMA**3, 4), 3, [2, 3]),
        1: (0.0, 3, [3, 4]),
        2: (0.0, 2, [3, 4]),
        3: (0.0, 1, [3, 4]),
    }
    paid = [1 + GAMMA + GAMMA**2, 1 + GAMMA + GAMMA**2, 1 + GAMMA, 1.0]
    assert batch.rewards.tolist() == pytest.approx(paid)


def test_padding_is_that_of_gymnasium():
    import gymnasium as gym
    from gymnasium.wrappers import FrameStackObservation

    for padding in ("reset", "zero"):
        env = FrameStackObservation(gym.make("CartPole-v1"), 4, padding_type=padding)
        memory = ReplayBuffer(50, (4,), np.float32, width=1, gamma=1.0, stack=4, padding=padding)
        observation, _ = env.reset(seed=3)
        seen, over = [], False
        while not over:
            action = len(seen) % 2
            following, reward, over, cut, _ = env.step(action)
            memory.add(
                observation[None, -1], [action], [reward], [over], [cut], following[None, -1]
            )
            seen.append((observation, following))
            observation = following
        batch = memory.windows(np.arange(len(seen)))
        np.testing.assert_array_equal(batch.observations, [pair[0] for pair in seen])
        np.testing.assert_array_equal(batch.next_observations, [pair[1] for pair in seen])


def test_interrupting_cuts_the_running_episodes():
    recorder, memory = Recorder(5, *IMAGE, 2, idle=0.0), make(80, width=3, num_envs=2, stack=4)
    for _ in range(10):
        recorder.play(memory, 4)
        memory.interrupt()
        for env in recorder.envs:
            env.steps[-1].ending = env.steps[-1].ending or "cut"
            env.running = False
    assert_same(memory, recorder)


@pytest.mark.parametrize("cut", [0.0, 0.9])  # most windows may be drawn, or few
def test_every_window_is_as_likely(cut):
    recorder = Recorder(2, *IMAGE, 3, cut=cut, end=0.02)
    memory = make(300, width=3, num_envs=3)
    recorder.play(memory, 150)
    drawn = memory.sample(200 * memory.num_windows, np.random.default_rng(7)).indices
    counts = np.bincount(drawn)
    assert np.count_nonzero(counts) == memory.num_windows > 5
    assert chisquare(counts[counts > 0]).pvalue > 0.001


def test_the_same_seed_draws_the_same():
    recorder, memory = Recorder(3, *IMAGE, 2), make(60, num_envs=2, stack=4)
    recorder.play(memory, 80)
    first, second, third = (
        memory.sample(32, np.random.default_rng(seed)).indices.tolist() for seed in (1, 1, 2)
    )
    assert first == second != third


@pytest.mark.parametrize("kind", [IMAGE, VECTOR])
@pytest.mark.parametrize("turns", [3, 250])
@DEVICES
def test_a_saved_memory_goes_on_as_if_nothing_had_happened(kind, turns, device):
    recorder = Recorder(4, *kind, 2, life=0.1)
    options = {"width": 3, "num_envs": 2, "stack": 4}
    memory, again = (make(140, kind, **options, device=of) for of in (None, device))
    recorder.play(memory, turns)
    saved = pickle.loads(pickle.dumps(memory.state_dict()))
    saved["settings"] = json.loads(json.dumps(saved["settings"]))
    blocks = saved["frames"]["sealed"]
    blocks |= {name: np.frombuffer(blob, np.uint8) for name, blob in blocks.items()}  # as a file
    again.load_state_dict(saved)
    assert again.nbytes == memory.nbytes
    for _ in range(100):
        step = recorder.step()
        memory.add(**step)
        again.add(**step)
    assert_same(again, recorder)
    left, right = (one.sample(32, np.random.default_rng(0)) for one in (memory, again))
    np.testing.assert_array_equal(left.observations, right.observations)
    np.testing.assert_array_equal(left.next_observations, right.next_observations)
    np.testing.assert_array_equal(left.rewards, right.rewards)
    assert left.indices.tolist() == right.indices.tolist()


def test_a_state_is_a_copy_and_its_full_chunks_never_change():
    recorder, memory = Recorder(6, *IMAGE, 1, idle=0.0), make(320)  # chunks of ten
    recorder.play(memory, 100)
    before = memory.state_dict()
    counts, kept = before["arrays"]["counts"].copy(), dict(before["frames"]["sealed"])
    recorder.play(memory, 100)
    after = memory.state_dict()
    assert before["arrays"]["counts"] == counts
    assert len(kept) >= 10
    assert all(after["frames"]["sealed"][name] == blob for name, blob in kept.items())
    assert len(after["frames"]["open"]) <= 1


def test_frames_are_forgotten_with_the_transitions():
    recorder, memory = Recorder(8, *IMAGE, 2, idle=0.0, end=0.01, cut=0.0), make(640, num_envs=2)
    recorder.play(memory, 400)
    full = memory.nbytes
    recorder.play(memory, 2000)
    assert len(memory) == 640
    assert memory.nbytes < 1.1 * full


def test_compression_is_lossless_whatever_the_frame():
    rng = np.random.default_rng(0)
    store = FrameStore((84, 84), np.uint8, 1, 3, compress=True)
    noise = rng.integers(256, size=(84, 84), dtype=np.uint8)
    frames = [noise, np.zeros_like(noise), noise.T, np.tile(noise[:1], (84, 1))]
    for frame in frames:
        store.append(0, frame)
    read = store.read(np.zeros(6, dtype=np.int64), np.array([3, 0, 1, -1, 2, 0]))
    np.testing.assert_array_equal(read, [frames[3], noise, frames[1], frames[1], noise.T, noise])


def test_what_stays_the_same_on_a_screen_is_stored_once():
    rng = np.random.default_rng(0)
    store = FrameStore((84, 84), np.uint8, 2, 50, compress=True)
    screens = rng.integers(256, size=(2, 84, 84), dtype=np.uint8)  # cannot be compressed
    shown = np.repeat(screens[:, None], 120, axis=1)  # [2, 120, 84, 84]
    shown[:, np.arange(120), np.arange(120) % 84] = 7  # but for a line
    for t in range(120):
        for stream in (0, 1):
            store.append(stream, shown[stream, t])
    assert store.nbytes < 2 * (3 * (7056 + 100) + 120 * 250)  # three chunks in each stream
    streams, numbers = np.array([[1], [0]]), np.arange(120)
    np.testing.assert_array_equal(store.read(streams, numbers[None] + 0 * streams), shown[::-1])


def test_what_it_will_take_is_told_beforehand():
    shape, options = (84, 84), {"extras": {"logits": ((18,), np.float32)}, "num_envs": 4}
    memory = ReplayBuffer(4000, shape, width=3, gamma=0.99, stack=4, **options)
    rng = np.random.default_rng(0)
    frames = rng.integers(256, size=(64, *shape), dtype=np.uint8)
    frames[:, 19:] = 0  # 1 596 bytes of noise are left
    for t in range(1300):
        now, then = (frames[(np.arange(4) * 7 + t + i) % 64] for i in (0, 1))
        logits = {"logits": np.zeros((4, 18))}
        memory.add(now, [0] * 4, [0.0] * 4, [False] * 4, [False] * 4, then, extras=logits)
    told = memory_needed(4000, shape, frame_nbytes=memory.bytes_per_frame, **options)
    assert memory.nbytes == pytest.approx(told, rel=0.04)
    assert memory.bytes_per_transition == pytest.approx(memory.nbytes / 4000, rel=0.01)
    assert memory_needed(4000, shape, **options) == pytest.approx(memory.nbytes, rel=0.1)


def test_vectors_take_what_they_are():
    kind = ((4,), np.float32)
    needed = memory_needed(1_000_000, *kind)
    assert needed == pytest.approx(1_000_000 * (16 + 4 + 34), rel=0.02)


def test_a_memory_that_does_not_fit_is_refused_with_the_cure():
    needed = memory_needed(1_000_000, (84, 84))
    check_memory(needed, 1_000_000, available=4_000_000_000)
    message = "takes about 1.67 GB, and 1.50 GB is free. Choose a capacity of at most 800000"
    with pytest.raises(TrdlabError, match=message):
        check_memory(needed, 1_000_000, available=1_500_000_000)
    free = available_memory()
    assert free is None or free > 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": 0}, "width w is 0. It must be at least 1"),
        ({"num_envs": 0}, "number of environments is 0"),
        ({"stack": 0}, "stack is 0. It must be at least 1"),
        ({"width": 60}, "50 transitions of 1 environments does not hold a window of 60 steps"),
        ({"padding": "zeros"}, "padding is 'zeros'. Did you mean 'zero'"),
        ({"width": 5, "time_limit": 4}, "end after 4 steps, so no window of 5 steps fits in"),
    ],
)
def test_options_out_of_range_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        make(50, **options)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"observations": np.zeros((1, 4, 6, 5), np.uint8)}, "of a stack, the newest frame alone"),
        ({"next_observations": np.zeros((1, 6, 5))}, "type float64, and would not fit into uint8"),
        ({"actions": [0, 1]}, r"actions have shape \(2,\), not \(1,\)"),
        ({"extras": {}}, r"extras are \[\], the replay memory stores \['id', 'logits'\]"),
    ],
)
def test_steps_that_do_not_fit_are_refused_and_leave_no_trace(changed, message):
    recorder, memory = Recorder(0, *IMAGE, 1, idle=0.0), make(50)
    with pytest.raises(InputError, match=message):
        memory.add(**(recorder.step() | changed))
    assert len(memory) == memory.num_windows == 0


def test_nothing_to_sample_is_said_so():
    memory = make(50, width=3, extras=None)
    scripted(memory, "cut", 2)
    with pytest.raises(TrdlabError, match="holds 2 transitions and no finished window of 3 steps"):
        memory.sample(1, np.random.default_rng(0))


def test_other_settings_and_torn_chunks_are_refused():
    recorder, memory = Recorder(0, *IMAGE, 1, idle=0.0), make(64, width=3)
    recorder.play(memory, 60)
    state = memory.state_dict()
    with pytest.raises(
        InputError, match=r"has width = 3, this one has 2\. Resume with the options"
    ):
        make(64, width=2).load_state_dict(state)
    sealed = state["frames"]["sealed"]
    name = next(iter(sealed))
    for torn in (sealed[name][:-1], b"", sealed[name][:5]):
        broken = state | {"frames": state["frames"] | {"sealed": sealed | {name: torn}}}
        with pytest.raises(InputError, match=r"does not hold the 2 frames it should\. The file is"):
            make(64, width=3).load_state_dict(broken)
    del sealed[name]
    with pytest.raises(InputError, match=f"chunk '{name}' of the replay memory is missing"):
        make(64, width=3).load_state_dict(state)


def test_without_lz4_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "lz4.block", None)
    with pytest.raises(TrdlabError, match=r"lz4 is needed\. Install it: pip install lz4"):
        make(50)
    make(50, compress=False)
