"""Videos: bars as high as their numbers, episodes beside their forecasts, files that are whole."""

import itertools
import weakref
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import trdlab
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, OutputError
from trdlab.estimator import Future
from trdlab.explanations import Explanation
from trdlab.explanations.calibration.calibration import Trust
from trdlab.explanations.episode.played import Played
from trdlab.explanations.saliency.groups import Group
from trdlab.rollouts.episodes import Episode
from trdlab.show.plots.style import action_colours
from trdlab.show.video import files
from trdlab.show.video.canvas import Frame, text_frame
from trdlab.show.video.episode import REST, caption_at, captions, episode_frames, num_frames
from trdlab.show.video.files import check_video, write_video
from trdlab.show.video.films import save_video
from trdlab.show.video.panel import Panel, Row, Span, best
from trdlab.show.video.saliency import component_frames, overlaid, saliency_frames
from trdlab.show.video.sights import Sight, sights
from trdlab.show.video.strip import Strip, before, lead_of

AXIS = TimeAxis(0.5, horizon=4)
NAMES = ("up", "down")
PANEL = Panel(AXIS, NAMES, height=300, size=14)


def pixels(frame: Frame, colour: str) -> np.ndarray:
    """Returns `[H, W]`, which pixels have a colour."""
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return (frame == rgb).all(axis=2)


