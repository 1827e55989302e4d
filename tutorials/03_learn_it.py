# %% [markdown]
# # Lesson 3: learn it
#
# So far every reward vector was *solved*: we knew each world's rules. An agent seldom does. It
# acts, sees what comes of it, and must learn the vector from that. In this lesson you write such a
# learner in ten lines, watch knowledge travel from component to component, and hold what was
# learned against the truth.
#
# - **Goal:** write a learner of reward vectors, and judge what it has learned.
# - **Before it:** [lesson 2](02_derive_it.md) and its law.
# - **Time:** half an hour to read; about 20 seconds to run, on two cores.

# %%
import gymnasium as gym
import numpy as np
from matplotlib import pyplot as plt

from trdlab.bellman import target
from trdlab.decomposition import TimeAxis
from trdlab.gridworld import Gridworld, load_map
from trdlab.tabular import exact, learn, spread
from trdlab.teach import check

AXIS = TimeAxis(gamma=0.95, horizon=4, width=1)
UP, DOWN, LEFT, RIGHT = range(4)

# %% [markdown]
# ## 1. The law as a target
#
# The law says how the vector of one moment follows from the vector of the next. It was an equation
# between things known. Now read it as an *instruction*. The agent did action a in state s, was paid
# r, and came to s′. It looks up its present opinion of s′, whatever that is worth, and takes the
# best action's components n. Then the law gives a **target**: what the vector of (s, a) should have
# been, judging by this one step. Move the entry of the table a little towards it:
#
# ```text
# table[s, a]  +=  α · ( target − table[s, a] )          α, the step size, from 0 to 1
# ```
#
# Learning an estimate from a later estimate is called *temporal-difference learning*, TD. With
# N = 0 this is Q-learning. With N > 0 it is the same, in every component at once.
#
# > **The formula.** After a step from $s$ with action $a$, where $n$ is what the table says of the
# > best next action (after a termination, $n = 0$):
# >
# > $$c(s,a)\leftarrow c(s,a)+\alpha\,\big(y-c(s,a)\big)$$
# >
# > $$y=\big(r,\;\gamma n_0,\;\dots,\;\gamma(n_{N-1}+n_N)\big)$$


# %%
def improve(table, state, action, reward, terminated, following, step_size):
    """Moves one entry of the table towards its target, in place."""
    best = table[following].sum(axis=1).argmax()
    discount = 0.0 if terminated else AXIS.gamma
    goal = target(np.float64(reward), np.float64(discount), table[following, best])
    table[state, action] += step_size * (goal - table[state, action])


# %% [markdown]
# Which action is best is decided by the *sum*. The components of that action are what is passed on.
#
# ## 2. How news travels
#
# Let the drone fly down and to the right, the same five steps again and again, and learn as it
# flies. It begins knowing nothing: all zeros. Here is what it thinks of going down, after each
# flight.

# %%
env = gym.make("trdlab.envs:trdlab/DroneGridworld-v0")
states, actions = env.observation_space.n, env.action_space.n
table = np.zeros((states, actions, AXIS.num_components))

for flight in range(1, 6):
    state, _ = env.reset(seed=0)
    for action in (DOWN, RIGHT, RIGHT, RIGHT, RIGHT):
        following, reward, terminated, _, _ = env.step(action)
        improve(table, state, action, reward, terminated, following, step_size=1)
        state = following
    print(f"after flight {flight}:", table[0, DOWN].round(2))

# %% [markdown]
# One more component each time. On the first flight the drone is paid four coins, but each is news
# only to the cell before it, as that cell's component 0. On the second flight it is news to the
# cell before *that*, as component 1. **Component i is learned after component i − 1, and from it.**
# So its errors are passed on, too. Keep this in mind whenever somebody shows you a *learned*
# vector: its near entries are the best known.
#
# Now let it try everything at random, for 300 flights, and compare with the exact table:

# %%
rng = np.random.default_rng(0)
for _ in range(300):
    state, _ = env.reset()
    ended = False
    while not ended:
        action = rng.integers(actions)
        following, reward, terminated, truncated, _ = env.step(action)
        improve(table, state, action, reward, terminated, following, step_size=1)
        state, ended = following, terminated or truncated

drone = exact(env.unwrapped.mdp, AXIS).decomposition
print("up  ", table[0, UP].round(4))
print("down", table[0, DOWN].round(4))
print("largest error anywhere:", np.abs(table - drone.components).max().round(12))

# %% [markdown]
# Not one number of the model was used, and yet every vector of every cell is right. Note the `or`
# in the last line of the loop, and that `improve` is not told of it: an episode that is
# *truncated*, cut off by a time limit, does not stop the world from going on. Only where it
# *terminates* nothing follows. Whoever merges the two teaches the agent that the future ends with
# the clock.

