# %% [markdown]
# # Lesson 6: debug an agent
#
# Lesson 5 ended with a warning: a good score is no proof that an agent's reward vectors are right.
# For a game there is no exact table to compare with. But there is what *happens*. In this lesson
# four teams describe the same autopilot. Three of them made a mistake that programmers really make,
# each in one line. The score will not tell you who. A **calibration** will, and it will tell you
# what to look for in the code.
#
# - **Goal:** find out which mistake an agent's forecasts hold, without an exact table.
# - **Before it:** [lesson 2](02_derive_it.md) and its law, and some of [lesson 3](03_learn_it.md).
# - **Time:** three quarters of an hour to read; half a minute to run, on two cores.

# %%
import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib import pyplot as plt

from trdlab.agents import Agent
from trdlab.bellman import target
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations import assess, moment_at
from trdlab.explanations.calibration import claims
from trdlab.explanations.calibration.faults import faults
from trdlab.explanations.moment import telling
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Memoryless
from trdlab.show.plots.calibration import plot_trust, trust_handles
from trdlab.show.plots.style import add_legend
from trdlab.tabular import exact
from trdlab.tabular.episodes import ModelEnvironments
from trdlab.teach import check

# %% [markdown]
# ## 1. One autopilot
#
# This is the slippery bridge of lesson 3. One move in ten slips sideways. `T` is worth 4, and `H`,
# the abyss, costs 4. The autopilot is good: it takes the long way round. It stays as it is in this
# lesson. We only ask what it *expects*.

# %%
bridge = Gridworld(load_map("bridge"))
model = bridge.mdp
solved = exact(model, TimeAxis(0.95, 8)).solution
autopilot = solved.policy.argmax(axis=1)  # [S], its action in each state

print("\n".join(bridge.grid.rows))

# %% [markdown]
# The teams may not look into the model. They get a log of many short flights: each begins somewhere
# with an action at random, so that every action is seen, and then the autopilot takes over. Where
# an episode ends, the environment begins the next one by itself, as most do; what is paid there no
# longer belongs to the flight.


# %%
@dataclass
class Log:
    """K flights of W steps: what was seen, done and paid."""

    states: np.ndarray  # [K, W+1]
    action: np.ndarray  # [K], the first one
    rewards: np.ndarray  # [K, W], 0 once the episode is over
    over: np.ndarray  # [K, W], whether the episode was over after each step


def record(seed, flights=40_000, steps=2):
    """Returns a log."""
    playing = ~model.terminal_states
    env = ModelEnvironments(
        model, flights, seed=seed, starts=playing / playing.sum()
    )
    first = np.random.default_rng(seed).integers(4, size=flights)
    states, rewards, over = [env.reset()], [], []
    action, ended = first, np.zeros(flights, dtype=bool)
    for _ in range(steps):
        step = env.step(action)
        rewards.append(np.where(ended, 0.0, step.rewards))
        ended = ended | step.ended
        over.append(ended)
        states.append(step.following)
        action = autopilot[step.following]
    return Log(np.stack(states, 1), first, np.stack(rewards, 1), np.stack(over, 1))


log = record(seed=0)
print(f"{log.action.size} flights, {log.over[:, -1].sum()} over in two steps")

# %% [markdown]
# All teams learn in the same way: each entry of the table becomes the mean of its targets, again
# and again, until nothing changes any more. What a target *is*, each team has written itself.


# %%
def learn(targets, axis, log, sweeps=60):
    """Returns a table `[S, A, N+1]` that its own targets no longer change."""
    table = np.zeros((*model.shape, axis.num_components))
    entries = log.states[:, 0] * 4 + log.action  # [K], which one a flight is about
    visits = np.bincount(entries, minlength=table[..., 0].size)
    for _ in range(sweeps):
        goal = targets(log, axis, table)  # [K, N+1]
        for i in range(axis.num_components):
            total = np.bincount(entries, goal[:, i], minlength=visits.size)
            table[..., i] = (total / np.maximum(visits, 1)).reshape(model.shape)
    return table


