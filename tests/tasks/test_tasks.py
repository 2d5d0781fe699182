from dataclasses import replace

import numpy as np
import pytest

from flyrl.tasks import TASKS, Episode, Task
from flyrl.tasks.episode import draw_oscillators
from flyrl.tasks.velocity import commanded_way
from flyrl.terrains import LITERATURE, TERRAINS, Flat
from tests.tasks.test_terms import fly_state, task_state

HEADING = TASKS["heading"]()
PATH = TASKS["path"]()
TARGET = TASKS["target"]()
VELOCITY = TASKS["velocity"]()
SIDES = np.array([-1, 1])


def test_oscillators_are_drawn_phases_first() -> None:
    phases, magnitudes = draw_oscillators(7)
    random_state = np.random.RandomState(7)
    np.testing.assert_array_equal(phases, random_state.uniform(0, 2 * np.pi, 6))
    np.testing.assert_array_equal(magnitudes, random_state.uniform(0, 1, 6))


@pytest.mark.parametrize("terrain", LITERATURE)
def test_paths_are_smooth_start_at_the_fly_and_stay_on_the_terrain(terrain: str) -> None:
    config = TERRAINS[terrain]
    bounds = config.bounds
    for seed in range(20):
        episode = PATH.sample_episode(config, seed)
        path = np.array(episode.command).reshape(-1, 2)
        np.testing.assert_allclose(path[0], episode.spawn_position_w[:2])
        np.testing.assert_allclose(path[-1], episode.goal)
        steps = np.diff(path, axis=0)
        np.testing.assert_allclose(np.linalg.norm(steps, axis=1), 0.5)
        turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
        assert np.abs(turns).max() <= 0.5 / 5 + 1e-9
        assert bounds.x_min < path[:, 0].min() <= path[:, 0].max() < bounds.x_max
        assert bounds.y_min < path[:, 1].min() <= path[:, 1].max() < bounds.y_max


@pytest.mark.parametrize(
    ("name", "term", "needed"), [("heading", "on_heading", 2.0), ("velocity", "on_command", 3.0)]
)
def test_success_in_time_is_a_total_of_seconds(name: str, term: str, needed: float) -> None:
    decisions = round(needed / 0.02)
    total = sum([0.02] * decisions)  # as the environment adds it up
    state = task_state(fly_state(2), **{term: [total - 0.02, total]})
    assert TASKS[name]().succeeds_in_time(state).tolist() == [False, True]


def test_a_path_counts_only_if_it_was_kept_to() -> None:
    fly = fly_state(2, time=[2.0, 2.0])
    state = task_state(fly, goal=[[0.5, 0]] * 2, deviation=[1.9, 2.1])
    success = PATH.terminations[0]
    assert success.is_success
    assert success.holds(state).tolist() == [True, False]


def test_a_fly_that_is_off_a_narrow_path_has_failed_and_pays_for_the_time_that_is_left() -> None:
    task = TASKS["path"](width=2)
    straight = np.stack([np.arange(49) / 2, np.zeros(49)], axis=1).ravel()
    fly = fly_state(2, position_w=[[5, 1.9, 1], [5, -2.1, 1]])
    state = task_state(fly, goal=[[24, 0]] * 2, command=[straight] * 2, deviation=[0.0, 0.0])
    assert task.outcomes[-1] == "left_path"
    assert task.terminations[-1].holds(state).tolist() == [False, True]
    lost = next(term for term in task.reward if term.name == "lost_time")
    np.testing.assert_allclose(lost.compute(state), [0.0, 2.0])  # 100 decisions of 0.02 s
    assert "left_path" not in PATH.outcomes


@pytest.mark.parametrize("terrain", LITERATURE)
def test_the_easiest_episodes_lead_straight_ahead(terrain: str) -> None:
    config = TERRAINS[terrain]
    for seed in range(10):
        target = TARGET.sample_episode(config, seed, 0.0)
        x, y, _ = target.spawn_position_w
        np.testing.assert_allclose(target.goal, [x + 5, y])
        path = PATH.sample_episode(config, seed, 0.0)
        points = np.array(path.command).reshape(49, 2)
        ahead = np.minimum(np.arange(49), 24) * 0.5  # 12 mm, and then the last point again
        np.testing.assert_allclose(points, np.stack([x + ahead, np.full(49, y)], axis=1))
        np.testing.assert_allclose(path.goal, points[-1])
        heading = HEADING.sample_episode(config, seed, 0.0)
        assert heading.command == (0.0,)
        assert heading.pushes[1::2] == (0.0, 0.0)
        command = VELOCITY.sample_episode(config, seed, 0.0).command
        np.testing.assert_array_equal(np.reshape(command, (4, 2)), [[7.0, 0.0]] * 4)


