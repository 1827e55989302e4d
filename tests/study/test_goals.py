"""The goal study: no part alone tells a goal, all together do, and its kits give none away."""

import json
import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import trdlab
from trdlab.decomposition import TimeAxis
from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.networks import build_network
from trdlab.errors import InputError, OutputError
from trdlab.estimator import Future
from trdlab.gridworld.world import State
from trdlab.study.design import GOAL_STUDY
from trdlab.study.goals.game import DANGER, FLAG, GOALS, SLIP, Game, draw_game, is_fair
from trdlab.study.goals.kit import Kit, blocks, key, kit_of, own_kit, write_kit
from trdlab.study.goals.known import Clips, moment_at, saliency_at
from trdlab.study.goals.trials import Trial, draw_pasts, draw_trials, trials_of
from trdlab.study.scoring import read_key, score

GIVEN_AWAY = re.compile(
    r"coin|treasure|hazard|circle|square|triangle|\bmap\b|goal|\bminds?\b|wants?\b", re.I
)


@pytest.fixture(scope="module")
def game() -> Game:
    return draw_game(np.random.default_rng(5))


@pytest.fixture(scope="module")
def trials() -> dict[str, Trial]:
    return {trial.letter: trial for trial in draw_trials(3)}


@pytest.fixture(scope="module")
def others() -> dict[str, Trial]:
    return {trial.letter: trial for trial in draw_trials(4)}


@pytest.fixture(scope="module")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half of a kit: pictures take time."""
    folder, whole = tmp_path_factory.mktemp("goals") / "kit", own_kit(3)
    write_kit(folder, replace(whole, trials=whole.trials[:2]))
    return folder


def bars(trial: Trial) -> np.ndarray:
    """`[moments, 2, N+1]`, of the action and of its foil."""
    return np.array(
        [
            [of.choice.moment.components(name) for name in (of.choice.action, of.choice.foil)]
            for of in trial.glances
        ]
    )


def frames(clips: tuple[Clips, ...]) -> list[np.ndarray | None]:
    return [frame for of in clips for strip in of.strips for frame in strip]


def by_numbers(trial: Trial) -> str:
    """Answers as a reader would: a cost is expected or not, and what was taken in the clips.

    The picture just before a reward of 1 and the one when it comes tell which thing has gone: of
    the two kinds, the one whose colour there is less of.
    """
    before, at, _ = trial.clips[0].strips[0]
    orange, blue = ((230, 159, 0), (0, 114, 178))
    gone = [_count(before, colour) - _count(at, colour) for colour in (orange, blue)]
    thing = "CD" if gone[0] > gone[1] else "AB"
    return thing[int(bars(trial).min() < -0.05)]


def _count(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((picture == colour).all(axis=-1).sum())


# ---- the game ------------------------------------------------------------------------------------


def test_each_map_is_its_own_mirror_image_but_for_the_two_kinds():
    for seed in range(4):
        drawn = draw_game(np.random.default_rng(seed))
        cells = np.array([list(row) for row in drawn.grid.rows])
        swapped = np.where(cells == "c", "t", np.where(cells == "t", "c", cells))
        mirrored = swapped[::-1] if cells.shape == (7, 10) else swapped[:, ::-1]
        assert np.array_equal(cells, mirrored)
        assert [(cells == x).sum() for x in "ctE"] == [2, 2, 1]


def test_what_is_expected_is_exact_for_what_pays(game: Game):
    """One step before a triangle's corridor: each side has it with half the chance of a slip."""
    first = game.states[0]
    for goal in GOALS:
        agent = game.agents[goal.candidate.letter]
        moment = moment_at(agent, np.int64(first))
        taken = moment.components(moment.choice().action)
        cost = 0.95 * SLIP * DANGER * 0.94 * goal.minds  # there after no slip, then to either side
        assert taken[:2] == pytest.approx([0.0, cost], abs=1e-12)
        assert taken[-1] == pytest.approx(0.0, abs=0.01)  # all of it is shown step by step


def test_a_game_that_gives_a_goal_away_is_not_fair(game: Game):
    assert is_fair(game)
    lopsided = tuple("\n".join(game.grid.rows).replace("t", ".", 1).split("\n"))
    assert not is_fair(Game(replace(game.grid, rows=lopsided), game.stops))