def expected(log, axis, table):
    """Returns `[K, N+1]`: what the table expects where each flight is after w steps."""
    there = log.states[:, axis.width]
    return table[there, autopilot[there]]


# %% [markdown]
# ## 2. Four teams
#
# Here they are. Ada and Cleo describe single steps, Ben groups of two; Dora's code can do both, and
# describes single steps here. One of the four is right. Read them if you like, but do not search
# long: in a real project, such lines are spread over a thousand others.

# %%
SINGLE, PAIRS = TimeAxis(0.95, 8), TimeAxis(0.95, 5, 2)


def ada(log, axis, table):
    reward = log.rewards[:, 1]
    discount = np.where(log.over[:, 0], 0.0, axis.gamma)
    return target(reward, discount, expected(log, axis, table))


def ben(log, axis, table):
    reward = log.rewards[:, 0] + axis.gamma * log.rewards[:, 1]
    discount = np.where(log.over[:, 1], 0.0, axis.gamma)
    return target(reward, discount, expected(log, axis, table))


def cleo(log, axis, table):
    reward = log.rewards[:, 0]
    discount = np.full(len(reward), axis.gamma)
    return target(reward, discount, expected(log, axis, table))


def dora(log, axis, table):
    steps = np.arange(axis.width)
    reward = log.rewards[:, steps] @ axis.gamma**steps
    discount = np.where(log.over[:, steps[-1]], 0.0, axis.gamma**axis.width)
    return target(reward, discount, expected(log, axis, table))


TEAMS = {"Ada": (ada, SINGLE), "Ben": (ben, PAIRS), "Cleo": (cleo, SINGLE)}
TEAMS["Dora"] = (dora, SINGLE)
tables = {
    name: learn(targets, axis, log) for name, (targets, axis) in TEAMS.items()
}
for name, table in tables.items():
    start = table[model.start, autopilot[model.start]]
    print(f"{name:>4} expects at the start", start.round(2) + 0.0)

# %% [markdown]
# ## 3. What the score says
#
# The autopilot brings nearly 4 for each flight, whoever describes it. So let the tables fly
# themselves: in each state, the action with the largest sum.

# %%
brings = TimeAxis(0.999999, 0)  # as good as undiscounted


def score(actions):
    """Returns what a flight brings on average, exactly."""
    flown = exact(model, brings, policy=np.eye(4)[actions])
    return flown.decomposition.value[model.start, actions[model.start]]


print(f"the autopilot {score(autopilot):5.2f}")
for name, table in tables.items():
    print(f"{name:>13} {score(table.sum(axis=2).argmax(axis=1)):5.2f}")

# %% [markdown]
# Three of them fly well, and two of those three are wrong. The score sees a mistake only when it
# changes which action is *best*. It cannot see a mistake that all actions share.
#
# ## 4. What the reports say
#
# Now we let the autopilot fly 300 times from the start, and hold what each table said at every step
# against what was paid in the steps after it. `assess` plays and judges. All it needs is something
# that turns states into reward vectors, the policy that these speak of, and somewhere to fly. No
# exact table is used.
#
# > **The formula.** The *skill* of component $i$ compares the forecasts $c_{t,i}$ with what then
# > came, $x_{t,i}$. The guess that is always the same is the mean $\bar x_i$:
# >
# > $$\text{skill}_i=1-\frac{\sum_t(c_{t,i}-x_{t,i})^2}{\sum_t(\bar x_i-x_{t,i})^2}$$
# >
# > It is 1 for a perfect forecast, and 0 for one that is no better than the guess.


# %%
@dataclass(frozen=True, eq=False)
class Table:
    """What a team expects, in the form that trdlab can judge: an Estimator."""

    components: np.ndarray
    time_axis: TimeAxis
    future = Future("the autopilot")

    def decompose(self, states):
        return RewardDecomposition(self.components[states], self.time_axis)


