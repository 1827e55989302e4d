# %% [markdown]
# # Lesson 1: read a reward vector
#
# Ask an agent why it went left, and all it can show you is a number: its **Q-value**, the reward it
# expects from now on. The number says *how much*. It does not say *when*, or in how many portions.
#
# A **reward vector** does. It splits the Q-value over time, and its entries still add up to it.
# This is Temporal Reward Decomposition, TRD for short. In this lesson you learn to read one.
#
# - **Goal:** say from a vector when an agent expects which reward, and why it prefers an action.
# - **Before it:** a little Python, and no reinforcement learning.
# - **Time:** a quarter of an hour to read; some seconds to run, on two cores.

# %% [markdown]
# ## A drone at a fork
#
# Here is a whole world, drawn in letters.

# %%
from textwrap import fill

from matplotlib import pyplot as plt

from trdlab.decomposition import TimeAxis
from trdlab.explanations import gridworld_moment
from trdlab.explanations.moment.telling import sections
from trdlab.gridworld import Gridworld, load_map
from trdlab.gridworld.render import draw_map
from trdlab.show.plots.moment import plot_components
from trdlab.show.plots.style import action_colours
from trdlab.tabular import exact, undiscounted_totals
from trdlab.teach import check

world = Gridworld(load_map("drone"))
print("\n".join(world.grid.rows))

# %% [markdown]
# The drone starts at `S`. Up leads to a treasure, `T`, which pays 4. Down leads to four coins,
# which pay 1 each: three `c`, and a last `C`. `T` and `C` end the episode. A `#` is a wall, and a
# drone that flies into one stays where it is. Behind each `>` the way back is closed.
#
# Here is the same as a picture. A frame inside a cell says that the episode ends there.

# %%
figure, ax = plt.subplots(figsize=(4, 2.4), layout="constrained")
_ = draw_map(ax, world, state=0)

# %% [markdown]
# The drone decides once, in its first step. Both routes take five steps, and both pay 4.

# %% [markdown]
# ## One number for each action
#
# Reward now is better than reward later. An agent expresses this with a **discount factor** γ
# (gamma) between 0 and 1: a reward that comes *k* steps from now counts γᵏ times its worth.
# At γ = 0.95 the treasure, four steps away, counts 4 · 0.95⁴ ≈ 3.26.
#
# The drone's world is small enough to solve exactly. No training, no luck:

# %%
table = exact(world.mdp, TimeAxis(gamma=0.95, horizon=4, width=1))

start = 0  # the number of the state in which the drone starts
UP, DOWN = 0, 1  # the numbers of its actions; left and right only meet walls
up = table.decomposition[start, UP]
down = table.decomposition[start, DOWN]

print(f"Q(up)   = {up.value:.2f}")
print(f"Q(down) = {down.value:.2f}")

# %% [markdown]
# Down is better, by a little. That is all a Q-value can tell. A treasure far away, or coins close
# by? From 3.26 and 3.52 alone, nobody can know.

# %% [markdown]
# ## The same number, split over time
#
# Now look at the vectors behind the two numbers.

# %%
print("up  ", up.components.round(2))
print("down", down.components.round(2))

# %% [markdown]
# Now the difference is plain. **Up** promises nothing for four steps, then one large reward.
# **Down** promises a small reward in each step but the first.
#
# The first entry is called component 0. It holds the reward of *the action taken now*: the step
# from *t* to the next moment. Component 1 holds the reward of the step after that, and so on.
# A table with the steps written above the entries is easier to read:

# %%
down

# %% [markdown]
# - **Component 0** (*t*) is 0: stepping down into the corridor pays nothing.
# - **Components 1, 2, 3** are the first three coins. Each is worth 1, discounted once more than
#   the one before: 0.95, then 0.95² ≈ 0.90, then 0.95³ ≈ 0.86.
# - **The last component** (*t+4…∞*) is different. It is the **residual**: *everything* from step
#   *t+4* on, in one sum. Here that is the fourth coin, 0.95⁴ ≈ 0.81.
#
# We asked for N = 4 explicit components, so the vector has N + 1 = 5 entries. The residual is
# always there, and always last.

# %% [markdown]
# > **The formula.** The reward $R_{t+k}$ is paid $k$ steps from now. Component $i$ is the expected,
# > discounted reward of its own $w$ steps, for $i < N$:
# >
# > $$c_i(s,a)=\mathbb{E}\Big[\sum_{k=iw}^{iw+w-1}\gamma^k R_{t+k}\;\Big|\;s,a\Big]$$
# >
# > The residual takes all the rest, and nothing is left out:
# >
# > $$c_N(s,a)=\mathbb{E}\Big[\sum_{k=Nw}^{\infty}\gamma^k R_{t+k}\;\Big|\;s,a\Big]$$
# >
# > $$\sum_{i=0}^{N}c_i(s,a)=Q(s,a)$$
# >
# > Here $N = 4$ and $w = 1$. What $w > 1$ is for, you see at the end of the lesson.

# %% [markdown]
# ## Nothing is lost
#
# Every future reward falls into exactly one component. So the components must add up to the
# Q-value. trdlab computes the two in different ways, which makes this a real check:

# %%
q_up, q_down = table.solution.q_values[start, [UP, DOWN]]
print(f"up:   components sum to {up.components.sum():.4f}, Q = {q_up:.4f}")
print(f"down: components sum to {down.components.sum():.4f}, Q = {q_down:.4f}")

# %% [markdown]
# TRD does not add a second opinion about the future. It cuts the agent's one opinion into slices.
#
# (Here the slices are exact. Where they are *learned*, a right sum does not make each slice right:
# they must be held against the rewards that really follow.)

