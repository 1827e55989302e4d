# %% [markdown]
# # Lesson 5: from pixels
#
# Until now a table had a row for every state. Most worlds have too many states for that, and an
# agent does not see a state's number: it sees a picture. In this lesson a neural network looks at
# pictures of the drone's world, learns by acting, and must say when it expects what. Because we
# know this small world exactly, we can check every number it says.
#
# - **Goal:** let a network learn the vector from pictures, and test every number that it says.
# - **Before it:** [lesson 3](03_learn_it.md) and [lesson 4](04_why_the_sum_fails.md).
# - **Time:** half an hour to read; one to two minutes to run, on two cores.

# %%
import gymnasium as gym
import numpy as np
from matplotlib import pyplot as plt

from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.networks import build_network
from trdlab.deep.settings import TrainSettings
from trdlab.environments import GymEnvironments
from trdlab.gridworld import Gridworld, load_map
from trdlab.gridworld.pixels import pictures
from trdlab.rollouts.evaluation import evaluate
from trdlab.tabular import exact
from trdlab.teach import check
from trdlab.training.machine import resolved
from trdlab.training.setup import future, new_trainer

UP, DOWN, LEFT, RIGHT = range(4)

# %% [markdown]
# ## 1. What it sees
#
# Each state is a grey picture of 84 × 84 pixels, the size that networks for Atari games take. Here
# is the start, the state after the first coin, and the difference of the two.

# %%
world = Gridworld(load_map("drone"))
seen = pictures(world)  # [S, 84, 84], a picture of each state
one_coin = next(
    i for i, state in enumerate(world.states) if len(state.collected) == 1
)

figure, axes = plt.subplots(1, 3, figsize=(6, 2.5), layout="constrained")
shown = {
    "the start": seen[0],
    "one coin later": seen[one_coin],
    "what differs": np.abs(seen[0].astype(int) - seen[one_coin]),
}
for ax, (title, picture) in zip(axes, shown.items(), strict=True):
    ax.imshow(picture, cmap="gray", vmin=0, vmax=255)
    ax.set_title(title, fontsize=10)
    ax.axis("off")

# %% [markdown]
# Nobody tells the network what a drone is, or a coin. It gets 7056 numbers, and most of them never
# change.
#
# ## 2. What it says
#
# A network for Q-learning has one output for each action. Ours has N + 1 for each: A · (N + 1) in
# all. The rest of it is the usual one, three layers of convolutions and one of 512 neurons.

# %%
settings = TrainSettings(
    kind="gym",
    env="trdlab/DroneGridworld-v0",
    env_arg=("observation=pixels", "exploring_starts=true", "max_episode_steps=6"),
    gamma=0.9,
    horizon=4,
    num_envs=8,
    epsilon_end=1.0,  # act at random throughout
    agent_steps=11_800,
    learning_starts=4_800,
    update_every=4,
    batch_size=64,
    learning_rate=1e-3,
    learning_rate_end=0.0,
    target_sync_updates=250,
    capacity=20_000,
    threads=1,  # so that you see the numbers that are printed here
)
network = build_network(
    gym.spaces.Box(0, 255, (1, 84, 84), np.uint8), 4, settings.time_axis, seed=1
)
estimator = NetworkEstimator(network, settings.time_axis, future(settings))
estimator.decompose(seen[:1, None])[0]

# %% [markdown]
# It has not learned yet, so it says something. Note the settings: it will *act at random*, begin
# anywhere, and learn of the *greedy* policy nevertheless (lesson 3, section 4). That it begins
# anywhere makes rare states as frequent as others. We want to know how well a network can learn
# this, not how well it explores.
#
# ## 3. Learn
#
# What changes, compared with the table of lesson 3?
#
# - An entry of a table can be moved by itself. Weights are shared: a step for one picture changes
#   what is said about all the others. So each update takes a *batch* of what happened, drawn from a
#   memory of thousands of steps.
# - If the targets came from the network that is being changed, they would run away from it. They
#   come from a copy, the **target network**, which is renewed every 250 updates.
# - The loss is the squared error, summed over the components: lesson 4 says why not of the sum.
#
# > **The formula.** For a batch of $B$ steps, with the weights $\theta$ that are learned:
# >
# > $$L(\theta)=\frac{1}{B}\sum_{b=1}^{B}\sum_{i=0}^{N}\big(c_i(s_b,a_b;\theta)-y_{b,i}\big)^2$$
# >
# > The target $y_b$ follows from the law. Its $n$ comes from the target network, whose weights
# > stand still.
#
# We watch the largest error of each component, over all states and actions, and what a flight
# brings.

# %%
environments = GymEnvironments(
    settings.env,
    settings.num_envs,
    seed=settings.seed,
    env_arguments={
        "observation": "pixels",
        "exploring_starts": True,
        "max_episode_steps": 6,
    },
)
trainer = new_trainer(resolved(settings, environments), environments)
estimator = NetworkEstimator(
    trainer.learner.q_network, settings.time_axis, future(settings)
)
truth = exact(world.mdp, settings.time_axis).decomposition
playing = ~world.mdp.terminal_states


