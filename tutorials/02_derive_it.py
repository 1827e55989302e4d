# %% [markdown]
# # Lesson 2: derive it
#
# In [lesson 1](01_read_a_reward_vector.md) you read reward vectors. Now you build them: why the
# Q-value may be cut into slices, the one equation by which the slices follow from each other, and
# three places where a reward vector must be read with care.
#
# - **Goal:** derive the vector, and know where it must be read with care.
# - **Before it:** lesson 1, and to have met an expectation E[…] before.
# - **Time:** half an hour to read; some seconds to run, on two cores.

# %%
import numpy as np

from trdlab.bellman import target
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.gridworld import Gridworld, load_map, map_names
from trdlab.tabular import exact, undiscounted_totals
from trdlab.teach import check

GAMMA = 0.95
world = Gridworld(load_map("drone"))
table = exact(world.mdp, TimeAxis(GAMMA, horizon=4, width=1))

# %% [markdown]
# ## 1. May the Q-value be cut?
#
# Call the rewards that follow Rₜ, Rₜ₊₁, Rₜ₊₂, …, where Rₜ is paid for the action taken now. The
# Q-value of action a in state s is the expectation of their discounted sum:
#
# ```text
# Q(s, a) = E[ Rₜ + γ·Rₜ₊₁ + γ²·Rₜ₊₂ + …  |  s, a ]
# ```
#
# TRD takes the expectation of each term first, and sums afterwards:
#
# ```text
# E[Rₜ] + E[γ·Rₜ₊₁] + E[γ²·Rₜ₊₂] + …
# ```
#
# For finitely many terms that is the same, always. It is the linearity of expectation, and it needs
# nothing: not even that the rewards are independent. But our sum has no last term, and then
# linearity alone is not enough. A limit and an expectation must change places.
#
# **What it needs:** rewards that are bounded, |R| ≤ M for some M, and γ < 1. Then no partial sum is
# ever larger in size than M + γM + γ²M + … = M / (1 − γ). One fixed number above all of them is
# just what the theorem of *dominated convergence* asks for, and it permits the exchange. ∎

# %% [markdown]
# ### Is that only pedantry?
#
# Here is a world without a bound. A gambler tosses a fair coin until the first win, and doubles the
# stake after each loss. (Stakes grow as fast as (2/γ)ⁱ, so that they double even *after*
# discounting.) Every bet is fair: each term of the sum has expectation 0. So the sum of the
# expectations is 0. But sooner or later the gambler wins, and then is ahead by exactly 1:

# %%
print("rounds  won by then  ahead by  not yet   ahead by  expected")
for rounds in (1, 2, 5, 10, 20):
    not_yet = 0.5**rounds
    lost = -(2**rounds - 1)
    won = 1 - not_yet
    expected = won * 1 + not_yet * lost
    print(f"{rounds:6} {won:12.5f} {1:9} {not_yet:8.5f} {lost:10} {expected:9.1f}")

# %% [markdown]
# The column on the right is 0 for ever. Yet the outcome is 1 with certainty. *The expectation of
# the sum is 1, the sum of the expectations is 0*: a vector of components would not add up to Q.
#
# So both conditions matter. Where states are finitely many, rewards are bounded of themselves. The
# other condition trdlab insists on:

# %%
try:
    TimeAxis(gamma=1.0, horizon=4)
except InputError as error:
    print(error.cause, error.cure, sep="\n")

