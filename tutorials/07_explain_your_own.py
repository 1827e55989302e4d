# %% [markdown]
# # Lesson 7: explain your own agent
#
# You have an agent. It plays, and nobody can say what it expects: neither you nor the library that
# trained it. In this lesson you find out, from `pip install` to a report. You do not train the
# agent again. You let it play, learn what comes, and ask how far that can be trusted.
#
# - **Goal:** fit an agent that you have, judge the fit, and ask it.
# - **Before it:** [lesson 1](01_read_a_reward_vector.md), and the extra `interop`.
# - **Time:** half an hour to read; one to two minutes to run, on two cores.
#
# The extra adds Stable-Baselines3, which trains the agent of this lesson. In the folder of the
# source:
#
# ```console
# $ pip install '.[interop]'
# ```

# %%
import sys

import gymnasium as gym
import torch

import trdlab
from trdlab.policies import EpsilonGreedy, Likeliest
from trdlab.teach import check

try:
    from stable_baselines3 import PPO
except ImportError:
    sys.exit(
        "This lesson needs Stable-Baselines3: pip install 'stable-baselines3>=2.5'"
    )

torch.set_num_threads(1)  # such small networks are no faster with more

# %% [markdown]
# ## 1. An agent, half trained
#
# CartPole is a cart with a pole on it. The agent pushes the cart left or right, fifty times a
# second. Each step pays 1. The game is lost when the pole falls, or when the cart leaves the track.
#
# We stop training early, on purpose. An agent that never fails has nothing to predict: each step
# pays 1, and that is all there is to say.

# %%
model = PPO("MlpPolicy", "CartPole-v1", seed=0, device="cpu").learn(4_096)

agent = trdlab.agent(model, env="CartPole-v1")
print(agent)

# %% [markdown]
# *Not fitted*: it can act, and nobody knows what it expects. Have you a file of your own? Then
# leave out the training, and give the file:
#
# ```python
# agent = trdlab.agent("ppo.zip", env="LunarLander-v3")
# ```
#
# A file is only read, and nothing in it is executed. A function from an observation to an action
# will do as well.
#
# Now look at its score. There are two, for this network can be played in two ways. It gives each
# action a chance, and *draws* one, as it did while it was trained. Or it always takes the likeliest
# action, which is what Stable-Baselines3 calls `deterministic=True`.

# %%
steady = trdlab.agent(agent, policy=Likeliest(agent.policy))

for name, of in {"draws": agent, "takes the likeliest": steady}.items():
    score = of.evaluate(50).mean
    print(f"{name:>20}: {score.value:5.0f} ({score.low:.0f} to {score.high:.0f})")

# %% [markdown]
# One network, and two agents: they have different futures. **Explain the one that you use.** Here
# we take the one that draws. It fails often, and we want to know how early that can be seen.
#
# ## 2. Fit it
#
# `fit` lets the agent play. Then a network learns what really came after each step, up to 30 steps
# later. The agent itself stays as it is.
#
# A reward is not all that can be forecast. Name whatever happens in a step, and it is learned, too.
# Here it is a game that is lost, which we call a fall. This cell takes most of the time. Without
# `most_updates` it would learn until it gains no more.

# %%
fitted = trdlab.fit(
    agent,
    horizon=30,
    steps=40_000,
    most_updates=5_000,
    outcomes={"fall": lambda step: step.terminated},
)
print(fitted.estimator.time_axis)

# %% [markdown]
# It keeps the γ that the agent was trained with.
#
# ## 3. First, how far can it be trusted?
#
# Read this before anything else. `calibrate` lets the agent play other games, and holds what was
# forecast against what came.

# %%
report = trdlab.calibrate(fitted)
print(report)

# %% [markdown]
# The score is not quite the one above, for these are other games. That is what the interval is for.
#
# The last line is about PPO's *critic*: one number for each state, with which it was trained. The
# critic says what is to come in all, and never when. It is judged by the same games. Half trained,
# it is still far off. trdlab does not use it.

# %%
report.plot()

# %% [markdown]
# **The upper picture.** A *skill* of 1 is a perfect forecast. A skill of 0 is no better than to say
# the same number always, namely the mean. For the step taken now there is nothing to predict: it
# always pays 1. From then on the forecast beats a guess, at every step on green ground. On grey
# ground too little is known; that is so of all that comes after 30 steps.
#
# The broken line is the skill that a *perfect* forecast would have. It falls, too. The agent draws
# its actions, so nobody can know for sure whether the pole stands half a second from now. Where the
# two lines come together, a longer fit has little to gain.
#
# **The lower picture.** When the forecast said "70 %", did it happen in about 70 % of the cases? On
# the dotted line it did. The large dots stay near it.
#
# ## 4. A game that it lost
#
# Now play one game, and look at all that was expected in it. Each column is a step of the game; the
# further up, the later the reward.

# %%
SEED = 1
game = trdlab.explain(fitted, seed=SEED, parts="episode", episodes=0)
game.plot()

