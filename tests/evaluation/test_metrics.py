import math

import numpy as np
import pytest

from flyrl.evaluation.metrics import (
    GAIT_METRICS,
    METRICS,
    SMALLEST_EFFECTS,
    compared_metrics,
    decisive_metrics,
    episode_metrics,
)
from flyrl.report.figures import METRIC_LABELS
from flyrl.rollouts import Gait
from flyrl.tasks import TASK_NAMES, TASKS
from tests.synthetic import make_record


def test_every_metric_is_there_in_order():
    assert list(episode_metrics(make_record([(0, 0), (1, 0)]))) == list(METRICS)


def test_path_length_adds_up_the_legs_of_a_path():
    metrics = episode_metrics(make_record([(0, 0), (3, 4), (3, 0)], interval_s=0.1))
    assert metrics["path_length_mm"] == pytest.approx(9)


def test_path_length_ends_at_the_end_of_the_path():
    # 0, 0.1 and 0.2 s, then the end at 0.24 s.
    path = [(0.5 * sample, 0) for sample in range(13)]
    metrics = episode_metrics(make_record(path, interval_s=0.02))
    assert metrics["path_length_mm"] == pytest.approx(6)


def test_swaying_within_a_stride_does_not_lengthen_the_path():
    swaying = [(0.1 * sample, 0.3 if sample % 5 else 0) for sample in range(16)]
    metrics = episode_metrics(make_record(swaying, interval_s=0.02))
    assert metrics["path_length_mm"] == pytest.approx(1.5)


def test_displacement_is_as_the_crow_flies():
    metrics = episode_metrics(make_record([(1, 1), (9, 9), (4, 5)]))
    assert metrics["displacement_mm"] == pytest.approx(5)


def test_advance_is_along_x_alone():
    metrics = episode_metrics(make_record([(1, 1), (9, 9), (4, -5)]))
    assert metrics["advance_mm"] == pytest.approx(3)


@pytest.mark.parametrize("task", TASKS)
def test_tasks_are_compared_by_metrics_that_there_are(task):
    success, *others = compared_metrics(task)
    assert success == "success"
    assert set(others) <= set(METRICS)
    assert set(others) <= set(METRIC_LABELS)


@pytest.mark.parametrize("task", TASK_NAMES)
def test_what_decides_a_task_has_a_smallest_effect(task):
    assert all(SMALLEST_EFFECTS[metric] > 0 for metric in decisive_metrics(task))


def test_the_smallest_effect_of_an_error_is_a_quarter_of_what_is_tolerated():
    tolerated = {
        "heading_error_deg": 15.0,
        "path_error_mm": 1.0,
        "speed_error_mm_s": 2.0,
        "yaw_rate_error_deg_s": np.degrees(1.0),
        "bend_error_deg": np.degrees(0.1),
    }
    for metric, tolerance in tolerated.items():
        assert SMALLEST_EFFECTS[metric] == pytest.approx(tolerance / 4, rel=0.1)


def test_height_does_not_count():
    metrics = episode_metrics(make_record([(0, 0, 0), (3, 4, 7)]))
    assert metrics["displacement_mm"] == pytest.approx(5)
    assert metrics["path_length_mm"] == pytest.approx(5)


def test_path_efficiency_of_a_right_angle():
    metrics = episode_metrics(make_record([(0, 0), (3, 0), (3, 4)], interval_s=0.1))
    assert metrics["path_efficiency"] == pytest.approx(5 / 7)


def test_a_fly_at_rest_has_no_path_efficiency_and_no_drift():
    metrics = episode_metrics(make_record([(2, 2), (2, 2)]))
    assert metrics["path_efficiency"] is None
    assert metrics["drift_deg"] is None


def test_drift_is_relative_to_the_heading_and_positive_to_the_left():
    record = make_record([(0, 0), (0, 2)], yaw=[math.pi / 4, math.pi / 4])
    assert episode_metrics(record)["drift_deg"] == pytest.approx(45)


def test_drift_wraps_around():
    # Heading 170 deg, walking towards -170 deg: 20 deg to the left, not 340 to the right.
    angle = math.radians(-170)
    record = make_record([(0, 0), (math.cos(angle), math.sin(angle))], yaw=[math.radians(170)] * 2)
    assert episode_metrics(record)["drift_deg"] == pytest.approx(20)


def test_yaw_change_counts_whole_turns():
    record = make_record([(0, 0), (1, 0)], yaw=[0, -2.5 * math.pi])
    assert episode_metrics(record)["yaw_change_deg"] == pytest.approx(-450)


def test_success_is_fast_over_its_own_duration():
    record = make_record([(0, 0), (6, 0)], outcome="success", duration_s=0.5, horizon_s=3)
    assert episode_metrics(record)["speed_mm_s"] == pytest.approx(12)


def test_time_out_is_scored_over_the_whole_episode():
    record = make_record([(0, 0), (6, 0)], outcome="timeout", duration_s=3, horizon_s=3)
    assert episode_metrics(record)["speed_mm_s"] == pytest.approx(2)


@pytest.mark.parametrize("outcome", ["fall", "left_arena", "unstable"])
def test_a_failure_is_scored_over_the_full_horizon(outcome):
    record = make_record([(0, 0), (6, 0)], outcome=outcome, duration_s=0.5, horizon_s=3)
    assert episode_metrics(record)["speed_mm_s"] == pytest.approx(2)