# ---- what each part tells ------------------------------------------------------------------------


def test_all_four_are_shown_at_the_same_moments_and_do_the_same(trials: dict[str, Trial]):
    for one, other in ((trials["A"], trials[x]) for x in "BCD"):
        for a, b in zip(one.glances, other.glances, strict=True):
            assert np.array_equal(a.picture, b.picture)
            assert (a.step, a.choice.action, a.choice.foil) == (
                b.step,
                b.choice.action,
                b.choice.foil,
            )


def test_bars_and_sentences_tell_only_who_minds_triangles(trials: dict[str, Trial]):
    for one, other in ("AC", "BD"):
        np.testing.assert_allclose(bars(trials[one]), bars(trials[other]), atol=1e-9)
        assert _sentences(trials[one]) == _sentences(trials[other])
    assert bars(trials["A"]).min() >= 0.0
    assert (bars(trials["B"]).min(axis=(1, 2)) < -0.1).all()  # at every moment


def _sentences(trial: Trial) -> list[str]:
    return key(_kit([trial]))["trials"][0]["sentences"]


def _kit(of: list[Trial]) -> Kit:
    return Kit(of, [goal.candidate for goal in GOALS], 0)


def test_clips_and_saliency_tell_only_what_is_wanted(trials: dict[str, Trial]):
    for one, other in ("AB", "CD"):
        pair = trials[one], trials[other]
        assert [of.caption for of in pair[0].clips] == [of.caption for of in pair[1].clips]
        for a, b in zip(*(frames(of.clips) for of in pair), strict=True):
            assert (a is None and b is None) or np.array_equal(a, b)
        for a, b in zip(*(of.glances for of in pair), strict=True):
            np.testing.assert_allclose(a.saliency, b.saliency, atol=1e-9)
    assert not np.array_equal(frames(trials["A"].clips)[1], frames(trials["C"].clips)[1])
    assert not np.allclose(trials["A"].glances[0].saliency, trials["C"].glances[0].saliency)


def test_saliency_is_what_would_be_lost_without_a_thing(game: Game):
    agent, state = game.agents["A"], game.states[0]
    number = agent.action_names.index(moment_at(agent, np.int64(state)).choice().action)
    found, world, lost = saliency_at(agent, np.int64(state), number), agent.world, {}
    worth = agent.estimator.decomposition.value[:, number]
    for row, column in np.ndindex(*found.shape):
        if world.grid.cell(row, column).kind == "coin":
            place = world.states[state].place
            other = world.states.index(State(*place, frozenset({(row, column)})))
            lost[row, column] = worth[state] - worth[other]
    assert found.max() == 1.0
    assert np.count_nonzero(found) == len(lost) == 2
    for place, value in lost.items():
        assert found[place] == pytest.approx(value / max(lost.values()))


def test_all_parts_together_tell_the_goal(trials: dict[str, Trial], others: dict[str, Trial]):
    for trial in (*trials.values(), *others.values()):
        assert by_numbers(trial) == trial.letter


def test_in_the_past_that_is_shown_nobody_touches_a_triangle(game: Game):
    for past in draw_pasts(game, np.random.default_rng(0)).values():
        for of in past.recorded:
            places = [game.world.states[s].place for s in of.episode.states.tolist()]
            assert "hazard" not in {game.grid.cell(*place).kind for place in places}
        assert {one.reward for one in past.gallery.came} == {1.0, FLAG}


# ---- the kit -------------------------------------------------------------------------------------


def test_a_kit_has_a_page_and_a_folder_for_each_group(kit: Path):
    names = [*GOAL_STUDY.groups, *(f"{of}.html" for of in GOAL_STUDY.groups), "answers.json"]
    assert sorted(path.name for path in kit.iterdir()) == sorted(names)
    pictures = {of: sorted(path.name for path in (kit / of).glob("trial-1-*")) for of in names[:4]}
    moments, clips = ([f"trial-1-{x}-{i}.png" for i in (1, 2, 3)] for x in ("moment", "clips"))
    assert pictures["bars"] == pictures["saliency"] == moments
    assert pictures["clips"] == clips[:2]
    assert pictures["report"] == clips[:2] + moments