def heights(frame: Frame, panel: Panel, row: int, name: str) -> list[int]:
    """Returns how many pixels high the bar of each explicit component of a row is."""
    own = pixels(frame, action_colours(panel.action_names)[name])
    top = panel.top(row)
    own = own[top : top + panel.bars_height]
    middles = [sum(panel.place(i)) // 2 for i in range(panel.axis.horizon)]
    return [int(own[:, x].sum()) for x in middles]


# ---- bars --------------------------------------------------------------------------------------


def test_bars_are_as_high_as_their_numbers():
    components = np.array([0.5, 1.0, 0.0, 2.0, 0.0])
    span = Span(0.0, 2.0)
    found = heights(PANEL.draw([Row("up", components)], span), PANEL, 0, "up")
    whole = PANEL.bars_height - 1
    assert found == [pytest.approx(whole * share, abs=1) for share in (0.25, 0.5, 0.0, 1.0)]


def test_costs_hang_below_the_line_of_zero():
    row = Row("down", np.array([1.0, -1.0, 0.0, 0.0, 0.0]))
    frame = PANEL.draw([row], Span(-1.0, 1.0))
    own = pixels(frame, action_colours(NAMES)["down"])
    zero = PANEL.line_of(0, Span(-1.0, 1.0), 0.0)
    up, down = (sum(PANEL.place(i)) // 2 for i in (0, 1))
    assert own[zero - 3, up]
    assert not own[zero + 3, up]
    assert own[zero + 3, down]
    assert not own[zero - 3, down]


def test_what_leaves_the_scale_ends_at_it_with_its_number():
    row = Row("up", np.array([9.0, 1.0, 0.0, 0.0, 0.0]))
    frame = PANEL.draw([row], Span(0.0, 1.0))
    first, second = heights(frame, PANEL, 0, "up")[:2]
    assert first <= second == pytest.approx(PANEL.bars_height - 1, abs=1)
    assert (
        frame != PANEL.draw([row._replace(components=row.components * 0.0)], Span(0.0, 1.0))
    ).any()


def test_what_is_not_to_be_trusted_is_pale():
    row = Row("up", np.ones(5), doubtful=np.array([False, False, True, True, True]))
    assert [h > 0 for h in heights(PANEL.draw([row], Span(0.0, 1.0)), PANEL, 0, "up")] == [
        *(True, True),
        *(False, False),
    ]


def test_two_rows_share_a_scale():
    rows = [Row("up", np.full(5, 1.0)), Row("down", np.full(5, 2.0))]
    frame = PANEL.draw(rows, Span(0.0, 2.0))
    low, high = (heights(frame, PANEL, i, name)[0] for i, name in enumerate(NAMES))
    assert high == pytest.approx(2 * low, abs=2)


def test_the_best_actions_come_first():
    rows = best(np.array([[1.0, 1.0], [3.0, 0.0], [0.0, 2.5]]), ("a", "b", "c"), 2)
    assert [(row.said, row.name) for row in rows] == [("best: ", "b"), ("next: ", "c")]
    assert len(best(np.ones((1, 2)), ("a",), 2)) == 1


def test_the_scale_only_grows_to_round_numbers_and_that_is_told():
    span = Span().over(np.array([[0.7, 0.0, 0.0]]))
    assert span == (0.0, 0.8, 0)  # nothing to tell of the first one
    assert span.over(np.array([[0.1, 0.0, 0.0]])) == span
    grown = span.over(np.array([[-0.2, 1.1, 0.0]]))
    assert grown[:2] == (-0.2, 1.5)
    assert grown.news > 0
    assert grown.over(np.array([[0.1, 0.0, 0.0]])).news == grown.news - 1


def test_what_comes_later_does_not_set_the_scale_unless_there_is_nothing_else():
    assert Span().over(np.array([[0.8, 50.0]])).high == 1.0
    assert Span().over(np.array([[0.0, 50.0]])).high == 50.0
    assert Span().over(np.zeros((1, 3)))[:2] == (0.0, 0.0)


def test_only_finite_numbers_have_bars():
    with pytest.raises(InputError, match="A component is nan"):
        Span().over(np.array([[0.0, np.nan]]))


@pytest.mark.parametrize("horizon", [0, 1, 40, 300])
def test_a_panel_has_room_for_any_number_of_components(horizon: int):
    panel = Panel(TimeAxis(0.9, horizon), NAMES, 200, 12)
    row = Row("up", np.ones(horizon + 1))
    frame = panel.draw([row, row._replace(name="down")], Span(0.0, 1.0), "a heading" * 20)
    assert frame.shape == (200, panel.width, 3)
    assert panel.place(horizon)[1] < panel.width
    assert panel.labels[-1][0] == horizon


# ---- files -------------------------------------------------------------------------------------


def moving(count: int = 5, side: int = 32) -> list[Frame]:
    """Returns frames with a square that moves."""
    frames = [np.full((side, 2 * side, 3), 255, np.uint8) for _ in range(count)]
    for at, frame in enumerate(frames):
        frame[4:12, 4 + 3 * at : 12 + 3 * at] = (0, 114, 178)
    return frames


def read(path: Path) -> list[Frame]:
    with Image.open(path) as image:
        found = []
        for at in range(getattr(image, "n_frames", 1)):
            image.seek(at)
            found.append(np.array(image.convert("RGB")))
        return found


def test_a_gif_holds_every_frame_exactly_and_lasts_as_long_as_it_should(tmp_path: Path):
    path = tmp_path / "a.gif"
    write_video(path, iter(moving()), 5, rate=15.0)
    for frame, expected in zip(read(path), moving(), strict=True):
        np.testing.assert_array_equal(frame, expected)
    with Image.open(path) as image:
        lasts = []
        for at in range(5):
            image.seek(at)
            lasts.append(image.info["duration"])
    assert sum(lasts) == 330  # five fifteenths of a second, in hundredths
    assert list(tmp_path.iterdir()) == [path]


def test_frames_that_do_not_change_last_as_long_as_others(tmp_path: Path):
    still = [moving()[0]] * 3
    write_video(tmp_path / "a.gif", iter(still), 3, rate=10.0)
    assert all((frame == still[0]).all() for frame in read(tmp_path / "a.gif"))


def test_a_webp_holds_every_frame_closely(tmp_path: Path):
    write_video(tmp_path / "a.webp", iter(moving()), 5, rate=15.0)
    found = read(tmp_path / "a.webp")
    assert len(found) == 5
    for frame, expected in zip(found, moving(), strict=True):
        assert np.abs(frame.astype(int) - expected).mean() < 3.0


def test_an_mp4_holds_every_frame(tmp_path: Path):
    imageio = pytest.importorskip("imageio.v2")
    pytest.importorskip("imageio_ffmpeg")
    write_video(tmp_path / "a.mp4", iter(moving(20, 64)), 20, rate=15.0)
    with imageio.get_reader(tmp_path / "a.mp4") as video:
        assert (video.count_frames(), video.get_meta_data()["size"]) == (20, (128, 64))
        assert video.get_meta_data()["fps"] == 15.0


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_frames_are_drawn_one_by_one_and_the_same_frames_are_the_same_file(
    tmp_path: Path, suffix: str
):
    made: list[weakref.ref[Frame]] = []
    most = 0

    def drawn() -> Iterator[Frame]:
        nonlocal most
        for at in range(50):
            frame = moving(50)[at].copy()
            made.append(weakref.ref(frame))
            yield frame
            del frame
            most = max(most, sum(of() is not None for of in made))

    for name in ("a", "b"):
        write_video(tmp_path / f"{name}{suffix}", drawn(), 50, rate=10.0)
    assert most <= 2
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_a_failure_leaves_what_was_there(tmp_path: Path):
    path = tmp_path / "a.gif"
    path.write_bytes(b"old")

    def broken() -> Iterator[Frame]:
        yield moving()[0]
        raise InputError("It broke.", "Mend it.")

    with pytest.raises(InputError, match=r"It broke\."):
        write_video(path, broken(), 5, rate=10.0)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_files_are_not_replaced_by_accident(tmp_path: Path):
    path = tmp_path / "a.gif"
    path.write_bytes(b"old")
    with pytest.raises(OutputError, match="exists"):
        check_video(path)
    check_video(path, overwrite=True)
    with pytest.raises(OutputError, match=r"Known: \.gif, \.mp4, \.webp"):
        check_video(tmp_path / "a.avi")


def test_an_mp4_without_the_extra_names_it_and_what_else_there_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(files, "find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r"pip install 'trdlab\[video\]', or write a \.webp or a \.gif"
    ):
        check_video(tmp_path / "a.mp4")
    check_video(tmp_path / "a.webp")


# ---- episodes ----------------------------------------------------------------------------------


@cache
def explained(name: str = "gridworld:drone") -> Explanation:
    return trdlab.explain(name, parts="episode", episodes=0, max_steps=30)


def played(**changes: Any) -> Played:
    """Returns three steps, of which the last one pays 1, as it was expected of old."""
    told = np.zeros((3, 2, 3))  # [T, A, N+1]
    told[0, 1], told[1, 1], told[2, 1] = (0, 0, 0.25), (0, 0.5, 0), (1, 0, 0)
    axis = TimeAxis(0.5, 2)
    episode = Episode(
        decomposition=RewardDecomposition(told, axis),
        expected=np.concatenate([told[:, 1], np.zeros((1, 3))]),
        actions=np.array([1, 1, 1]),
        rewards=np.array([0.0, 0.0, 1.0]),
        life_lost=np.zeros(3, bool),
        ends=np.array([False, False, True]),
        terminated=True,
        random=np.zeros(5, bool),
    )
    return Played(replace(episode, **changes), NAMES)


def test_a_reward_is_held_against_what_was_expected_of_its_step():
    assert before(played().episode, 1).tolist() == [pytest.approx(np.nan, nan_ok=True), 0.0, 1.0]
    assert before(played().episode, 0).tolist() == [0.0, 0.0, 1.0]


def test_about_a_second_before_it_or_as_long_as_can_be():
    assert lead_of(played()) == 1  # of two explicit steps
    long = TimeAxis(0.9, 40)
    told = RewardDecomposition(np.zeros((3, 2, 41)), long)
    of = played(decomposition=told, expected=np.zeros((4, 41)), random=np.zeros(43, bool))
    assert lead_of(of) == 10
    assert lead_of(replace(of, seconds_per_step=1 / 15)) == 15


def test_a_strip_shows_what_came_and_nothing_that_is_to_come():
    strip = Strip(played(), width=320, size=12)
    ink = "#16202c"
    rewards = [pixels(strip.at(step), ink)[strip.line_at(0.5)].sum() for step in range(4)]
    assert rewards[:3] == [0, 0, 0]
    assert rewards[3] > 0
    columns = np.flatnonzero(pixels(strip.at(3), ink)[strip.line_at(0.5)])
    assert strip.column(2) <= columns.min() <= columns.max() < strip.column(3)


def test_captions_are_the_storys_own_sentences():
    told = explained().story
    assert told is not None
    texts = " ".join(caption.text for caption in captions(told))
    assert all(claim.sentence in texts for claim in told.moments)
    assert caption_at(captions(told), 0, 100) == told.start[0].sentence
    assert caption_at(captions(told), len(told.played.episode), 100).endswith(told.end[-1].sentence)
    assert caption_at(captions(told), 2, 1) == ""  # it has been read by then


def test_an_episode_has_a_frame_for_each_observation_and_rests_at_its_end():
    told = explained().story
    assert told is not None
    frames = [*episode_frames(told, sights(explained().agent, told.played.episode, 0), rate=4.0)]
    steps = len(told.played.episode)
    assert len(frames) == num_frames(told.played, 4.0) == steps + 1 + REST * 4
    assert {frame.shape for frame in frames} == {frames[0].shape}
    assert not any(side % 2 for side in frames[0].shape[:2])
    assert all((a != b).any() for a, b in itertools.pairwise(frames[: steps + 1]))
    picture = next(sights(explained().agent, told.played.episode, 0)).picture
    height, width, _ = picture.shape
    np.testing.assert_array_equal(frames[0][:height, :width], picture)


def test_an_episode_of_a_gymnasium_environment_is_played_again():
    agent = trdlab.agent(
        lambda observation: int(observation[2] > 0), env="CartPole-v1", name="a rule"
    )
    table = RewardDecomposition(np.ones((1, 2, 3)), TimeAxis(0.9, 2))

    class Ones:
        time_axis, future = table.time_axis, Future("a rule's policy")

        def decompose(self, observations: Any) -> RewardDecomposition:
            return RewardDecomposition(np.ones((len(observations), 2, 3)), self.time_axis)

    agent = replace(agent, estimator=Ones())
    (episode,) = agent.play(1, seed=3, max_steps=30)
    seen = [*sights(agent, episode, 3)]
    assert len(seen) == len(episode) + 1
    assert {sight.picture.shape for sight in seen} == {(400, 600, 3)}
    assert (seen[0].picture != seen[-1].picture).any()
    with pytest.raises(trdlab.errors.TrdlabError, match="when it was played again"):
        [*sights(agent, replace(episode, rewards=episode.rewards * 2), 3)]


def test_a_world_without_pictures_is_shown_as_text():
    (frame,) = {sight.picture.shape for sight in sights_of("tabular:FrozenLake-v1")}
    assert frame[2] == 3
    assert text_frame(["one", "two"]).shape[0] % 2 == 0


def sights_of(name: str) -> list[Sight]:
    told = explained(name).story
    assert told is not None
    return [*sights(explained(name).agent, told.played.episode, 0)]


def test_trust_makes_pale_what_lies_beyond():
    told = explained().story
    assert told is not None
    trust = Trust(told.played.episode.time_axis, ("good", "bad", "bad", "bad", "bad"))
    seen = sights_of("gridworld:drone")
    plain, pale = (
        next(episode_frames(told, iter(seen), rate=4.0, trust=of)) for of in (None, trust)
    )
    assert (
        pixels(plain, action_colours(told.played.action_names)["down"]).sum()
        > pixels(pale, action_colours(told.played.action_names)["down"]).sum()
    )


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_the_same_seed_makes_the_same_video(tmp_path: Path, suffix: str):
    paths = [tmp_path / f"{name}{suffix}" for name in "ab"]
    told: list[tuple[int, int]] = []
    for path in paths:
        explained().to_video(path, watch=lambda done, count: told.append((done, count)))
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert told[-1][0] == told[-1][1] == len(told) // 2


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"what": "salience"}, "Did you mean 'saliency'"),
        ({"rate": 0.0}, "The rate is 0"),
        ({"what": "saliency"}, "has no maps of where it looks"),
        ({"what": "components"}, "has no maps of where it looks"),
    ],
)
def test_what_cannot_be_made_is_refused(tmp_path: Path, how: dict[str, Any], message: str):
    with pytest.raises(InputError, match=message):
        save_video(explained(), tmp_path / "a.gif", **how)
    assert list(tmp_path.iterdir()) == []


