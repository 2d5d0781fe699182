"""Terms against numbers worked out by hand, on a state made by hand."""

import numpy as np
import pytest

from flyrl.simulation.flies import FlyState
from flyrl.tasks import TASKS, TaskState, terms
from flyrl.tasks.hybrid_turning import thorax
from flyrl.tasks.path import path_deviation, path_direction_b, path_progress
from flyrl.terrains import Bounds


def fly_state(n: int = 1, **changes: object) -> FlyState:
    names = ("phases", "magnitudes", "retraction", "stumbling", "adhesion", "is_grounded")
    shapes = dict.fromkeys(names, (6,))
    names = ("position_w", "velocity_w", "angular_velocity_w", "fictive_velocity_b")
    shapes |= dict.fromkeys(names, (3,))
    shapes |= dict.fromkeys(("joint_angles", "joint_velocities", "actuator_torques"), (42,))
    shapes |= {"time": (), "command": (2,), "muscle_tensions": (84,)}
    shapes |= {"contact_forces_w": (36, 3), "end_effectors_w": (6, 3)}
    state = {name: np.zeros((n, *shape)) for name, shape in shapes.items()}
    state["rotation_w"] = np.tile(np.eye(3), (n, 1, 1))
    state |= {name: np.asarray(value, dtype=float) for name, value in changes.items()}
    return FlyState(**state, is_unstable=np.zeros(n, dtype=bool))


def task_state(
    fly: FlyState,
    previous: FlyState | None = None,
    goal: object = ((0.0, 0.0),),
    command: object = ((),),
    means: dict[str, object] | None = None,
    **totals: object,
) -> TaskState:
    return TaskState(
        body=fly,
        previous=previous or fly,
        props=np.zeros((len(fly.time), 0, 3)),
        goal=np.asarray(goal, dtype=float),
        command=np.asarray(command, dtype=float),
        totals={name: np.asarray(values, dtype=float) for name, values in totals.items()},
        means={name: np.asarray(values) for name, values in (means or {}).items()},
        decisions_left=np.full(len(fly.time), 100.0),
        decision_interval_s=0.02,
        bounds=Bounds(-10.0, 25.0, -20.0, 20.0),
    )


def turned(yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (np.cos, np.sin))
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return (about_z @ about_y @ about_x)[None]


def test_a_target_to_the_left_has_a_positive_sine() -> None:
    state = task_state(fly_state(position_w=[[1, 1, 1]]), goal=[[1, 6]])
    np.testing.assert_allclose(terms.target_direction_b(state), [[0, 1]], atol=1e-12)
    np.testing.assert_allclose(terms.target_distance(state), [[5 / 15]])


def test_velocity_is_in_the_yaw_frame() -> None:
    state = task_state(fly_state(rotation_w=turned(yaw=np.pi / 2), velocity_w=[[10, 20, 3]]))
    np.testing.assert_allclose(terms.velocity_b(state), [[1, -0.5]], atol=1e-12)


def test_tilt_of_a_fly_pitched_up_and_of_one_rolled() -> None:
    rotations = np.concatenate([turned(pitch=-0.3), turned(roll=0.2)])
    tilt = terms.tilt_b(task_state(fly_state(2, rotation_w=rotations)))
    np.testing.assert_allclose(tilt, [[np.sin(0.3), 0], [0, np.sin(0.2)]], atol=1e-12)


def test_contacts_are_the_legs_on_the_ground() -> None:
    state = task_state(fly_state(is_grounded=[[0, 0, 1, 0, 0, 0]]))
    assert terms.leg_contacts(state).tolist() == [[0, 0, 1, 0, 0, 0]]


def test_yaw_pitch_roll_and_their_rates_which_are_finite_differences() -> None:
    rates, start, step = np.array([0.7, -0.4, 0.9]), np.array([0.3, 0.5, -0.8]), 1e-6
    now, later = turned(*start)[0], turned(*(start + step * rates))[0]
    spin = (later @ now.T - np.eye(3)) / step
    omega = [spin[2, 1], spin[0, 2], spin[1, 0]]
    state = task_state(fly_state(rotation_w=now[None], angular_velocity_w=[omega]))
    np.testing.assert_allclose(thorax(state)[0, 2:], [start, rates], atol=1e-5)


def test_progress_counts_mm_towards_the_target() -> None:
    before, after = fly_state(position_w=[[0, 0, 1]]), fly_state(position_w=[[3, 0, 1]])
    assert terms.progress(task_state(after, before, goal=[[10, 0]])) == pytest.approx(3)
    assert terms.progress(task_state(after, before, goal=[[-10, 0]])) == pytest.approx(-3)