def test_the_same_seed_makes_the_same_kit_and_another_one_another(
    trials: dict[str, Trial], others: dict[str, Trial], kit: Path
):
    own = json.loads((kit / "answers.json").read_text())
    assert own["answers"] == "".join(trials)[:2]
    assert own["trials"] == key(_kit(list(trials.values())))["trials"][:2]
    first = next(iter(trials.values()))
    for block in blocks(first, "report"):
        assert block.picture == (kit / "report" / f"trial-1-{block.name}.png").read_bytes()
    assert not np.array_equal(others["A"].glances[0].picture, trials["A"].glances[0].picture)


@pytest.mark.parametrize("group", GOAL_STUDY.groups)
def test_nothing_that_is_shown_names_a_goal_or_what_pays(group: str, kit: Path):
    questions = (kit / group / "questions.txt").read_text()
    page = (kit / f"{group}.html").read_text()
    shown = re.sub(r"Which goal does it have\?.*", "", questions.partition("Trial 1 of 2")[2])
    assert GIVEN_AWAY.findall(shown) == []
    first = page.partition("<fieldset>")[2].partition("</fieldset>")[0].partition('"ask"')[0]
    assert GIVEN_AWAY.findall(re.sub(r'src="[^"]*"', "", first)) == []
    answers = json.loads((kit / "answers.json").read_text())
    for trial in answers["trials"]:
        assert trial["reason"] not in page + questions
    assert f'"{answers["answers"]}"' not in page
    hidden = re.search(r'<script id="key"[^>]*>([^<]*)</script>', page)
    assert json.loads(b64decode(hidden[1]))["answers"] == answers["answers"]


@pytest.mark.parametrize("group", GOAL_STUDY.groups)
def test_controls_see_nothing_but_their_part(group: str, kit: Path):
    questions = (kit / group / "questions.txt").read_text()
    assert ("Why " in questions) == (group == "report")
    assert ("came" in questions.partition("Trial 1")[2]) == (group in ("report", "clips"))
    alts = re.findall(r'alt="([^"]*)"', (kit / f"{group}.html").read_text())
    assert any("Bars of" in alt for alt in alts) == (group in ("report", "bars"))


def test_sentences_to_readers_are_short(kit: Path):
    head = (kit / "report" / "questions.txt").read_text().partition("-----")[0]
    paragraphs = (words for words in head.split("\n\n") if not words.startswith("  A"))
    told = (s for paragraph in paragraphs for s in re.split(r"[.:?]\s", paragraph))
    assert all(len(sentence.split()) <= 25 for sentence in told)


def test_a_page_loads_nothing(kit: Path):
    page = (kit / "report.html").read_text()
    assert not re.search(r"https?:|@import|url\(|(src|href)=\"(?!data:)", page)
    assert "default-src 'none'; img-src data:;" in page


def test_no_kit_is_replaced(kit: Path, tmp_path: Path):
    with pytest.raises(OutputError, match=r"report.html' exists. Choose another `out`."):
        write_kit(kit, _kit([]))
    (tmp_path / "clips").mkdir()
    with pytest.raises(OutputError, match=r"The folder '.*clips' exists"):
        write_kit(tmp_path, _kit([]))


@pytest.mark.parametrize("count", [0, 3, 6, 20])
def test_trials_come_by_four(count: int):
    with pytest.raises(InputError, match=rf"There cannot be {count} trials. Give a multiple of 4"):
        draw_trials(0, count)


def test_a_class_is_scored_beside_guessing_and_each_control(kit: Path):
    read = read_key(kit / "answers.json")
    right = read.answers
    given = {"report": {"Ada": right}, "bars": {"Ben": right[0] * 2}, "clips": {"Cleo": "--"}}
    found = score(read, given)
    assert found.groups["report"].overall.p_value == pytest.approx(0.25**2)
    assert found.groups["bars"].overall.right == 1
    assert found.help["bars"].difference.value == pytest.approx(0.5)
    assert found.help["clips"].p_value == 1 / 4
    assert found.help.keys() == {"bars", "clips"}
    with pytest.raises(InputError, match=r"no group 'q'. Its groups are report, bars, saliency,"):
        score(read, {"q": {"Ada": right}})
    with pytest.raises(InputError, match=r"Write A, B, C, D, or - for none"):
        score(read, {"report": {"Ada": "AE"}})


