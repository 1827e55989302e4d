# %% [markdown]
# # Lesson 10: the paper, reproduced
#
# This package began with one paper: Towers, Du, Freeman and Norman, *Explaining an Agent's Future
# Beliefs through Temporally Decomposing Future Reward Estimators* ([how to cite
# it](../index.md#how-to-cite)). Here you go through it from the abstract to the last appendix:
# each section, equation, figure, table and claim. What can be checked in seconds is checked while
# this page is made. What cannot is said to be so.
#
# - **Goal:** say of each part of the paper whether it holds, how you know, and what is open.
# - **Before it:** lessons [1](01_read_a_reward_vector.md) and [2](02_derive_it.md);
#   [4](04_why_the_sum_fails.md), [8](08_from_a_teacher.md) and [9](09_which_pixels.md) tell more
#   of what is only named here.
# - **Time:** an hour to read all of it; half a minute to run, on two cores.

# %% [markdown]
# ## How to read the tables
#
# Numbers of equations and figures are those of the paper as it is typeset, counted through. Below
# each stands its label in the source of the paper. There are five answers:
#
# - **reproduced**: done again, and the same came out.
# - **corrected**: done again, after a correction. [Errata and deviations](../errata.md) has the
#   reasons: P1 to P13 are about the paper, C1 to C8 about its published code.
# - **partly**: the method is here, and what came out is like the paper's. But it is of other
#   agents or smaller worlds.
# - **not**: not done again here, or something else came out.
# - **nothing**: nothing that could be reproduced, such as the work of others.
#
# Tests are in the folder `tests/` of the source, benchmarks in `benchmarks/`. To run one of them:
# `pytest tests/test_bellman.py`. *Above* means the cells above the table; they stop with an error
# where two answers differ.

# %%
import json
from collections import Counter
from typing import NamedTuple

import gymnasium as gym
import numpy as np
import torch
from matplotlib import pyplot as plt
from torch import nn

from trdlab.bellman import target
from trdlab.decomposition import TimeAxis
from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.lessons import Levels
from trdlab.deep.loss import distillation_loss, greedy_actions, td_loss, trd_target
from trdlab.deep.networks import build_network
from trdlab.deep.presets import preset, with_teacher
from trdlab.estimator import Future
from trdlab.explanations import gridworld_moment
from trdlab.explanations.moment.telling import sections
from trdlab.explanations.saliency.groups import Group
from trdlab.explanations.saliency.maps import SaliencyMaps
from trdlab.gridworld import Gridworld, load_map, parse_map
from trdlab.runs import read_metrics
from trdlab.runs.pretrained import SHIPPED, pretrained_names
from trdlab.tabular import (
    evaluate,
    exact,
    from_environment,
    learn,
    operator_table,
    outcomes,
    undiscounted_totals,
)
from trdlab.tabular.models import from_arrays
from trdlab.teach import check

torch.set_num_threads(1)  # such small networks are no faster with more


def agree(what, ours, by_hand, most=1e-9):
    """Says that two answers are the same, or stops."""
    apart = np.abs(np.asarray(ours) - np.asarray(by_hand)).max()
    assert apart <= most, f"{what}: {apart:g} apart"
    print(f"{what}: the same, to {most:g}")


# %% folded
STATUSES = ("reproduced", "corrected", "partly", "not", "nothing")
ROWS = []  # of all tables


class Row(NamedTuple):
    """One thing of the paper: where, what it says, what became of it, and how one knows."""

    labels: str
    where: str
    says: str
    status: str
    check: str
    got: str
    differs: str = "nothing"


class Table:
    """Rows, as a table of a page or of a notebook."""

    def __init__(self, *rows):
        assert all(row.status in STATUSES for row in rows)
        self.rows = rows
        ROWS.extend(rows)

    def __repr__(self):
        return "\n".join(f"{row.where}: {row.status}" for row in self.rows)

    def _repr_markdown_(self):
        lines = [
            "| where | what it says | here | what differs, and why |",
            "|---|---|---|---|",
        ]
        for row in self.rows:
            labels = " ".join(f"`{label}`" for label in row.labels.split())
            check = f"<br>Check: {row.check}" if row.check else ""
            cells = (
                f"**{row.where}** {labels}",
                row.says,
                f"**{row.status}**<br>{row.got}{check}",
                row.differs,
            )
            lines.append(f"| {' | '.join(cells)} |")
        return "\n".join(lines)


# %% [markdown]
# ## Abstract and introduction
#
# The paper's example is a drone at a fork (Figure 1). Up leads to a treasure of 4, down to four
# coins of 1. Both routes take five steps. With a pencil that is two short sums; trdlab solves the
# map without knowing them.

# %%
GAMMA = 0.95
UP, DOWN, LEFT, RIGHT = range(4)
drone = Gridworld(load_map("drone"))
solved = exact(drone.mdp, TimeAxis(GAMMA, horizon=4))
up, down = solved.decomposition[0, UP], solved.decomposition[0, DOWN]

discounts = GAMMA ** np.arange(5)
by_hand_up = discounts * [0, 0, 0, 0, 4]
by_hand_down = discounts * [0, 1, 1, 1, 1]

agree("the vector of up", up.components, by_hand_up)
agree("the vector of down", down.components, by_hand_down)
print("up  ", up.components.round(2), "Q =", up.value.round(2))
print("down", down.components.round(2), "Q =", down.value.round(2))

wide_up, wide_down = (of.regroup(2).components for of in (up, down))
agree("down in pairs", wide_down, [0 + 0.95, 0.95**2 + 0.95**3, 0.95**4])
print("in pairs: up", wide_up.round(2), "down", wide_down.round(2))

totals = undiscounted_totals(drone.mdp, solved.solution.policy)[0]
agree("what both pay without a discount", totals[[UP, DOWN]], [4, 4])

# %% [markdown]
# And the sentence? The paper writes one by hand: "while the sum of actual rewards is equal,
# taking the route down has more immediate rewards, which are preferred by the drone due to its
# discount factor". Here is what trdlab says, from the numbers alone:

# %%
choice = gridworld_moment(drone, solved, 0).choice("down", "up")
said = [sentence for part in sections(choice) for sentence in part.sentences]
print(*said[:2], sep="\n")

# %% [markdown]
# The introduction also says that a Q-value hides *when*. That is a claim which one example
# proves: on the map `tie`, two policies are worth the same, and expect something else.

# %%
tie = Gridworld(load_map("tie")).mdp
one, other = (
    exact(tie, TimeAxis(GAMMA, horizon=3), ties=ties).state_decomposition[0]
    for ties in ("lowest", "mixed")
)
agree("two policies of the same worth", one.value, other.value)
print("expect", one.components.round(2), "and", other.components.round(2))

# %% folded
Table(
    Row(
        "abstract",
        "Abstract",
        "An agent's next N expected rewards can be predicted. That tells when rewards come, how "
        "sure they are, what matters in an observation, and what another action changes. DQN "
        "agents can be retrained for it at little cost.",
        "partly",
        "the tables below",
        "All methods are here, and tested against exact answers.",
        f"Retrained were agents of {', '.join(pretrained_names())}, from other teachers.",
    ),
    Row(
        "sec:introduction",
        "Section 1",
        "A scalar Q tells nothing of when rewards come, or how many.",
        "reproduced",
        "above",
        f"On the map `tie`, Q is {one.value:.2f} twice, with two different vectors.",
    ),
    Row(
        "fig:gridworld",
        "Figure 1",
        "A drone with two paths.",
        "reproduced",
        "`trdlab gridworld --gamma 0.95 --N 4`",
        "The map `drone`. [Lesson 1](01_read_a_reward_vector.md) shows it.",
        "The picture is drawn anew; walls and arrows make it five steps either way.",
    ),
    Row(
        "claim:q-of-the-drone",
        "Section 1",
        "Q is 3.26 for up, and 3.52 for down.",
        "reproduced",
        "above; `tests/tabular/test_table.py::test_the_papers_drone_at_095`",
        f"{up.value:.2f} and {down.value:.2f}",
    ),
    Row(
        "claim:vectors-of-the-drone",
        "Section 1",
        "Down is [0, 0.95, 0.90, 0.86, 0.81], up is [0, 0, 0, 0, 3.26].",
        "reproduced",
        "above; `tests/tabular/test_table.py::test_the_papers_vectors_for_every_gamma`",
        f"{list(map(float, down.components.round(2)))} and "
        f"{list(map(float, up.components.round(2)))}",
        "nothing. The fifth number is the residual; that it holds one reward only is so on "
        "this map.",
    ),
    Row(
        "claim:sentence",
        "Section 1",
        "The sentence: the same in all, but down sooner, and so preferred.",
        "reproduced",
        "above; `tests/explanations/moment/test_sentences.py`",
        f"“{said[0]} {said[1]}”",
        "It is made from the numbers, and read back and checked against them.",
    ),
    Row(
        "claim:two-changes",
        "Section 1",
        "Two changes make a DQN a TRD agent: N + 1 more outputs, and another loss.",
        "corrected",
        "`tests/deep/test_loss.py::test_without_explicit_components_it_is_dqn`",
        "With N = 0, loss and gradient are DQN's.",
        "The outputs are multiplied by N + 1, not raised by it ([P7](../errata.md#p7)).",
    ),
)

