"""A fit in its folder: begun, stopped, gone on with, and read again."""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trdlab.environments.interface import Interface
from trdlab.environments.outcomes import INFO, LIFE_LOST
from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.estimator import Future
from trdlab.runs import MetricsFile, RunFolder, checkpoint_steps, load_checkpoint, save_checkpoint
from trdlab.runs.folder import check_free, is_fit
from trdlab.time_axis import TimeAxis

if TYPE_CHECKING:
    from trdlab.deep.estimator import NetworkEstimator
    from trdlab.deep.experience import Experience
    from trdlab.deep.fit import Fit
    from trdlab.deep.fit_settings import FitProgress, FitSettings, Layers

SAVE_SECONDS = 30.0
"""So often a fit is saved while it learns."""


class Stopped(TrdlabError):  # noqa: N818  nothing has failed
    """A fit was asked to stop before its end."""


@dataclass(frozen=True)
class Plan:
    """What is fitted to whom, as it stands in `config.toml`.

    Args:
        agent: as a user names it; None where it was given as an object.
        env: where it acts; None where it was made for.
        env_arguments: what that is made with, as `KEY=VALUE`.
        solved_for: the γ of the table that the agent acts by; None where it has none.
        axis: γ, N and w.
        steps: that it plays, at least.
        share: of its actions that are forced.
        epsilon: the chance that it takes any action, as a part of how it acts.
        layers: which layers the network had before it learned (see `Layers`).
        outcomes: what else is forecast, and where it stands in `info`, or that it is a function.
        parts: those of the outcomes that add up to the reward.
        settings: how it is learned.
    """

    agent: str | None
    env: str | None
    env_arguments: tuple[str, ...]
    solved_for: float | None
    axis: TimeAxis
    steps: int
    share: float
    epsilon: float
    layers: "Layers"
    outcomes: Mapping[str, str]
    parts: tuple[str, ...]
    settings: "FitSettings"

    @property
    def has_functions(self) -> bool:
        """Whether an outcome was given as a function, which has no name."""
        places = self.outcomes.values()
        return any(place != LIFE_LOST and not place.startswith(INFO) for place in places)

    @property
    def arguments(self) -> dict[str, Any]:
        """What `trdlab.fit` was called with, beside the agent."""
        axis, places = self.axis, self.outcomes
        return {
            "gamma": axis.gamma,
            "horizon": axis.horizon,
            "width": axis.width,
            "steps": self.steps,
            "share": self.share,
            "epsilon": self.epsilon,
            "layers": self.layers,
            "outcomes": {name: of for name, of in places.items() if name not in self.parts},
            "parts": {name: places[name] for name in self.parts},
            **asdict(self.settings),
        }

    def to_config(self) -> dict[str, Any]:
        """Returns it as plain values; what is None is left out."""
        told = {
            "agent": self.agent,
            "env": self.env,
            "env_arguments": list(self.env_arguments),
            "solved_for": self.solved_for,
            "gamma": self.axis.gamma,
            "N": self.axis.horizon,
            "w": self.axis.width,
            "steps": self.steps,
            "share": self.share,
            "epsilon": self.epsilon,
            "layers": self.layers,
            "parts": list(self.parts),
            **asdict(self.settings),
        }
        told["hidden"] = told["hidden"] and list(told["hidden"])
        told |= {"outcomes": dict(self.outcomes)} if self.outcomes else {}
        return {name: value for name, value in told.items() if value is not None}

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> "Plan":
        """Returns the plan that `to_config` told.

        Raises:
            LookupError, TypeError: it is none.
        """
        from trdlab.deep.fit_settings import FitSettings

        names = {field.name for field in fields(FitSettings)} & set(config)
        settings = {name: config[name] for name in names}
        if "hidden" in settings:
            settings["hidden"] = tuple(settings["hidden"])
        return cls(
            agent=config.get("agent"),
            env=config.get("env"),
            env_arguments=tuple(config["env_arguments"]),
            solved_for=config.get("solved_for"),
            axis=TimeAxis(config["gamma"], config["N"], config["w"]),
            steps=config["steps"],
            share=config["share"],
            epsilon=config["epsilon"],
            layers=config["layers"],
            outcomes=config.get("outcomes", {}),
            parts=tuple(config["parts"]),
            settings=FitSettings(**settings),
        )


