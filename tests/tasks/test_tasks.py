"""Episodes of the tasks: places, ranges by difficulty, and ends."""

from dataclasses import replace

import numpy as np
import pytest

from flyrl.tasks import TASKS, Episode, Task
from flyrl.tasks.chase import revolved
from flyrl.tasks.episode import draw_oscillators
from flyrl.tasks.velocity import commanded_way
from flyrl.terrains import LITERATURE, TERRAINS, Flat
from tests.tasks.test_terms import fly_state, task_state

HEADING = TASKS["heading"]()
PATH = TASKS["path"]()
TARGET = TASKS["target"]()
VELOCITY = TASKS["velocity"]()
SIDES = np.array([-1, 1])


def course(episode: Episode) -> np.ndarray:
    """Places of a moving target in 4 s, (k, 3)."""
    times = np.linspace(0.0, 4.0, 9)
    start, command = (np.tile(each, (9, 1)) for each in (episode.props, episode.command))
    return revolved(start, times, command)


PLACES = {
    "target": lambda episode: np.array([episode.goal]),
    "path": lambda episode: np.reshape(episode.command, (-1, 2)),
    "velocity": lambda episode: commanded_way(episode, np.reshape(episode.command, (-1, 2)), 1.0).T,
    "slalom": lambda episode: np.reshape(episode.props, (-1, 3)),
    "chase": course,
}
"""Where an episode of a task leads, mm, (k, 2 or 3)."""


def drawn(task: Task, count: int, difficulty: float = 1.0) -> list[Episode]:
    return [task.sample_episode(Flat(), seed, difficulty) for seed in range(count)]


def offset(episode: Episode) -> np.ndarray:
    """From the start to the goal, mm."""
    return np.subtract(episode.goal, episode.spawn_position_w[:2])


def is_spread(values: object, low: float, high: float) -> bool:
    """Whether values fill a range but for a twentieth at either end."""
    margin = 0.05 * (high - low)
    found = np.min(values), np.max(values)
    return low <= found[0] < low + margin and high - margin < found[1] <= high + 1e-9


def test_oscillators_are_drawn_phases_first() -> None:
    random_state = np.random.RandomState(7)
    expected = [random_state.uniform(0, high, 6) for high in (2 * np.pi, 1)]
    np.testing.assert_array_equal(draw_oscillators(7), expected)


@pytest.mark.parametrize("terrain", LITERATURE)
@pytest.mark.parametrize("name", PLACES)
def test_all_that_an_episode_leads_to_lies_on_the_terrain(name: str, terrain: str) -> None:
    bounds, task = TERRAINS[terrain].bounds, TASKS[name]()
    episodes = [task.sample_episode(TERRAINS[terrain], seed) for seed in range(40)]
    x, y = np.concatenate([PLACES[name](episode)[:, :2] for episode in episodes]).T
    assert bounds.x_min < x.min() < x.max() < bounds.x_max
    assert bounds.y_min < y.min() < y.max() < bounds.y_max
    assert np.abs([episode.spawn_position_w[:2] for episode in episodes]).max() <= 2


def test_paths_are_smooth_and_lead_from_the_fly_to_the_goal() -> None:
    for episode in drawn(PATH, 20):
        path = np.array(episode.command).reshape(-1, 2)
        np.testing.assert_allclose(path[0], episode.spawn_position_w[:2])
        np.testing.assert_allclose(path[-1], episode.goal)
        steps = np.diff(path, axis=0)
        np.testing.assert_allclose(np.linalg.norm(steps, axis=1), 0.5)
        turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
        assert np.abs(turns).max() <= 0.5 / 5 + 1e-9


@pytest.mark.parametrize(
    ("name", "term", "needed"), [("heading", "on_heading", 2.0), ("velocity", "on_command", 3.0)]
)
def test_success_in_time_is_a_total_of_seconds(name: str, term: str, needed: float) -> None:
    total = sum([0.02] * round(needed / 0.02))  # as the environment adds it up
    state = task_state(fly_state(2), **{term: [total - 0.02, total]})
    assert TASKS[name]().succeeds_in_time(state).tolist() == [False, True]


@pytest.mark.parametrize(("name", "is_shown"), [("stop", True), ("path", True), ("heading", False)])
def test_the_time_left_is_shown_where_a_success_ends_the_episode(name: str, is_shown: bool) -> None:
    task = TASKS[name]()
    ends = [end.outcome for end in task.terminations]
    assert ("time_left" in task.slices()) == is_shown == ("success" in ends)


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


