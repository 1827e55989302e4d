# %% [markdown]
# # Lesson 9: which pixels matter, near and far
#
# An agent expects a reward soon, and another one late. *What* does it look at for the one, and what
# for the other? A picture can show it, with bright places on the screen. Such pictures are easy to
# make, and easy to believe, also where they are wrong. In this lesson you learn to make them, to
# test them, and when not to show them.
#
# We begin where the truth is known.
#
# - **Goal:** make a map of what a forecast hangs on, test it, and know when not to show it.
# - **Before it:** [lesson 1](01_read_a_reward_vector.md); [lesson 7](07_explain_your_own.md) helps.
# - **Time:** half an hour to read; half a minute to run, on two cores.

# %%
import gymnasium as gym
import numpy as np
import torch

import trdlab
from trdlab.teach import check

torch.set_num_threads(1)  # such small networks are no faster with more

# %% [markdown]
# ## 1. A world with a known answer
#
# Eight parcels lie on a belt. Each step the agent may *take* the first one, and is paid its weight,
# but never more than 0.75. Then the belt moves on, and a new parcel comes. So the parcel in place
# *k* is paid *k* steps later, and no other parcel counts for that step. Beside the belt are two
# dials which show noise. The scale errs a little, up or down, as scales do.

# %%
GAMMA, MOST, TAKE = 0.9, 0.75, 1


class Belt(gym.Env):
    observation_space = gym.spaces.Dict(
        belt=gym.spaces.Box(0, 1, (8,)), noise=gym.spaces.Box(0, 1, (2,))
    )
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.belt, self.steps = self.np_random.random(8), 0
        return self.seen(), {}

    def step(self, action):
        error = self.np_random.uniform(-0.1, 0.1)
        paid = float(min(self.belt[0], MOST) + error) * (action == TAKE)
        self.belt = np.append(self.belt[1:], self.np_random.random())
        self.steps += 1
        return self.seen(), paid, False, self.steps == 50, {}

    def seen(self):
        noise = self.np_random.random(2)
        return {
            "belt": self.belt.astype("float32"),
            "noise": noise.astype("float32"),
        }


# %% [markdown]
# One moment of it: eight parcels, then two dials. An agent that always takes, and knows all, would
# expect this:

# %%
NAMES = [f"belt {k}" for k in range(8)] + ["noise 0", "noise 1"]
HERE = np.array([0.2, 0.9, 0.4, 0.7, 0.1, 0.3, 0.6, 0.8, 0.9, 0.1])


def truth(seen):
    """Returns what is to be expected at t to t+7, of observations [B, 10]: [B, 8]."""
    return GAMMA ** np.arange(8) * np.minimum(seen[:, :8], MOST)


expected = truth(HERE[None])[0]
print(f"near, t+1: {expected[1]:.3f}")
print(f" far, t+5: {expected[5]:.3f}")

# %% [markdown]
# Check the second one: the parcel in place 5 weighs 0.3, and 0.9⁵ times 0.3 is 0.177.
#
# ## 2. Hide it, and ask again
#
# Which entries matter for t+1? Ask without one of them, and see what changes. But "without" needs a
# value. A belt with a hole is something that never happens, so take values that do happen: put in
# the entry's place what it was at 1 000 other moments, and average.


# %%
MET = np.random.default_rng(0).random(
    (1000, 10)
)  # all entries are as likely from 0 to 1


def hidden(tell):
    """Returns how much more is told here than with each entry hidden: [10, ...]."""
    changes = []
    for entry in range(10):
        others = np.repeat(HERE[None], len(MET), axis=0)
        others[:, entry] = MET[:, entry]
        changes.append(tell(HERE[None])[0] - tell(others).mean(axis=0))
    return np.array(changes)


def table(near, far):
    """Prints a number of each entry for near, and one for far."""
    print("            t+1     t+5")
    rounded = np.round([near, far], 3).T + 0.0  # no -0.0
    for name, (one, other) in zip(NAMES, rounded, strict=True):
        print(f"{name:>7}  {one:6.3f}  {other:6.3f}")


by_hiding = hidden(truth)
table(by_hiding[:, 1], by_hiding[:, 5])