def find_fit(path: Path, plan: Plan) -> RunFolder | None:
    """Returns the folder of the same fit, if it was begun and stopped there; None if it is free.

    Raises:
        OutputError: there is something else.
        InputError: another fit was begun there.
    """
    if not is_fit(path):
        check_free(path)
        return None
    folder = RunFolder.open(path)
    if is_done(folder):
        raise OutputError(f"'{path}' holds a fit that is done.", "Choose another `out`.")
    now = plan.to_config()
    changed = [key for key in now | folder.config if now.get(key) != folder.config.get(key)]
    if changed:
        key = changed[0]
        raise InputError(
            f"The fit in '{path}' was begun with {key} = {folder.config.get(key)!r}, and this has "
            f"{now.get(key)!r}.",
            "Go on with the same, or choose another `out`.",
        )
    return folder


def new_fit(path: Path, plan: Plan, interface: Interface, future: Future) -> RunFolder:
    """Makes the folder of a fit.

    Args:
        path: the folder.
        plan: what is fitted to whom.
        interface: what the agent sees and does.
        future: whose future is told.

    Raises:
        OutputError: there is something already, or it cannot be written.
    """
    extra = {"fit": {"interface": interface.to_dict(), "future": future.to_dict()}}
    return RunFolder.create(path, plan.to_config(), extra)


def is_done(folder: RunFolder) -> bool:
    """Returns whether a fit has come to its end."""
    return bool(checkpoint_steps(folder)) and bool(load_checkpoint(folder).state["done"])


