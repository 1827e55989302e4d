"""Fits against exact answers, and what they cost.

Policies are frozen, some of their actions are forced, and all that is told of every state and
action is compared with the exact evaluation: components, the variance of each, survival, the parts
of the reward and an event (to end without being paid). Episodes begin anywhere. An error is told as
a share of the largest |Q|, that of a chance as it is.

    python benchmarks/fit.py                      # three worlds, two policies, three methods
    python benchmarks/fit.py --seeds 1 --steps 200000
    python benchmarks/fit.py --cost               # beside bare regression, and the environment
"""

import argparse
import time
from collections.abc import Callable
from functools import cache
from itertools import cycle

import gymnasium as gym
import numpy as np
import torch

from trdlab.deep.experience import Experience, gather
from trdlab.deep.fit import Fit
from trdlab.deep.fit_settings import FitSettings, Method
from trdlab.environments import GymEnvironments
from trdlab.environments.making import make_environment
from trdlab.environments.outcomes import Outcomes
from trdlab.estimator import Future
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Memoryless
from trdlab.tabular import MDP, exact, optimal
from trdlab.tabular.episodes import ModelEnvironments
from trdlab.tabular.toytext import make_world
from trdlab.tabular.uncertainty import spread
from trdlab.time_axis import TimeAxis

AXIS = TimeAxis(0.95, 8)
METHODS: tuple[Method, ...] = ("mixed", "regression", "td")
FUTURE = Future("the given policy")
UNPAID = "unpaid end"
SHARE = {"mixed": 0.3, "td": 0.3, "regression": 0.2}
"""Of forced actions: what comes after the next one is of no use for regression."""
FORCED = 0.1
"""The share of forced actions where costs are measured."""
Parts = dict[str, np.ndarray]
Likely = Callable[[np.ndarray], np.ndarray]


@cache
def worlds() -> dict[str, tuple[MDP, Parts]]:
    """Returns models of which everything is known, and what their rewards are made of."""
    maps = {name: Gridworld(load_map(name).with_slip(0.1)) for name in ("drone", "ledge")}
    drawn = {name: (world.mdp, world.parts) for name, world in maps.items()}
    return {"FrozenLake": (make_world("FrozenLake-v1", {}).mdp, {})} | drawn


def policies(mdp: MDP, seed: int) -> dict[str, np.ndarray]:
    """Returns a random policy `[S, A]`, and one that takes good actions more often."""
    q_values = optimal(mdp, AXIS.gamma).q_values
    logits = {
        "random": np.random.default_rng(seed).normal(size=mdp.shape),
        "soft-optimal": 10.0 * q_values / np.abs(q_values).max(),
    }
    return {name: np.exp(of) / np.exp(of).sum(axis=1, keepdims=True) for name, of in logits.items()}


def played(name: str, policy: np.ndarray, steps: int, seed: int, share: float) -> Experience:
    """Returns what a policy did, with what else is forecast of it."""
    mdp, parts = worlds()[name]
    alive = ~mdp.terminal_states
    return gather(
        lambda count, own: ModelEnvironments(
            mdp, count, seed=own, starts=alive / alive.sum(), time_limit=200, parts=parts
        ),
        Memoryless(lambda states: policy[states]),
        FUTURE,
        steps=steps,
        share=share,
        num_envs=1_000,
        seed=seed,
        outcomes=Outcomes(outcomes(parts)),
    )


def outcomes(parts: Parts) -> dict[str, Callable | str]:
    """Returns what is forecast beside the reward."""
    unpaid = {UNPAID: lambda step: step.terminated and step.reward <= 0.0}
    return {name: f"info.parts.{name}" for name in parts} | unpaid


