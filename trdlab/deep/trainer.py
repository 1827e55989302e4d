"""Deep Q-learning with components, top to bottom: act, remember, learn; and pick up again.

It is DQN (Mnih et al., 2015) with a head of A × (N+1) and the law as its target; with N = 0 it is
plain DQN. With a teacher it is QDagger (Agarwal et al., 2022). What differs from the paper, and
why, stands in the docs under "Errata and deviations".
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from trdlab.arrays import IntArray
from trdlab.deep.exploring import Exploring
from trdlab.deep.lessons import TAUGHT, Lessons, Levels, Phase
from trdlab.deep.loss import acted
from trdlab.deep.metrics import Standing, TeachingMetrics
from trdlab.deep.metrics import TrainMetrics as TrainMetrics
from trdlab.deep.networks import build_network
from trdlab.deep.replay import ReplayBuffer
from trdlab.deep.scores import Scores
from trdlab.deep.settings import TrainSettings
from trdlab.deep.update import Learner
from trdlab.environments import Environments, NotReproducible, Step
from trdlab.environments.faults import blamed, check_finite
from trdlab.environments.protocol import Frames
from trdlab.environments.stack import FrameStack, observation_space
from trdlab.policies.teacher import Lesson, Teacher
from trdlab.rollouts.playing import drawn

_SEEN = 1_000  # observations by which others are standardised


class Trainer:
    """An agent that learns to decompose while it acts.

    Args:
        settings: what to do; its device is a real one, not `auto`.
        environments: where; made with `settings.seed`. They are reset at once.
        teacher: whom it learns from, if it does, and the scores that it is measured by.

    Raises:
        InputError: there is no network for what the environments show.
        EnvironmentFault: they fail, or show what is no number.
    """

    def __init__(
        self,
        settings: TrainSettings,
        environments: Environments,
        teacher: tuple[Teacher, Levels] | None = None,
    ) -> None:
        self.settings, self.environments = settings, environments
        self.lessons = teacher and Lessons(*teacher, settings, environments.num_envs)
        self.rng = np.random.default_rng(settings.seed)
        network = build_network(
            observation_space(environments),
            environments.num_actions,
            settings.time_axis,
            seed=settings.seed,
            hidden=settings.hidden,
            policy_head=settings.distil == "policy",
        )
        self.learner = Learner(network, settings.update_settings, settings.device)
        self.memory = self._new_memory()
        self.stack = FrameStack(self._reset(), environments.stack, environments.padding)
        self.scores = Scores(environments.num_envs)
        self.exploring = Exploring(
            environments.num_envs, environments.num_actions, settings.epsilon_hold
        )
        self.agent_steps = 0
        self._losses, self._values, self._updates_told = 0.0, 0.0, 0

    @property
    def phase(self) -> Phase:
        """What comes next: steps of the teacher, offline updates, or the agent's own steps."""
        return self.lessons.phase if self.lessons else "online"

    @property
    def clock(self) -> int:
        """What has been done: the teacher's steps, the offline updates and the agent's steps."""
        taught = self.lessons
        before = taught.teacher_steps + taught.offline_updates if taught else 0
        return before + self.agent_steps

    @property
    def standing(self) -> Standing:
        """How far it is in this phase."""
        settings, of = self.settings, self.lessons
        if of and of.phase == "teacher":
            return Standing(of.teacher_steps, settings.teacher_steps, "steps of the teacher")
        if of and of.phase == "offline":
            return Standing(of.offline_updates, settings.offline_updates, "offline updates")
        return Standing(self.agent_steps, settings.agent_steps, "steps")

    @property
    def done(self) -> bool:
        """Whether all steps have been taken."""
        return self.agent_steps >= self.settings.agent_steps

    def begin_with(self, weights: Mapping[str, Any]) -> None:
        """Gives the network weights, arrays by name, before anything is learned.

        Raises:
            InputError: they are those of another network.
        """
        self.learner.begin_with(weights)

    def step(self) -> None:
        """Acts once in every environment, remembers it, and makes the updates that are due.

        With a teacher, it is the teacher that acts at first; then each step is one update.

        Raises:
            EnvironmentFault: an environment fails, or gives a reward or an observation that is no
                number. Nothing was remembered or learned of it, but the trainer cannot go on.
            TrdlabError: the loss is not finite; likewise.
        """
        phase = self.phase
        if self.lessons and phase == "offline":
            self.learner.set_learning_rate(self._learning_rate)
            self._update()
            self.lessons.offline_updates += 1
        else:
            self._act()
        if phase != self.phase:
            self.scores = Scores(self.environments.num_envs)
        if phase != self.phase == "online":
            self.memory = self._new_memory()
            self._begin_afresh()

    def _act(self) -> None:
        lesson = self.lessons.ask(self.environments, self.stack) if self.lessons else None
        frames, actions = self.stack.newest.copy(), self._choose(lesson)
        with blamed(f"at agent step {self.clock + 1}"):
            step = self.environments.step(actions)
        _check_step(step, f"after {self.clock} agent steps")
        self._remember(frames, actions, step, lesson)
        self.scores.add(step)
        self.exploring.drop(step.ended)
        self.stack.push(step.following, step.ended)
        if self.lessons:
            self.lessons.follow(step.ended)
        if self.lessons and self.phase == "teacher":
            self.lessons.teacher_steps += len(actions)
        else:
            self.agent_steps += len(actions)
            self._learn()

    def _begin_afresh(self) -> None:
        """Begins new episodes everywhere, of which nobody can remember anything."""
        everywhere = np.ones(self.environments.num_envs, dtype=np.bool_)
        self.exploring.drop(everywhere)
        if self.lessons:
            self.lessons.follow(everywhere)
        self.stack.begin(self._reset(), everywhere)

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
            learning_rate=self._learning_rate,
            teaching=self._teaching(),
        )
        self._losses, self._values, self._updates_told = 0.0, 0.0, told.updates
        return told

    @property
    def _learning_rate(self) -> float:
        offline = self.lessons.offline_updates if self.lessons else None
        return self.settings.learning_rate_at(self.agent_steps, offline)

    def _teaching(self) -> TeachingMetrics | None:
        if not (of := self.lessons):
            return None
        weight = of.weight(self.scores.mean_return)
        return TeachingMetrics(self.clock, of.phase, of.teacher_steps, of.tell(), weight)

    def _new_memory(self) -> ReplayBuffer:
        """Returns a memory for this phase: the teacher's steps, all of them, or the agent's."""
        settings, of = self.settings, self.environments
        extras = {TAUGHT: ((of.num_actions,), np.float32)} if self.lessons else None
        return ReplayBuffer(
            settings.capacity if self.phase == "online" else settings.teacher_steps,
            of.observation_space.shape or (),
            np.dtype(of.observation_space.dtype),
            width=settings.width,
            gamma=settings.gamma,
            num_envs=of.num_envs,
            stack=of.stack,
            padding=of.padding,
            time_limit=of.time_limit,
            extras=extras,
            device=settings.device if "cuda" in settings.device else None,
        )

    def _reset(self) -> Frames:
        """Begins an episode in every environment; returns their first frames `[B, ...]`."""
        with blamed("when it was reset"):
            frames = self.environments.reset()
        check_finite("observation", frames, "when it was reset")
        return frames

    def _choose(self, lesson: Lesson | None) -> IntArray:
        """Returns the actions `[B]`: the teacher's, or at random with probability ε, else own."""
        if self.lessons and lesson and self.phase == "teacher":
            return self.lessons.actions(lesson, self.environments, self.rng)
        epsilon = self.settings.epsilon(self.agent_steps)
        explore, actions = self.exploring.draw(epsilon, self.rng)  # [B], [B]
        if not explore.all():
            actions = np.where(explore, actions, self._own())
        return actions

    @torch.inference_mode()
    def _own(self) -> IntArray:
        """Returns what the network does `[B]`."""
        observations = torch.from_numpy(self.stack.observations).to(self.learner.device)
        logits = self.learner.agent.logits(observations)  # [B, A]
        if not self.settings.draw:
            return np.asarray(logits.argmax(dim=1).cpu().numpy())  # [B]
        likely = acted(logits, draw=True).cpu().numpy()  # [B, A]
        return drawn(likely, self.rng.random(len(likely)))  # [B]

    def _remember(self, frames: Any, actions: IntArray, step: Step, lesson: Lesson | None) -> None:
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
            extras={TAUGHT: lesson.taught} if lesson else None,
        )

    def _learn(self) -> None:
        before = self.lessons.offline_updates if self.lessons else 0
        due = before + self.settings.updates_due(self.agent_steps)
        if self.learner.num_updates < due:
            self.learner.set_learning_rate(self._learning_rate)
        while self.learner.num_updates < due:
            self._update()

    def _update(self) -> None:
        if self.settings.standardise and not self.learner.num_updates:
            seen = self.memory.sample(_SEEN, np.random.default_rng(self.settings.seed))
            self.learner.standardise(seen.observations)
        batch = self.memory.sample(self.settings.batch_size, self.rng)
        taught, of = batch.extras.get(TAUGHT), self.lessons
        weight = of.weight(self.scores.mean_return) if of else 0.0
        update = self.learner.update(batch, taught=taught, distillation=weight)
        self._losses += update.loss
        self._values += update.mean_value
        if of:
            of.learned(update.distance)

    def state_dict(self) -> dict[str, Any]:
        """Returns everything that the rest of the run depends on: plain numbers, arrays, bytes."""
        state = {
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
        return state | ({"lessons": self.lessons.state_dict()} if self.lessons else {})

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
        if self.lessons:
            self.lessons.load_state_dict(state["lessons"])
            self.memory = self._new_memory()
        self.learner.load_state_dict(state["learner"])
        self.memory.load_state_dict(state["memory"])
        try:
            with blamed("when its episodes were played again"):
                self.environments.load_state_dict(state["environments"])
        except NotReproducible as problem:
            self.memory.interrupt()
            self.scores.drop()
            self._begin_afresh()
            return problem
        self.stack.frames[...] = state["stack"]
        return None


def _check_step(step: Step, when: str) -> None:
    """Refuses what is no number: in what a step led to, and in the next episode's beginning."""
    check_finite("reward", step.rewards, when)
    check_finite("observation", step.frames, when)
    check_finite("observation", step.following[step.ended], when)
