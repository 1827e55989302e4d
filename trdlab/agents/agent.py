"""The agent that is explained: an estimator, the policy it describes, and where it acts."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from trdlab.agents.models import World
from trdlab.agents.places import Origin, look
from trdlab.decomposition import RewardDecomposition
from trdlab.environments import Environments
from trdlab.environments.batches import Make, in_batches
from trdlab.environments.interface import Interface
from trdlab.errors import InputError
from trdlab.estimator import Estimator, Unfitted
from trdlab.policies import Likeliest, Policy, acting, ask
from trdlab.rollouts.branches import Effort
from trdlab.rollouts.episodes import Episode, Recording, collect
from trdlab.rollouts.evaluation import Evaluation, score
from trdlab.rollouts.playing import Watch, part_of, unwatched


@dataclass(frozen=True, eq=False)
class Agent:
    """Who acts, where, and what it expects.

    Args:
        name: what people call it.
        estimator: what it expects; `Unfitted` while nobody knows.
        action_names: A names.
        make: makes the environments that it acts in, from their number and a seed.
        policy: who acts, where that is not the estimator's greedy policy.
        world: the model that the estimator is the exact table of; None if it was learned.
        is_away: whether it acts elsewhere than in that model, so that nothing is certain there.
        seconds_per_step: how long one of its steps takes as people play, if that is known.
        origin: how a user has named it, and where it acts; None if it was given as an object.
        effort: how much is played and copied to judge it, where nothing else is said.
    """

    name: str
    estimator: Estimator
    action_names: tuple[str, ...]
    make: Make
    policy: Policy | None = None
    world: World | None = None
    is_away: bool = False
    seconds_per_step: float | None = None
    origin: Origin | None = None
    effort: Effort = Effort()  # noqa: RUF009  it is frozen

    def __repr__(self) -> str:
        told = "not fitted"
        if self.is_fitted:
            told = f"{self.estimator.time_axis} · {self.estimator.future.policy}"
        return f"<Agent: {self.name} · {told} · {', '.join(self.action_names)}>"

    @property
    def is_fitted(self) -> bool:
        """Whether it is known what it expects."""
        return not isinstance(self.estimator, Unfitted)

    @cached_property
    def interface(self) -> Interface:
        """What it sees and does, by the names that it has for that."""
        return replace(look(self.make), action_names=self.action_names)

    @contextmanager
    def begin(
        self, *, seed: int, film: Callable[[Environments], Environments] | None = None, **how: Any
    ) -> Iterator[Recording]:
        """Begins an episode of the agent, to be played and paused as one likes.

        Args:
            seed: of the environment, and of the actions.
            film: is given the environment, and returns it such that it is looked at (`Filmed`).
            how: as for `Recording`.
        """
        made = self.make(1, seed)
        with closing(made if film is None else film(made)) as environments:
            yield Recording(self.estimator, environments, policy=self.policy, seed=seed, **how)

    def play(
        self, count: int, *, seed: int, watch: Watch = unwatched, **how: Any
    ) -> tuple[Episode, ...]:
        """Returns whole episodes that the agent plays, each in an environment of its own.

        They are played one after another where only one environment can be there at a time.

        Args:
            count: of the episodes.
            seed: of the environments, and of the actions.
            watch: told how far they are, after every step.
            how: else, as for `collect`.
        """
        played: tuple[Episode, ...] = ()
        for batch, environments in enumerate(in_batches(self.make, count, seed)):
            own = int(np.random.SeedSequence([seed, batch]).generate_state(1)[0]) if batch else seed
            tell = part_of(watch, len(played), count)
            played += collect(
                self.estimator, environments, policy=self.policy, seed=own, watch=tell, **how
            )
        return played

    def evaluate(
        self,
        episodes: int = 20,
        *,
        greedy: bool = False,
        max_steps: int | None = None,
        seed: int = 0,
        watch: Watch = unwatched,
    ) -> Evaluation:
        """Returns its score: the rewards of whole episodes, as the environment pays them.

        It need not be known what it expects.

        Args:
            episodes: how many.
            greedy: whether it takes its likeliest action, where it draws from probabilities.
            max_steps: after which an episode is cut off, if not before.
            seed: of the environments, and of the actions.
            watch: told how far they are, after every step.
        """
        policy = acting(self.policy or self.estimator)
        who = Likeliest(policy) if greedy else policy
        return score(who, self.make, episodes, max_steps=max_steps, seed=seed, watch=watch)

    def state_value(self, observations: Any) -> RewardDecomposition:
        """Returns what it expects before it chooses: v^TRD, `[B, N+1]`, of its own policy.

        Args:
            observations: `[B, ...]`; of an agent that remembers, those that begin episodes.

        Raises:
            InputError: nobody knows yet what it expects.
        """
        told = self.estimator.decompose(observations)
        return told.under(ask(acting(self.policy or self.estimator), observations)[0])

    def named(self, action_names: Sequence[str]) -> "Agent":
        """Returns the same agent, its actions called as people say.

        Args:
            action_names: A names.

        Raises:
            InputError: there are more or fewer, or two are the same.
        """
        names = self.interface.named(action_names).action_names
        if len(set(names)) < len(names) or not all(name.strip() for name in names):
            raise InputError(
                f"The action names are {', '.join(map(repr, names))}.",
                "Each has a name of its own.",
            )
        return replace(self, action_names=names)

    def is_same(self, other: "Agent") -> bool:
        """Returns whether both act alike at the same place, and expect the same.

        Two that were found by one name are the same if they expect the same at the beginning.
        """
        if self.estimator is other.estimator:
            return self.policy is other.policy and self.make is other.make
        if self.origin is None or self.origin != other.origin:
            return False
        with self.begin(seed=0) as recording:
            seen = recording.playing.stack.observations
        one, two = (agent.estimator.decompose(seen).components for agent in (self, other))
        return np.array_equal(one, two)

    def action(self, name: str) -> str:
        """Returns the name of an action that is given by its name or its number."""
        known = self.action_names
        is_number = name not in known and name.isdecimal() and int(name) < len(known)
        return known[int(name)] if is_number else name