# %% [markdown]
# ## Section 3: what it builds on
#
# Equations 1 to 5 are textbook: two values, a loss, a target, a teacher. To check trdlab against
# them, take a small world of chance, with five states and three actions, and a policy that draws.
# Its Q-values solve a system of linear equations, which numpy can do alone.

# %%
rng = np.random.default_rng(0)
STATES, ACTIONS, DISCOUNT = 5, 3, 0.9
chances = rng.dirichlet(np.ones(STATES), (STATES, ACTIONS))  # P(s' | s, a)
pays = rng.normal(size=(STATES, ACTIONS))  # E[R | s, a]
policy = rng.dirichlet(np.ones(ACTIONS), STATES)  # π(a | s)
world = from_arrays(chances, pays)

chain = np.einsum("sa,san->sn", policy, chances)  # P(s' | s), as the policy acts
v_by_hand = np.linalg.solve(
    np.eye(STATES) - DISCOUNT * chain, (policy * pays).sum(1)
)
q_by_hand = pays + DISCOUNT * chances @ v_by_hand

axis = TimeAxis(DISCOUNT, horizon=6)
given = exact(world, axis, policy=policy)
agree("Eq. 1, the Q-values", given.decomposition.value, q_by_hand)
agree("Eq. 2, the state values", given.state_decomposition.value, v_by_hand)

# %% [markdown]
# The optimal Q-values are a fixed point of Eq. 4, and with N = 0 the law of trdlab *is* Eq. 4.
# The loss of a batch is Eq. 3:

# %%
best = exact(world, TimeAxis(DISCOUNT, horizon=0)).decomposition.value  # [S, A]
following = chances @ best.max(axis=1)  # E[max q(s', a')]
agree(
    "Eq. 4, the target at N = 0",
    target(pays, DISCOUNT, following[..., None])[..., 0],
    pays + DISCOUNT * following,
)
agree("the optimal Q is its fixed point", best, pays + DISCOUNT * following)

q, y = torch.tensor([[3.0, 1.0], [2.0, 5.0]]), torch.tensor([1.0, 4.0])
taken = torch.tensor([0, 1])
agree(
    "Eq. 3, the loss at N = 0",
    td_loss(q[..., None], taken, y[:, None]),
    ((3 - 1) ** 2 + (5 - 4) ** 2) / 2,
)

# %% [markdown]
# Equation 5 adds a teacher, and its sign is wrong ([P5](../errata.md#p5)). What it adds is Σ π_T
# log π, which is largest where the student is like its teacher; a loss is made *small*. trdlab
# takes the Kullback–Leibler divergence from teacher to student. Follow both downhill from a
# student that knows nothing:

# %%
teacher = torch.tensor([[0.7, 0.2, 0.1]])


def uphill(loss):
    """Returns the gradient of a loss for a student to whom all actions are the same."""
    logits = torch.zeros(1, 3, requires_grad=True)
    loss(logits).backward()
    return logits.grad[0].numpy()


ours = uphill(lambda logits: distillation_loss(logits, teacher))
printed = uphill(lambda logits: (teacher * logits.log_softmax(1)).sum(1).mean())
agree("the gradient is that of Eq. 5 with a minus", ours, -printed, most=1e-6)
print("a step downhill, here:      ", -ours.round(3))
print("a step downhill, as printed:", -printed.round(3))

# %% [markdown]
# The teacher prefers the first action. Here the student does, too, after a step; as printed, it
# prefers the last.
#
# The teacher's weight λ has to fall while the student learns. In the text it is "the ratio of
# teacher to student average reward", in the published code 1 − student / teacher. Try that on
# Pong, where a game can end at −21 ([P6](../errata.md#p6)). These scores are from the agent that
# comes with trdlab:

# %%
CARDS = {
    game: json.loads((SHIPPED / game / "card.json").read_text(encoding="utf-8"))
    for game in pretrained_names()
}
pong = CARDS["Pong"]["teacher"]
levels = Levels(teacher=pong["score"], chance=pong["random"])
published = 1 - pong["random"] / pong["score"]
print(f"teacher {pong['score']:.1f}, random play {pong['random']:.1f}")
print(f"λ of a student that plays at random: published {published:.2f}, ", end="")
print(f"here {levels.weight(pong['random']):.2f}")
print(f"λ of one as good as its teacher: here {levels.weight(pong['score']):.2f}")

last = read_metrics(SHIPPED / "Breakout" / "metrics.jsonl")[-1]
took = last["teacher_steps"] + last["agent_steps"]

# %% [markdown]
# GradCAM is the last thing that Section 3 needs. Here it is by hand, for one component of a small
# network with three convolutions: the gradient of the output by each map of the first layer,
# averaged over the map, says how much that map counts.

# %%
SCREEN = gym.spaces.Box(0, 255, (4, 44, 44), np.uint8)
looking = TimeAxis(0.99, horizon=40)
network = build_network(SCREEN, 3, looking)
screen = rng.integers(0, 256, (1, *SCREEN.shape), dtype=np.uint8)
ACTION = 2

maps = network.body[:2](network.preprocess(torch.from_numpy(screen))).detach()
maps.requires_grad_()
outputs = network.by_action(network.body[2:](maps))[0, ACTION]  # [N+1]
gradcam = []
for k in (0, 39):  # t+1 and t+40 in the paper
    (gradient,) = torch.autograd.grad(outputs[k], maps, retain_graph=True)
    counts = gradient.mean(dim=(2, 3), keepdim=True)
    gradcam.append((counts * maps).sum(dim=1)[0].detach().numpy())

estimator = NetworkEstimator(network, looking, Future("nobody's yet"))
signed = estimator.saliency(screen, [ACTION])[0]  # [N+1, h, w], all at once
agree("GradCAM of t and of t+39", signed[[0, 39]], gradcam, most=1e-6)

# %% folded
Table(
    Row(
        "sec:preliminary",
        "Section 3",
        "A Markov decision process ⟨S, A, R, P, T⟩ with bounded rewards, and γ in [0, 1).",
        "reproduced",
        "`tests/tabular/test_mdp.py`",
        "`trdlab.tabular.MDP`; γ = 1 is refused.",
        "The end belongs to a transition here, not to a state: that is more general.",
    ),
    Row(
        "eq:q-value eq:state-value",
        "Eqs. 1, 2",
        "Q and v are expected discounted sums of rewards.",
        "reproduced",
        "above; `tests/tabular/test_table.py::test_any_small_model`",
        "The same as the solution of linear equations, to 1e-9.",
    ),
    Row(
        "eq:dqn-loss eq:dqn-target",
        "Eqs. 3, 4",
        "Q-learning: the squared distance from r + γ max q.",
        "reproduced",
        "above; `tests/deep/test_loss.py::test_without_explicit_components_it_is_dqn`",
        "The loss, the target and the gradients of N = 0.",
    ),
    Row(
        "claim:q-learning-converges",
        "Section 3",
        "Q-learning converges to the optimal policy (Watkins and Dayan).",
        "reproduced",
        "`tests/tabular/test_learning.py::test_control_with_single_steps_finds_the_optimum`",
        "Learned tables come to the exact ones, on random models.",
        "A test is no proof; the proof is theirs.",
    ),
    Row(
        "claim:dqn",
        "Section 3",
        "DQN: a replay memory, a target network, a convolutional network.",
        "reproduced",
        "`tests/deep/test_networks.py::test_the_nature_network_is_that_of_the_paper`, "
        "`tests/deep/test_replay.py`",
        "All three are here.",
        "The memory keeps each frame once, and knows where episodes end ([C1](../errata.md#c1) to "
        "[C3](../errata.md#c3)).",
    ),
    Row(
        "eq:qdagger",
        "Eq. 5",
        "QDagger adds λ times Σ π_T log π.",
        "corrected",
        "above; `tests/deep/test_loss.py::test_the_distance_from_a_teacher_by_hand`",
        "KL(teacher ‖ student), whose gradient is that of Eq. 5 with a minus in front.",
        "The sign ([P5](../errata.md#p5)).",
    ),
    Row(
        "claim:lambda",
        "Section 3",
        "λ is the ratio of teacher to student reward.",
        "corrected",
        "above; `tests/deep/test_lessons.py::"
        "test_the_teacher_weighs_less_the_nearer_the_student_comes`",
        f"At random play in Pong, the published code has λ = {published:.1f}, trdlab "
        f"{levels.weight(pong['random']):.0f}.",
        "Random play is measured, too ([P6](../errata.md#p6)), and λ has one source "
        "([C4](../errata.md#c4)).",
    ),
    Row(
        "claim:twenty-times",
        "Section 3",
        "QDagger matches a teacher with 20 times fewer observations (Agarwal et al.).",
        "not",
        "",
        f"The student of Breakout was made of {took:,} steps; its teacher of "
        f"{CARDS['Breakout']['teacher']['origin'].rsplit(', ', 1)[-1]}.",
        "A claim of another paper. Nothing was trained here with and without a teacher until both "
        "were equal.",
    ),
    Row(
        "claim:gradcam",
        "Section 3",
        "GradCAM: the gradients of an output by the maps of a convolution.",
        "reproduced",
        "above; `tests/deep/test_saliency.py::test_all_components_at_once_equal_captum_one_by_one`",
        "The same as by hand, and as another library has it, for all components at once.",
    ),
)