def test_an_explanation_without_its_episode_makes_none(tmp_path: Path):
    alone = trdlab.explain(trdlab.agent("gridworld:drone"), parts="forecast", episodes=0)
    with pytest.raises(InputError, match="has no episode"):
        alone.to_video(tmp_path / "a.gif")


# ---- maps --------------------------------------------------------------------------------------


def test_a_map_covers_what_it_speaks_of_and_darkens_the_rest():
    picture = np.full((8, 8, 3), 100, np.uint8)
    plain = overlaid(picture, np.zeros((2, 2)))
    assert (plain < 100).all()
    over = overlaid(picture, np.array([[2.0, 0.0], [0.0, -1.0]]))
    assert over[0, 0].tolist() == [255, 176, 0]  # it raises what is expected
    assert over[-1, -1].tolist() == [63, 183, 255]  # it lowers it
    assert (over[-1, 0] == plain[-1, 0]).all()


class Eyes:
    """Expects of each component what a pixel of its own shows."""

    time_axis, future = TimeAxis(0.9, 3), Future("nobody's policy")

    def decompose(self, observations: Any) -> RewardDecomposition:
        rows = np.repeat(observations[:, -1, :1, :4].astype(float), 2, axis=1)
        return RewardDecomposition(rows, self.time_axis)

    def saliency(self, observations: Any, actions: Any, *, layer: int = 0) -> np.ndarray:
        maps = np.zeros((len(observations), 4, 8, 8))
        for component in range(4):
            maps[:, component, 0, component] = observations[:, -1, 0, component]
        return maps