def errors(
    name: str, policy: np.ndarray, experience: Experience, method: Method, seed: int
) -> dict[str, float]:
    """Returns the largest error of each kind, as a share of the largest |Q|, or of a chance."""
    mdp, parts = worlds()[name]
    alive = ~mdp.terminal_states
    states = np.flatnonzero(alive)
    fit = Fit(
        experience,
        gym.spaces.Discrete(mdp.num_states),
        AXIS,
        FitSettings(method, batch_size=512, most_updates=16_000, seed=seed),
        names=tuple(outcomes(parts)),
        parts=tuple(parts),
    )
    while not fit.done:
        fit.learn()
    estimator = fit.estimator(FUTURE)
    told, outlook = estimator.decompose(states).components, estimator.outlook(states)
    true = exact(mdp, AXIS, policy=policy)
    known, scale = spread(true), np.abs(true.solution.q_values).max()
    ended = exact(
        mdp.with_rewards((mdp.terminated & (mdp.rewards <= 0.0)) * 1.0), AXIS, policy=policy
    )
    chances = ended.decomposition.components[alive][..., :-1] / AXIS.discounts[:-1]
    made_of = [
        np.abs(outlook.parts[part] - _table(mdp.with_rewards(paid), policy)[alive]).max() / scale
        for part, paid in parts.items()
    ]
    return {
        "components": np.abs(told - true.decomposition.components[alive]).max() / scale,
        "variance": np.abs(outlook.variance - known.variance[alive][..., :-1]).max() / scale,
        "survival": np.abs(outlook.survival - known.survival[alive]).max(),
        "parts": max(made_of, default=0.0),
        "event": np.abs(outlook.events[UNPAID] - chances).max(),
    }


def _table(mdp: MDP, policy: np.ndarray) -> np.ndarray:
    return exact(mdp, AXIS, policy=policy).decomposition.components


def truth(names: list[str], steps: int, seeds: int) -> None:
    """Prints the errors of every method, the worst of all seeds."""
    kinds = ["components", "variance", "survival", "parts", "event"]
    print(f"| world | policy | method | {' | '.join(kinds)} | seconds |")
    print(f"|---|---|---|{'--:|' * (len(kinds) + 1)}", flush=True)
    for name in names:
        mdp = worlds()[name][0]
        for kind in policies(mdp, 0):
            worst = {method: dict.fromkeys(kinds, 0.0) for method in METHODS}
            took = dict.fromkeys(METHODS, 0.0)
            for seed in range(seeds):
                policy = policies(mdp, seed)[kind]
                seen = {
                    share: played(name, policy, steps, seed, share) for share in {*SHARE.values()}
                }
                for method in METHODS:
                    began = time.perf_counter()
                    found = errors(name, policy, seen[SHARE[method]], method, seed)
                    worst[method] = {of: max(worst[method][of], found[of]) for of in kinds}
                    took[method] += (time.perf_counter() - began) / seeds
            for method in METHODS:
                told = " | ".join(f"{100.0 * worst[method][of]:.1f} %" for of in kinds)
                print(f"| {name} | {kind} | {method} | {told} | {took[method]:.0f} |", flush=True)


def cost(steps: int) -> None:
    """Prints what an update and a step cost, beside the least that they could."""
    rollouts("LunarLander-v3", lambda seen: np.full((len(seen), 4), 0.25), 64_000)
    rollouts("CartPole-v1", balancing, 200_000)
    experience = rolled("CartPole-v1", balancing, steps)
    space = make_environment("CartPole-v1").observation_space
    for method in METHODS:
        whole = Fit(experience, space, TimeAxis(0.99, 40), FitSettings(method))
        plain = Fit(experience, space, TimeAxis(0.99, 0), FitSettings(method))
        bare_update = _bare(whole)
        rounds = [_round(whole, bare_update, plain) for _ in range(7)]
        own, bare, value = np.median(rounds, axis=0) * 1e3
        print(
            f"{method:>10}, N = 40: {own:.2f} ms an update; {own / bare:.2f} times bare regression "
            f"of the same network, {own / value:.2f} times N = 0",
            flush=True,
        )


def balancing(observations: np.ndarray) -> np.ndarray:
    """Returns how likely a policy that keeps the pole up for a while takes each action `[B, 2]`."""
    right = np.where(observations[:, 2] + 0.5 * observations[:, 3] > 0.0, 0.85, 0.15)
    return np.column_stack([1.0 - right, right])