# %% [markdown]
# ## 2. The law
#
# Now cut. Component *i* is E[γⁱ·Rₜ₊ᵢ] for i < N. Component N, the **residual**, is all the rest.
# How does the vector of one moment follow from the vector of the next?
#
# Let the drone act once. It is paid r, and arrives in a state whose best action has the components
# n₀, n₁, …, n_N. What is *one* step away there is *two* steps away here, and counts γ times as
# much. So everything moves one place to the right and shrinks by γ. In front there is room for r.
# At the end there is one entry too many: the last explicit step has moved past the horizon. It
# belongs to the residual now. Fold the two together. For N = 3:
#
# ```text
# there      n₀       n₁       n₂     n₃
#               ↘        ↘        ↘   ↓
# here       r     γ·n₀     γ·n₁     γ·(n₂ + n₃)
# ```
#
# That is all: **put r in front, fold the last two.** Where the episode ends, nothing follows, and
# γ is replaced by 0.
#
# > **The formula.** In general $r$ is the discounted sum of $w$ rewards, and $n$ the vector of what
# > the policy does $w$ steps later:
# >
# > $$c(s,a)=\mathbb{E}\big[\,r,\;\gamma^w n_0,\;\dots,\;\gamma^w(n_{N-1}+n_N)\,\big]$$
# >
# > After a termination $n = 0$.


# %%
def law(reward: float, discount: float, following: np.ndarray) -> np.ndarray:
    """The law for one vector, written as we say it."""
    shifted = [reward, *(discount * following)]
    return np.array([*shifted[:-2], shifted[-2] + shifted[-1]])


# %% [markdown]
# ### By hand, from the last coin backwards
#
# The way down takes five steps. Begin with the last one, where the future is short, and walk back
# to the start. Each line uses nothing but the law and the line above it.

# %%
DOWN, RIGHT = 1, 3
route = [
    ("2,3", RIGHT, 1),
    ("2,2", RIGHT, 1),
    ("2,1", RIGHT, 1),
    ("2,0", RIGHT, 1),
    ("1,0", DOWN, 0),
]

print(" cell  r  components")
by_hand = np.zeros(5)  # after the last coin nothing follows
for place, action, reward in route:
    by_hand = law(reward, GAMMA, by_hand)
    print(f"  {place}  {reward}  {by_hand.round(4)}")

    solved = table.decomposition[world.find_state(place), action].components
    assert np.allclose(by_hand, solved)  # the exact solver agrees, at every cell

# %% [markdown]
# Watch the 1 of the last coin wander to the right, and shrink as it goes. In the last line it
# passes the horizon: 0.8574 was component 3, and γ times that, 0.8145, is in the residual.
#
# In trdlab the law stands in one place, `trdlab.bellman.target`. It takes whole batches, of numpy
# and torch alike. On one vector it does what you did by hand:

# %%
following = table.decomposition[world.find_state("2,0"), RIGHT].components
print("ours  ", law(0.0, GAMMA, following).round(4))
print("trdlab", target(np.float64(0.0), np.float64(GAMMA), following).round(4))

# %% [markdown]
# ### When luck is involved
#
# If an action may lead to several states, take the expectation over them: each state's target,
# weighted by its probability. The law is linear, so nothing else changes. On the map `bridge`,
# for example, the drone slips, and its components are averages over all the ways it may go.
#
# So let us test the law on every state and every action of all built-in maps. Two things are
# claimed. The components obey the law. And they add up to Q:


# %%
def deviations(name: str) -> tuple[int, float, float]:
    """Returns the number of states, and how far law and sum are off at worst."""
    mdp = Gridworld(load_map(name)).mdp
    table = exact(mdp, TimeAxis(GAMMA, horizon=4, width=1))
    # for each of the K transitions, the components of what the policy does next
    following = table.state_decomposition.components[mdp.next_states]  # [K, N+1]
    discount = np.where(mdp.terminated, 0.0, GAMMA)  # [K]
    targets = target(mdp.rewards, discount, following)  # [K, N+1]
    weighted = mdp.probabilities[:, None] * targets  # [K, N+1]
    expected = np.add.reduceat(weighted, mdp.offsets[:-1])  # [S·A, N+1]
    solved = table.decomposition
    off_law = np.abs(expected - solved.components.reshape(expected.shape)).max()
    off_sum = np.abs(solved.value - table.solution.q_values).max()
    return mdp.num_states, float(off_law), float(off_sum)