def test_a_fall_costs_as_much_as_waiting_for_the_time_limit() -> None:
    task = TASKS["target"]()
    weights = {term.name: term.weight for term in task.reward}
    fallen = task_state(fly_state(rotation_w=turned(roll=np.pi)), goal=[[5, 5]])
    assert terms.time_lost(fallen) == pytest.approx(2.0)
    assert weights["lost_time"] == weights["time"] < 0


def test_a_fall_is_a_tilt_beyond_75_degrees() -> None:
    rotations = np.concatenate([turned(roll=np.deg2rad(a)) for a in (74, 76, 180)])
    state = task_state(fly_state(3, rotation_w=rotations))
    assert terms.has_fallen(state).tolist() == [False, True, True]


def test_the_arena_ends_at_its_bounds_and_below() -> None:
    state = task_state(fly_state(4, position_w=[[24, 19, 0], [26, 0, 0], [0, -21, 0], [0, 0, -6]]))
    assert terms.has_left(state).tolist() == [False, True, True, True]


def test_the_heading_error_is_the_shorter_way_round() -> None:
    fly = fly_state(rotation_w=turned(yaw=3.0))
    state = task_state(fly, command=[[-3.0]])
    assert terms.heading_error(state) == pytest.approx(2 * np.pi - 6)
    np.testing.assert_allclose(
        terms.commanded_direction_b(state), [[np.cos(6), -np.sin(6)]], atol=1e-12
    )


def test_time_counts_as_on_heading_within_15_degrees() -> None:
    before = fly_state(3, time=[0, 0, 0])
    rotations = np.concatenate([turned(yaw=np.deg2rad(a)) for a in (14, -14, 16)])
    after = fly_state(3, time=[0.02] * 3, rotation_w=rotations)
    state = task_state(after, before, command=[[0.0]] * 3)
    np.testing.assert_allclose(terms.time_on_heading(state, np.deg2rad(15)), [0.02, 0.02, 0])


def test_commands_change_every_second() -> None:
    command = [[1, 10, 2, 20, 3, 30]] * 4
    state = task_state(fly_state(4, time=[0, 0.98, 1 - 1e-9, 7]), command=command)
    commands = terms.command_at(state, state.fly.time, 1.0)
    np.testing.assert_array_equal(commands, [[1, 10], [1, 10], [2, 20], [3, 30]])
    left = terms.command_time_left(state, 1.0)
    np.testing.assert_allclose(left, [[1], [0.02], [1], [1]], atol=1e-6)


def test_perfect_tracking_counts_whole_and_a_deviation_less() -> None:
    before, after = fly_state(3, time=[0, 0, 0]), fly_state(3, time=[0.02] * 3)
    means = {"velocity": [[10, 1.5], [14, 1.5], [10, -0.5]]}
    state = task_state(after, before, command=[[10, 1.5]] * 3, means=means)
    np.testing.assert_allclose(
        terms.time_tracked(state, 1.0, (2.0, 1.0)), [0.02, 0.02 * np.exp(-1), 0.02 * np.exp(-1)]
    )


def test_the_velocity_over_a_decision_is_way_and_turn_over_time() -> None:
    before = fly_state(rotation_w=turned(yaw=3.1))
    way = 0.3 * np.array([[np.cos(3.1), np.sin(3.1), 0]])
    after = fly_state(time=[0.02], position_w=way, rotation_w=turned(yaw=3.15))
    found = terms.velocity_over_decision(task_state(after, before))
    np.testing.assert_allclose(found, [[15.0, 2.5]])


def test_the_way_forward_is_along_the_heading_before() -> None:
    before = fly_state(rotation_w=turned(yaw=np.pi / 2))
    after = fly_state(position_w=[[1, 2, 0]], rotation_w=turned(yaw=0.0))
    assert terms.forward_way(task_state(after, before)) == pytest.approx(2)


def test_progress_along_a_path_counts_its_points() -> None:
    path = np.stack([np.arange(20) * 0.5, np.zeros(20)], axis=1).ravel()
    before = fly_state(position_w=[[1.1, 1, 0]], time=[1.0])
    after = fly_state(position_w=[[2.6, -0.5, 0]], time=[1.1])
    state = task_state(after, before, command=[path])
    assert path_progress(state) == pytest.approx(1.5)
    assert path_deviation(state) == pytest.approx(0.1 * np.hypot(0.1, 0.5))
    # 4 mm beyond the nearest point, (2.5, 0)
    expected = np.array([6.5 - 2.6, 0.5])
    np.testing.assert_allclose(path_direction_b(state, 4.0)[0], expected / np.hypot(*expected))


def test_a_state_asks_a_term_once() -> None:
    asked = []

    def term(state: TaskState) -> np.ndarray:
        asked.append(state)
        return state.goal[:, 0]

    state, other = task_state(fly_state(), goal=[(3, 0)]), task_state(fly_state(), goal=[(4, 0)])
    assert [state.once(term)[0], state.once(term)[0], other.once(term)[0]] == [3, 3, 4]
    assert asked == [state, other]