def errors():
    """Returns the largest error of each component, `[N+1]`."""
    said = estimator.decompose(seen[playing][:, None]).components
    return np.abs(said - truth.components[playing]).max(axis=(0, 1))


def score():
    """Returns what one greedy flight from the start brings."""
    flight = GymEnvironments(
        settings.env, seed=0, env_arguments={"observation": "pixels"}
    )
    return evaluate(estimator, flight).returns[0]


print("updates   flight   largest error of component 0 … 4")
history = [(0, errors())]
while not trainer.done:
    trainer.step()
    updates = trainer.learner.num_updates
    if updates > history[-1][0] and updates % 50 == 0:
        history.append((updates, errors()))
        if updates % 250 == 0:
            row = " ".join(f"{error:6.2f}" for error in history[-1][1])
            print(f"{updates:7}   {score():6.0f}   {row}")

# %%
updates, error = (
    np.array([at for at, _ in history]),
    np.array([e for _, e in history]),
)
figure, ax = plt.subplots(figsize=(6, 3.2), layout="constrained")
for i, label in enumerate(settings.time_axis.labels):
    ax.plot(updates, error[:, i], label=label)
for copy in range(250, updates[-1], 250):
    ax.axvline(copy, color="black", lw=0.4, ls=":")
ax.set(
    xlabel="updates (dotted: a copy to the target network)", ylabel="largest error"
)
ax.legend(frameon=False, ncols=3)
ax.set_yscale("log")

# %% [markdown]
# **One component after another.** Component 0 needs no target network: it is the reward itself.
# Component 1 is learned from the copy's component 0, so it can only be right after a copy that has
# a right component 0; and so on. This is the news of lesson 3 again, but now it travels one *copy*
# at a time. With N = 40 the last component cannot be right before the fortieth copy.
#
# **The score comes first.** Look at the column *flight*. 4 is the most a flight can bring, and it
# is reached while some components are still off by more than a whole reward. To fly well, the best
# action only has to have the largest *sum*. A good score proves nothing about the components.
#
# ## 4. Against the exact table

# %%
for action, name in ((UP, "up"), (DOWN, "down")):
    said, exactly = estimator.decompose(seen[:1, None])[0, action], truth[0, action]
    print(f"{name:>5}  network  {said.components.round(2)}   Q = {said.value:.2f}")
    print(
        f"       exact    {exactly.components.round(2)}   Q = {exactly.value:.2f}"
    )

print("largest error anywhere:", errors().max().round(3))
assert errors().max() < 0.05

# %% [markdown]
# From 7056 pixels to the right reward at the right time, for every state and action. Here we could
# check it. For a game there is no exact table, and you have just seen that the score is no
# substitute. What remains is to compare what was said with what then *happened*: that is called
# calibration, and a later lesson is about it.
#
# ## 5. A run of your own
#
# What this lesson did step by step, a command does as well, with a folder that keeps everything:
#
# ```console
# $ trdlab train gym trdlab/DroneGridworld-v0 --N 4 --gamma 0.9   # by the state, in minutes
# $ trdlab evaluate runs/DroneGridworld-v0-N4-w1-seed1
# ```
#
# With `--env-arg observation=pixels` it learns from the pictures, and takes an hour: the settings
# above are made for this lesson. In the source's folder, `python benchmarks/pixels.py` holds other
# maps and wider groups against their exact tables.
#
# [How to train an agent](../train.md) tells more.

# %% [markdown]
# ## Your turn
#
# **Exercise 5.1.** A game has 6 actions, and you choose N = 40. How many outputs has the network?

# %%
answer_1 = None  # replace with a whole number
check("5.1", answer_1)

# %% [markdown]
# **Exercise 5.2.** There is an update every 4 agent steps, and a copy every 250 updates. After how
# many agent steps, from the first update on, can component 10 begin to be learned from a right
# component 9, at the earliest? (Component 0 needs no copy.)

# %%
answer_2 = None  # replace with a whole number
check("5.2", answer_2)

# %% [markdown]
# **Exercise 5.3.** The target network says [1, 2, 3] for the best next action, the reward is 4, and
# γ = 0.5. The network says [4, 1, 1]. What is the squared error, summed over the components?

# %%
answer_3 = None  # replace with a number
check("5.3", answer_3)

# %% [markdown]
# > **An open question.** In the table above, the score is right long before the components are.
# > Most trainings end when the score no longer grows. Who would notice that such an agent plays
# > well and explains badly? Must the network that plays be the network that explains?

# %% [markdown]
# ## What you have learned
#
# - A network that decomposes has N + 1 outputs for each action; nothing else about it is new.
# - Component i + 1 is learned from a copy whose component i is right: news travels one copy at a
#   time.
# - The score is right long before the components are.
# - Where there is an exact table, test against it. Elsewhere, test against what happens.