def agent(name, table, axis):
    """Returns the autopilot, as a team describes it."""
    return Agent(
        name,
        Table(table, axis),
        bridge.action_names,
        make=lambda count, seed: ModelEnvironments(
            model, count, seed=seed, time_limit=200
        ),
        policy=Memoryless(lambda states: np.eye(4)[autopilot[states]]),
    )


def say(sections):
    """Prints the sentences of some sections, one below the other."""
    for section in sections:
        for sentence in section.sentences:
            print(textwrap.indent(textwrap.fill(sentence, 78), "  "))


agents = {
    name: agent(name, tables[name], axis) for name, (_, axis) in TEAMS.items()
}

# %% [markdown]
# First, what does each of them say, eight steps into the same flight?

# %%
for name, of in agents.items():
    told = telling.sections(moment_at(of, step=8).choice())
    print(f"{name}:")
    say(section for section in told if section.name == "forecast")

# %% [markdown]
# Each of these texts could be true. Nothing that an agent *says* shows whether it is right. So
# play, and compare:

# %%
reports = {name: assess(of, episodes=300) for name, of in agents.items()}

print("Dora's report says:")
say(claims.sections(reports["Dora"]))

# %% [markdown]
# Dora's forecasts are better than a guess at every step. How much comes later than she tells is
# told, too. Nothing in the report speaks of a mistake. She is the one who is right. Now the others:

# %%
for name in ("Ada", "Ben", "Cleo"):
    print(f"{name}'s report says:")
    say(claims.sections(reports[name]))

# %%
figure, axes = plt.subplots(4, figsize=(6, 12), layout="constrained")
for ax, (name, report) in zip(axes, reports.items(), strict=True):
    plot_trust(ax, report)
    ax.set_title(name, loc="right", fontsize=11, fontweight="bold")
add_legend(figure, trust_handles(reports["Ada"]))

# %% [markdown]
# **Look at the pictures first.** Ada's skill is gone from the first step on. Those of Ben and Cleo
# look much like Dora's! To be *trusted* means only this: better than a guess that is always the
# same. Ben's amounts are somewhat too large, and most of Cleo's mistake lies in the residual. A
# picture of skill does not tell such mistakes from what nobody could know.
#
# **Then read.** The report also tests whether the vectors fit *each other*: by the law, component i
# of one step must be γ^w times component i − 1 of the next. For this it needs no rewards at all.
#
# - Ada "expects rewards 1 step too early". All her rewards are there, but in the wrong place.
# - For Ben "a reward 2 steps later counts" about 0.95 times as much; it should be γ^w, which is
#   0.9025. He groups two steps, so from one component to the next two steps pass.
# - Cleo "ignores where episodes end". What she adds there is what the start of the next one
#   promises, all of it. (It is a little more than all, because in her log flights began anywhere.)
#
# ## 5. Repair
#
# Now you know what to search for, and three lines are found quickly. `log.rewards[:, 1]` is the
# reward of the *next* action. `axis.gamma` stands where `axis.gamma**axis.width` should. And
# `np.full` never asks whether the episode is over. Each repair is one line:


# %%
def ada_repaired(log, axis, table):
    reward = log.rewards[:, 0]  # of this action
    discount = np.where(log.over[:, 0], 0.0, axis.gamma)
    return target(reward, discount, expected(log, axis, table))


def ben_repaired(log, axis, table):
    reward = log.rewards[:, 0] + axis.gamma * log.rewards[:, 1]
    discount = np.where(log.over[:, 1], 0.0, axis.gamma**axis.width)  # w steps pass
    return target(reward, discount, expected(log, axis, table))


def cleo_repaired(log, axis, table):
    reward = log.rewards[:, 0]
    discount = np.where(log.over[:, 0], 0.0, axis.gamma)  # nothing follows an end
    return target(reward, discount, expected(log, axis, table))


REPAIRED = {
    "Ada": (ada_repaired, SINGLE),
    "Ben": (ben_repaired, PAIRS),
    "Cleo": (cleo_repaired, SINGLE),
}