@pytest.mark.parametrize("difficulty", [0.5, 1.0])
def test_ranges_are_as_wide_as_the_difficulty(difficulty: float) -> None:
    def drawn(task: Task, count: int = 300) -> list[Episode]:
        return [task.sample_episode(Flat(), seed, difficulty) for seed in range(count)]

    def is_spread(values: object, low: float, high: float) -> bool:
        margin = 0.05 * (high - low)
        found = np.min(values), np.max(values)
        return low <= found[0] < low + margin and high - margin < found[1] <= high + 1e-9

    offsets = np.array([np.subtract(e.goal, e.spawn_position_w[:2]) for e in drawn(TARGET)])
    assert is_spread(np.hypot(*offsets.T), 5, 5 + 10 * difficulty)
    assert is_spread(np.arctan2(offsets[:, 1], offsets[:, 0]), *(np.pi * difficulty * SIDES))
    headings = drawn(HEADING)
    assert is_spread([each.command[0] for each in headings], *(np.pi * difficulty * SIDES))
    first, strength, second, other = np.transpose([each.pushes for each in headings])
    assert is_spread(first, 1, 2)
    assert is_spread(second, 2.5, 3.5)
    for strengths in (strength, other):
        assert is_spread(np.abs(strengths), 4 * difficulty, 8 * difficulty)
        assert 105 < (strengths > 0).sum() < 195
    paths = [np.reshape(each.command, (49, 2)) for each in drawn(PATH)]
    firsts = [np.arctan2(*(path[1] - path[0])[::-1]) for path in paths]
    assert 0.9 * np.pi * difficulty < np.abs(firsts).max() <= np.pi * difficulty + 0.05
    speeds, yaw_rates = np.reshape([each.command for each in drawn(VELOCITY)], (-1, 2)).T
    assert is_spread(speeds, *(7 + 5 * difficulty * SIDES))
    assert is_spread(yaw_rates, *(2.5 * difficulty * SIDES))


@pytest.mark.parametrize("terrain", LITERATURE)
def test_targets_lie_on_the_terrain(terrain: str) -> None:
    bounds = TERRAINS[terrain].bounds
    episodes = [TARGET.sample_episode(TERRAINS[terrain], seed) for seed in range(300)]
    x, y = np.transpose([episode.goal for episode in episodes])
    assert bounds.x_min < x.min() < x.max() < bounds.x_max
    assert bounds.y_min < y.min() < y.max() < bounds.y_max
    assert np.abs([episode.spawn_position_w[:2] for episode in episodes]).max() <= 2


def test_targets_lie_where_the_parameters_say() -> None:
    task = TASKS["target"](distance=(20, 30), bearing=90)
    for seed in range(100):
        episode = task.sample_episode(Flat(), seed)
        offset = np.subtract(episode.goal, episode.spawn_position_w[:2])
        assert 20 <= np.hypot(*offset) <= 30
        assert offset[0] >= 0


def test_a_reach_says_when_a_target_is_reached() -> None:
    task = TASKS["target"](reach=2)
    heights = [[0, 0, 5], [0, 0, 0]]  # do not matter
    state = task_state(fly_state(2, position_w=heights), goal=[[1.9, 0], [2.1, 0]])
    assert task.terminations[0].holds(state).tolist() == [True, False]
    reward = {term.name: term for term in task.reward}
    assert reward["success"].compute(state).tolist() == [1.0, 0.0]
    assert task.success == "thorax within 2 mm of the target"


def test_a_longer_episode_of_velocity_has_more_commands() -> None:
    # a command every 0.5 s for 6 s
    task = TASKS["velocity"](time_limit=6, command_time=0.5, speed=(5, 5), yaw_rate=(0, 1))
    command = np.reshape(task.sample_episode(Flat(), 3).command, (-1, 2))
    assert command.shape == (12, 2)
    assert set(command[:, 0]) == {5.0}
    assert 0 <= command[:, 1].min() < command[:, 1].max() <= 1


def test_commands_of_speed_and_yaw_rate_lead_along_lines_and_circles() -> None:
    # 10 mm ahead from (1, 2), then half a circle to the left with a radius of 10 mm / pi
    episode = Episode(0, (1.0, 2.0, 0.0), 0.0, ())
    x, y = commanded_way(episode, np.array([[10.0, 0.0], [10.0, np.pi]]), 1.0)
    assert (x[9], y[9]) == pytest.approx((11.0, 2.0))
    assert (x[-1], y[-1]) == pytest.approx((11.0, 2.0 + 20 / np.pi), rel=5e-3)


@pytest.mark.parametrize("terrain", LITERATURE)
def test_commands_of_speed_and_yaw_rate_lead_along_the_terrain(terrain: str) -> None:
    bounds = TERRAINS[terrain].bounds
    for seed in range(20):
        episode = VELOCITY.sample_episode(TERRAINS[terrain], seed)
        x, y = commanded_way(episode, np.reshape(episode.command, (-1, 2)), 1.0)
        assert bounds.x_min < x.min() <= x.max() < bounds.x_max
        assert bounds.y_min < y.min() <= y.max() < bounds.y_max