# %% [markdown]
# Dark means: the reward will come. You see the fall before it happens: white comes down from above,
# with the steps that the agent does not expect to reach. You also see false alarms, where the
# picture turned pale and then dark again. That is what a chance looks like.
#
# The numbered moments, if there are any, are draws: the agent drew an action that is worse than
# what it draws on average. Nothing else is left to chance in CartPole, where a push always does the
# same. So which draw was it? Hold what was expected before each draw against what is expected of
# the action that was drawn:

# %%
(episode,) = fitted.play(1, seed=SEED)
before = episode.expected[:-1].sum(axis=1)  # [T], the mean over what it may draw
after = episode.predicted.sum(axis=1)  # [T], of the action that it drew
worst = int((after - before).argmin())

print(f"The game has {len(episode)} steps.")
print(
    f"Step {worst}: {before[worst]:.0f} before the draw, {after[worst]:.0f} after it."
)

# %% [markdown]
# That is the draw that has cost most in this game. A few steps later the game was over.
#
# ## 5. That moment
#
# `explain` plays the same game up to that step. There it compares what the agent most likely does
# with the other action, which it drew this time.

# %%
lost = trdlab.explain(fitted, seed=SEED, step=worst, parts="contrast")
print(lost)

# %%
lost.plot()

# %% [markdown]
# **Look at the bars.** In the first steps both actions pay the same. Then the bars of the action
# that was drawn shrink: the pole falls, and nothing is paid any more. The dotted line is the chance
# that the game still runs. It says the same, as far as it can be told. The hatched bar is all that
# comes after 30 steps, in one sum without a date. An arrow with a number means that it is cut off.
#
# **Look at the diamonds.** They are no forecast. trdlab copied the game at this step, 50 times for
# each action, pushed, and let the agent go on. So the diamonds are what really came of the
# difference. They stand close to the bars. That tests just this forecast, at this moment, of an
# action that the agent takes less often here.
#
# ## 6. A moment when all is well
#
# For comparison: the step of the same game where most was expected of the first 30.

# %%
best = int(episode.expected[:-1, :-1].sum(axis=1).argmax())
well = trdlab.explain(fitted, seed=SEED, step=best, parts="contrast")
print(well)

# %% [markdown]
# Each step pays nearly 1, whatever it does now. The two actions differ by little, and the trial
# cannot tell them apart. Do not make a story of such a difference: the next push can make up for
# this one.
#
# ## 7. Will it fall, and when?
#
# The fit has also learned the outcome that you have named, for each action and each step. Here is
# what it said at the moment of section 5. Some steps are left out: `reach` says how many steps have
# passed a test, on games that were not learned from. Do not read further than that.

# %%
outlook = lost.choice.moment.outlook
falls = outlook.events["fall"]  # [A, N], the chance of a fall at each step
told = outlook.reach["fall"]

for name, chance in zip(fitted.action_names, falls, strict=True):
    print(
        f"{name:>10}", chance[:told].round(2), f"in all {chance[:told].sum():.2f}"
    )
print(f"Tested for {told} steps. The game was over after {len(episode) - worst}.")

# %% [markdown]
# You see how likely a fall is with either push, and when.
#
# These are chances of *different* steps, and a game ends only once. So add them up, and you have
# the chance that it has fallen by then. The fit has learned another number that says the same: the
# chance that the game still runs when a step begins, its `survival`.
#
# > **The formula.** With $p_{t+j}$ the chance that the game ends at step $t+j$, the game still runs
# > at step $t+i$ with the chance
# >
# > $$s_i=1-\sum_{j=0}^{i-1}p_{t+j}$$
# >
# > Where each step pays 1, a component is that chance, discounted: $c_i=\gamma^i s_i$.

# %%
for name, chance, runs in zip(
    fitted.action_names, falls, outlook.survival, strict=True
):
    print(
        f"{name:>10}: fallen in the first {told} steps {chance[:told].sum():.2f}, "
        f"no longer running {1 - runs[told]:.2f}"
    )
print(f"Tested for {outlook.survival_reach} steps.")

# %% [markdown]
# The two were learned apart, so they agree only roughly, and each is tested by itself. It is harder
# to say in *which* step the game ends than whether it still runs, so the first reaches less far.
#
# The same can be asked of any observation: `fitted.estimator.outlook(observation[None])`. But ask
# about what the agent really meets. Far away from that, the network answers as well, and nobody has
# tested what it says.

# %% [markdown]
# ## 8. What not to conclude
#
# **"It plays well, so its forecasts are right."** Here is a second fit of the same agent. It was
# done in a hurry: few steps to learn from, and little learning.

# %%
hasty = trdlab.fit(agent, horizon=30, steps=1_000, most_updates=1_000)
hurried = trdlab.calibrate(hasty)

print("       score   skill at t+1    t+5   t+20   trusted to")
for name, of in {"hasty": hurried, "fitted": report}.items():
    skill = of.calibration.skill.value
    print(
        f"{name:>6}  {of.score.returns.value:5.0f}          "
        f"{skill[1]:5.2f}  {skill[5]:5.2f}  {skill[20]:5.2f}   t+{of.trust.last_step}"
    )