# %% [markdown]
# One entry for near, another one for far, and 0 for all others. The near one is above 0: a parcel
# of 0.9 is more than there mostly is. The far one is below 0: a parcel of 0.3 is less.
#
# ## 3. Push it a little
#
# Hiding asks again for each entry. With ten entries that is nothing, with the 28 224 numbers that a
# game shows it is a lot. A *gradient* is had for all entries at once. It says how fast the answer
# grows when an entry grows a little. Here we can find it by hand, with a small push:


# %%
def slopes(tell, at=HERE, push=0.001):
    """Returns how fast what is told grows with each entry: [10, ...]."""
    pushed = at + push * np.eye(10)
    return (tell(pushed) - tell(at[None])) / push


by_pushing = slopes(truth)
table(by_pushing[:, 1], by_pushing[:, 5])

# %% [markdown]
# For far it is right: the entry is belt 5. For near it says that *nothing* matters! Look at the
# parcel: it weighs 0.9, and more than 0.75 is never paid. Make it a little heavier, and nothing
# changes. So the gradient is 0, though the reward hangs on this parcel alone.
#
# **A gradient answers another question:** not "what does it hang on?", but "what would a little
# more of it change?". Most maps that you will see are made of gradients.
#
# ## 4. All the way
#
# There is a cure. Do not push only here. Walk from some *baseline* to here on a straight line, and
# push at each step of the way. An entry's mean slope, times how far it went, is what it *adds*.
# These are integrated gradients. Our baseline is the mean of what is met: each entry at 0.5.
#
# > **The formula.** On the way from the baseline $b$ to the observation $x$, entry $e$ adds to
# > component $k$
# >
# > $$a_e=(x_e-b_e)\int_0^1\frac{\partial c_k}{\partial x_e}\big(b+\lambda(x-b)\big)\,d\lambda$$
# >
# > Together they add the whole difference: $\sum_e a_e=c_k(x)-c_k(b)$.

# %%
BASE = np.full(10, 0.5)


def integrated(tell, points=200):
    """Returns what each entry adds on the way from the baseline to here: [10, ...]."""
    way = [
        BASE + share * (HERE - BASE) for share in (np.arange(points) + 0.5) / points
    ]
    mean = np.mean([slopes(tell, at) for at in way], axis=0)
    return mean * (HERE - BASE)[:, None]


by_walking = integrated(truth)
table(by_walking[:, 1], by_walking[:, 5])

# %% [markdown]
# Belt 1 is back. And now there is something to check, with one line of arithmetic. Whatever is told
# here beyond the baseline must have been added by some entry. So the column must sum to the
# difference. This is called *completeness*:

# %%
base = truth(BASE[None])[0]
for k in (1, 5):
    print(
        f"t+{k}: {expected[k]:.3f} here − {base[k]:.3f} there = {expected[k] - base[k]:.3f}"
    )
    print(f"     all entries add {by_walking[:, k].sum():.3f}")

# %% [markdown]
# Take your pencil for the first one. Here 0.9 · 0.75 is expected, there 0.9 · 0.5. The difference
# is 0.9 · 0.25 = 0.225. If such a column does not add up, something is wrong: do not go on.
#
# It is not the number of section 2, and it need not be. There we asked what the *mean* over other
# weights is; here, what there is at the mean weight.
#
# ## 5. An agent that has learned it
#
# Now nobody tells us the truth. An agent takes every parcel, and a network learns what comes of
# that, as in lesson 7.

# %%
agent = trdlab.agent(
    lambda seen: TAKE, env=Belt, action_names=["leave", "take"], name="belt"
)
agent = trdlab.fit(agent, horizon=8, gamma=GAMMA, steps=4_000, most_updates=1_500)


def learned(seen):
    """Returns what the network tells of taking: [B, 9], the last one is all that comes later."""
    told = agent.estimator.decompose(seen.astype("float32")).components
    return told[:, TAKE]


by_hiding = hidden(learned)
table(by_hiding[:, 1], by_hiding[:, 5])

# %% [markdown]
# Compare with the table of section 2. Belt 1 and belt 5 stand out, with the right sign. The others
# are no longer 0, but small. **Noise is a free test.** You know that these dials count for nothing,
# so what they get is about how wrong the other small numbers are.
#
# `attributions` of an estimator are integrated gradients. It is the function that you wrote above,
# made with exact gradients. Does the line of arithmetic hold for it?