def test_falling_early_never_raises_the_speed():
    # The same walk at 10 mm/s, cut short by a fall at every possible sample.
    path = np.column_stack([np.linspace(0, 30, 151), np.zeros(151)])
    walked = episode_metrics(make_record(path))["speed_mm_s"]
    fallen = [
        episode_metrics(make_record(path[:end], outcome="fall"))["speed_mm_s"]
        for end in range(2, 151)
    ]
    assert max(fallen) < walked


def test_time_to_goal_is_only_for_success():
    reached = make_record([(0, 0), (6, 0)], outcome="success", duration_s=0.5)
    fallen = make_record([(0, 0), (6, 0)], outcome="fall", duration_s=0.5)
    assert episode_metrics(reached)["time_to_goal_s"] == 0.5
    assert episode_metrics(fallen)["time_to_goal_s"] is None


def test_distance_and_progress_to_a_goal():
    metrics = episode_metrics(make_record([(0, 0), (7, 4)], goal=(10, 0)))
    assert metrics["goal_distance_mm"] == pytest.approx(5)
    assert metrics["goal_progress_mm"] == pytest.approx(5)


def test_no_goal_no_goal_metrics():
    metrics = episode_metrics(make_record([(0, 0), (7, 4)]))
    assert metrics["goal_distance_mm"] is None
    assert metrics["goal_progress_mm"] is None


def make_gait(stance, *, retraction=None, work_nj=0.0, slip_mm=0.0):
    """Legs that all do the same, a sample every 10 ms."""
    rows = np.repeat(np.array([mark == "#" for mark in stance])[:, np.newaxis], 6, axis=1)
    none = np.zeros_like(rows)
    return Gait(
        interval_s=0.01,
        stance=rows,
        adhesion=rows,
        retraction=none if retraction is None else none | (np.arange(6) < retraction),
        stumbling=none,
        work_nj=work_nj,
        slip_mm=np.full(6, slip_mm),
    )


def test_strides_make_the_way():
    # touchdowns every 100 ms; 6 mm in 0.3 s are 2 mm a stride
    gait = make_gait("..######....######....######..")
    metrics = episode_metrics(make_record([(0, 0), (6, 0)], interval_s=0.3, gait=gait))
    assert metrics["stride_frequency_hz"] == pytest.approx(10)
    assert metrics["stride_length_mm"] == pytest.approx(2)
    assert metrics["duty_factor"] == pytest.approx(0.6)
    assert metrics["tripod_coordination"] == 1


def test_legs_that_lose_the_ground_under_a_standing_body_take_no_strides():
    # 0.2 mm in 3 strides
    gait = make_gait("..######....######....######..")
    metrics = episode_metrics(make_record([(0, 0), (0.2, 0)], interval_s=0.3, gait=gait))
    names = ("stride_frequency_hz", "stride_length_mm", "duty_factor", "tripod_coordination")
    assert [metrics[name] for name in names] == [None] * 4


def test_a_turn_on_the_spot_has_strides():
    gait = make_gait("..######....######....######..")
    record = make_record([(0, 0), (0, 0)], interval_s=0.3, yaw=[0, 2.0], gait=gait)
    assert episode_metrics(record)["stride_frequency_hz"] == pytest.approx(10)


def test_a_body_that_sways_takes_no_strides():
    # a path of 4 mm that leads nowhere
    gait = make_gait("..######....######....######..")
    record = make_record([(0, 0), (1, 0)] * 2 + [(0, 0)], interval_s=0.1, gait=gait)
    metrics = episode_metrics(record)
    assert metrics["path_length_mm"] == 4
    assert metrics["stride_frequency_hz"] is metrics["work_nj_per_mm"] is None


def test_work_and_slip_are_told_per_way():
    gait = make_gait("####", work_nj=600.0, slip_mm=1.5)
    metrics = episode_metrics(make_record([(0, 0), (6, 0)], gait=gait))
    assert metrics["work_nj_per_mm"] == pytest.approx(100)
    assert metrics["slip_share"] == pytest.approx(0.25)


def test_who_stands_has_no_cost_per_way_and_no_strides():
    gait = make_gait("####", work_nj=600.0, slip_mm=1.5)
    metrics = episode_metrics(make_record([(0, 0), (0.5, 0)], gait=gait))
    assert metrics["work_nj_per_mm"] is None
    assert metrics["slip_share"] is None
    assert metrics["stride_length_mm"] is None


def test_two_corrected_legs_of_six():
    metrics = episode_metrics(make_record([(0, 0), (6, 0)], gait=make_gait("####", retraction=2)))
    assert metrics["reflex_activity"] == pytest.approx(1 / 3)


def test_without_a_log_there_is_no_gait():
    metrics = episode_metrics(make_record([(0, 0), (6, 0)]))
    assert {metrics[name] for name in GAIT_METRICS} == {None}


def test_errors_are_those_of_the_task():
    metrics = episode_metrics(make_record([(0, 0), (6, 0)], errors={"path_error_mm": 0.5}))
    assert metrics["path_error_mm"] == 0.5
    assert metrics["heading_error_deg"] is None


def test_the_drive_before_the_first_decision_does_not_count():
    record = make_record([(0, 0)] * 4, drive=[(0, 0), (1, 1), (1, 1), (1, 0.5)], interval_s=0.02)
    assert episode_metrics(record)["drive_variation"] == pytest.approx(0.25 / 0.04)