# %% [markdown]
# ## A picture of it

# %%
figure, axes = plt.subplots(2, sharey=True, figsize=(6, 4.2), layout="constrained")
colours = action_colours(world.action_names)
for ax, name, vector in zip(axes, ("up", "down"), (up, down), strict=True):
    plot_components(ax, vector.components, table.time_axis, colour=colours[name])
    ax.set_title(name, loc="left", pad=20)

# %% [markdown]
# ## Read the rewards themselves
#
# A component is *discounted*: it says what a reward is worth from here. Often you would rather know
# the reward itself. For a single step, that is easy. Component *i* was multiplied by γⁱ, so divide
# by it:

# %%
print("down, undiscounted:", down.undiscounted().round(2))

# %% [markdown]
# Nothing, then three coins of 1. But there are only four numbers. Where is the fifth?
#
# The residual cannot be undiscounted. It says 0.81, which may be one coin at *t+4*, or two coins
# much later, or a trickle for ever. One number cannot tell them apart, and trdlab will not guess.
# To know the undiscounted total, the world must be solved once more, for that question:

# %%
totals = undiscounted_totals(world.mdp, table.solution.policy)[start]
print("up pays", totals[UP].round(2), "and down", totals[DOWN].round(2))

# %% [markdown]
# ## So why down?
#
# Both routes pay 4. They differ only in *when*. Subtract one vector from the other, and the reason
# stands there:

# %%
down - up

# %% [markdown]
# Read it from left to right. By going down the drone gains 0.95, 0.90 and 0.86 early on, and gives
# up 2.44 from *t+4* on. The gain is larger, by 0.27. That is exactly the gap between the Q-values.
#
# In one sentence: *both routes pay 4, but down pays most of it sooner, and the discount makes
# sooner better.* The Q-values agree with that sentence. Only the vectors can prove it.

# %% [markdown]
# ## Let trdlab say it
#
# trdlab can put this into words. Each sentence comes from numbers of the two vectors, and is only
# said if they support it:

# %%
moment = gridworld_moment(world, table, start)
for section in sections(moment.choice("down", "up"))[:2]:
    print(section.heading)
    for sentence in section.sentences:
        print(fill(f"- {sentence}", width=80, subsequent_indent="  "))

# %% [markdown]
# ## How much does the drone care about "sooner"?
#
# That is what γ sets. Here are the two Q-values for an impatient drone and for ever more patient
# ones.

# %%
print("    γ     up   down    gap")
for gamma in (0.5, 0.8, 0.95, 0.99, 0.999):
    solved = exact(world.mdp, TimeAxis(gamma, horizon=4))
    q_values = solved.decomposition[start].value
    q_up, q_down = q_values[UP], q_values[DOWN]
    print(f"{gamma:5} {q_up:6.2f} {q_down:6.2f} {q_down - q_up:6.2f}")

# %% [markdown]
# At γ = 0.5 the treasure is hardly worth the flight. As γ comes close to 1, both routes come close
# to their full 4, and the gap closes. But it never turns: whatever γ is, down has been paid at
# least as much as up at every moment. The preference is slight, and yet safe. A Q-value would not
# have told you that either.

# %% [markdown]
# ## Fewer, wider components
#
# Five entries are easy to read. To look 400 steps ahead, nobody wants 401 of them. So let each
# component cover **w** steps instead of one. Here are N = 2 components of w = 2 steps:

# %%
wide = exact(world.mdp, TimeAxis(gamma=0.95, horizon=2, width=2)).decomposition[
    start
]
print("steps", wide.time_axis.labels)
print("up   ", wide[UP].components.round(2))
print("down ", wide[DOWN].components.round(2))

# %% [markdown]
# The steps are the same, in wider boxes: 0 + 0.95 = 0.95, then 0.90 + 0.86 = 1.76, then the
# residual, which starts at *t+4* as before. Two settings, N and w, and the explicit components
# reach N · w steps ahead. Wide boxes are fewer, and say less about when.

# %% [markdown]
# ## Your turn
#
# Replace each `None` with your answer. Numbers are compared to two decimals.
#
# **Exercise 1.1.** Some agent with γ = 0.9 and w = 1 reports `[0, 0, 1.62, 0, 0]`. How many points
# does it expect to be paid at *t+2*?

# %%
answer_1 = None  # replace with a number
check("1.1", answer_1)

# %% [markdown]
# **Exercise 1.2.** With N = 3 and w = 2, which future steps does component 1 cover? Write *t* as 0,
# *t+1* as 1, and so on, in a list.

# %%
answer_2 = None  # replace with a list of whole numbers
check("1.2", answer_2)

# %% [markdown]
# **Exercise 1.3.** At γ = 0.95, how much would the treasure have to pay for up to be exactly as
# good as down? You can try an answer on the world itself:
# `Gridworld(load_map("drone").with_value("treasure", 5))`.

# %%
answer_3 = None  # replace with a number
check("1.3", answer_3)

# %% [markdown]
# > **An open question.** The drone chose down because one sum was larger than another. It never
# > looked at the components. So is the vector an explanation of the *choice*, or only a description
# > of what the drone expects? What would you have to see to call it the reason?

# %% [markdown]
# ## What you can read now
#
# - Component *i* holds the discounted reward of its own steps. Component 0 is the action taken now.
# - The residual is the rest, up to the end of time. It has a worth, but no date.
# - The components add up to the Q-value. Always.
# - The difference of two vectors says *when* one action beats another.
#
# In [lesson 2](02_derive_it.md) you derive all of this yourself, and meet the cases in which a
# reward vector must be read with care.