def rolled(env_id: str, policy: Likely, steps: int) -> Experience:
    """Returns what a policy did in a Gymnasium environment."""

    def make(count: int, seed: int) -> GymEnvironments:
        return GymEnvironments(env_id, count, seed=seed)

    return gather(make, Memoryless(policy), FUTURE, steps=steps, share=FORCED, seed=0)


def rollouts(env_id: str, policy: Likely, steps: int, rounds: int = 5) -> None:
    """Prints how fast experience is gathered, beside a plain loop over one such environment.

    That loop takes the actions of the same policy, drawn before, and begins anew at every end. The
    time is that of the processor, so that whatever else runs counts for little.
    """
    env, actions = make_environment(env_id), _actions(env_id, policy, 20_000)
    asked = 0.0

    def timed(observations: np.ndarray) -> np.ndarray:
        nonlocal asked
        began = time.process_time()
        told = policy(observations)
        asked += time.process_time() - began
        return told

    found = []
    for _ in range(rounds):
        plain, asked = _alone(env, actions), 0.0
        began = time.process_time()
        count = len(rolled(env_id, timed, steps).steps)
        ours = time.process_time() - began
        found.append((count / ours, plain * count / ours, plain * count / (ours - asked)))
    speed, whole, without = np.median(found, axis=0)
    print(
        f"rollouts of {env_id}: {speed:,.0f} steps/s, {100.0 * whole:.0f} % of the environment "
        f"alone; {100.0 * without:.0f} % without the policy's own time",
        flush=True,
    )


def _actions(env_id: str, policy: Likely, steps: int) -> np.ndarray:
    """Returns the actions of a policy in an environment begun with seed 0, some of them forced."""
    env, rng, taken = make_environment(env_id), np.random.default_rng(0), []
    seen, _ = env.reset(seed=0)
    for _ in range(steps):
        likely = policy(seen[None])[0]
        taken.append(rng.choice(len(likely), p=(1.0 - FORCED) * likely + FORCED / len(likely)))
        seen, _, terminated, truncated, _ = env.step(taken[-1])
        if terminated or truncated:
            seen, _ = env.reset()
    return np.array(taken)


def _alone(env: gym.Env, actions: np.ndarray) -> float:
    """Returns the seconds that a step takes in a plain loop."""
    env.reset(seed=0)
    began = time.process_time()
    for action in actions:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()
    return (time.process_time() - began) / len(actions)


def _round(
    whole: Fit, bare: Callable[[], object], plain: Fit, count: int = 200
) -> tuple[float, float, float]:
    """Returns the seconds of an update of a fit, of bare regression, and of a fit with N = 0."""
    return (_seconds(whole.update, count), _seconds(bare, count), _seconds(plain.update, count))


def _bare(fit: Fit) -> Callable[[], object]:
    """Returns an update of a fit's network on its own batches, whose targets are there already."""
    batches = cycle(zip(*fit._drawn(fit.settings.sync_every), strict=True))
    optimizer = torch.optim.Adam(fit.network.parameters(), lr=0.0, fused=True)

    def update() -> float:
        rows, target, weight = next(batches)
        told = fit._components(fit.network, rows)[range(len(rows)), fit._actions(rows)]
        apart = (told - torch.from_numpy(target)).square() * torch.from_numpy(weight)
        loss = apart.sum() / len(rows)
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        return loss.item()

    return update


def _seconds(update: Callable[[], object], count: int) -> float:
    began = time.perf_counter()
    for _ in range(count):
        update()
    return (time.perf_counter() - began) / count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, help="By default 2,000,000; for --cost 50,000.")
    parser.add_argument("--worlds", nargs="*", default=[*worlds()])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--cost", action="store_true")
    options = parser.parse_args()
    torch.set_num_threads(1)
    if options.cost:
        cost(options.steps or 50_000)
    else:
        truth(options.worlds, options.steps or 2_000_000, options.seeds)


if __name__ == "__main__":
    main()
