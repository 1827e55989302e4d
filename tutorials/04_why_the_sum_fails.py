# %% [markdown]
# # Lesson 4: why the sum fails
#
# In [lesson 3](03_learn_it.md) a table learned each component from its own target. Two questions
# were left. An agent needs only the sum to act: could it not learn the sum, and let the components
# follow? And with w > 1, where a component covers many steps, what happens to learning?
#
# The answers are *no*, and *more than it seems*.
#
# - **Goal:** know which loss learns components, and whose future a wide window tells.
# - **Before it:** [lesson 3](03_learn_it.md).
# - **Time:** half an hour to read; about 20 seconds to run, on two cores.

# %%
from textwrap import fill

import numpy as np
from matplotlib import pyplot as plt

from trdlab.decomposition import TimeAxis
from trdlab.gridworld import Gridworld, load_map
from trdlab.show.plots.moment import plot_components
from trdlab.show.plots.style import action_colours
from trdlab.tabular import WindowBuilder, exact, learn, operator_table
from trdlab.teach import check

GAMMA = 0.95
UP, DOWN, LEFT, RIGHT = range(4)
drone = Gridworld(load_map("drone"))
AXIS = TimeAxis(GAMMA, horizon=4, width=1)
truth = exact(drone.mdp, AXIS).decomposition

# %% [markdown]
# ## 1. The tempting loss
#
# You have a network for Q-values, and a loss that works: the squared distance between Q and
# r + γ·max Q. Now the network shall put out N + 1 numbers that add up to Q. The least effort is to
# leave the loss as it is, and write Σ components wherever it says Q:
#
# ```text
# loss on the sum          ( Σᵢ cᵢ − (r + γ·Σᵢ nᵢ) )²
# loss on the components   Σᵢ ( cᵢ − targetᵢ )²            the target by the law
# ```
#
# The first is zero wherever the second is. Is it as good? Let three learners try it on the drone's
# world. They differ only in the random numbers they begin with.

# %%
exact_down = truth[0, DOWN]
print("exact    ", exact_down.components.round(2), "sum", exact_down.value.round(2))
for seed in range(3):
    rng = np.random.default_rng(seed)
    initial = rng.normal(size=truth.components.shape)
    learned = learn(
        drone.mdp,
        AXIS,
        loss="sum",
        initial=initial,
        agent_steps=300_000,
        num_envs=128,
    )
    down = learned.decomposition[0, DOWN]
    print("learner", seed, down.components.round(2), "sum", down.value.round(2))

# %% [markdown]
# Every sum is right. Every vector is different, and every one is wrong. And the loss is zero: no
# further training will change anything.

# %%
figure, axes = plt.subplots(2, sharey=True, figsize=(6, 4.2), layout="constrained")
colour = action_colours(drone.action_names)["down"]
shown = {"exact": truth[0, DOWN], "learned with the loss on the sum": down}
for ax, (how, vector) in zip(axes, shown.items(), strict=True):
    plot_components(ax, vector.components, AXIS, colour=colour)
    ax.set_title(f"down, {how}", loc="left", pad=20)

# %% [markdown]
# ### Where it ends
#
# We can say exactly where. The sum depends on each component in the same way, so the gradient of
# the loss is *the same number* for all of them. They only ever move together. Whatever stood
# between two components at the beginning stands there at the end.
#
# > **The formula.** The slope is the same for every $i$, and so is the way that each component
# > goes:
# >
# > $$\frac{\partial}{\partial c_i}\Big(\sum_j c_j-y\Big)^2=2\Big(\sum_j c_j-y\Big)$$
# >
# > $$c_i^{\text{end}}=c_i^{\text{start}}+\frac{1}{N+1}\Big(Q-\sum_j c_j^{\text{start}}\Big)$$

# %%
start, end = initial[0, DOWN], down.components
print("at first, less component 0:", (start - start[0]).round(3))
print("at last,  less component 0:", (end - end[0]).round(3))

missing = truth[0, DOWN].value - start.sum()
foretold = start + missing / AXIS.num_components
print("foretold:", foretold.round(3))
print("learned: ", end.round(3))

# %% [markdown]
# The components are the initial ones, plus an even share of what the sum was short of. The world
# decides only the share. A learner that begins with zeros gives each moment the same reward, 0.70,
# whether anything is paid then or not.
#
# Of the N + 1 numbers, the loss on the sum fixes *one*. The other N it leaves as it found them. In
# a network the weights are shared, so they drift, but no loss pulls them anywhere. The paper found
# that such training "does not converge" to the vector. Now you know why: it has no reason to.
#
# The loss on the components begins just as badly, and forgets it:

# %%
learned = learn(drone.mdp, AXIS, initial=initial, agent_steps=300_000, num_envs=128)
print("learned with the law:", learned.decomposition[0, DOWN].components.round(2))

# %% [markdown]
# Mind what this says about *testing*. The three learners above have perfect Q-values, take perfect
# actions and reach a perfect score. Their vectors are fiction. Neither the score nor the loss can
# tell you. Only the rewards that follow can.

# %% [markdown]
# ## 2. Windows of w steps
#
# With w > 1 each component covers w steps. The law stays, with r the discounted sum of w rewards,
# the discount γʷ, and n from the state w steps later. So a learner needs **windows**: w steps in a
# row, and the state where they end. `WindowBuilder` cuts them from an episode as it goes on. Here
# are five steps, which pay 1, 2, 3, 4 and 5, in windows of w = 3:


# %%
def windows_of(rewards, *, terminated, width=3, gamma=0.5):
    builder = WindowBuilder(width, gamma, num_envs=1)
    print("  from   rewards  discount  bootstrap in")
    for step, reward in enumerate(rewards):
        last = step + 1 == len(rewards)
        found = builder.add(
            observations=[step],
            actions=[0],
            rewards=[reward],
            terminated=[last and terminated],
            truncated=[last and not terminated],
            next_observations=[step + 1],
        )
        for i in range(len(found)):
            over = found.terminated[i]
            where = (
                "nothing, it is over" if over else f"s{found.next_observations[i]}"
            )
            print(
                f"  s{found.observations[i]} {found.rewards[i]:10}"
                f" {found.discounts[i]:9}  {where}"
            )
    print(f"  dropped: {builder.dropped}")


print("the episode terminates:")
windows_of([1, 2, 3, 4, 5], terminated=True)
print("the episode is cut off by a time limit:")
windows_of([1, 2, 3, 4, 5], terminated=False)

# %% [markdown]
# Two rules are at work at the end.
#
# - After a **termination** zeros follow. A short window is exact: the missing rewards are 0.
# - After a **truncation** the world goes on, unseen. The window that is just full is good, if the
#   true last state was kept. A shorter one is useless. Filling it with zeros would be a lie.
#   Bootstrapping after two steps instead of three would be right for a scalar Q, with γ² for γ³,
#   and wrong for us: what lies three steps ahead would be entered as if it lay two ahead, and
#   *every* component would be off by a step. So it is dropped, and counted.
#
# Between episodes there is a third: no window may cross from one to the next.

# %% [markdown]
# ### One step is not w steps
#
# A window must bootstrap in the state **w** steps later. Many replay memories store, beside each
# state, the very next one. Take that one, and everything *looks* well: the shapes fit, the loss
# falls. Here is the drone's way down, w = 2, learned both ways, to the end:

# %%
coins = np.array([0.0, 1.0, 1.0, 1.0, 1.0])  # what the five steps pay


def settled(bootstrap_after, width=2, horizon=2):
    """Applies the law to the way down, over and over, until nothing changes."""
    vectors = np.zeros((len(coins), horizon + 1))
    for _ in range(100):
        for step in range(len(coins)):
            window = coins[step : step + width]
            r = sum(GAMMA**i * coin for i, coin in enumerate(window))
            n = np.zeros(horizon + 1)  # where the episode terminates in the window
            if step + width < len(coins):
                n = GAMMA**width * vectors[step + bootstrap_after]
            vectors[step] = [r, *n[:-2], n[-2] + n[-1]]
    return vectors[0]


wide = exact(drone.mdp, TimeAxis(GAMMA, horizon=2, width=2)).decomposition[0, DOWN]
print("exact        ", wide.components.round(3), "sum", wide.value.round(3))
for after in (2, 1):
    vector = settled(after)
    print(f"{after} step(s) later", vector.round(3), "sum", vector.sum().round(3))

# %% [markdown]
# With the wrong state the coins are counted again and again, 5.7 in place of 3.5. This is no straw
# man: see [errata C1](../errata.md#c1).

# %% [markdown]
# ## 3. Whose rewards are in the window?
#
# A window of one step holds the reward of *its own action*, whatever it was. Anything may act, and
# Q-learning still learns of the greedy agent. A window of w steps also holds the rewards of the w −
# 1 actions that came after. If those were random now and then (ε-greedy, as agents explore), their
# accidents go into the target, and no amount of data will take them out. The learner converges, but
# to a table of its own. We can solve for that table:

# %%
WIDE = TimeAxis(GAMMA, horizon=2, width=2)
for epsilon in (0.0, 0.1, 0.3):
    print(fill(str(operator_table(drone.mdp, WIDE, epsilon)), 80))

# %% [markdown]
# A random action bumps the drone into a wall, the treasure comes a step later, and Q(up) falls from
# 3.258. The components suffer more than Q: a coin that slips from one window into the next is
# missing in the one, and surplus in the other. Does a learner really end there? It does:

# %%
own = operator_table(drone.mdp, WIDE, 0.1)
learned = learn(drone.mdp, WIDE, epsilon=0.1, agent_steps=2_000_000, num_envs=1024)
print("optimal table  ", own.optimal[0, DOWN].components.round(3))
print("own fixed point", own.decomposition[0, DOWN].components.round(3))
print("learned        ", learned.decomposition[0, DOWN].components.round(3))
print(fill(f"whose future: {learned.future.policy}", 80))

# %% [markdown]
# This is no failure of the learner. It tells the truth, about somebody else: an agent that is
# greedy in every second step and a little random in between. Whose future a vector tells is not for
# you to choose afterwards. It is decided by the data.

# %% [markdown]
# ### Greedy tails
#
# One cure: learn only from windows whose *tail*, all actions after the first, happened to be
# greedy.

# %%
learned = learn(
    drone.mdp, WIDE, tail="greedy", agent_steps=2_000_000, num_envs=1024
)
print("greedy tails   ", learned.decomposition[0, DOWN].components.round(3))
share = learned.left_out / (learned.left_out + learned.visits.sum())
print(f"left out: {share:.1%} of all windows")

# %% [markdown]
# The price is data, and it grows fast. A tail has w − 1 actions, and all of them must be greedy:

# %%
print(" ε      w = 2   w = 5  w = 10  w = 24")
for epsilon in (0.01, 0.1, 0.3):
    stays = (
        1 - epsilon + epsilon / 4
    )  # of four actions; a random one may be the greedy one
    shares = [stays ** (width - 1) for width in (2, 5, 10, 24)]
    print(f"{epsilon:<5}", *(f"{share:7.1%}" for share in shares))

# %% [markdown]
# And there is a trap inside. A window that terminates early has a short tail, with fewer chances of
# a random action. Keep every window that qualifies, and those that ended early are kept more often
# than the others: an end looks likelier than it is. On a frozen lake full of holes, with ε = 0.5,
# that alone shifts a component by 0.11. So trdlab draws, for the actions that were never taken,
# whether they *would* have been greedy, and keeps all kinds of windows equally often.

# %% [markdown]
# ### The simplest cure
#
# Learn with w = 1, where none of this arises, and group when you look:

# %%
fine = learn(drone.mdp, AXIS, epsilon=0.1, agent_steps=300_000, num_envs=128)
print("w = 1, grouped ", fine.decomposition[0, DOWN].regroup(2).components.round(3))

# %% [markdown]
# Wide windows are for when N + 1 outputs would be too many. Then know whose future you get. For a
# *given* policy that is easy, for the actions in the window are its own.

# %% [markdown]
# ## Your turn
#
# **Exercise 4.1.** A learner with the loss on the sum begins with the components [1, 0, 0, 0], and
# the true Q is 5. Where will the four components end?

# %%
answer_1 = None  # replace with a list of four numbers
check("4.1", answer_1)

# %% [markdown]
# **Exercise 4.2.** An episode has four steps, and w = 3. How many windows can be learned from if it
# is truncated after the fourth, and how many if it terminates there?

# %%
answer_2 = None  # replace with a list of two whole numbers
check("4.2", answer_2)

# %% [markdown]
# **Exercise 4.3.** With four actions, ε = 0.2 and w = 3: which share of the full windows has a
# greedy tail?

# %%
answer_3 = None  # replace with a number from 0 to 1
check("4.3", answer_3)

# %% [markdown]
# > **An open question.** You deploy an agent that always takes the best action. Its vectors were
# > learned from an agent that was random now and then. Is that a wrong explanation of your agent,
# > or a right one of another? How could somebody find out whom you have not told?

# %% [markdown]
# ## What you have learned
#
# - The loss on the sum fixes one number of N + 1. The others stay where they began.
# - Perfect Q-values, actions and scores say nothing about components.
# - A window bootstraps w steps later, ends with its episode, and is dropped if it was cut short.
# - In a wide window the behaviour's rewards count. Either keep greedy tails only, or learn with w =
#   1 and group afterwards, or say whose future it is.