# %% [markdown]
# The scores are the same to the last digit, as it is the same agent in the same games. The score
# says nothing about a forecast. The report does: of the hasty fit, nothing is to be trusted beyond
# the step taken now, which always pays 1.
#
# **"There is a bar, so it will be so."** Trust it only as far as the report goes. Beyond that there
# are bars, too, but on red or grey ground. The hatched bar has no date at all. And a forecast that
# can be trusted is better than a guess, no more: look at its skill.
#
# **"The other action would have been worse."** Nobody knows what comes of an action that is never
# taken. So `fit` forces one action in ten (`share=0.1`): any action, evenly. In a state that is
# seldom visited this is still little. The report judges such actions apart, under *Other actions*;
# `print(report.details())` shows all of it. A trial tests a single moment.
#
# **"It was right in all test games."** Were these different games? Many simulators begin in the
# same way each time. An agent that draws nothing then has a single game, or a few:


# %%
class SameStart(gym.Wrapper):
    def reset(self, **how):
        return self.env.reset(**(how | {"seed": 0}))


def same_start():
    return SameStart(gym.make("CartPole-v1"))


copies = trdlab.agent(steady, env=same_start)
stumbling = trdlab.agent(copies, policy=EpsilonGreedy(copies.policy, 0.2))

for name, of in {"as it is": copies, "stumbling": stumbling}.items():
    lengths = of.evaluate(10).lengths
    print(f"{name}: games of {', '.join(map(str, lengths))} steps")

# %% [markdown]
# Whoever has learned nine such games knows the tenth by heart: to forecast it proves nothing. Make
# the agent stumble *before* you fit it, as above, with one action in five at random. All that is
# said then is about the agent that stumbles. Say so when you show it.
#
# ## 9. Your own environment
#
# All of this needs no Python, if your agent is a file:
#
# ```console
# $ trdlab agent ppo.zip --env CartPole-v1            # what is in it, and its score
# $ trdlab fit ppo.zip --env CartPole-v1 --N 30       # kept in fits/ppo-N30-w1
# $ trdlab explain fits/ppo-N30-w1 --what calibration # first, how far to trust it
# $ trdlab explain fits/ppo-N30-w1 --seed 3 --step 50
# ```
#
# An environment of your own can have an id, too: register it in your module, and write `--env
# my_module:MyGame-v0`. Or stay in Python, and give a function that makes one: `trdlab.agent(model,
# env=MyGame)`. What your environment reports in `info` is forecast with `--outcome
# crash=info.crash`.
#
# What to choose?
#
# - **horizon** (`--N`): as many steps as a decision matters for. The report tells you when it was
#   too short, under *What comes later than it tells*.
# - **steps**: if the report is not good enough, play more before you change anything else.
# - **stumbling**: if your agent hardly ever fails, or all its games are alike.
#
# More is on the page [Explain the agent you already have](../fit.md).

# %% [markdown]
# ## Your turn
#
# **Exercise 7.1.** The chances of a fall are 0.1, 0.2 and 0.3 at *t*, *t+1* and *t+2*. How likely
# is it that the game still runs at *t+3*?

# %%
answer_1 = None  # replace with a number from 0 to 1
check("7.1", answer_1)

# %% [markdown]
# **Exercise 7.2.** Each step pays 1, and γ = 0.9. Component 2 of an action is 0.405. How likely is
# it that the game still runs at *t+2*?

# %%
answer_2 = None  # replace with a number from 0 to 1
check("7.2", answer_2)

# %% [markdown]
# **Exercise 7.3.** An agent takes the likeliest of two actions, always. You fit it with
# `share=0.1`. In a certain state it goes left. In which share of its visits there does the fit see
# what comes of going right?

# %%
answer_3 = None  # replace with a number from 0 to 1
check("7.3", answer_3)

# %% [markdown]
# **Exercise 7.4.** The skills from *t* to *t+5* are 0.6, 0.5, 0.3, −0.1, 0.2 and 0.1, and each is
# known to within 0.05. Up to which step *t+k* can the forecast be trusted?

# %%
answer_4 = None  # replace with a whole number
check("7.4", answer_4)

# %% [markdown]
# > **An open question.** Train the agent of section 1 for ten times as long. Before you fit it,
# > write down what you expect of its score, of its skill, and of the sentences of its report. Then
# > try. What would you have to change to learn where its weak points are? And of which agent would
# > that report speak?

# %% [markdown]
# ## What you have learned
#
# - A trained agent is explained as it is: bring it in, fit it, judge the fit, and then ask.
# - Trust first. The report says how far ahead a forecast is better than a guess, and how good a
#   perfect one could be.
# - A forecast can be tested where it matters: copy the moment, and try both actions.
# - Outcomes have chances, step by step. Chances of the same end add up.
# - A score, a horizon, actions that are never taken, and games that are all alike prove nothing.