# %%
added = agent.estimator.attributions(
    HERE[None].astype("float32"), [TAKE], baseline=BASE.astype("float32")
)[0]  # [9, 10]
table(added[1], added[5])
here, there = learned(np.stack([HERE, BASE]))
for k in (1, 5):
    print(f"t+{k}: {here[k]:.3f} − {there[k]:.3f} = {here[k] - there[k]:.3f}")
    print(f"     all entries add {added[k].sum():.3f}")

# %% [markdown]
# It holds for what the *network* tells, whether that is true or not. Completeness says that the
# sum was done right. It does not say that the network is right.
#
# All of it at once, at a moment of an episode:

# %%
found = trdlab.explain(
    agent, step=5, parts="saliency", components="1,5", episodes=0
)
print(found)

# %%
found.plot()

# %% [markdown]
# ## 6. Two checks, and a false alarm
#
# The last lines of the text are two checks.
#
# - **New weights.** Draw the weights of the network anew, as before it learned anything, and make
#   the same picture. It should be another one. If not, it shows what is *seen*, and not what was
#   learned.
# - **Hiding.** Where the picture is strong, hiding should change much. This is your section 2, held
#   against your section 4.
#
# Both give a *rank correlation*. Put all places in order, the strongest first, once by each of two
# pictures. It is 1 if both orders are the same, about 0 if they have nothing to do with each other,
# and −1 if one is the other backwards. With new weights, less than 0.50 should be left of the
# order. Hiding should find 0.30 of it or more.
#
# Here some checks are failed, and yet you *know* that belt 1 and belt 5 are right! Ask what an
# order of ten entries is, when nine of them count for nothing: the places two to ten are luck. And
# each slope is multiplied by the way from the baseline. So an entry far from 0.5 comes early, with
# old weights and with new ones.
#
# **A failed check is an alarm, and no proof.** It takes away your right to believe the picture for
# its looks. Other evidence can give it back. Here there is a lot: the table of hiding, the noise,
# the truth. Next comes a world where you have none of it.
#
# ## 7. Pixels
#
# Now a game, where nobody can write down the truth. The agent of Breakout sees four small grey
# pictures. Near is the reward of the step taken now, far the one 39 steps later. The map is
# GradCAM, as in the paper: it is made of gradients, each averaged over the whole screen.

# %%
MOMENT = {"step": 60, "parts": "saliency", "components": "0,39", "episodes": 0}

gradcam = trdlab.explain("pretrained:Breakout", **MOMENT)
gradcam.plot()

# %% [markdown]
# The first row shows the maps of near and of far, and then their difference. Orange raises what is
# expected, blue lowers it. The second row shows what really changes when a patch of the screen is
# hidden.
#
# It is a good-looking picture, and a story is quickly found. Before you tell it, read what stands
# below it:


# %%
def checks(explanation):
    """Prints what the two checks have found, for near and for far."""
    saliency = explanation.saliency
    for name, group in zip(("near", "far"), saliency.groups, strict=True):
        weights, hiding = saliency.of.checks(group)
        print(
            f"{name:>4}: new weights {weights.verdict} ({weights.value:.2f}), ",
            end="",
        )
        print(f"hiding {hiding.verdict} ({hiding.value:.2f})")


checks(gradcam)

# %% [markdown]
# The first check is passed: this map depends on what was learned. The second one is *failed*. The
# numbers are even below 0: where the map is strong, hiding changes rather less than elsewhere. Look
# for it in the picture. At the score the map shines, and hiding that changes next to nothing. In
# the wall of bricks hiding changes most, and there the map is nearly dark.
#
# **So do not show this map.** It is not "a little uncertain". It says "here", and hiding says
# "rather elsewhere". Nothing else speaks for it, as the parcels did. Whoever sees it will believe
# it, and no small print beneath will help. Its one good place does not save it: that the ball is
# bright, you noticed because you knew that the ball matters. Nor is anything proved of the *agent*:
# where it looks, this map has not told.
#
# ## 8. A map that passes
#
# GradCAM averages each gradient over the screen, and so it forgets where that came from. HiResCAM
# multiplies place by place. This one is of the same moment and the same layer:

# %%
hirescam = trdlab.explain("pretrained:Breakout", **MOMENT, maps="hirescam")
checks(hirescam)