def test_tolerances_of_velocity_say_who_is_on_command() -> None:
    task = TASKS["velocity"](tolerance=(1, 1), on_command=0.5)
    state = task_state(
        fly_state(2, time=[0.52, 0.52]),
        fly_state(2, time=[0.5, 0.5]),
        command=[[5, 0]] * 2,
        means={"velocity": [[5.9, 0.0], [6.1, 0.0]]},
        on_command=[0.5, 0.4],
    )
    on_command = task.reward[1].compute(state)
    np.testing.assert_allclose(on_command, [0.02, 0.0], atol=1e-12)
    assert task.succeeds_in_time(state).tolist() == [True, False]
    np.testing.assert_allclose(task.errors[0].compute(state), [0.9, 1.1])


def test_a_path_is_as_long_as_asked_and_shows_what_lies_ahead() -> None:
    task = TASKS["path"](length=10, look_ahead=1)
    episode = task.sample_episode(Flat(), 0)
    points = np.reshape(episode.command, (-1, 2))
    assert len(points) == 21  # 0.5 mm apart
    straight = np.stack([np.arange(21) / 2, np.zeros(21)], axis=1)
    state = task_state(fly_state(position_w=[[0, 1, 1]]), command=[straight.ravel()])
    expected = np.array([1, -1]) / np.sqrt(2)
    np.testing.assert_allclose(task.observation[0].compute(state)[0], expected)


def test_a_heading_without_pushes() -> None:
    task = TASKS["heading"](push_times=[], turn=30, tolerance=5, kept=1)
    episodes = [task.sample_episode(Flat(), seed) for seed in range(100)]
    assert {episode.pushes for episode in episodes} == {()}
    turns = np.rad2deg([episode.command[0] for episode in episodes])
    assert 25 < np.abs(turns).max() <= 30
    assert task.success == "within 5 degrees of the heading for 1 s"


def test_the_finish_line_ends_the_ground() -> None:
    task = TASKS["traverse"](finish_line=10)
    state = task_state(fly_state(2, position_w=[[9.9, 0, 1], [10.1, 0, 1]]))
    assert task.terminations[0].holds(state).tolist() == [False, True]
    np.testing.assert_allclose(task.observation[1].compute(state), [[0.1 / 15], [-0.1 / 15]])


def test_a_worm_has_a_way_and_a_bend_as_asked() -> None:
    # 5 segments of a worm are 18 mm
    crawl = TASKS["worm_crawl"](lengths=0.5)
    assert crawl.succeeds_in_time.keywords == {"way": 9.0}
    hang = TASKS["worm_hang_box"](bend=0.5, tolerance=0.3)
    bends = [hang.sample_episode(Flat(), seed).command[0] for seed in range(100)]
    assert 0.4 < np.abs(bends).max() <= 0.5
    assert hang.success == "within 0.3 rad of the bend at the end"


def test_targets_and_headings_lie_in_every_direction() -> None:
    targets = [TARGET.sample_episode(Flat(), seed) for seed in range(400)]
    offsets = np.array([np.subtract(each.goal, each.spawn_position_w[:2]) for each in targets])
    headings = [HEADING.sample_episode(Flat(), seed).command[0] for seed in range(400)]
    for angles in (np.arctan2(offsets[:, 1], offsets[:, 0]), headings):
        counts, _ = np.histogram(angles, bins=8, range=(-np.pi, np.pi))
        assert counts.min() > 25


@pytest.mark.parametrize("name", TASKS)
def test_an_episode_follows_from_its_seed_and_difficulty(name: str) -> None:
    task = TASKS[name]()
    assert task.sample_episode(Flat(), 5) == task.sample_episode(Flat(), 5)
    assert task.sample_episode(Flat(), 5) != task.sample_episode(Flat(), 6)
    easy, usual = (task.sample_episode(Flat(), 5, difficulty) for difficulty in (0.0, 1.0))
    assert (replace(easy, difficulty=1.0) != usual) == bool(task.difficulty)
    for terrain in LITERATURE:
        assert task.sample_episode(TERRAINS[terrain], 3, 0.3).difficulty == 0.3


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("target", {"distance": (60, 80)}, r"task\.distance must leave a target room"),
        ("path", {"length": 400, "radius": 1000}, r"task\.length must leave a path room"),
        ("traverse", {"finish_line": 300}, r"task\.finish_line must lie on the terrain, below x ="),
    ],
)
def test_a_terrain_that_is_too_small_is_refused(name, parameters, message, monkeypatch) -> None:
    monkeypatch.setattr("flyrl.tasks.path.MOST_DRAWS", 100)
    with pytest.raises(ValueError, match=message):
        TASKS[name](**parameters).sample_episode(TERRAINS["blocks"], 0)
