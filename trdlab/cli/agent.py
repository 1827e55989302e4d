"""`trdlab agent`: what an agent is that another library trained, and how well it plays."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from trdlab.cli import common

if TYPE_CHECKING:
    from trdlab.agents import Agent


def agent(
    name: Annotated[
        str,
        typer.Argument(
            metavar="AGENT",
            help="A file: an archive of Stable-Baselines3, weights of CleanRL, baby-a3c, ACKTR or "
            "the paper's authors, or linear layers; with what it does not say after commas, such "
            "as ppo.zip,activation=relu. Or "
            "python:FILE.py:FUNCTION, whose function makes an agent. Or any other AGENT.",
        ),
    ],
    env: Annotated[
        str | None,
        typer.Option(
            "--env",
            help="Where it acts: a Gymnasium id, or an Atari game.",
            show_default="where it was made for",
        ),
    ] = None,
    env_arguments: common.EnvArguments = None,
    action_names: common.ActionNames = None,
    episodes: Annotated[int, typer.Option("--episodes", min=1, help="To play.")] = 20,
    greedy: Annotated[
        bool, typer.Option("--greedy", help="Take the likeliest action, where it would draw one.")
    ] = False,
    seed: common.EpisodesSeed = 0,
    max_steps: Annotated[
        int | None, common.max_steps_option("the environment's limit, or else 1000")
    ] = None,
    modules: common.Import = None,
    as_json: common.AsJson = False,
    verbose: common.Verbose = False,
) -> None:
    """Show what an agent is, check that it fits an environment, and play it for its score.

    Files are read, and never executed; python:FILE.py:FUNCTION is.
    """
    from trdlab.agents.naming import find_agent
    from trdlab.cli.progress import EpisodeProgress
    from trdlab.show.outside import agent_page
    from trdlab.show.training import evaluation_page

    found = find_agent(name, env=env, env_arguments=env_arguments or ())
    found = common.named(found, action_names)
    with EpisodeProgress(common.errors()) as progress:
        result = found.evaluate(
            episodes, greedy=greedy, max_steps=max_steps, seed=seed, watch=progress.on_progress
        )
    how = "sampled" if draws(found) and not greedy else "greedy"
    if as_json:
        told = {"acts": how, "evaluation": result.to_dict()}
        common.print_json({"schema": "trdlab.agent/1", **_data(found), **told})
    else:
        common.print_text(agent_page(found, how))
        common.print_text(evaluation_page(result, how=how))


def draws(found: "Agent") -> bool:
    """Returns whether an agent draws its actions from probabilities."""
    about = getattr(found.policy, "about", None)
    return found.policy is not None and (about is None or about.draws)


def _data(found: "Agent") -> dict[str, Any]:
    """Returns what is known about an agent, as plain data."""
    about = getattr(found.policy or found.estimator, "about", None)
    return {
        "name": found.name,
        "about": about and about.to_dict(),
        "environment": found.interface.to_dict(),
        "is_fitted": found.is_fitted,
    }