# %%
hirescam.plot()

# %% [markdown]
# Both checks are passed, for near and for far. For near, the brightest place is just below the
# ball; for far, the map is strong there and at the paddle, too. The score is dark now.
#
# The same in words:

# %%
print(hirescam)

# %% [markdown]
# This map may be shown, with its numbers. But passed is not perfect.
#
# - **Look at the wall.** In the lower row it is the strongest place, and in the map it is dim. The
#   check compares the order of all places, so a few may be wrong.
# - **The lower row is no truth either.** A patch hidden in the wall is a hole in the wall. The
#   agent has never seen just this picture, and what it makes of it is its own affair. That is why
#   section 2 took values that do happen. For pixels there are no such values.
# - **The forecast may be wrong.** A map shows what a forecast hangs on, be it right or not. We left
#   out the judging with `episodes=0`. First calibrate ([lesson 6](06_debug_an_agent.md)), then ask
#   for maps of what can be trusted.
# - **A place is no reason.** That the forecast hangs on the ball does not say how.
#
# ## 9. Your own agent
#
# ```console
# $ trdlab explain AGENT --step 60 --what saliency --component 0,39 --details
# $ trdlab explain AGENT --step 60 --what saliency --component 0-9,30-39 --maps hirescam --layer 1
# ```
#
# In this order:
#
# 1. Calibrate. Ask for no map of what is no better than a guess.
# 2. Make the map, and read the checks *before* you look at it.
# 3. Was one failed? Try `--maps hirescam`, or another `--layer`. Do not try moments until one
#    passes, and then show that one alone: say how many you tried.
# 4. Still failed? Show what hiding changes, or nothing.
#
# More is on the page [Which pixels matter](../saliency.md).

# %% [markdown]
# ## Your turn
#
# **Exercise 9.1.** On the belt of section 1, with γ = 0.9, place 2 holds a parcel of 0.6. The
# baseline is 0.5. What does this entry add to what is expected at t+2?

# %%
answer_1 = None  # replace with a number
check("9.1", answer_1)

# %% [markdown]
# **Exercise 9.2.** An agent expects 0.62 here, and 0.40 at the baseline. It sees four entries.
# Three of them add 0.30, −0.12 and 0.01. What must the fourth one add?

# %%
answer_2 = None  # replace with a number
check("9.2", answer_2)

# %% [markdown]
# **Exercise 9.3.** A map has the strengths 5, 3, 1 and 0 at four patches. Hiding these changes 0.1,
# 0.4, 0.3 and 0.2. What is the rank correlation? Write the rank of each patch in both orders.
# Where *d* is the difference of its two ranks, the correlation of *n* patches is
# 1 − 6·Σd² / (n·(n² − 1)).

# %%
answer_3 = None  # replace with a number
check("9.3", answer_3)

# %% [markdown]
# **Exercise 9.4.** You have four maps of a game, and nothing else. Which of them may be shown?
#
# | map | new weights | hiding | its forecast |
# |---|---|---|---|
# | 1 | 0.62 | 0.48 | better than a guess |
# | 2 | 0.05 | −0.20 | better than a guess |
# | 3 | 0.10 | 0.52 | better than a guess |
# | 4 | 0.20 | 0.45 | no better than a guess |

# %%
answer_4 = None  # replace with a list of numbers of maps
check("9.4", answer_4)

# %% [markdown]
# **To try next.** Let the scale of section 1 pay for the *lighter* one of the first two parcels.
# Which entries matter for t+1 now? Find it by hiding, by pushing and by walking, before you train
# anything. Then take `pretrained:Pong`, and ask what its maps hang on before a point is lost.

# %% [markdown]
# > **An open question.** A map passes both checks, and still shows the wall dimmer than it should
# > be. A doctor sees such a map of a scan, and looks no further than where it is bright. Who is to
# > blame? What would you have shown in its place?

# %% [markdown]
# ## What you have learned
#
# - Near and far reward can hang on different things. Ask for each by itself.
# - Hiding asks what an answer hangs on; a gradient asks what a little more would change.
# - Integrated gradients must add up. That tests the sum, and not the network.
# - Check a map before you look at it. If a check is failed, and nothing else speaks for the map, do
#   not show it.