def named(name, targets, axis, seed):
    """Returns the faults that a report names, after learning from a log of its own."""
    table = learn(targets, axis, record(seed))
    report = assess(agent(name, table, axis), episodes=300, seed=seed)
    return ", ".join(fault.kind for fault in faults(report)) or "none"


for name, (targets, axis) in REPAIRED.items():
    print(f"{name:>4}, repaired: {named(name, targets, axis, seed=0)}")

# %% [markdown]
# ## 6. Was it luck?
#
# A report that finds mistakes everywhere would be of no use, nor would one that finds them now and
# then. So let everybody learn once more, from five other logs, and be judged by other flights:

# %%
print("log   " + "".join(f"{name:>16}" for name in TEAMS))
for seed in range(1, 6):
    row = [named(name, *team, seed) for name, team in TEAMS.items()]
    print(f"{seed:3}   " + "".join(f"{found:>16}" for found in row))

# %% [markdown]
# ## 7. What has no name
#
# Three faults have names. There are others. Emil, too, groups two steps, and his code has one wrong
# line:


# %%
def emil(log, axis, table):
    there = log.states[:, 1]  # line 1
    reward = log.rewards[:, 0] + axis.gamma * log.rewards[:, 1]  # line 2
    discount = np.where(log.over[:, 1], 0.0, axis.gamma**2)  # line 3
    return target(reward, discount, table[there, autopilot[there]])  # line 4


print("Emil's report says:")
emils = assess(agent("Emil", learn(emil, PAIRS, log), PAIRS), episodes=300)
say(claims.sections(emils))

# %% [markdown]
# No fault is named, and still the report is no good one: from some step on his forecasts are no
# better than a guess, and he expects too little. Which line is it? That is exercise 6.3.
#
# ## 8. Your own agent
#
# The same report is made of every agent that trdlab can load:
#
# ```console
# $ trdlab explain runs/my-run --what calibration
# $ trdlab explain gridworld:bridge --N 8 --what calibration
# ```
#
# When it complains, this is where to look:
#
# - **Rewards are expected too early, or too late.** Search for the reward of another step: an
#   index, a wrapper or a buffer that is off by one.
# - **Another discount than γ^w.** A missing or a doubled power, or an n-step return whose n is not
#   w.
# - **Ends are ignored.** Follow the flag *terminated* on its way from the environment to the
#   target.
# - **Times as much as comes.** Clipped or scaled rewards, or a max over noisy values.
# - **No better than a guess from some step on.** The wrong next state or next action. Or too little
#   was learned. Or nothing could be known: compare with what the report says of a perfect forecast.

# %% [markdown]
# ## Your turn
#
# **Exercise 6.1.** An agent has γ = 0.9 and groups of w = 4 steps. Its report says that
# for it a reward 4 steps later counts 0.81 times as much, and should count 0.656 times as much.
# Which power of γ does its code use?

# %%
answer_1 = None  # replace with a whole number
check("6.1", answer_1)

# %% [markdown]
# **Exercise 6.2.** An agent with γ = 0.5, N = 2 and w = 1 ignores where episodes end. At the start
# of an episode it expects [1, 2, 6]. What does it expect at the last step of one, which surely pays
# 4?

# %%
answer_2 = None  # replace with a list of three numbers
check("6.2", answer_2)

# %% [markdown]
# **Exercise 6.3.** Which line of Emil's is wrong?

# %%
answer_3 = None  # replace with the number of a line
check("6.3", answer_3)

# %% [markdown]
# > **An open question.** One forecast says the mean of all games, always. It is never too high or
# > too low on average, and it tells nothing. Another one tells much, and is always a little too
# > high. Which would you give to a player, and which to a surgeon? Could one number judge both?

# %% [markdown]
# ## What you have learned
#
# - A score sees only mistakes that change which action is best.
# - To be trusted means to be better than a constant guess, and no more than that.
# - Vectors must fit what happens, *and* each other. The second test finds what the first misses.
# - A named fault is a search order: you know which line to look for.
# - Not every mistake has a name. Emil's is one of the code that was published with the paper: see
#   [errata C1](../errata.md#c1).