# %% [markdown]
# ## 3. Slip
#
# In that world nothing is left to chance, so one look is enough, and the step size can be 1. Here
# is another one. The drone wants the treasure on the right, worth 4. The way over the bridge is
# short, but with a chance of 0.1 a move slips sideways, into the abyss, `H`, which costs 4.

# %%
bridge = Gridworld(load_map("bridge"))
print("\n".join(bridge.grid.rows))

# %% [markdown]
# Take the last step over the bridge. It pays 4, most of the time. What is its component 0? Two
# learners watch the same 200 tries: one keeps the step size 0.3, the other lets it shrink like 1/n.

# %%
tries = rng.choice([4.0, -4.0, 0.0], p=[0.9, 0.05, 0.05], size=200)
steady, shrinking = np.zeros(201), np.zeros(201)
for n, reward in enumerate(tries, start=1):
    steady[n] = steady[n - 1] + 0.3 * (reward - steady[n - 1])
    shrinking[n] = shrinking[n - 1] + 1 / n * (reward - shrinking[n - 1])

figure, ax = plt.subplots(figsize=(6, 2.6), layout="constrained")
ax.plot(steady, color="tab:orange", label="α = 0.3")
ax.plot(shrinking, color="tab:blue", label="α = 1/n")
ax.axhline(0.9 * 4 - 0.05 * 4, color="black", lw=0.8, ls="--", label="true: 3.4")
ax.set(xlabel="tries", ylabel="component 0")
_ = ax.legend(loc="lower right", ncols=3, frameon=False)

# %% [markdown]
# The steady learner is thrown off by every accident, for ever. The other one takes an average, and
# comes to rest. So step sizes must shrink. But not too fast: the *targets* of later components are
# wrong at first, and a learner that soon hardly moves would keep them. 1/n is too fast.
#
# `trdlab.tabular.learn` is the learner you wrote, for many episodes at a time. Its steps shrink a
# little slower than 1/n, and it averages its tables over time. Give it ever more steps on the
# bridge, and compare with the exact table, over all cells and actions:

# %%
AHEAD = TimeAxis(gamma=0.9, horizon=8, width=1)
solved = exact(bridge.mdp, AHEAD).decomposition

print("   steps   Q off by   components off by, for i = 0 … 8")
for steps in (30_000, 300_000, 1_000_000):
    learned = learn(bridge.mdp, AHEAD, agent_steps=steps, num_envs=128, seed=2)
    off = np.abs(learned.decomposition.components - solved.components)
    off_q = np.abs(learned.decomposition.value - solved.value).max()
    print(
        f"{steps:8} {off_q:8.2f}     ", *(f"{x:5.2f}" for x in off.max(axis=(0, 1)))
    )

# %% [markdown]
# With enough steps, all of it goes to 0. But look at the second line: Q is nearly right everywhere,
# and components 6 and 8 are far off. How can that be? At some cell, over the bridge or round it is
# almost the same:

# %%
values = np.sort(solved.value, axis=1)
gaps = np.where(bridge.mdp.terminal_states, np.inf, values[:, -1] - values[:, -2])
closest = gaps.argmin()
print(f"at {bridge.states[closest]}, two actions are {gaps[closest]:.3f} apart")
for action in np.argsort(solved.value[closest])[:-3:-1]:
    name, vector = bridge.action_names[action], solved[closest, action]
    print(f"{name:>6}  Q = {vector.value:.3f}  {vector.components.round(2)}")

# %% [markdown]
# A learner that takes the slightly worse way loses next to nothing, so Q hardly notices. But it is
# *paid at other times*, and every cell that leads here inherits the mistake. **A right sum is no
# proof of right components.** Each must be tested by itself. In a small world there is an exact
# table to test against. Elsewhere there are the rewards that really follow.

# %% [markdown]
# ## 4. Whose future did it learn?
#
# The target above took the *best* action's components. So the table tells the future of the agent
# that always takes the best action, although the drone we watched flew at random! That is the gift
# of Q-learning: it learns of one policy while following another.
#
# Often you want to know about a *given* policy instead: an agent that is already there, with its
# faults. Then n is not the best action's vector, but the average over what that policy would do:

# %%
at_random = np.full((bridge.mdp.num_states, 4), 0.25)
aimless = learn(bridge.mdp, AHEAD, policy=at_random, seed=2)
for learner in (learned, aimless):
    print(learner.future.policy)
    print(
        "   right, at the start:",
        learner.decomposition[0, RIGHT].components.round(2),
    )

# %% [markdown]
# The same world, the same first step, two futures. Flying at random is a bad idea on a bridge.
#
# With a given policy there is a snag. A policy that never does a certain action never finds out
# what comes of it. So `learn` begins with any action, evenly, and lets the policy do the rest. If
# you collect data for such a purpose, do the same: **force the first action now and then.**

# %% [markdown]
# ## 5. What the average hides
#
# Over the bridge, the vector says:

# %%
table = exact(bridge.mdp, AHEAD)
right = table.decomposition[0, RIGHT]
right

# %% [markdown]
# At *t+5* it expects 1.17. Will it be paid 1.17? Never. It will be paid 4, which counts 2.36 from
# here, or nothing, or −4, which counts −2.36. A component is an **expectation**, an average over
# all that may happen. So look at what does happen, in 5000 flights:


# %%
def returns(world, policy, first_action, episodes, horizon, rng):
    """Returns what the first steps pay, `[episodes, horizon]`, 0 after the end."""
    mdp = world.mdp
    rewards = np.zeros((episodes, horizon))
    for episode in range(episodes):
        state, action = mdp.start, first_action
        for step in range(horizon):
            row = state * mdp.num_actions + action
            first, end = mdp.offsets[row], mdp.offsets[row + 1]
            likely = np.cumsum(mdp.probabilities[first:end])
            drawn = first + np.searchsorted(
                likely, rng.random() * likely[-1], "right"
            )
            rewards[episode, step] = mdp.rewards[drawn]
            if mdp.terminated[drawn]:
                break
            state = mdp.next_states[drawn]
            action = policy[state]
    return rewards


policy = table.solution.policy.argmax(axis=1)
paid = returns(bridge, policy, RIGHT, 5000, 8, rng)
discounted = paid * AHEAD.discounts[:-1]

known = spread(table).deviation[bridge.mdp.start, RIGHT]  # without a single flight

print("step   component   average    spread   exactly    +4      0     −4")
for i in range(8):
    shares = [(paid[:, i] == pays).mean() for pays in (4, 0, -4)]
    print(
        f" t+{i} {right.components[i]:10.2f} {discounted[:, i].mean():10.2f}"
        f" {discounted[:, i].std():9.2f} {known[i]:9.2f} ",
        *(f"{share:6.1%}" for share in shares),
    )

# %% [markdown]
# The *spread* is the standard deviation: how far a reward usually is from its average. Where it is
# small beside the component, the component is nearly a promise. Where it is large, it is a bet. The
# shares on the right say which bet. An exact model knows both without a flight: `spread` gave the
# column *exactly*, and `outcomes` gives the shares.

# %%
figure, ax = plt.subplots(figsize=(6, 2.8), layout="constrained")
steps = np.arange(8)
ax.bar(steps, right.components[:-1], color="tab:blue", label="component")
ax.errorbar(
    steps,
    right.components[:-1],
    discounted.std(axis=0),
    fmt="none",
    ecolor="black",
    capsize=3,
    label="spread",
)
ax.axhline(0, color="black", lw=0.8)
ax.set(xlabel="steps from now", ylabel="discounted reward")
ax.set_xticks(steps, AHEAD.labels[:-1])
_ = ax.legend(frameon=False)

# %% [markdown]
# Two different doubts should not be confused. *The world* may be uncertain: then even the exact
# component has a spread, and no learner can remove it. And *the learner* may be uncertain, since it
# has seen too little: then the component itself is off, and more steps will help. The table of
# section 3 showed the second, this one the first.

# %% [markdown]
# ## Your turn
#
# **Exercise 3.1.** The table holds [0, 2, 4] for an action. It is taken once: r = 1, γ = 0.5, and
# the best next action has n = [2, 2, 4]. What does the table hold after one step of size α = 0.5?

# %%
answer_1 = None  # replace with a list of three numbers
check("3.1", answer_1)

# %% [markdown]
# **Exercise 3.2.** A corridor, flown along from end to end, learning as in section 2 (all zeros at
# first, N = 4, α = 1). The only reward comes with the *tenth* step. After how many flights does the
# first step's vector change for the first time?

# %%
answer_2 = None  # replace with a whole number
check("3.2", answer_2)

# %% [markdown]
# **Exercise 3.3.** At *t+1* an agent is paid 4 with a chance of 0.25, and nothing otherwise. At
# γ = 1 the component would be 1. How large would its spread be?

# %%
answer_3 = None  # replace with a number
check("3.3", answer_3)

# %% [markdown]
# > **An open question.** News travels one component at a time, and errors travel with it. One could
# > instead wait until the episode is over, and learn each component from what was really paid. What
# > would that gain, and what would it cost? Which of the two would you trust for the far
# > components?

# %% [markdown]
# ## What you have learned
#
# - The law is a target: move a table towards it, and every component is learned at once.
# - News travels one component at a time. Near entries are learned first, and errors are passed on.
# - Components can be wrong while their sum is right. Test each of them.
# - A target with the best action learns of the greedy policy; a target with the average, of a given
#   one.
# - A component is an average. Its spread says whether it is a promise or a bet.
#
# Could the learner not simply watch the sum, and let the components follow? And what if each covers
# many steps? That is [lesson 4](04_why_the_sum_fails.md).