def looking() -> tuple[Any, Episode, list[Sight]]:
    agent = replace(
        trdlab.agent("gridworld:drone"), estimator=Eyes(), action_names=NAMES, world=None
    )
    seen = np.zeros((4, 1, 8, 8), np.uint8)
    seen[:, 0, 0, 0], seen[:, 0, 0, 3] = 50, 100
    told = RewardDecomposition(np.zeros((3, 2, 4)), Eyes.time_axis)
    episode = played(
        decomposition=told, expected=np.zeros((4, 4)), random=np.zeros(6, bool)
    ).episode
    return agent, episode, [Sight(np.zeros((40, 40, 3), np.uint8), one) for one in seen]


def test_near_and_far_are_shown_beside_each_other_at_every_step():
    agent, episode, seen = looking()
    frames = [*saliency_frames(agent, episode, iter(seen), (Group(0, 0), Group(3, 3)))]
    assert len(frames) == len(episode)
    assert {frame.shape for frame in frames} == {frames[0].shape}
    assert not any(side % 2 for side in frames[0].shape[:2])


def test_every_component_has_its_turn():
    agent, _, seen = looking()
    frames = [*component_frames(agent, seen[0].observation, seen[0].seen, 1, step=0)]
    assert len(frames) == 4
    assert all((a != b).any() for a, b in itertools.combinations(frames, 2))


def test_only_pictures_can_be_laid_maps_over():
    with pytest.raises(InputError, match="The agent sees no picture"):
        _ = Sight(np.zeros((8, 8, 3), np.uint8), np.zeros(4)).seen