def learn(
    experience: "Callable[[], Experience]",
    make: "Callable[[Experience], Fit]",
    future: Future,
    *,
    found: RunFolder | None = None,
    new: Callable[[], RunFolder] | None = None,
    seconds: float | None = None,
    judge: "Callable[[Fit], tuple[int, ...]]" = lambda fitting: (),
    tell: "Callable[[FitProgress], None]" = lambda progress: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> "NetworkEstimator":
    """Fits until held-out error stops falling; in a folder it goes on where it was stopped.

    Args:
        experience: plays; it is not asked where that has been done.
        make: begins to fit what was played.
        future: whose future is told.
        found: where it was begun and stopped; None where that is not so.
        new: makes the folder to keep it in, once something has been played; None for nowhere.
        seconds: after which learning stops, if not before.
        judge: says how far each channel reaches, when all is learned.
        tell: told of each look at the held-out error.
        should_stop: asked before each.

    Raises:
        Stopped: it should, and what has been learned is saved if there is a folder.
        OutputError: the disk is full; what was saved before is whole.
    """
    is_saved = found is not None and bool(checkpoint_steps(found))
    fitting = _restored(found, make) if found and is_saved else make(experience())
    folder = found or (new() if new is not None else None)
    if folder is None:
        _rounds(fitting, seconds, tell, should_stop, lambda: None)
        return replace(fitting.estimator(future), reach=judge(fitting))
    with folder.held():
        if not is_saved:
            _save(folder, fitting, future)
        with MetricsFile(folder.metrics, fitting.num_updates) as metrics:

            def told(progress: "FitProgress") -> None:
                metrics.append({"agent_steps": progress.updates, **asdict(progress)})
                tell(progress)

            _rounds(fitting, seconds, told, should_stop, lambda: _save(folder, fitting, future))
        reach = judge(fitting)
        _save(folder, fitting, future, reach, done=True)
    return replace(fitting.estimator(future), reach=reach)


def _rounds(
    fitting: "Fit",
    seconds: float | None,
    tell: "Callable[[FitProgress], None]",
    should_stop: Callable[[], bool],
    save: Callable[[], None],
) -> None:
    began = saved = time.monotonic()
    while not fitting.done and (seconds is None or time.monotonic() < began + seconds):
        if should_stop():
            save()
            raise Stopped(f"Stopped at {fitting.num_updates:,} updates.")
        tell(fitting.learn())
        if time.monotonic() > saved + SAVE_SECONDS:
            save()
            saved = time.monotonic()


def _restored(folder: RunFolder, make: "Callable[[Experience], Fit]") -> "Fit":
    """Returns a fit as it was saved."""
    from trdlab.deep.experience import Experience

    checkpoint = load_checkpoint(folder)
    columns: dict[str, Any] = {
        name: np.frombuffer(checkpoint.blocks.get(name, b""), dtype).reshape(shape)
        for name, (dtype, shape) in checkpoint.state["columns"].items()
    }
    fitting = make(Experience(**columns, **checkpoint.state["stacks"]))
    fitting.load_state_dict(checkpoint.state["learner"])
    return fitting


def _save(
    folder: RunFolder,
    fitting: "Fit",
    future: Future,
    reach: tuple[int, ...] = (),
    *,
    done: bool = False,
) -> None:
    """Saves a fit; what was played is kept until it is done."""
    from trdlab.deep.update import arrays_of

    estimator = fitting.estimator(future)
    played = fitting.experience
    columns = (
        {}
        if done
        else {name: np.ascontiguousarray(column) for name, column in played.columns.items()}
    )
    state = {
        "done": done,
        "q_network": arrays_of(estimator.network.state_dict()),
        "channels": [asdict(channel) for channel in fitting.channels],
        "possible": fitting.possible,
        "reach": list(reach),
        "hidden": [getattr(layer, "out_features", 0) for layer in fitting.network.body.children()],
        "columns": {name: [of.dtype.str, list(of.shape)] for name, of in columns.items()},
        "stacks": {"stack": played.stack, "padding": played.padding},
        "learner": {} if done else fitting.state_dict(),
    }
    blocks = {name: of.data.cast("B") for name, of in columns.items() if of.size}
    save_checkpoint(folder, fitting.num_updates, state, blocks, keep=1)


def load_fit(path: Path) -> "tuple[NetworkEstimator, Interface, Plan]":
    """Returns what was fitted, the best of it so far, what its agent sees and does, and the plan.

    Where it reads features of frozen layers, so does the estimator (see `upon`).

    Raises:
        TrdlabError: something is torn.
    """
    from trdlab.deep.channels import Channel
    from trdlab.deep.estimator import NetworkEstimator
    from trdlab.deep.features import features_space
    from trdlab.deep.networks import build_network
    from trdlab.deep.update import load_weights

    folder = RunFolder.open(path)
    state = load_checkpoint(folder).state
    try:
        plan, told = Plan.from_config(folder.config), folder.manifest["fit"]
        interface = Interface.from_dict(told["interface"])
        future = Future.from_dict(told["future"])
        channels = tuple(Channel(**channel) for channel in state["channels"])
        hidden = tuple(size for size in state["hidden"] if size)
        rows = len(interface.action_names) * len(channels)
        space = interface.space
        if plan.layers == "frozen":
            space = features_space(state["q_network"]["body.0.weight"].shape[1])
        network = build_network(space, rows, plan.axis, seed=0, hidden=hidden)
        load_weights(network, state["q_network"])
    except (LookupError, TypeError, ValueError, InputError) as error:
        raise TrdlabError(
            f"'{path}' does not say what was fitted: it is torn.", "Fit the agent again."
        ) from error
    estimator = NetworkEstimator(
        network,
        plan.axis,
        future,
        channels=channels,
        possible=state["possible"],
        reach=tuple(state["reach"]),
    )
    return estimator, interface, plan
