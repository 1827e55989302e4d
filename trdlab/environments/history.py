"""What environments have done since they were last seeded: enough to do it again."""

from array import array
from collections.abc import Mapping, Sequence
from typing import Any
from zlib import crc32

import numpy as np

from trdlab.arrays import FloatArray, IntArray
from trdlab.environments.protocol import Frames, NotReproducible
from trdlab.errors import InputError, TrdlabError

_HELD, _LEAST = 1_000_000, 1_000  # bytes of steps noted together; each counts as so many at least


class Histories:
    """The seeds and actions of B environments, from which they can be restored to the bit.

    What an environment does is a function of the seed of its last seeded reset and of the actions
    since. Its seeds are drawn from `SeedSequence([seed, i, k])`, with k = 0, 1, … counting the
    seeded resets of environment i. At the end of an episode the next reset is a seeded one if
    `reseed_after` actions or more were taken since the last: the fewer, the shorter the histories,
    and the more often the price of a seeded reset is paid.

    Args:
        settings: what must be the same where a saved history is to be replayed, as plain values.
        num_envs: B.
        seed: what the seeds are drawn from.
        reseed_after: see above.

    Raises:
        InputError: there are no environments, or the seed is negative.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        *,
        num_envs: int,
        seed: int,
        reseed_after: int = 0,
    ) -> None:
        if num_envs < 1:
            raise InputError(f"There are {num_envs} environments.", "Make at least 1.")
        if seed < 0:
            raise InputError(f"The seed is {seed}.", "It must be a whole number from 0 on.")
        self._seed, self._reseed_after = seed, reseed_after
        self._settings = {**settings, "num_envs": num_envs, "seed": seed}
        self._settings["reseed_after"] = reseed_after
        self._seedings = np.full(num_envs, -1, dtype=np.int64)  # k
        self._actions = [array("i") for _ in range(num_envs)]
        self._checksums = [0] * num_envs
        # steps are noted some at a time, which takes a third of the time: those not yet, and from
        # which of them on they belong to the present of each environment
        self._open: list[tuple[Sequence[int], Frames, FloatArray]] = []
        self._acting: Sequence[int] = ()
        self._since = [0] * num_envs

    def begin(self, env: int, seeding: int | None = None) -> int:
        """Forgets the past of an environment, and returns the seed to reset it with.

        Args:
            env: which one.
            seeding: k; by default the next one.
        """
        self._seedings[env] = self._seedings[env] + 1 if seeding is None else seeding
        self._actions[env] = array("i")
        self._checksums[env], self._since[env] = 0, len(self._open)
        return self._seed_of(env)

    def past(self, env: int) -> tuple[int, IntArray]:
        """Returns the seed of an environment's last seeded reset, and its actions since.

        Raises:
            TrdlabError: no episode has begun.
        """
        self._check_begun(env)
        self._settle()
        return self._seed_of(env), np.array(self._actions[env], dtype=np.int64)

    def same(self, env: int, other: "Histories", other_env: int) -> bool:
        """Returns whether two environments have shown the same since they were last seeded."""
        self._settle()
        other._settle()
        return self._checksums[env] == other._checksums[other_env]

    def is_due(self, env: int) -> bool:
        """Whether the next reset of an environment should be a seeded one."""
        self._settle()
        return len(self._actions[env]) >= self._reseed_after

    def record_reset(self, env: int, frames: Frames) -> None:
        """Notes the first frame of an episode, that of `env` in `frames [B, ...]`."""
        if self._since[env] < len(self._open):
            self._settle()
        self._checksums[env] = crc32(frames[env : env + 1].data, self._checksums[env])

    def record_step(
        self, envs: Sequence[int], actions: Sequence[int], frames: Frames, rewards: FloatArray
    ) -> None:
        """Notes the actions of some environments, and what they led to.

        Args:
            envs: which ones.
            actions: one of each of them.
            frames: `[B, ...]`, of all; nobody may change them afterwards.
            rewards: `[B]`, of all; likewise.
        """
        if len(envs) < len(rewards):
            frames, rewards = frames[envs], rewards[envs]
        if envs != self._acting or len(self._open) * max(frames.nbytes, _LEAST) > _HELD:
            self._settle()
        self._acting = envs
        self._open.append((actions, frames, rewards))

    def _settle(self) -> None:
        """Adds the steps that are open to the pasts of those that took them."""
        if not self._open:
            return
        actions, frames, rewards = (np.stack(of, axis=1) for of in zip(*self._open, strict=True))
        taken = actions.astype(np.intc)  # [R, T]
        seen = np.concatenate([_bytes_of(frames), _bytes_of(rewards)], axis=2)  # [R, T, bytes]
        for row, env in enumerate(self._acting):
            own = self._since[env]
            self._actions[env].frombytes(taken[row, own:].tobytes())
            self._checksums[env] = crc32(seen[row, own:].data, self._checksums[env])
        self._open, self._since = [], [0] * len(self._since)

    def state_dict(self) -> dict[str, Any]:
        """Returns the histories as plain settings and small arrays.

        Raises:
            TrdlabError: no episode has begun.
        """
        self._settle()
        for env in range(len(self._actions)):
            self._check_begun(env)
        actions = np.concatenate(self._actions)  # [Σ lengths]
        return {
            "settings": dict(self._settings),
            "seedings": self._seedings.copy(),  # [B]
            "lengths": np.array([len(actions) for actions in self._actions]),  # [B]
            "actions": actions.astype(np.min_scalar_type(actions.max(initial=0))),
            "checksums": np.array(self._checksums, dtype=np.int64),  # [B]
        }

    def saved(self, state: Mapping[str, Any]) -> list[tuple[int, IntArray]]:
        """Returns what a saved state is played again from: k and actions of each environment.

        Raises:
            InputError: it was saved with other settings, or is torn.
        """
        for name, value in self._settings.items():
            saved = state["settings"].get(name)
            if saved != value:
                raise InputError(
                    f"The saved environments have {name} = {saved}, these have {value}.",
                    "Resume with the options that the run began with.",
                )
        lengths, actions = np.asarray(state["lengths"]), np.asarray(state["actions"])
        if len(lengths) != len(self._actions) or lengths.sum() != len(actions):
            raise InputError(
                f"The saved environments have {len(actions)} actions in place of {lengths.sum()}.",
                "The file is torn: resume from an earlier one.",
            )
        past = np.split(actions.astype(np.int64), np.cumsum(lengths)[:-1])
        return list(zip(map(int, state["seedings"]), past, strict=True))

    def verify(self, state: Mapping[str, Any], name: str) -> None:
        """Compares what a replay has led to with what was saved.

        Raises:
            NotReproducible: something else was seen on the way.
        """
        self._settle()
        different = np.flatnonzero(np.asarray(state["checksums"]) != self._checksums)
        self._seedings = np.maximum(self._seedings, state["seedings"])  # no seed comes twice
        if len(different):
            env = int(different[0])
            raise NotReproducible(
                f"{name} did something else when {int(state['lengths'][env])} actions were taken "
                f"again from the same seed (environment {env}).",
                "Begin new episodes with reset().",
            )

    def _check_begun(self, env: int) -> None:
        if self._seedings[env] < 0:
            raise TrdlabError("The environments have not begun.", "Call reset() first.")

    def _seed_of(self, env: int) -> int:
        words = np.random.SeedSequence([self._seed, env, int(self._seedings[env])])
        return int(words.generate_state(1)[0] >> 1)  # 31 bits: ALE's seeds are signed


def _bytes_of(rows: Frames) -> Frames:
    """Returns what each of some rows `[R, T, ...]` consists of, as bytes `[R, T, bytes]`."""
    return np.ascontiguousarray(rows).reshape(*rows.shape[:2], -1).view(np.uint8)


def checked_actions(actions: Any, num_envs: int, num_actions: int) -> IntArray:
    """Returns actions `[B]`.

    Raises:
        InputError: there are not B of them, or one does not exist.
    """
    given = np.asarray(actions)
    if given.shape != (num_envs,) or given.dtype.kind not in "iu":
        raise InputError(
            f"The actions have shape {given.shape} and type {given.dtype}.",
            f"Give {num_envs} whole numbers.",
        )
    if given.min() < 0 or given.max() >= num_actions:
        raise InputError(
            f"The actions are {given.tolist()}.", f"They run from 0 to {num_actions - 1}."
        )
    return given.astype(np.int64, copy=False)