# ---- agents of one's own -------------------------------------------------------------------------


class Flashes(gym.Env):
    """Three grey screens; at the second, action 1 pays what the goal says, and shows it."""

    observation_space = gym.spaces.Box(0, 255, (84, 84), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, pays: float = 2.0) -> None:
        self.pays = pays

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return self._seen(), {}

    def step(self, action):
        self.count += 1
        reward = self.pays * (self.count == 2)
        return self._seen(), reward, self.count == 12, False, {}

    def _seen(self):
        return np.full((84, 84), 20 * self.count, dtype=np.uint8)


def agent_of(pays: float, env=None):
    axis, env = TimeAxis(0.9, 3), env or Flashes(pays)
    network = build_network(gym.spaces.Box(0, 255, (1, 84, 84), np.uint8), 2, axis, seed=0)
    estimator = NetworkEstimator(network, axis, Future("the greedy policy of the network"))
    return trdlab.agent(estimator, env, action_names=("go", "stop"))


def test_four_agents_of_ones_own_are_asked_about():
    pays = {"A": 2.0, "B": -1.0, "C": 5.0, "D": 0.0}
    own = {letter: agent_of(value) for letter, value in pays.items()}
    asked = trials_of(own, seed=1)
    assert sorted(trial.letter for trial in asked) == [*pays]
    by_letter = {trial.letter: trial for trial in asked}
    assert [of.step for of in by_letter["A"].glances] == [2, 5, 8]
    captions = {letter: of.clips[0].caption for letter, of in by_letter.items()}
    assert captions["A"] == captions["C"] == "A reward of 1 came 4 times."  # in its own unit
    assert captions["B"] == "A cost of 1 came 4 times."
    assert captions["D"].startswith("In 4 episodes with 48 steps, no reward came.")
    before, at, after = by_letter["A"].clips[0].strips[0]
    assert [of[0, 0, 0] for of in (before, at, after)] == [0, 40, 120]
    assert by_letter["D"].clips[0].strips == ()
    # amounts are told in units of the largest that came
    one, other = (by_letter[x].glances[0].choice.moment.q_values for x in "AC")
    np.testing.assert_allclose(2.0 * one, 5.0 * other, rtol=1e-6)
    assert by_letter["A"].glances[0].saliency.shape == (20, 20)  # the network's first convolution
    assert asked[0].groups == tuple(GOAL_STUDY.groups)


def test_a_table_of_a_map_is_shown_without_what_it_pays():
    named = [f"goal {i}=gridworld:drone,treasure={i}" for i in (1, 2, 3, 4)]
    made = kit_of(named, seed=0)
    assert [of.about for of in made.candidates] == ["goal 1", "goal 2", "goal 3", "goal 4"]
    assert not made.is_own_game
    shown = {of.letter: of.glances[0].picture for of in made.trials}
    assert np.array_equal(shown["A"], shown["D"])


@pytest.mark.parametrize(
    ("named", "message"),
    [
        (["a=gridworld:drone"], "There is 1 goal. Give 4 different ones, each with its agent."),
        (["a=gridworld:drone"] * 4, "There is 1 goal."),
        (["gridworld:drone"], "'gridworld:drone' is no goal and agent. Write GOAL=AGENT."),
        ([f"{x}=gridworld:nowhere" for x in "abcd"], "There is no map 'nowhere'"),
        (
            [*(f"{x}=gridworld:drone" for x in "abc"), "d=gridworld:ledge"],
            "'ledge' does not fit the agent",
        ),
    ],
)
def test_agents_that_cannot_be_asked_about_are_refused(named: list[str], message: str):
    with pytest.raises(InputError, match=message):
        kit_of(named, 0)


def test_agents_of_whom_nothing_is_known_or_seen_are_refused():
    blind = trdlab.agent(lambda seen: 0, Flashes(), action_names=("go", "stop"))
    with pytest.raises(InputError, match=r"what the agent of goal B expects. Fit it first."):
        trials_of({"A": agent_of(1.0), "B": blind}, 0)
    unseen = trdlab.agent("tabular:FrozenLake-v1")
    with pytest.raises(InputError, match=r"nothing to see of 'FrozenLake-v1'"):
        trials_of({"A": unseen}, 0)
