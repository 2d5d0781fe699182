"""Metrics of episodes, on paths and gaits drawn by hand."""

import math

import numpy as np
import pytest

from flyrl.evaluation.metrics import METRICS, decisive_metrics, episode_metrics, metric_named
from flyrl.rollouts import Gait
from flyrl.tasks import TASKS
from tests.synthetic import make_record

LINE = [(0, 0), (6, 0)]


def test_every_metric_is_there_in_order():
    assert list(episode_metrics(make_record(LINE))) == list(METRICS)


@pytest.mark.parametrize("task", TASKS)
def test_what_decides_a_task_has_a_smallest_effect(task):
    assert all(metric_named(metric).smallest_effect > 0 for metric in decisive_metrics(task))


@pytest.mark.parametrize(
    ("name", "label", "lower_is_better"),
    [
        ("speed_mm_s", "speed (mm/s)", False),
        ("advance_mm", "way along +x (mm)", False),
        ("time_to_goal_s", "time to goal (s)", True),
        ("path_error_mm", "distance to path (mm)", True),
        # errors of a user's own task
        ("way_off_mm", "way off (mm)", True),
        ("sources_missed", "sources missed", True),
    ],
)
def test_a_metric_has_its_label_and_its_better_end(name, label, lower_is_better):
    metric = metric_named(name)
    assert (metric.label, metric.lower_is_better) == (label, lower_is_better)


SWAYING = [(0.1 * sample, 0.3 if sample % 5 else 0) for sample in range(16)]


@pytest.mark.parametrize(
    ("metric", "path", "interval_s", "expected"),
    [
        ("path_length_mm", [(0, 0), (3, 4), (3, 0)], 0.1, 9),
        # 0, 0.1 and 0.2 s, then the end at 0.24 s
        ("path_length_mm", [(0.5 * sample, 0) for sample in range(13)], 0.02, 6),
        ("path_length_mm", SWAYING, 0.02, 1.5),  # swaying within a stride does not count
        ("path_length_mm", [(0, 0, 0), (3, 4, 7)], 0.1, 5),  # nor does height
        ("displacement_mm", [(0, 0, 0), (3, 4, 7)], 0.1, 5),
        ("displacement_mm", [(1, 1), (9, 9), (4, 5)], 0.1, 5),
        ("advance_mm", [(1, 1), (9, 9), (4, -5)], 0.1, 3),
        ("path_efficiency", [(0, 0), (3, 0), (3, 4)], 0.1, 5 / 7),
        ("path_efficiency", [(2, 2), (2, 2)], 0.1, None),
        ("drift_deg", [(2, 2), (2, 2)], 0.1, None),
    ],
)
def test_the_measure_of_a_path(metric, path, interval_s, expected):
    found = episode_metrics(make_record(path, interval_s=interval_s))[metric]
    assert found == (expected if expected is None else pytest.approx(expected))


# heading 170 deg, walking towards -170 deg: 20 deg to the left, not 340 to the right
@pytest.mark.parametrize(("heading", "towards", "drift"), [(45, 90, 45), (170, -170, 20)])
def test_drift_is_relative_to_the_heading_and_positive_to_the_left(heading, towards, drift):
    heading, angle = np.radians([heading, towards])
    record = make_record([(0, 0), (np.cos(angle), np.sin(angle))], yaw=[heading, heading])
    assert episode_metrics(record)["drift_deg"] == pytest.approx(drift)


def test_yaw_change_counts_whole_turns():
    record = make_record([(0, 0), (1, 0)], yaw=[0, -2.5 * math.pi])
    assert episode_metrics(record)["yaw_change_deg"] == pytest.approx(-450)


@pytest.mark.parametrize(
    ("outcome", "duration_s", "speed", "time_to_goal"),
    [
        ("success", 0.5, 12, 0.5),  # over its own duration
        ("timeout", 3, 2, None),
        ("fall", 0.5, 2, None),  # over the full horizon
        ("left_arena", 0.5, 2, None),
        ("unstable", 0.5, 2, None),
    ],
)
def test_a_failure_is_scored_over_the_full_horizon(outcome, duration_s, speed, time_to_goal):
    record = make_record(LINE, outcome=outcome, duration_s=duration_s, horizon_s=3)
    metrics = episode_metrics(record)
    assert metrics["speed_mm_s"] == pytest.approx(speed)
    assert metrics["time_to_goal_s"] == time_to_goal


def test_distance_and_progress_to_a_goal():
    path = [(0, 0), (7, 4)]
    for goal, expected in (((10, 0), pytest.approx(5)), ((), None)):
        metrics = episode_metrics(make_record(path, goal=goal))
        assert metrics["goal_distance_mm"] == metrics["goal_progress_mm"] == expected


def make_gait(stance, *, work_nj=0.0, slip_mm=0.0):
    """Legs that all do the same, a sample every 10 ms, and none corrected."""
    rows = np.array([[mark == "#"] * 6 for mark in stance])
    never = np.zeros_like(rows)
    return Gait(0.01, rows, rows, never, never, work_nj, np.full(6, slip_mm))


TO_AND_FRO = [(0, 0), (1, 0)] * 2 + [(0, 0)]
"""A body that sways: a path of 4 mm that leads nowhere."""

# touchdowns every 100 ms
STRIDES = make_gait("..######....######....######..")


@pytest.mark.parametrize(
    ("path", "yaw", "frequency", "length", "duty", "tripod"),
    [
        (LINE, [0, 0], 10, 2, 0.6, 1),  # 6 mm in 0.3 s are 2 mm a stride
        ([(0, 0), (0, 0)], [0, 2.0], 10, None, 0.6, 1),  # a turn on the spot
        # legs that lose the ground under a standing body: 0.2 mm in 3 strides
        ([(0, 0), (0.2, 0)], [0, 0], None, None, None, None),
        (TO_AND_FRO, [0] * 5, None, None, None, None),
    ],
)
def test_strides_make_the_way(path, yaw, frequency, length, duty, tripod):
    interval_s = 0.3 if len(path) == 2 else 0.1
    metrics = episode_metrics(make_record(path, interval_s=interval_s, yaw=yaw, gait=STRIDES))
    names = ("stride_frequency_hz", "stride_length_mm", "duty_factor", "tripod_coordination")
    for name, expected in zip(names, (frequency, length, duty, tripod), strict=True):
        assert metrics[name] == (expected if expected is None else pytest.approx(expected))


@pytest.mark.parametrize(
    ("path", "work", "slip"),
    [(LINE, 100, 0.25), ([(0, 0), (0.5, 0)], None, None), (TO_AND_FRO, None, None)],
)
def test_work_and_slip_are_per_way_of_a_body_that_walks(path, work, slip):
    gait = make_gait("####", work_nj=600.0, slip_mm=1.5)
    metrics = episode_metrics(make_record(path, interval_s=0.1, gait=gait))
    assert (metrics["work_nj_per_mm"], metrics["slip_share"]) == (work, slip)
    assert metrics["stride_length_mm"] is None


def test_without_a_log_there_is_no_gait():
    metrics = episode_metrics(make_record(LINE))
    assert {metrics[name] for name, metric in METRICS.items() if metric.needs_gait} == {None}


def test_errors_are_those_of_the_task():
    metrics = episode_metrics(make_record(LINE, errors={"path_error_mm": 0.5}))
    assert metrics["path_error_mm"] == 0.5
    assert metrics["heading_error_deg"] is None