def test_the_easiest_episodes_lead_straight_ahead() -> None:
    for seed in range(10):
        target, path, heading, velocity = (
            task.sample_episode(TERRAINS["mixed"], seed, 0.0)
            for task in (TARGET, PATH, HEADING, VELOCITY)
        )
        np.testing.assert_allclose(offset(target), [5, 0], atol=1e-12)
        ahead = np.minimum(np.arange(49), 24) * 0.5  # 12 mm, and then the last point again
        points = np.reshape(path.command, (49, 2)) - path.spawn_position_w[:2]
        np.testing.assert_allclose(points, np.stack([ahead, np.zeros(49)], axis=1), atol=1e-12)
        np.testing.assert_allclose(offset(path), points[-1])
        assert heading.command == (0.0,)
        assert heading.pushes[1::2] == (0.0, 0.0)
        np.testing.assert_array_equal(np.reshape(velocity.command, (4, 2)), [[7.0, 0.0]] * 4)


@pytest.mark.parametrize("difficulty", [0.5, 1.0])
def test_ranges_are_as_wide_as_the_difficulty(difficulty: float) -> None:
    targets, headings, paths, velocities = (
        drawn(task, 300, difficulty) for task in (TARGET, HEADING, PATH, VELOCITY)
    )
    to_sides = np.pi * difficulty * SIDES
    x, y = np.transpose([offset(episode) for episode in targets])
    assert is_spread(np.hypot(x, y), 5, 5 + 10 * difficulty)
    turns = [episode.command[0] for episode in headings]
    for angles in (np.arctan2(y, x), turns):
        assert is_spread(angles, *to_sides)
        assert np.histogram(angles, bins=8, range=tuple(to_sides))[0].min() > 18
    first, strength, second, other = np.transpose([each.pushes for each in headings])
    assert is_spread(first, 1, 2)
    assert is_spread(second, 2.5, 3.5)
    for strengths in (strength, other):
        assert is_spread(np.abs(strengths), 4 * difficulty, 8 * difficulty)
        assert 105 < (strengths > 0).sum() < 195
    points = [np.reshape(each.command, (49, 2)) for each in paths]
    firsts = [np.arctan2(*(path[1] - path[0])[::-1]) for path in points]
    assert 0.9 * np.pi * difficulty < np.abs(firsts).max() <= np.pi * difficulty + 0.05
    speeds, yaw_rates = np.reshape([each.command for each in velocities], (-1, 2)).T
    assert is_spread(speeds, *(7 + 5 * difficulty * SIDES))
    assert is_spread(yaw_rates, *(2.5 * difficulty * SIDES))


def test_targets_lie_where_the_parameters_say() -> None:
    offsets = np.array(
        [offset(each) for each in drawn(TASKS["target"](distance=(20, 30), bearing=90), 100)]
    )
    assert is_spread(np.hypot(*offsets.T), 20, 30)
    assert offsets[:, 0].min() >= 0


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
    points = np.reshape(task.sample_episode(Flat(), 0).command, (-1, 2))
    assert len(points) == 21  # 0.5 mm apart
    straight = np.stack([np.arange(21) / 2, np.zeros(21)], axis=1)
    state = task_state(fly_state(position_w=[[0, 1, 1]]), command=[straight.ravel()])
    expected = np.array([1, -1]) / np.sqrt(2)
    np.testing.assert_allclose(task.observation[0].compute(state)[0], expected)


def test_a_heading_without_pushes() -> None:
    task = TASKS["heading"](push_times=[], turn=30, tolerance=5, kept=1)
    episodes = drawn(task, 100)
    assert {episode.pushes for episode in episodes} == {()}
    assert is_spread(np.rad2deg([episode.command[0] for episode in episodes]), -30, 30)
    assert task.success == "within 5 degrees of the heading for 1 s"


def test_the_finish_line_ends_the_ground() -> None:
    task = TASKS["traverse"](finish_line=10)
    state = task_state(fly_state(2, position_w=[[9.9, 0, 1], [10.1, 0, 1]]))
    assert task.terminations[0].holds(state).tolist() == [False, True]
    np.testing.assert_allclose(task.observation[1].compute(state), [[0.1 / 15], [-0.1 / 15]])


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
        ("target", {"distance": (60, 80)}, r"task\.distance must leave room .* got \(60"),
        ("path", {"length": 400, "radius": 1000}, r"task\.length must leave room .* got 400"),
        ("slalom", {"spacing": (60, 80)}, r"task\.spacing and task\.gates must leave room"),
        ("chase", {"radius": 60, "speed": 60}, r"task\.time_limit must leave room on the terrain"),
        ("traverse", {"finish_line": 300}, r"task\.finish_line must lie on the terrain, below x ="),
        ("stop", {"distance": (2, 3), "reach": 2}, r"reach must be below the least task\.distance"),
        ("slalom", {"spacing": (2, 3), "reach": 2}, r"below the least task\.spacing, 2"),
        ("chase", {"distance": (2, 3), "reach": 2}, r"below the least task\.distance, 2"),
    ],
)
def test_what_leaves_no_room_is_refused(name, parameters, message, monkeypatch) -> None:
    monkeypatch.setattr("flyrl.tasks.episode.MOST_DRAWS", 100)
    with pytest.raises(ValueError, match=message):
        TASKS[name](**parameters).sample_episode(TERRAINS["blocks"], 0)