# %% [markdown]
# ## Section 4: the decomposition
#
# Equation 6 is the heart of the paper. By hand, step *i* pays on average γⁱ times the reward that
# the chain of the policy meets after *i* steps. That takes a loop and no library. The residual is
# what all further steps add; here a thousand of them, after which nothing is left that counts.


# %%
def steps_by_hand(count):
    """Returns E[γ^i R_(t+i)] of each step i, state and action: [count, S, A]."""
    ahead, found = (policy * pays).sum(axis=1), [pays]
    for i in range(1, count):
        found.append(DISCOUNT**i * chances @ ahead)
        ahead = chain @ ahead
    return np.array(found)


steps = steps_by_hand(1000)
vectors = np.concatenate([steps[:6], steps[6:].sum(axis=0)[None]])  # N = 6
vectors = np.moveaxis(vectors, 0, -1)  # [S, A, N+1]
agree("Eq. 6, each component", given.decomposition.components, vectors)
agree("Eq. 7, the components sum to Q", vectors.sum(axis=-1), q_by_hand)

# %% [markdown]
# That last line is Theorem 1, too: the sum of the expected rewards is the expectation of their
# sum, which the linear equations gave. (For an infinite sum that needs bounded rewards and γ < 1,
# [P12](../errata.md#p12).)
#
# Now in groups of w steps (Eq. 13). As printed, the last group before the residual is summed up
# to step N·w, and the residual begins at N·w. That step is counted twice ([P3](../errata.md#p3)):

# %%
grouped = given.decomposition.regroup(3)  # N = 2, w = 3
agree("Eq. 13, component 1", grouped.components[..., 1], steps[3:6].sum(axis=0))
agree("Eq. 14, groups sum to Q", grouped.value, q_by_hand)
by_itself = exact(world, TimeAxis(DISCOUNT, horizon=2, width=3), policy=policy)
agree("solved in groups", by_itself.decomposition.components, grouped.components)

as_printed = steps[:3].sum(axis=0) + steps[3:7].sum(axis=0) + steps[6:].sum(axis=0)
surplus = as_printed - q_by_hand
agree("Eq. 13 as printed, less Q, is step 6", surplus, steps[6])
print(f"which here is up to {np.abs(surplus).max():.2f}")

# %% [markdown]
# The loss (Eq. 15) compares a vector with a target: the rewards of the window in front, the next
# vector behind it, the last two folded. On the drone's map nothing is left to chance, so the
# exact vectors have to be their own targets, at each step of the way down. As printed, the first
# row takes one reward too many, and discounts none ([P2](../errata.md#p2)).

# %%
WIDTH = 2
wide = exact(drone.mdp, TimeAxis(GAMMA, horizon=2, width=WIDTH))
way, state = [], 0  # down, then right along the corridor
for action in (DOWN, RIGHT, RIGHT, RIGHT, RIGHT):
    row = state * drone.mdp.num_actions + action
    k = drone.mdp.offsets[row]  # of its one transition
    way.append((state, action, drone.mdp.rewards[k]))
    state = drone.mdp.next_states[k]
print("the way down pays", [float(reward) for *_, reward in way])

for i in range(len(way) - WIDTH):
    (here, action, _), (later, *_) = way[i], way[i + WIDTH]
    rewards = [reward for *_, reward in way[i : i + WIDTH]]
    r = sum(GAMMA**k * reward for k, reward in enumerate(rewards))
    n = wide.decomposition.components[later]  # [A, N+1]
    n = n[n.sum(axis=1).argmax()]
    agree(
        f"Eq. 15 at step {i}",
        wide.decomposition.components[here, action],
        target(np.float64(r), GAMMA**WIDTH, n),
    )

first = GAMMA**0 * way[0][2] + GAMMA * way[1][2]
literal = sum(reward for *_, reward in way[: WIDTH + 1])
print(f"the first entry is {first:.2f}; as printed it would be {literal:.2f}")

# %% [markdown]
# In a network the same function makes the target, and the loss sums what is left over its
# entries. A batch of one, by hand:

# %%
told = torch.tensor([[[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]])  # s_t: two actions, N = 2
then = torch.tensor([[[2.0, 4.0, 6.0], [9.0, 0.0, 0.0]]])  # s_(t+w)
best_next = greedy_actions(then)  # 12 against 9
goal = trd_target(torch.tensor([1.0]), torch.tensor([0.5]), then)
by_hand = [1.0, 0.5 * 2.0, 0.5 * (4.0 + 6.0)]
agree("the target of a network", goal[0], by_hand)
agree(
    "its loss",
    td_loss(told, torch.tensor([0]), goal),
    sum((a - b) ** 2 for a, b in zip([1, 2, 3], by_hand, strict=True)),
)

# %% [markdown]
# "Through experiment, we found" that the loss on the sum does not find the vector. A table shows
# that as well, and why: nothing in that loss knows of a single component ([lesson
# 4](04_why_the_sum_fails.md)).

# %%
budget = {"agent_steps": 60_000, "num_envs": 256}
by_sum = learn(drone.mdp, TimeAxis(GAMMA, 4), loss="sum", **budget)
by_law = learn(drone.mdp, TimeAxis(GAMMA, 4), **budget)
for name, of in {"on the sum": by_sum, "by Eq. 15": by_law}.items():
    vector = of.decomposition[0, DOWN]
    print(
        f"learned {name:>10}:",
        vector.components.round(2),
        "Q",
        vector.value.round(2),
    )
law_apart = np.abs(
    by_law.decomposition.components - solved.decomposition.components
).max()
print(f"by Eq. 15, no component of any state and action is off by {law_apart:.1g}")

# %% [markdown]
# > **The formula.** The next $w$ steps pay $r=\sum_{i=0}^{w-1}\gamma^i R_{t+i}$, and $n$ is the
# > vector of the best action in $s_{t+w}$. In its right form, Eq. 15 has $N+1$ errors:
# >
# > $$L=\mathbb{E}\big[e_0^2+e_1^2+\dots+e_N^2\big]$$
# >
# > $$e_0=q_0-r,\qquad e_i=q_i-\gamma^w n_{i-1}$$
# >
# > $$e_N=q_N-\gamma^w(n_{N-1}+n_N)$$
# >
# > As printed there are $N+2$ of them, and $\sum_{i=0}^{w}R_{t+i}$ stands in place of $r$.

# %% folded
Table(
    Row(
        "sec:temporally-decomposed-q-value",
        "Section 4",
        "The estimator, its equivalence, its loss.",
        "corrected",
        "`tests/test_bellman.py`, `tests/tabular/test_table.py`",
        "The rows below.",
        "Indices and signs; the idea stands.",
    ),
    Row(
        "eq:trd-array",
        "Eq. 6",
        "The vector: N expected rewards, and all that comes later.",
        "corrected",
        "above; `tests/tabular/test_table.py::test_any_small_model`",
        "Each component is the one by hand, to 1e-9.",
        "Components are counted from 0 to N; component i is step t+i ([P1](../errata.md#p1), "
        "[P8](../errata.md#p8)).",
    ),
    Row(
        "eq:trd-equiv",
        "Eq. 7",
        "The components sum to Q.",
        "reproduced",
        "above; `tests/test_bellman.py::test_the_target_sums_to_the_scalar_target`",
        "They do, to 1e-9. Every run of `trdlab gridworld` checks it again.",
        "nothing. trdlab computes the residual by itself, so that this is a test.",
    ),
    Row(
        "theorem:sum-expected-reward proof:sum-expected-reward eq:expanded-sum-expectation",
        "Theorem 1, Eqs. 8 to 12",
        "The expectation of the sum is the sum of the expectations.",
        "corrected",
        "above; [lesson 2](02_derive_it.md#1-may-the-q-value-be-cut)",
        "Both sides computed apart, and equal.",
        "Linearity covers finite sums. Bounded rewards and γ < 1 are needed "
        "([P12](../errata.md#p12)).",
    ),
    Row(
        "claim:not-reversible",
        "Section 4",
        "From Q alone the vector cannot be known.",
        "reproduced",
        "above (map `tie`); "
        "`tests/tabular/test_table.py::test_the_tie_map_has_two_futures_of_the_same_worth`",
        "One Q, two vectors.",
    ),
    Row(
        "claim:acts-by-the-sum",
        "Section 4",
        "To act, sum the components, and go on as usual.",
        "reproduced",
        "above; `tests/deep/test_loss.py::test_loops_in_plain_python_agree`",
        "`greedy_actions` takes the largest sum.",
    ),
    Row(
        "eq:trd-binned-array",
        "Eq. 13",
        "The vector in groups of w steps.",
        "corrected",
        "above; `tests/tabular/test_table.py::test_wide_groups_are_narrow_ones_summed`",
        f"The same as single steps, summed. As printed it exceeds Q by up to "
        f"{np.abs(surplus).max():.2f} in the world above.",
        "A group ends one step before the next one begins ([P3](../errata.md#p3)).",
    ),
    Row(
        "eq:grouped-trd-equiv",
        "Eq. 14",
        "The groups sum to Q.",
        "reproduced",
        "above",
        "They do, to 1e-9.",
        "nothing, once Eq. 13 is corrected.",
    ),
    Row(
        "claim:groups-of-the-drone",
        "Section 4",
        "With N = 2, w = 2: up is [0, 0, 3.26], down is [0.95, 1.76, 0.81].",
        "reproduced",
        "above; `trdlab gridworld --gamma 0.95 --N 2 --w 2`",
        f"{list(map(float, wide_up.round(2)))} and {list(map(float, wide_down.round(2)))}",
    ),
    Row(
        "claim:n-and-w",
        "Section 4",
        "N·w rewards are told by N + 1 outputs; w = 1 is Eq. 6; N = 30, w = 1 and N = 6, w = 5 "
        "both "
        "reach 30 steps.",
        "reproduced",
        "`tests/test_decomposition.py`",
        f"{TimeAxis(0.99, 30).num_steps} and {TimeAxis(0.99, 6, 5).num_steps} steps, "
        f"{TimeAxis(0.99, 30).num_components} and {TimeAxis(0.99, 6, 5).num_components} outputs",
    ),
    Row(
        "claim:n-step-buffer",
        "Section 4",
        "For w > 1 an N-step replay memory is all that is needed.",
        "corrected",
        "`tests/tabular/test_windows.py::test_the_bootstrap_state_is_w_steps_later`, "
        "`tests/deep/test_replay.py::test_windows_are_those_of_the_recorded_history`",
        "Windows bootstrap w steps later, and never cross the end of an episode.",
        "The published buffer bootstraps one step later ([C1](../errata.md#c1)), and leaks at "
        "truncations ([C2](../errata.md#c2), [C3](../errata.md#c3)). Windows also hold what "
        "the agent "
        "did while it explored ([lesson 4](04_why_the_sum_fails.md)).",
    ),
    Row(
        "claim:sum-does-not-converge",
        "Section 4",
        "The scalar loss on the sum does not find the vector.",
        "reproduced",
        "above; "
        "`tests/tabular/test_learning.py::test_the_loss_on_the_sum_learns_q_and_nothing_else`",
        f"Q is {by_sum.decomposition[0, DOWN].value:.2f}, the vector "
        f"{list(map(float, by_sum.decomposition[0, DOWN].components.round(2)))}.",
        "nothing, and [lesson 4](04_why_the_sum_fails.md) says where it ends.",
    ),
    Row(
        "eq:trd-loss",
        "Eq. 15",
        "The loss: squared distances from the shifted target.",
        "corrected",
        "above; `tests/test_bellman.py::test_the_target_is_its_definition`, "
        "`tests/deep/test_loss.py::test_loops_in_plain_python_agree`",
        f"Exact vectors are their own targets; learned ones come within {law_apart:.1g} of them.",
        "N + 1 rows, not N + 2 ([P1](../errata.md#p1)); w rewards, each discounted "
        "([P2](../errata.md#p2)); a sum over components in place of a mean, if not asked otherwise "
        "([C5](../errata.md#c5)).",
    ),
    Row(
        "eq:index-notation",
        "Eqs. 16 to 19",
        "Names for the elements: 0, 1, N, and N + 1.",
        "corrected",
        "`tests/test_decomposition.py`",
        "0 to N − 1, and N for the residual.",
        "There, element N is the step t+N−1 ([P1](../errata.md#p1)).",
    ),
    Row(
        "claim:shift",
        "Section 4",
        "What is i steps away now will be i − 1 steps away: the target is the next vector, "
        "shifted, "
        "times γ.",
        "corrected",
        "above; `tests/test_bellman.py::test_a_group_is_single_steps_summed`",
        "The same, with γʷ.",
        "The text has γ, Eq. 15 has γʷ. The latter is right ([P4](../errata.md#p4)).",
    ),
)

# %% [markdown]
# ## Section 5: what it costs to train
#
# The paper retrains DQN agents of Breakout, Space Invaders and Ms. Pacman, in three sweeps, of N,
# of w, and of both with N·w = 24, each with three seeds. A run takes "around 7 hours" on a V100.
# That has **not** been done here. What has been done on the real games is one agent each of
# these, on two cores of a CPU. All numbers are read from what was kept when they were made:

# %%
print("game       teacher  student  of the way  human way  minutes  N   trusted to")
for game, card in CARDS.items():
    mean, to = card["mean"], card["fitted"]["trusted to"]
    print(
        f"{game:<9} {card['teacher']['score']:8.1f} {mean['value']:8.1f}"
        f" {card['teacher-normalised']:10.2f} {card['human-normalised']:10.2f}"
        f" {card['seconds'] / 60:8.0f}  {len(card['fitted']['skill']['value'])}  t+{to}"
    )

# %% [markdown]
# *Of the way* is the interquartile mean of 30 games on the way from random play (0) to the
# teacher (1), *human way* the mean from random play to a person (Mnih et al., 2015). The paper's
# agents have these scores, beside their teachers':

# %%
PAPER = {  # Appendix B, N = 25, w = 1, seed 0
    "Breakout": (399.0, 386.9),
    "Space Invaders": (1444.0, 1324.0),
    "Ms. Pacman": (2756.0, 2433.0),
}
for game, (score, of_teacher) in PAPER.items():
    print(
        f"{game:<14} {score:7.1f}, its teacher {of_teacher:7.1f}: {score / of_teacher:.2f}"
    )

# %% [markdown]
# So both times the students come near their teachers, or past them. But the teachers differ, and
# the paper's raw 399 points of Breakout have not been reached here. Other settings differ, too.
# Here is the paper's Table 1 beside what `--preset paper` takes:

# %%
base = preset("atari", "Breakout", "paper")
taught = base.changed({"teacher": "FILE", **with_teacher("atari", base, "paper")})
TABLE_1 = (
    ("training seeds", "0, 1, 2", f"--seed, by default {base.seed}"),
    ("online training steps", 4_000_000, taught.agent_steps),
    ("offline replay memory", 1_000_000, taught.teacher_steps),
    ("offline training steps", 1_000_000, taught.offline_updates),
    ("learning rate", 1e-4, base.learning_rate),
    ("buffer size", 1_000_000, base.capacity),
    ("discount factor", 0.99, base.gamma),
    ("target update, in steps", 1000, base.target_sync_updates * base.update_every),
    ("batch size", 32, base.batch_size),
    ("ε when acting", 0.01, taught.epsilon_end),
    ("training frequency", 4, base.update_every),
    ("QDagger temperature", 1.0, base.temperature),
    ("evaluation", "seeds 0 to 9", f"{base.evaluate_episodes} games, at the end"),
    ("evaluated offline every", 100_000, "never"),
    ("evaluated online every", 250_000, "never, if not asked for"),
)
same = 0
print("parameter                       paper  here")
for name, theirs, ours in TABLE_1:
    same += theirs == ours
    mark = "" if theirs == ours else "  differs"
    theirs, ours = (
        f"{of:,}" if isinstance(of, int) else str(of) for of in (theirs, ours)
    )
    print(f"{name:<24} {theirs:>12}  {ours}{mark}")

# %% [markdown]
# Such a run needs a GPU, or days:
#
# ```console
# $ trdlab train atari Breakout --preset paper --teacher FILE
# ```
#
# ### The sweeps, where the answer is known
#
# Figure 2 says that N and w hardly change the score; Figure 3, that Q comes close to the
# teacher's "with w = 1 being an important factor". On the games nobody knows the true Q. On the
# drone's map everybody does. So here are the three sweeps in a table, with the same number of
# steps each, and 10 % of random actions. *Error* is the mean squared distance from the true Q
# over all states and actions. *Limit* is where it ends with unlimited data, which can be solved
# for.

# %%
SWEEPS = {
    "N, w = 1": [(0, 1), (12, 1), (24, 1)],
    "w, N = 6": [(6, 1), (6, 2), (6, 4)],
    "N·w = 24": [(24, 1), (12, 2), (6, 4), (3, 8)],
}
truth = solved.solution.q_values
optimum = truth[0].max()
found = {}
for horizon, width in sorted({pair for of in SWEEPS.values() for pair in of}):
    swept = TimeAxis(GAMMA, horizon, width)
    told = learn(drone.mdp, swept, **budget).decomposition.value
    greedy = np.eye(4)[told.argmax(axis=1)]
    own = evaluate(drone.mdp, greedy, GAMMA).q_values[0]
    limit = operator_table(drone.mdp, swept, epsilon=0.1).bias.value
    found[horizon, width] = {
        "score": (greedy[0] @ own) / optimum,
        "error": np.mean((told - truth) ** 2),
        "limit": np.mean(limit**2),
        "q": told,
    }

for name, pairs in SWEEPS.items():
    print(f"{name}    score of the optimum     error     limit")
    for pair in pairs:
        of = found[pair]
        limit = f"{of['limit']:.0e}" if of["limit"] > 1e-20 else "0"
        print(
            f"  N = {pair[0]:>2}, w = {pair[1]}   {of['score']:10.3f}"
            f" {of['error']:17.0e} {limit:>9}"
        )

# %%
figure, axes = plt.subplots(
    1, 3, sharey=True, figsize=(8, 2.6), layout="constrained"
)
for ax, (name, pairs) in zip(axes, SWEEPS.items(), strict=True):
    errors = [found[pair]["error"] for pair in pairs]
    ax.plot(range(len(pairs)), errors, "o", color="#00695c")
    ax.set_xticks(range(len(pairs)), [f"{n}, {w}" for n, w in pairs])
    ax.set(title=name, xlabel="N, w")
    ax.margins(x=0.2)
_ = axes[0].set(yscale="log", ylabel="error of Q")

# %% [markdown]
# All reach the optimum. And the two halves of Figure 3 are here as well, for reasons that one can
# name:
#
# - **N changes nothing.** Not "little": the Q-values are the same numbers. The entries of the
#   target sum to Q-learning's own target, whatever N is ([lesson 2](02_derive_it.md)). In a
#   table, learning is linear, so the sum of what is learned is what Q-learning learns. That
#   performance does not fall was "unexpected" to the paper; in a table it cannot fall. In a
#   network it could, since all outputs share its layers.
# - **w > 1 costs exactness, and more data does not help.** A window of w steps holds the rewards
#   of the agent's random actions, and nothing takes them out. This world has correct windows; the
#   published ones were wrong as well ([C1](../errata.md#c1)). How much of Figure 3 is the one,
#   and how much the other, is not known. The paper's agents act at random in 1 % of their steps
#   (Table 1), and for that the limit below is much lower. The wrong state does more on this map
#   ([lesson 4](04_why_the_sum_fails.md#one-step-is-not-w-steps)). That speaks for the buffer, and
#   is no proof.

# %%
agree("Q at N = 0 and N = 24", found[0, 1]["q"], found[24, 1]["q"])
widths = [pair for pair in found if pair[1] > 1]
factor = min(found[pair]["error"] for pair in widths) / found[24, 1]["error"]
assert factor > 10
print(f"the least error of w > 1 is {factor:,.0f} times that of w = 1")
seldom = operator_table(drone.mdp, TimeAxis(GAMMA, 12, 2), epsilon=0.01).bias.value
assert np.mean(seldom**2) < 0.1 * found[12, 2]["limit"]
print(f"limit of w = 2 with 1 % of random actions: {np.mean(seldom**2):.0e}")

# %% [markdown]
# ### What it costs
#
# "About 10 % fewer steps per second" is what the paper measured, 248 against 274, with the
# teacher's forward pass in it. How much more is there to compute? Count the multiplications of a
# forward pass of the Atari network:

# %%
ATARI = gym.spaces.Box(0, 255, (4, 84, 84), np.uint8)


def multiplications(horizon, num_actions=4):
    """Returns how many a forward pass of one observation takes."""
    network = build_network(ATARI, num_actions, TimeAxis(0.99, horizon))
    count, x = network.head.weight.numel(), torch.zeros(1, *ATARI.shape)
    for layer in network.body:
        x = layer(x)
        if isinstance(layer, nn.Conv2d | nn.Linear):
            places = x[0, 0].numel() if isinstance(layer, nn.Conv2d) else 1
            count += places * layer.weight.numel()
    return count


plain, more = multiplications(0), multiplications(40)
extra = more / plain - 1
outputs = (more - plain) // 512 + 4  # of a head that reads 512 features
print(f"N = 0: {plain:,}, N = 40: {more:,}: {extra:.1%} more")
print(f"and {outputs} outputs, which is 4 · (40 + 1)")
far = multiplications(400) / plain - 1
print(f"N = 400: {far:.1%} more")

# %% [markdown]
# So the decomposition itself is nearly free. `python benchmarks/update.py` measures whole
# updates, with N = 40 and N = 0 taking turns; what it printed stands in the README, under
# *Cheap*.

# %% folded
Table(
    Row(
        "sec:training-performance",
        "Section 5",
        "TRD agents should perform like the agents that they are made of.",
        "partly",
        "`python benchmarks/ship.py`",
        f"{len(CARDS)} students, "
        + ", ".join(
            f"{game} {of['teacher-normalised']:.2f}" for game, of in CARDS.items()
        )
        + " of the way from random play to the teacher.",
        "Other games and teachers; one seed each; imitation by a policy head "
        "([how](../how-to/teacher.md)).",
    ),
    Row(
        "fig:dqn-sweep-episodic-return",
        "Figure 2",
        "Scores along training, for N, w, and N·w = 24; three games, three seeds.",
        "not",
        "above, on the drone's map",
        "Not trained: each run takes hours on a GPU. On the map all settings reach "
        f"{min(of['score'] for of in found.values()):.3f} of the optimum.",
        "No teacher that is a DQN, and no such budget. The trainer has all settings, and "
        "[four classic tasks](../train.md#the-other-classic-tasks) have been trained with N = "
        "0 and "
        "10, three seeds each (`python benchmarks/classic.py classic`).",
    ),
    Row(
        "fig:dqn-sweep-error",
        "Figure 3",
        "The distance of the student's Q from the teacher's, for the same sweeps.",
        "not",
        "above, on the drone's map",
        "Not trained. On the map the distance from the true Q is measured instead.",
        "As Figure 2. Here the truth is known, so it need not be a teacher's.",
    ),
    Row(
        "claim:pretrained-agents",
        "Section 5",
        "Agents are retrained from published DQN agents, by QDagger.",
        "partly",
        "`trdlab train atari GAME --preset cpu --teacher FILE`; `tests/training/test_taught.py`",
        "Retrained from published agents, in the three phases of QDagger.",
        "Those are A3C agents, which have no Q-values to match. They teach a policy head, and the "
        "components learn the future of that.",
    ),
    Row(
        "claim:reach-the-teacher",
        "Section 5",
        "All settings approach the teacher's score.",
        "partly",
        "above; `tests/atari/test_shipped.py`",
        "They do: see the table above.",
        "One setting, N = 40 and w = 1.",
    ),
    Row(
        "claim:no-degradation-in-n",
        "Section 5",
        "Larger N does not degrade performance, which was unexpected.",
        "partly",
        "above; `python benchmarks/classic.py classic`",
        "In a table Q is the same for all N, to 1e-9. "
        "[CartPole](../train.md#the-other-classic-tasks) is solved with N = 0 and with N = 10.",
        "Not swept on Atari.",
    ),
    Row(
        "claim:smaller-w-starts-better",
        "Section 5",
        "Offline, at N·w = 24, smaller w is better at first.",
        "not",
        "",
        "Not tried.",
        "It would need the runs of Figure 2.",
    ),
    Row(
        "claim:w-is-important",
        "Section 5",
        "All get close to the teacher's Q, with w = 1 an important factor.",
        "partly",
        "above; `tests/tabular/test_learning.py::test_the_bias_of_the_drone`",
        f"On the map the least error of w > 1 is {factor:,.0f} times that of w = 1, and stays.",
        "Two causes are known: random actions inside windows "
        "([lesson 4](04_why_the_sum_fails.md#3-whose-rewards-are-in-the-window)), and the "
        "published "
        "buffer ([C1](../errata.md#c1)).",
    ),
    Row(
        "claim:loss-converges",
        "Section 5",
        "The TRD loss converges to a policy like that of the scalar Q.",
        "reproduced",
        "above; "
        "`tests/tabular/test_learning.py::test_control_with_single_steps_finds_the_optimum`, "
        "[lesson 5](05_from_pixels.md) with a network",
        f"Learned Q and exact Q differ by {found[24, 1]['error'] ** 0.5:.0e} (root mean square).",
        "Of worlds with a known answer.",
    ),
    Row(
        "claim:larger-n",
        "Section 5",
        "Whether this holds for larger N and for other agents is open.",
        "nothing",
        "",
        "Still open on Atari.",
        "It says nothing of the components: they can be wrong where the score is right "
        "([lesson 8](08_from_a_teacher.md)).",
    ),
    Row(
        "claim:ten-percent",
        "Section 5",
        "About 10 % fewer steps per second than DQN: 248 against 274.",
        "partly",
        "above; `python benchmarks/update.py`",
        f"{extra:.1%} more multiplications at N = 40; measured updates are in the README.",
        "No update asks the teacher here: what it says is stored when somebody acts. Two kinds of "
        "machine, so steps per second do not compare.",
    ),
    Row(
        "claim:scale",
        "Section 4",
        "The outputs grow with N, which limits how far single steps can be told.",
        "partly",
        "above",
        f"They do; at N = 400 a pass of the Atari network takes {far:.1%} more multiplications.",
        "So cost is a weak limit. That far steps are learned badly is a stronger one "
        "([why](../train.md#which-n-and-w)).",
    ),
    Row(
        "claim:evaluation",
        "Section 5",
        "Evaluated on the same ten seeds again and again; interquartile means, normalised by the "
        "teacher.",
        "partly",
        "`trdlab evaluate pretrained:Breakout`; `tests/rollouts/test_evaluation.py`",
        "30 games from the same starts each time; mean and interquartile mean, with intervals.",
        "Once, at the end. Of games, not of training seeds, for there is one seed each. Normalised "
        "between random play and the teacher.",
    ),
    Row(
        "claim:scripts-and-weights",
        "Section 5",
        "Training scripts and all weights are published.",
        "partly",
        "[Agents of Atari games](../fit.md#agents-of-atari-games); `tests/policies/test_flax.py`",
        "A published student is read and explained without a fit: "
        "`trdlab explain FILE --env Breakout`.",
        "They do not come with trdlab. `n-41` in a name means N = 40 ([C7](../errata.md#c7)); "
        "those "
        "with w > 1 learned from wrong windows ([C1](../errata.md#c1)).",
    ),
)

# %% [markdown]
# ## Section 6: explaining
#
# **What rewards, and when** (6.1). The paper divides by γⁱ and reads a component as the agent's
# confidence: the probability of a reward at that step. When may one? Two worlds tell. On
# FrozenLake a reward is 0 or 1, and the probabilities can be followed forward, one step at a
# time. In the second world a fair coin pays 1 or −1, as clipped rewards can.

# %%
lake = from_environment(gym.make("FrozenLake-v1"))
on_ice = exact(lake, TimeAxis(0.99, horizon=40))
ACTION = int(on_ice.decomposition[lake.start].value.argmax())
component = on_ice.decomposition[lake.start, ACTION]
forward = outcomes(lake, on_ice.solution.policy, lake.start, ACTION, 40)
chance = [step.get(1.0, 0.0) for step in forward]
agree(
    "rewards of 0 and 1: expectation and probability",
    component.undiscounted(),
    chance,
)
print(f"likeliest at t+{np.argmax(chance)}, with {max(chance):.1%}")

coin = from_arrays([[[0.5, 0.5]], [[0.5, 0.5]]], [[[1.0, -1.0]], [[1.0, -1.0]]])
tossed = exact(coin, TimeAxis(0.9, horizon=1)).decomposition[0, 0].components[0]
print(f"a coin for 1 or −1: expected {tossed:.1f}, though a reward is sure")

# %% [markdown]
# So it holds for rewards of 0 and one amount ([P10](../errata.md#p10)). Dividing by γⁱ is exact
# for w = 1 only, and never for the residual ([P9](../errata.md#p9)). And whose confidence is it?
# The target takes the maximum, so it speaks of an agent that never acts at random
# ([P11](../errata.md#p11)).
#
# The paper reads from its plots that confidence falls with distance. Whether a forecast deserves
# it is another question: the shipped agents' forecasts were held against what came, in games that
# they had not learned from. Skill is 1 for a perfect forecast, and 0 for a constant guess:

# %%
print("skill at      t   t+5  t+20  t+39   (fitted | learned with the policy)")
for game, card in CARDS.items():
    rows = [
        [card[of]["skill"]["value"][k] for k in (0, 5, 20, 39)]
        for of in ("fitted", "joint")
    ]
    print(
        f"{game:<9}",
        " | ".join("".join(f"{of:6.2f}" for of in row) for row in rows),
    )

# %% [markdown]
# The first four numbers of a row are of a fit, made for a policy that stands still. The last four
# are of components that were learned together with the policy, as the paper's are (for a policy
# head, though, and not with a maximum). Of those, near steps are told, and far ones mostly not. The
# paper did not measure this. A good score, and plausible peaks, do not show it.
#
# **What matters in an observation** (6.2). GradCAM was checked above. What is left is the paper's
# difference: each map without what is below 0, divided by its largest, and one taken from the
# other.

# %%
near, far = (np.maximum(of, 0.0) for of in gradcam)
difference = far / far.max() - near / near.max()
of_all = SaliencyMaps(signed, looking)
agree(
    "the paper's difference of maps",
    of_all.paper_difference(Group(0, 0), Group(39, 39)).signed,
    difference,
    most=1e-5,
)

# %% [markdown]
# What the maps *show* is where the paper and trdlab part. The paper finds the agent's focus on
# the ball for near reward, and on the bricks for far reward. [The paper's
# figures](../figures.md#figure-6-where-it-looks) has such maps of the agent here; [lesson
# 9](09_which_pixels.md) tests them. They mostly fail: hiding what is bright changes no more than
# hiding something else. So it is not shown that the agent looks there.
#
# **What an action changes** (6.3). Subtract two vectors. They add up to the lead in Q, and in the
# paper's Figure 7 they show an upward spike, and a later downward one: one action has the reward
# at once, the other one a little later, and after that nothing differs. A corridor with one coin
# does the same. Right goes to the coin; up meets the wall, so it waits for one step.

# %%
corridor = Gridworld(parse_map("C = coin 1 terminal\n---\nS..C"))
values = exact(corridor.mdp, TimeAxis(GAMMA, horizon=6)).decomposition[0]
spikes = values[RIGHT] - values[UP]
print("right − up:", spikes.components.round(2), "in all", spikes.value.round(3))
agree("a coin at t+2 or at t+3", spikes.components[2:4], [GAMMA**2, -(GAMMA**3)])
agree(
    "the contrast of the drone, and its lead",
    (down - up).components.sum(),
    down.value - up.value,
)

# %% folded
skills = {game: card["joint"]["skill"]["value"] for game, card in CARDS.items()}
Table(
    Row(
        "sec:explainability",
        "Section 6",
        "Three ways to explain, of agents with N = 40 and w = 1.",
        "reproduced",
        "`trdlab explain pretrained:Breakout`",
        "All three, for any agent; shipped agents have N = 40 and w = 1.",
        "Other games: see the figures below.",
    ),
    Row(
        "subsec:extracting-reward-prob",
        "Section 6.1",
        "What rewards to expect, and when.",
        "reproduced",
        "`trdlab explain AGENT --what forecast`",
        "In sentences, pictures, pages and JSON.",
        "How far it can be trusted is judged first.",
    ),
    Row(
        "claim:probability",
        "Section 6.1",
        "For binary rewards the expectation tells the probability; so it does for rewards "
        "clipped to "
        "−1 … 1.",
        "corrected",
        "above; `tests/tabular/test_uncertainty.py`",
        "For 0 and one amount it is so, to 1e-9.",
        "With −1, 0 and 1 it is not: a sure reward of either sign can have the expectation 0 "
        "([P10](../errata.md#p10)).",
    ),
    Row(
        "claim:factor-out",
        "Section 6.1",
        "The discount is factored out, which leaves the expected reward.",
        "corrected",
        "above; `tests/test_decomposition.py`",
        "`RewardDecomposition.undiscounted()`",
        "Exact for w = 1 and explicit components, and nowhere else ([P9](../errata.md#p9)).",
    ),
    Row(
        "fig:spaceinvaders-expected-reward",
        "Figure 4",
        "Space Invaders, and the next 40 expected rewards.",
        "partly",
        "`python benchmarks/figures.py pretrained:Pong 250 --max-steps 300 --name pong`",
        "[Pong](../figures.md#figures-4-and-5-what-reward-and-when): the point that it is "
        "nearly sure of "
        "came at its step.",
        "No agent of Space Invaders comes with trdlab. With one, the same command draws it.",
    ),
    Row(
        "fig:breakout-expected-reward",
        "Figure 5",
        "Breakout, and the next 40 expected rewards.",
        "partly",
        "`python benchmarks/figures.py pretrained:Breakout 151 56 --max-steps 300 --name breakout`",
        "[Breakout](../figures.md#figures-4-and-5-what-reward-and-when): two peaks, the second "
        "lower and "
        "wider; both rewards came.",
        "Another agent, at another moment.",
    ),
    Row(
        "claim:rhythm",
        "Section 6.1",
        "Rewards every 8 to 9 steps in Space Invaders, every 15 in Breakout.",
        "partly",
        "`tests/explanations/moment/test_peaks.py`",
        "Peaks and rhythms are found and named. In the picture of Breakout the peaks are about "
        "24 steps "
        "apart.",
        "How long the ball needs depends on its speed and on the bricks that are left.",
    ),
    Row(
        "claim:confidence-falls",
        "Section 6.1",
        "Confidence falls with distance.",
        "partly",
        "above; `trdlab explain pretrained:Breakout --what calibration`",
        "So does skill: learned with the policy, from "
        + ", ".join(
            f"{of[0]:.2f} to {abs(of[-1]):.2f} ({game})"
            for game, of in skills.items()
        )
        + ".",
        "The paper shows what agents say. Here it is also held against what came.",
    ),
    Row(
        "claim:domain-knowledge",
        "Section 6.1",
        "The plots fit what one knows of the games: shots and bricks are periodic.",
        "partly",
        "[The paper's figures](../figures.md)",
        "They do, for Breakout and Pong.",
        "A plot that fits is no test; calibration is.",
    ),
    Row(
        "claim:epsilon",
        "Section 6.1",
        "Far steps are uncertain since the policy is ε-greedy.",
        "corrected",
        "`tests/tabular/test_learning.py::"
        "test_without_random_actions_inside_the_windows_there_is_no_bias`",
        "With w = 1 the target holds no random action.",
        "It speaks of the greedy agent ([P11](../errata.md#p11)). Chance in the game, and what "
        "a network "
        "has not learned, remain.",
    ),
    Row(
        "claim:videos",
        "Sections 6.1, 6.2",
        "Videos of whole episodes, and of the maps of all components.",
        "reproduced",
        "`trdlab video pretrained:Breakout -o breakout.webp`, `--what components`; "
        "`tests/show/test_video.py`",
        "Both, and the maps of near and far along an episode (`--what saliency`).",
        "Of other agents; see [Videos](../video.md).",
    ),
    Row(
        "claim:debugging",
        "Sections 6.1, 6.2, 7",
        "It can help people to debug and to understand agents.",
        "partly",
        "[lesson 6](06_debug_an_agent.md), [Does it help?](../goals.md)",
        "Planted faults are named from data. Readers who were language models told goals apart.",
        "Nobody has tried it on people, neither the paper nor trdlab. "
        "`trdlab study make --out kit` makes what it takes.",
    ),
    Row(
        "subsec:vis-temporal-decision-making",
        "Section 6.2",
        "Which features of an observation matter, for near and far reward.",
        "reproduced",
        "above; `trdlab explain pretrained:Breakout --what saliency --component 0,39`",
        "GradCAM of each component, of groups, of differences.",
        "Each map is checked in two ways ([why](../saliency.md#when-not-to-believe-a-map)).",
    ),
    Row(
        "fig:breakout-feature-importance",
        "Figure 6",
        "Maps of Breakout for t+1 and t+40, and their normalised difference.",
        "partly",
        "`trdlab explain pretrained:Breakout --what saliency --component 0,39 --step 151 "
        "--episodes 0`",
        "The method is the same, to 1e-5: [the maps](../figures.md#figure-6-where-it-looks).",
        "t+1 to t+40 there is t to t+39 here ([P8](../errata.md#p8)). Another agent.",
    ),
    Row(
        "claim:ball-and-bricks",
        "Section 6.2",
        "Near reward hangs on the ball, far reward on the bricks.",
        "not",
        "[lesson 9](09_which_pixels.md)",
        "The ball is bright for near reward, but so is what does not matter: most maps fail a "
        "check.",
        "The paper tests no map. GradCAM of the first layer forgets where a gradient came from.",
    ),
    Row(
        "claim:only-the-total",
        "Section 6.2",
        "Until now only the total reward could be mapped.",
        "nothing",
        "",
        "A remark on earlier work.",
    ),
    Row(
        "subsec:contrast-exp",
        "Section 6.3",
        "What another action would change: the difference of two vectors.",
        "reproduced",
        "above; `trdlab explain gridworld:ledge --what contrast`",
        "Component by component; they add up to the lead in Q.",
        "Where it can be, both actions are tried out in copies of the game.",
    ),
    Row(
        "fig:action-expected-reward-diff",
        "Figure 7",
        "Seaquest: two actions, and their difference.",
        "partly",
        "`python benchmarks/figures.py seaquest 65 199:LEFT:RIGHT --max-steps 300 --name seaquest`",
        "[Seaquest](../figures.md#figure-7-left-or-right), an agent trained by others and "
        "fitted here.",
        "The caption says left and right, the text no action and fire. Here it is left and right.",
    ),
    Row(
        "claim:spikes",
        "Section 6.3",
        "A spike up, then one down, then no difference: the reward is only delayed.",
        "reproduced",
        "above",
        f"In a corridor: {spikes.components[2]:.2f} at t+2, {spikes.components[3]:.2f} at t+3, "
        "0 elsewhere.",
        f"They do not cancel: {spikes.value:.3f} is left, for what is later is worth less.",
    ),
)

# %% [markdown]
# ## Sections 2 and 7: other work, and what comes next

# %% folded
Table(
    Row(
        "sec:related-work",
        "Section 2",
        "Earlier work decomposes Q by parts of the reward, or by states, not by time.",
        "nothing",
        "",
        "A review of others.",
        "Parts of the reward, such as coins and a treasure, are combined with time here "
        "([how](../fit.md#what-not-only-when)).",
    ),
    Row(
        "sec:conclusion",
        "Section 7",
        "The claims of Sections 4 to 6 once more.",
        "partly",
        "the tables above",
        "As there.",
        "As there.",
    ),
    Row(
        "claim:future-components",
        "Section 7",
        "Future work: which part of the reward is expected when.",
        "reproduced",
        "[What, not only when](../fit.md#what-not-only-when); "
        "`tests/environments/test_outcomes.py`",
        "Built: parts of a reward, forecast step by step, add up to its own forecast.",
        "It is an addition, no part of the paper.",
    ),
    Row(
        "claim:future-distributions",
        "Section 7",
        "Future work: each reward as a distribution.",
        "partly",
        "`tests/tabular/test_uncertainty.py`, `tests/deep/test_channels.py`",
        "Exact models: the whole distribution of each step. Fits: the chance of each reward "
        "where few "
        "different ones came, else the variance.",
        "No quantiles of learned forecasts yet.",
    ),
    Row(
        "claim:future-training",
        "Section 7",
        "Future work: use Eq. 7 to train more efficiently.",
        "not",
        "",
        "Nothing was tried.",
        "With the law the sum learns as Q-learning does (Section 5 above): by itself Eq. 7 gains "
        "nothing in a table.",
    ),
)

# %% [markdown]
# ## Appendix A: state values
#
# The same, given a state alone. A policy's components are the average of those of its actions:

# %%
v_steps = np.einsum("sa,isa->is", policy, steps)  # E[γ^i R_(t+i) | s]
v_vectors = np.concatenate([v_steps[:6], v_steps[6:].sum(axis=0)[None]]).T
states = given.state_decomposition  # [S, N+1]
agree("Eq. 25, each component of v", states.components, v_vectors)
agree("Theorem 2, they sum to v", states.value, v_by_hand)
agree(
    "v as the average of its actions",
    states.components,
    given.decomposition.under(policy).components,
)
agree("Eqs. 26 and 27, groups", states.regroup(3).components.sum(axis=1), v_by_hand)

expected = (
    np.stack(  # Eq. 28: the reward in front, v of the next state behind it, folded
        [
            target(
                (policy[s] * pays[s]).sum(),
                DISCOUNT,
                chain[s] @ states.components,
            )
            for s in range(STATES)
        ]
    )
)
agree("Eq. 28, v is its own target", states.components, expected)

# %% [markdown]
# ## Appendix B: the listing
#
# The listing of the appendix takes the maximum over a single number. What is the next action
# then?

# %%
batch = rng.normal(size=(4, 3, 6))  # four observations, three actions, N = 5
print(
    "as listed:",
    np.argmax(np.sum(batch)),
    " here:",
    batch.sum(axis=2).argmax(axis=1),
)

# %% folded
Table(
    Row(
        "theorem:state-value-sum-expected-reward",
        "Theorem 2, Eqs. 20 to 24",
        "Theorem 1 for state values.",
        "corrected",
        "above; `tests/tabular/test_table.py::test_every_map_under_a_random_policy`",
        "Both sides are the same, to 1e-9.",
        "Bounded rewards and γ < 1, as for Theorem 1 ([P12](../errata.md#p12)).",
    ),
    Row(
        "app:state-value eq:state-value-trd-array",
        "Appendix A, Eq. 25",
        "The vector of a state.",
        "corrected",
        "above; `tests/test_decomposition.py`",
        "`state_decomposition` of a table, `RewardDecomposition.under` of any actions; the same, "
        "to 1e-9.",
        "Components 0 to N, as in Eq. 6 ([P1](../errata.md#p1)).",
    ),
    Row(
        "eq:state-value-trd-binned-array eq:grouped-state-value-equiv",
        "Eqs. 26, 27",
        "The same in groups, which sum to v.",
        "corrected",
        "above",
        "They do, to 1e-9.",
        "As in Eq. 13, the last group is a step too long ([P3](../errata.md#p3)).",
    ),
    Row(
        "eq:state-value-trd-loss",
        "Eq. 28",
        "The loss for state values.",
        "corrected",
        "above; `tests/deep/test_loss.py::test_the_target_of_a_given_policy_by_hand`",
        "The exact vectors are their own targets, to 1e-9.",
        "As in Eq. 15 ([P1](../errata.md#p1), [P2](../errata.md#p2)). trdlab learns components of "
        "actions, and averages them; no network has components of states alone.",
    ),
    Row(
        "app:training claim:hardware",
        "Appendix B",
        "One V100 and 20 cores, around 7 hours for a run.",
        "not",
        "`trdlab train atari GAME --preset cpu --teacher FILE`",
        "Shipped agents took "
        + ", ".join(
            f"{of['seconds'] / 60:.0f} min ({game})" for game, of in CARDS.items()
        )
        + ", and a fit, on a CPU.",
        "Far fewer steps, and no such card.",
    ),
    Row(
        "claim:scores",
        "Appendix B",
        "Scores 399.0, 1444.0 and 2756.0 (teachers 386.9, 1324.0, 2433.0), with clipped rewards.",
        "not",
        "`trdlab evaluate pretrained:Breakout`",
        f"Breakout {CARDS['Breakout']['mean']['value']:.1f} of 30 games, where its teacher has "
        f"{CARDS['Breakout']['teacher']['score']:.1f}. The other two games: not trained.",
        "Another teacher. Scores are raw in both: the paper's words are wrong "
        "([P13](../errata.md#p13)).",
    ),
    Row(
        "listing:trd-training",
        "Figure 8 (listing)",
        "The loss in fifteen lines.",
        "corrected",
        "above; `tests/test_bellman.py`, `tests/deep/test_loss.py`",
        "As listed, the next action is always the first one.",
        "Axes, γʷ, a target network ([P4](../errata.md#p4)). The law stands in "
        "[`trdlab.bellman`](../reference/bellman.md).",
    ),
    Row(
        "claim:listing-text",
        "Appendix B",
        "The listing in words: sum, choose, shift by one, fold the last, put the reward in front.",
        "reproduced",
        "`tests/test_bellman.py::test_targets_by_hand`",
        "That is what trdlab does.",
        "The words are right where the listing is not.",
    ),
    Row(
        "tab:hyperparameters",
        "Table 1",
        f"{len(TABLE_1)} settings.",
        "partly",
        "the table of Section 5 above",
        f"{same} of {len(TABLE_1)} are the same in `--preset paper`.",
        "Other evaluations. 1000 steps are 250 updates ([C6](../errata.md#c6)).",
    ),
    Row(
        "app:rewards",
        "Appendix C",
        "More expected rewards.",
        "partly",
        "[The paper's figures](../figures.md#appendix-c-more-rewards)",
        "Breakout and Seaquest.",
        "Other agents.",
    ),
    Row(
        "fig:mspacman-expected-reward",
        "Figure 9",
        "Ms. Pacman: a reward every three steps, sure up to t+25.",
        "not",
        "",
        "No agent of Ms. Pacman comes with trdlab.",
        "With one: `python benchmarks/figures.py FILE 120 --env MsPacman`",
    ),
    Row(
        "fig:breakout-expected-reward-app",
        "Figure 10",
        "Breakout: one reward, spread over two steps, and nothing for 30 more.",
        "partly",
        "`python benchmarks/figures.py pretrained:Breakout 56 --max-steps 300 --name breakout`",
        "One peak at t+5, and little after it.",
        "Another agent, at another moment.",
    ),
    Row(
        "fig:seaquest-expected-reward",
        "Figure 11",
        "Seaquest: one reward around t+5, of low confidence.",
        "partly",
        "`python benchmarks/figures.py seaquest 65 --max-steps 300 --name seaquest`",
        "What is expected rises step by step; beyond t+8 it is not known to be better than a "
        "guess.",
        "An agent trained by others (ACKTR), with another game.",
    ),
    Row(
        "claim:uncertain-why",
        "Appendix C",
        "Whether more training or chance in the game makes agents unsure is open.",
        "partly",
        "`trdlab explain pretrained:Breakout --what calibration --details`",
        "A calibration tells how much of what comes a perfect forecast could know, where it can.",
        "Not answered for the paper's agents.",
    ),
    Row(
        "app:features fig:breakout-feature-importance-middle fig:breakout-feature-importance-late",
        "Appendix D, Figures 12, 13",
        "Maps of Breakout in the middle and at the end of an episode.",
        "partly",
        "`trdlab explain pretrained:Breakout --what saliency --component 0,39 --step 551 "
        "--episodes 0`, "
        "and `--step 850`",
        "[Both are drawn](../figures.md#appendix-d-where-it-looks-later).",
        "Another agent. “Figure 5” in this appendix is Figure 6.",
    ),
    Row(
        "claim:reversed-ball",
        "Appendix D",
        "Late in the game the ball matters for far reward and not for near; why is unclear.",
        "not",
        "[When not to believe a map](../saliency.md#when-not-to-believe-a-map)",
        "These maps fail their checks here. That would explain contradictory stories.",
        "Whether the paper's own maps fail, nobody has tested.",
    ),
    Row(
        "app:contrasts fig:riverraid-contrastive",
        "Appendix E, Figure 14",
        "River Raid: left raises what is expected from 0.2 to 0.8, then both converge.",
        "partly",
        "`python benchmarks/figures.py pretrained:Riverraid 100:LEFT:RIGHT --max-steps 300 "
        "--name riverraid`",
        "[River Raid](../figures.md#appendix-e-more-of-left-and-right), all of it pale.",
        "The agent hardly ever takes either action, so what it says of them is not tested.",
    ),
    Row(
        "fig:mspacman-contrastive",
        "Figure 15",
        "Ms. Pacman: left, towards pellets, or right, away from them.",
        "not",
        "",
        "No agent of Ms. Pacman comes with trdlab. "
        "[Breakout](../figures.md#appendix-e-more-of-left-and-right) "
        "stands in its place.",
        "With an agent, the same command draws it.",
    ),
)

# %% [markdown]
# ## All of it, counted

# %%
counts = Counter(row.status for row in ROWS)
for status in STATUSES:
    print(f"{status:>10} {counts[status]:3}")
print(f"{'rows':>10} {len(ROWS):3}")
print("not:", *(row.labels for row in ROWS if row.status == "not"), sep="\n  ")

# %% [markdown]
# What can be proved or computed holds, much of it after a small correction. What was measured on
# Atari came out alike here, on other games and agents, or was not measured again. In one thing
# the results part: maps like those of Figure 6 mostly fail their checks here. Whether the paper's
# own would, nobody has tested.

# %% [markdown]
# ## Your turn
#
# **Exercise 10.1.** Take the drone's way down, whose five steps pay 0, 1, 1, 1, 1, with γ = 0.95.
# What is its vector with N = 1 and w = 3? Mind where the group ends.

# %%
answer_1 = None  # replace with a list of two numbers
check("10.1", answer_1)

# %% [markdown]
# **Exercise 10.2.** The next four rewards are 4, 2, 8 and 1, and γ = 0.5. With w = 2, what is the
# first entry of the target?

# %%
answer_2 = None  # replace with a number
check("10.2", answer_2)

# %% [markdown]
# **Exercise 10.3.** In Space Invaders the paper's agent has 1444 points, its teacher 1324, and
# random play 148 (Mnih et al., 2015). How much of the way from random play to its teacher has the
# agent come?

# %%
answer_3 = None  # replace with a number
check("10.3", answer_3)

# %% [markdown]
# > **An open question.** Two things are known that make w > 1 worse: random actions inside the
# > windows, and a buffer that bootstraps in the wrong state. Which experiment would tell how much
# > of Figure 3 is which? On which worlds would you do it first, and with how many seeds?

# %% [markdown]
# ## What you have learned
#
# - The theory holds: a vector that sums to Q, one law, groups. Its printed form needs small
#   corrections.
# - That N does not hurt is no surprise: the sum of the components learns as Q-learning does.
# - What is learned together with the policy is mostly right near, and often wrong far. Nobody
#   sees that who looks at scores.
# - A reproduction is a table with honest gaps. Say what you did not do, and why.
