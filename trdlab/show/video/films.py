"""An explanation as a video: beside its forecast, or with maps of where rewards are decided."""

from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Literal, get_args

from trdlab.errors import InputError, closest
from trdlab.explanations.episode.story import Story
from trdlab.explanations.explanation import Explanation
from trdlab.explanations.saliency.groups import usual_groups
from trdlab.show.video.canvas import Frame
from trdlab.show.video.episode import episode_frames, num_frames
from trdlab.show.video.files import check_video, write_video
from trdlab.show.video.saliency import check_looks, component_frames, saliency_frames
from trdlab.show.video.sights import sights

What = Literal["episode", "saliency", "components"]
KINDS: tuple[What, ...] = get_args(What)
MOST_RATE = 100.0

_RATES = {"components": 4.0}  # frames in a second, where the episode does not decide
_RATE = 4.0  # likewise, where nobody knows how long a step takes

Watch = Callable[[int, int], None]
"""Is told how many frames there are, of how many."""


def save_video(
    explained: Explanation,
    path: str | Path,
    what: str = "episode",
    *,
    rate: float | None = None,
    overwrite: bool = False,
    watch: Watch = lambda done, count: None,
) -> Path:
    """Writes the episode of an explanation as a video, and returns its path.

    An `episode` is shown beside what is expected of the action taken and of the best other one,
    with its key moments in words, and what was expected against what came. `saliency` is the screen
    with what matters for near reward, for far reward, and how the two differ. `components` is one
    step: where each component is decided, one after the other.

    Args:
        explained: with its episode.
        path: where it goes: `.mp4` (with the extra `video`), `.webp` or `.gif`.
        what: `episode`, `saliency` or `components`.
        rate: how many frames are shown in a second; by default so many that time passes as it does
            for people who play.
        overwrite: whether it may replace a file.
        watch: told how many frames are done.

    Raises:
        InputError: the explanation has no episode, or there is nothing to see of it.
        OutputError: the file exists, or cannot be written.
    """
    to = Path(path)
    check(to, what, rate=rate, overwrite=overwrite)
    if explained.story is None:
        raise InputError("The explanation has no episode.", "Ask for `parts='episode'`.")
    per_second = rate or rate_of(explained, what)
    frames, count = _frames(explained, explained.story, what, per_second)
    write_video(to, _watched(frames, count, watch), count, per_second)
    return to


def check(path: Path, what: str, *, rate: float | None, overwrite: bool) -> None:
    """Checks what is asked for, before any work is done.

    Raises:
        InputError: there is no such video, the rate is none, or an mp4 needs an extra.
        OutputError: the file exists, or cannot be written.
    """
    if what not in KINDS:
        raise InputError(f"There is no video '{what}'.", closest(what, KINDS))
    if rate is not None and not 0.0 < rate <= MOST_RATE:
        raise InputError(f"The rate is {rate:g}.", f"It lies above 0, and up to {MOST_RATE:g}.")
    check_video(path, overwrite=overwrite)


def rate_of(explained: Explanation, what: str) -> float:
    """Returns how many frames are shown in a second, where nothing is said."""
    seconds = explained.agent.seconds_per_step
    return _RATES.get(what, _RATE if seconds is None else min(1.0 / seconds, MOST_RATE))


def _frames(
    explained: Explanation, told: Story, what: str, rate: float
) -> tuple[Iterator[Frame], int]:
    """Returns the frames of a video, and how many there are."""
    agent, episode = explained.agent, told.played.episode
    seen, trust = sights(agent, episode, explained.seed), None
    if explained.report is not None:
        trust = explained.report.trust
    if what == "episode":
        return episode_frames(told, seen, rate=rate, trust=trust), num_frames(told.played, rate)
    check_looks(agent.estimator)
    if what == "saliency":
        groups = usual_groups(episode.time_axis, trust)
        if len(groups) < 2:
            raise InputError("There is no near and no far reward with N = 0.", "Use a larger N.")
        return saliency_frames(agent, episode, seen, groups), len(episode)
    step = explained.step
    if step >= len(episode):
        raise InputError(
            f"There is no step {step}: the episode is over after {len(episode)} steps.",
            f"Choose a step from 0 to {len(episode) - 1}.",
        )
    sight = next(islice(seen, step, None))
    action = int(episode.actions[step])
    if explained.choice is not None:
        action = agent.action_names.index(explained.choice.action)
    shown = component_frames(agent, sight.observation, sight.seen, action, step)
    return shown, episode.time_axis.num_components


def _watched(frames: Iterator[Frame], count: int, watch: Watch) -> Iterator[Frame]:
    for done, frame in enumerate(frames, 1):
        watch(done, count)
        yield frame