print("map       states  law holds  sum is Q")
for name in map_names():
    states, off_law, off_sum = deviations(name)
    print(f"{name:9} {states:6}  {off_law < 1e-12!s:>9}  {off_sum < 1e-12!s:>8}")

# %% [markdown]
# Is the last column not true by construction? It would be, if the residual were what is left of Q.
# But the exact solver computes the residual by itself: the Q-values N·w steps later, discounted.
# So the sum could go wrong, and that it does not is evidence.
#
# ### What the sum tells
#
# Add up both sides of the law. The fold moves nothing in or out, so
#
# ```text
# Σ target = r + γ·Σ n
# ```
#
# and with Q = Σ n this is the Bellman equation you may know: Q(s, a) = r + γ·max Q(s′, ·). With
# N = 0 there is only the residual, and the law *is* Q-learning. A vector agent and a scalar agent
# have the same Q-values and take the same actions. The vector only keeps apart what the sum mixes.

# %% [markdown]
# ## 3. N against w
#
# To look 30 steps ahead with w = 1 takes 31 entries for each action. For a table that is nothing,
# for a neural network it may be much. So group the steps: with width w each explicit component
# covers w of them, and N components reach N · w steps.
#
# The law stays. Take w steps instead of one: r is their discounted sum, the discount is γʷ, and n
# belongs to the state w steps later. For w = 2, the first two steps down pay 0 and 1, and lead to
# the cell 2,1:

# %%
wide = exact(world.mdp, TimeAxis(GAMMA, horizon=2, width=2))
following = wide.decomposition[world.find_state("2,1"), RIGHT].components
print("by the law:", law(0 + GAMMA * 1, GAMMA**2, following).round(4))
print("solved:    ", wide.decomposition[0, DOWN].components.round(4))

# %% [markdown]
# Or do not solve again, but add up what you have. Groups are sums of steps:

# %%
fine = table.decomposition[0, DOWN]
for width in (1, 2, 4):
    grouped = fine.regroup(width)
    setting = f"N={grouped.time_axis.horizon} w={width}"
    print(setting, grouped.components.round(2), "sum", grouped.value.round(4))

# %% [markdown]
# The residual is the same each time, and so is the sum. Only the view in between becomes coarser.
# There is no way back, for a sum does not remember its parts. And groups must fit:

# %%
try:
    fine.regroup(3)
except InputError as error:
    print(error.cause, error.cure, sep="\n")

# %% [markdown]
# ## 4. What undiscounting can do, and what it cannot
#
# Component *i* of a w = 1 vector is γⁱ times an expected reward. Divide, and you have the reward.
# Three limits are worth knowing.
#
# **A group has no single discount.** Its steps carry different ones. Component 1 of down, at w = 2,
# is 1.7599. Three futures that all give just that:

# %%
print("paid at t+2  paid at t+3  component  together")
for first, second in [(1.0, 1.0), (1.95, 0.0), (0.0, 1 + 1 / GAMMA)]:
    component = GAMMA**2 * first + GAMMA**3 * second
    print(f"{first:11.4f} {second:12.4f} {component:10.4f} {first + second:9.4f}")

# %% [markdown]
# So the undiscounted sum is not known. But it has **bounds**. If no step pays less than 0, it is
# least when all is paid in the group's first step, and most when all is paid in the last. If you
# also know that no step pays more than 1, the bounds draw closer. For component 1 they meet:

# %%
grouped = wide.decomposition[0, DOWN]
for highest in (np.inf, 1.0):
    low, high = grouped.undiscounted_bounds(lowest=0.0, highest=highest)
    print(f"0 to {highest} a step:  least {low.round(2)}, most {high.round(2)}")

# %% [markdown]
# **A residual has no date at all.** It has no upper bound either, as you see above: the later the
# reward, the more of it fits into the same worth.
#
# **A total may not exist.** On the map `loop` the drone is paid once each round, for ever. With
# γ < 1 that has a worth, and without a discount it has none:

# %%
loop = exact(Gridworld(load_map("loop")).mdp, TimeAxis(GAMMA, horizon=10, width=1))
totals = undiscounted_totals(loop.mdp, loop.solution.policy)
print("Q(right)    ", loop.decomposition[0, RIGHT].value.round(4))
print("undiscounted", totals[0, RIGHT])

# %% [markdown]
# `nan`, not a number, is the honest answer. Where a total does exist, mind whose it is. It belongs
# to the policy that was chosen *with* the discount. An agent that does not discount might choose
# another.

# %% [markdown]
# ## 5. Whose future?
#
# One thing is still hidden in the law: what the agent does *next*. Usually that is the best action.
# What if there are two? Here is a corridor with 19 on one side, and 20 on the other, one step
# further away:

# %%
corridor = Gridworld(load_map("tie"))
print("\n".join(corridor.grid.rows), "     X pays 19, Y pays 20")
tie = exact(corridor.mdp, TimeAxis(GAMMA, horizon=3, width=1))
for action, name in enumerate(corridor.action_names):
    mark = "tied" if tie.solution.tied[0, action] else ""
    print(f"{name:>5}  Q = {tie.decomposition[0, action].value:5.2f}  {mark}")

# %% [markdown]
# At γ = 0.95, left is worth 19·γ = 18.05, and right 20·γ² = 18.05. It does not matter to the agent
# which it takes, and the Q-values are unique all the same. But *the state's* vector depends on it:
# does the agent expect a reward at *t+1*, or at *t+2*? Both answers are right. They speak of
# different agents.

# %%
for ties in ("lowest", "mixed"):
    told = exact(corridor.mdp, TimeAxis(GAMMA, horizon=3, width=1), ties=ties)
    vector = told.state_decomposition[0]
    print(f'ties="{ties}": {told.future.policy}')
    print("   the state's vector", vector.components.round(3))
    print("   its sum           ", vector.value.round(3))
    print("   up, into the wall ", told.decomposition[0, 0].components.round(3))

# %% [markdown]
# The sums agree, the vectors do not. Even for an action that is not tied, up, the vector changes,
# because the tie comes after it. So trdlab always says whose future it tells
# (`table.future.policy`), and where the answer could have been different:

# %%
print("states with tied but different futures:", np.flatnonzero(tie.ambiguous))

# %% [markdown]
# Q is unique. **A decomposition belongs to a policy.** Whenever somebody shows you a reward vector,
# ask whose.

# %% [markdown]
# ## Your turn
#
# **Exercise 2.1.** An action pays r = 0.5, the discount is 0.5, and the next components are
# n = [1, 2, 4]. Apply the law, by hand.

# %%
answer_1 = None  # replace with a list of three numbers
check("2.1", answer_1)

# %% [markdown]
# **Exercise 2.2.** You want a network to look 30 steps ahead, in groups of 5. How many outputs does
# it need for each action?

# %%
answer_2 = None  # replace with a whole number
check("2.2", answer_2)

# %% [markdown]
# **Exercise 2.3.** Suppose the near reward of the corridor were 18 instead of 19, and the far one
# still 20. At which γ, above 0, do left and right tie?

# %%
answer_3 = None  # replace with a number
check("2.3", answer_3)

# %% [markdown]
# > **An open question.** Somebody is refused a loan by an agent, and the law wants a reason. In
# > this state two actions were tied, with different futures. Which vector would you show? What
# > would have to stand beside it?

# %% [markdown]
# ## What you have derived
#
# - With bounded rewards and γ < 1 the Q-value may be cut into slices, and the slices add up to it.
# - One law links a vector to the next: put r in front, fold the last two.
# - N and w say how finely you look, and how far. They change neither Q nor what the agent does.
# - A single step can be undiscounted. A group has bounds, and a residual has no date.
# - Q is unique. A decomposition belongs to a policy.
#
# Where the paper's own formulas differ from the ones here, and why, is told on the page
# [Errata and deviations](../errata.md). What to do where nobody tells you the rules of the world,
# you find in [lesson 3](03_learn_it.md).
