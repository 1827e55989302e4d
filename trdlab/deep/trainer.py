"""Deep Q-learning with components, top to bottom: act, remember, learn; and pick up again.

It is DQN (Mnih et al., 2015) with a head of A × (N+1) and the law as its target; with N = 0 it is
plain DQN. What differs from the paper, and why, stands in the docs under "Errata and deviations".
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from trdlab.arrays import BoolArray, IntArray
from trdlab.deep.exploring import Exploring
from trdlab.deep.loss import greedy_actions
from trdlab.deep.networks import build_network
from trdlab.deep.replay import ReplayBuffer
from trdlab.deep.scores import Scores
from trdlab.deep.settings import TrainSettings
from trdlab.deep.update import Learner, load_weights
from trdlab.environments import Environments, NotReproducible, Step
from trdlab.environments.faults import blamed, check_finite
from trdlab.environments.protocol import Frames
from trdlab.environments.stack import FrameStack, observation_space


@dataclass(frozen=True)
class TrainMetrics:
    """What a run tells of itself every now and then.

    Args:
        agent_steps: taken so far, of all environments together.
        updates: made so far.
        episodes: ended so far.
        score: the mean return of the last hundred, as the environment pays it; None before one.
        length: their mean length, in agent steps.
        loss: the mean loss of the updates since the line before; None if there was none.
        mean_value: the mean Q-value of the actions taken, likewise.
        epsilon: the chance of a random action.
        learning_rate: Adam's.
    """

    agent_steps: int
    updates: int
    episodes: int
    score: float | None
    length: float | None
    loss: float | None
    mean_value: float | None
    epsilon: float
    learning_rate: float


class Trainer:
    """An agent that learns to decompose while it acts.

    Args:
        settings: what to do; its device is a real one, not `auto`.
        environments: where; made with `settings.seed`. They are reset at once.

    Raises:
        InputError: there is no network for what the environments show.
        EnvironmentFault: they fail, or show what is no number.
    """

    def __init__(self, settings: TrainSettings, environments: Environments) -> None:
        self.settings, self.environments = settings, environments
        self.rng = np.random.default_rng(settings.seed)
        network = build_network(
            observation_space(environments),
            environments.num_actions,
            settings.time_axis,
            seed=settings.seed,
            hidden=settings.hidden,
        )
        self.learner = Learner(network, settings.update_settings, settings.device)
        self.memory = ReplayBuffer(
            settings.capacity,
            environments.observation_space.shape or (),
            np.dtype(environments.observation_space.dtype),
            width=settings.width,
            gamma=settings.gamma,
            num_envs=environments.num_envs,
            stack=environments.stack,
            padding=environments.padding,
            time_limit=environments.time_limit,
        )
        self.stack = FrameStack(self._reset(), environments.stack, environments.padding)
        self.scores = Scores(environments.num_envs)
        self.exploring = Exploring(
            environments.num_envs, environments.num_actions, settings.epsilon_hold
        )
        self.agent_steps = 0
        self._losses, self._values, self._updates_told = 0.0, 0.0, 0

    @property
    def done(self) -> bool:
        """Whether all steps have been taken."""
        return self.agent_steps >= self.settings.agent_steps

    def begin_with(self, weights: Mapping[str, Any]) -> None:
        """Gives the network weights, arrays by name, before anything is learned.

        Raises:
            InputError: they are those of another network.
        """
        load_weights(self.learner.q_network, weights)
        self.learner.sync_target()

    def step(self) -> None:
        """Acts once in every environment, remembers it, and makes the updates that are due.

        Raises:
            EnvironmentFault: an environment fails, or gives a reward or an observation that is no
                number. Nothing was remembered or learned of it, but the trainer cannot go on.
            TrdlabError: the loss is not finite; likewise.
        """
        frames, actions = self.stack.newest.copy(), self._choose()
        with blamed(f"at agent step {self.agent_steps + 1}"):
            step = self.environments.step(actions)
        _check_step(step, f"after {self.agent_steps} agent steps")
        self._remember(frames, actions, step)
        self.scores.add(step)
        self.exploring.drop(step.ended)
        self.stack.push(step.following, step.ended)
        self.agent_steps += len(actions)
        self._learn()

    def metrics(self) -> TrainMetrics:
        """Returns what has happened, the losses since the last call."""
        updates = self.learner.num_updates - self._updates_told
        told = TrainMetrics(
            agent_steps=self.agent_steps,
            updates=self.learner.num_updates,
            episodes=self.scores.num_episodes,
            score=self.scores.mean_return,
            length=self.scores.mean_length,
            loss=self._losses / updates if updates else None,
            mean_value=self._values / updates if updates else None,
            epsilon=self.settings.epsilon(self.agent_steps),
            learning_rate=self.settings.learning_rate_at(self.agent_steps),
        )
        self._losses, self._values, self._updates_told = 0.0, 0.0, told.updates
        return told

    def _reset(self) -> Frames:
        """Begins an episode in every environment; returns their first frames `[B, ...]`."""
        with blamed("when it was reset"):
            frames = self.environments.reset()
        check_finite("observation", frames, "when it was reset")
        return frames

    def _choose(self) -> IntArray:
        """Returns the actions `[B]`: at random with probability ε, else the greedy ones."""
        epsilon = self.settings.epsilon(self.agent_steps)
        explore, actions = self.exploring.draw(epsilon, self.rng)  # [B], [B]
        if not explore.all():
            actions = np.where(explore, actions, self._greedy())
        return actions

    @torch.inference_mode()
    def _greedy(self) -> IntArray:
        observations = torch.from_numpy(self.stack.observations).to(self.learner.device)
        components = self.learner.q_network(observations)  # [B, A, N+1]
        return np.asarray(greedy_actions(components).cpu().numpy())  # [B]

    def _remember(self, frames: Any, actions: IntArray, step: Step) -> None:
        """Stores what happened, as it is learned from: clipped, and perhaps life by life."""
        clipped = np.sign(step.rewards) if self.settings.clip_rewards else step.rewards
        goes_on = step.life_lost & self.settings.life_loss_ends  # [B], an end for learning only
        self.memory.add(
            frames,
            actions,
            clipped,
            step.terminated | goes_on,
            step.truncated,
            step.frames,
            goes_on=goes_on,
        )

    def _learn(self) -> None:
        due = self.settings.updates_due(self.agent_steps)
        if self.learner.num_updates < due:
            self.learner.set_learning_rate(self.settings.learning_rate_at(self.agent_steps))
        while self.learner.num_updates < due:
            batch = self.memory.sample(self.settings.batch_size, self.rng)
            update = self.learner.update(batch)
            self._losses += update.loss
            self._values += update.mean_value

    def state_dict(self) -> dict[str, Any]:
        """Returns everything that the rest of the run depends on: plain numbers, arrays, bytes."""
        return {
            "progress": {
                "agent_steps": self.agent_steps,
                "losses": self._losses,
                "values": self._values,
                "updates_told": self._updates_told,
                "rng": self.rng.bit_generator.state,
            },
            "scores": self.scores.state_dict(),
            "exploring": self.exploring.state_dict(),
            "stack": self.stack.frames.copy(),
            "learner": self.learner.state_dict(),
            "memory": self.memory.state_dict(),
            "environments": self.environments.state_dict(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> NotReproducible | None:
        """Goes on where `state_dict` was taken, to the bit.

        Returns:
            What went wrong if the environments could not be restored, else None. They have begun
            new episodes then, and the running ones stand in the memory as truncated.

        Raises:
            InputError: the state is of a run with other settings.
            EnvironmentFault: an environment fails.
        """
        progress = state["progress"]
        self.agent_steps = progress["agent_steps"]
        self._losses, self._values = progress["losses"], progress["values"]
        self._updates_told = progress["updates_told"]
        self.rng.bit_generator.state = progress["rng"]
        self.scores.load_state_dict(state["scores"])
        if "exploring" in state:  # which older runs did not have
            self.exploring.load_state_dict(state["exploring"])
        self.learner.load_state_dict(state["learner"])
        self.memory.load_state_dict(state["memory"])
        try:
            with blamed("when its episodes were played again"):
                self.environments.load_state_dict(state["environments"])
        except NotReproducible as problem:
            self.memory.interrupt()
            self.scores.drop()
            self.exploring.drop(_all(self.environments.num_envs))
            self.stack.begin(self._reset(), _all(self.environments.num_envs))
            return problem
        self.stack.frames[...] = state["stack"]
        return None


def _check_step(step: Step, when: str) -> None:
    """Refuses what is no number: in what a step led to, and in the next episode's beginning."""
    check_finite("reward", step.rewards, when)
    check_finite("observation", step.frames, when)
    check_finite("observation", step.following[step.ended], when)


def _all(num_envs: int) -> BoolArray:
    return np.ones(num_envs, dtype=np.bool_)
