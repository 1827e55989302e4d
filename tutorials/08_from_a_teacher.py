# %% [markdown]
# # Lesson 8: from a teacher to a trusted agent
#
# Some rewards are hard to find. An agent that begins at random may look for a goal for hours, and
# never see it. But often somebody can do it already: another agent, or three lines of code. In this
# lesson an agent learns from such a *teacher*. Then you find out whether its forecasts can be
# trusted, which is another question.
#
# - **Goal:** let an agent learn from a teacher, and find out whether its forecasts can be trusted.
# - **Before it:** [lesson 7](07_explain_your_own.md).
# - **Time:** a quarter of an hour to read; about a minute to run, on two cores.

# %%
from pathlib import Path
from tempfile import mkdtemp

import torch

import trdlab
from trdlab.teach import check

torch.set_num_threads(1)  # such small networks are no faster with more
folder = Path(mkdtemp())  # what is kept of this lesson

# %% [markdown]
# ## 1. The teacher
#
# MountainCar is a car in a valley. It is too weak to drive up the hill at once: it has to swing.
# Each step costs 1, until it is at the top, or until 200 steps are over. Random actions never get
# there, so there is nothing to learn from.
#
# Here is a driver of one line. It pushes the car the way it rolls.

# %%
(folder / "driver.py").write_text(
    '''
def make():
    """Pushes the car the way it rolls: 0 is left, 2 is right."""
    return lambda seen: 2 if seen[1] > 0.0 else 0
'''
)
teacher = f"python:{folder / 'driver.py'}:make"
score = trdlab.agent(teacher, env="MountainCar-v0").evaluate(30).mean
print(f"The teacher: {score.value:.0f} ({score.low:.0f} to {score.high:.0f})")

# %% [markdown]
# A teacher may be anything that `trdlab agent` can name: a file of another library, a run, or code
# like this.
#
# ## 2. Learn from it
#
# Three things happen, one after the other. The teacher drives, and each of its steps is remembered.
# Then a network learns from that, without driving. Then the network drives, and the teacher looks
# on, and says what it would have done.

# %%
student = trdlab.train(
    "MountainCar-v0",
    out=folder / "student",
    teacher=teacher,
    teacher_steps=8_000,
    offline_updates=2_500,
    agent_steps=2_000,
    evaluate_episodes=0,
    checkpoint_episodes=0,
)
score = student.evaluate(30).mean
print(f"The student: {score.value:.0f} ({score.low:.0f} to {score.high:.0f})")

# %% [markdown]
# It reaches the top, after a few seconds of training. Alone it would have found nothing in that
# time.
#
# > **The formula.** This loss is least where the student's chances $q$ of all actions are those of
# > the teacher, $p$:
# >
# > $$L=\sum_a p(a)\,\ln\frac{p(a)}{q(a)}$$
# >
# > It is 0 there, and above 0 elsewhere. It is called the Kullback–Leibler divergence.
#
# ## 3. Who is explained?
#
# The driver says what to do, and not what that is worth. So the network has two parts. A *policy
# head* learns what the teacher does, and acts. Beside it, the components tell what will come of
# that. Every explanation says so:

# %%
print(student.estimator.future.policy)

# %% [markdown]
# Both parts were learned together, while the policy was still changing. Is what the components say
# true? The score cannot tell. Hold them against what really came:

# %%
joint = trdlab.calibrate(student, episodes=20)
fitted = trdlab.fit(
    student, horizon=10, steps=10_000, layers="copied", most_updates=3_000
)
afterwards = trdlab.calibrate(fitted, episodes=20)

print("                skill at t+5    t+9   trusted to")
for name, of in {"with the policy": joint, "afterwards": afterwards}.items():
    skill, last = of.calibration.skill.value, of.trust.last_step
    told = "nothing" if last is None else f"t+{last}"
    print(f"{name:>16}        {skill[5]:5.2f}  {skill[9]:5.2f}   {told}")

# %% [markdown]
# The policy is the same, to the last weight. What differs is how its future was learned. The second
# one was *fitted* to a policy that stood still, as in lesson 7. It began with the layers that the
# agent had already (`layers="copied"`).
#
# That is why `trdlab train atari` ends with a fit.
#
# ## 4. A game
#
# The same on the screen of a video game: the agent sees four small grey pictures, and nothing else.
# One that has learned in this way comes with trdlab. It was trained from an agent that others have
# published, and then fitted.

# %%
agent = trdlab.agent("pretrained:Breakout")
print(agent)

# %%
moment = trdlab.explain(
    agent, seed=3, step=200, parts="forecast,contrast", episodes=0
)
print(moment)

# %%
moment.plot()

# %% [markdown]
# The bars come in groups. The ball needs some thirty steps from the paddle to the bricks and back,
# and while it is away nothing can be paid.
#
# **Read "Tried out", too.** Both actions were really tried here, from copies of the game, and what
# came was the same, though more was forecast of the other one. The agent does not take that action
# here, so the fit has seldom seen it: only where it was forced. Believe what is said of the action
# that the agent takes, and of the other one no more than a trial confirms.
#
# How far its forecasts can be trusted is on the page of the next section. To test them again, in
# other games: `trdlab explain pretrained:Breakout --what calibration`.
#
# ## 5. Your own game
#
# ```console
# $ trdlab train atari Breakout --preset smoke        # a minute, to see that it works
# $ trdlab train atari Breakout                       # half an hour, from the one above
# $ trdlab train atari Breakout --teacher mine.zip    # from one of yours
# ```
#
# All of it stands in [Train an agent](../train.md).

# %% [markdown]
# ## Your turn
#
# **Exercise 8.1.** Where a teacher has values, such as a DQN, these are learned, and the student
# can become better than its teacher. So the teacher weighs 1 while the student is no better than
# random actions, 0 where it has come to the teacher's score, and in proportion in between. Random
# actions reach 2 points in a game, the teacher 102, and the student has 27 so far. What does the
# teacher weigh?

# %%
answer_1 = None  # replace with a number
check("8.1", answer_1)

# %% [markdown]
# **Exercise 8.2.** A teacher takes an action with a chance of 0.9, and the student with a chance of
# 0.5; there is one other action. How far apart are they, by the formula of section 2?

# %%
answer_2 = None  # replace with a number
check("8.2", answer_2)

# %% [markdown]
# > **An open question.** The driver of section 1 reaches the top in some 130 steps. A good agent
# > needs about 100. Can this student become as good, with a policy head that learns what the
# > teacher does? What would you change?

# %% [markdown]
# ## What you have learned
#
# - A teacher finds the rewards; the student need not be like it inside.
# - What somebody does and what that is worth are two things, and are learned apart.
# - A score proves nothing about components. Fit them to the policy as it is, and judge the fit.
