"""Metrics of one episode, from its record.

Everything horizontal: distances in the world's xy plane, mm. A metric that an episode cannot have
(the time to a goal never reached, the efficiency of a path of no length) is None, never a made-up
number.

A failure is scored over the full horizon. A fly that falls after 1 s of a 3 s episode covered its
distance in 3 s, or falling early would raise the speed; and for the other 2 s it was as far off as
can be. How it walked (strides, slip, what its way cost) is told of the time it did.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from flyrl.evaluation.gait import (
    drive_variation,
    duty_factor,
    moved_mm,
    reflex_activity,
    step_raster,
    stride_frequency_hz,
    tripod_coordination,
)
from flyrl.rollouts.records import BoolArray, EpisodeRecord, FloatArray
from flyrl.tasks import ERRORS

PATH_SAMPLING_S: Final = 0.1
"""A path is measured from point to point at least this far apart, s.

The thorax sways with every stride (1/12 s); measured more finely, straight walking is 20 % longer
than the way it covers.
"""

LEAST_WAY_MM: Final = 2.0
"""A body that gets less far from its start has not walked, mm; standing, it slides by up to 1.8."""

METRICS: Final[dict[str, str]] = {
    "return": "sum of rewards",
    "duration_s": "simulated time until the episode ended, s",
    "time_to_goal_s": "time until success, s; none without success",
    "displacement_mm": "straight distance from start to end, mm",
    "advance_mm": "way along the world's x axis, which traverse and worm_crawl ask for, mm",
    "path_length_mm": "length of the path, from point to point every 0.1 s, mm",
    "path_efficiency": "displacement ÷ path length",
    "speed_mm_s": "displacement ÷ time, mm/s; failures over the full horizon",
    "drift_deg": "direction of displacement against the heading at the start, deg, left positive",
    "yaw_change_deg": "heading at the end minus heading at the start, deg, left positive",
    "goal_distance_mm": "distance left to the goal at the end, mm",
    "goal_progress_mm": "how much closer to the goal the end was than the start, mm",
    **ERRORS,
    "work_nj_per_mm": "work of the servos ÷ path length, nJ/mm",
    "slip_share": "way of a leg's tip on the ground while it grips ÷ path length, mean of the legs",
    "stride_frequency_hz": "strides per second, from touchdown to touchdown, mean of the legs; "
    "none while the body stands",
    "stride_length_mm": "path length ÷ time ÷ stride frequency, mm",
    "duty_factor": "share of a stride that the leg stands, mean of the legs",
    "tripod_coordination": "how far the legs of a tripod swing together: 1 as one, 0 never",
    "reflex_activity": "share of the time that a reflex corrects a leg, mean of the legs",
    "drive_variation": "change of the drives (of a worm, its tensions) per second, on average, 1/s",
}
"""Name of every metric of an episode, and what it means."""

GAIT_METRICS: Final = (
    "work_nj_per_mm",
    "slip_share",
    "stride_frequency_hz",
    "stride_length_mm",
    "duty_factor",
    "tripod_coordination",
    "reflex_activity",
)
"""Those that need a log of the gait."""

COMPARED: Final = ("success", "time_to_goal_s", "speed_mm_s", "return")
"""What controllers are compared by, episode by episode, unless the task has metrics of its own."""

LOWER_IS_BETTER: Final = frozenset({"time_to_goal_s", *ERRORS})
"""Of the metrics that controllers are compared by, those that are better the lower they are."""

SMALLEST_EFFECTS: Final[dict[str, float]] = {
    "success": 0.05,
    "time_to_goal_s": 0.1,
    "speed_mm_s": 1.0,
    "advance_mm": 1.0,
    "heading_error_deg": 4.0,
    "path_error_mm": 0.25,
    "speed_error_mm_s": 0.5,
    "yaw_rate_error_deg_s": 15.0,
    "bend_error_deg": 1.5,
    "recruited_share": 0.05,
}
"""Smallest difference of interest by metric, in its unit; a smaller one is no one's win.

The rule: of a share 0.05; of way and time about a stride of a fly (1 mm, 0.1 s), of speed that way
in 1 s; of an error about a quarter of what the task tolerates in a success.
"""

_COMPARED_IN_TASK: Final = {
    "traverse": ("success", "time_to_goal_s", "advance_mm", "speed_mm_s", "return"),
    # to keep up what is asked takes as long as the episode, and is no question of speed
    "velocity": ("success", "speed_error_mm_s", "yaw_rate_error_deg_s", "return"),
    "heading": ("success", "heading_error_deg", "return"),
    "path": ("success", "time_to_goal_s", "path_error_mm", "return"),
    **dict.fromkeys(
        ("worm_crawl", "worm_crawl_box"), ("success", "advance_mm", "recruited_share", "return")
    ),
    **dict.fromkeys(
        ("worm_hang", "worm_hang_box"), ("success", "bend_error_deg", "recruited_share", "return")
    ),
}


_DECISIVE: Final = {
    "traverse": ("advance_mm",),
    "velocity": ("success", "speed_error_mm_s"),
    "heading": ("success", "heading_error_deg"),
    "path": ("success", "path_error_mm"),
    "worm_crawl": ("advance_mm",),
    "worm_crawl_box": ("advance_mm",),
    "worm_hang": ("success", "bend_error_deg"),
    "worm_hang_box": ("success", "bend_error_deg"),
}


def decisive_metrics(task: str) -> tuple[str, ...]:
    """What decides who is best in a task, and then who of those that are equal in it."""
    return _DECISIVE.get(task, ("success", "time_to_goal_s"))


def compared_metrics(task: str) -> tuple[str, ...]:
    """Names of the metrics that controllers are compared by in a task, `success` first."""
    return _COMPARED_IN_TASK.get(task, COMPARED)


def episode_metrics(record: EpisodeRecord) -> dict[str, float | None]:
    """All metrics of `METRICS` for one episode, in that order."""
    position = record.position_w[:, :2]
    displacement = displacement_mm(position)
    path = path_length_mm(position, record.time_s)
    goal = np.array(record.episode.goal)
    distances = np.linalg.norm(position[[0, -1]] - goal, axis=1) if goal.size else None
    return {
        "return": float(record.return_),
        "duration_s": float(record.duration_s),
        "time_to_goal_s": float(record.duration_s) if record.success else None,
        "displacement_mm": displacement,
        "advance_mm": float(position[-1, 0] - position[0, 0]),
        "path_length_mm": path,
        # The chord of a sampled path is never longer than the path; rounding may say so.
        "path_efficiency": min(1.0, displacement / path) if path > 0 else None,
        "speed_mm_s": speed_mm_s(record, displacement),
        "drift_deg": drift_deg(position, float(record.yaw[0])),
        "yaw_change_deg": math.degrees(float(record.yaw[-1] - record.yaw[0])),
        "goal_distance_mm": None if distances is None else float(distances[1]),
        "goal_progress_mm": None if distances is None else float(distances[0] - distances[1]),
        **{name: record.errors.get(name) for name in ERRORS},
        **gait_metrics(record, path),
        "drive_variation": drive_variation(record.drive, record.time_s),
    }


def gait_metrics(record: EpisodeRecord, path_length: float) -> dict[str, float | None]:
    """Metrics of how the fly walked its way of `path_length`, mm; None without a log of it."""
    gait = record.gait
    if gait is None:
        return dict.fromkeys(GAIT_METRICS)
    stance = counted_stance(record)
    frequency = stride_frequency_hz(stance, gait.interval_s)
    way = np.linalg.norm(record.position_w[:, :2] - record.position_w[0, :2], axis=1)
    has_way = way.max() >= LEAST_WAY_MM
    walked_s = len(stance) * gait.interval_s
    return {
        "work_nj_per_mm": gait.work_nj / path_length if has_way else None,
        "slip_share": float(gait.slip_mm.mean()) / path_length if has_way else None,
        "stride_frequency_hz": frequency,
        "stride_length_mm": path_length / walked_s / frequency if has_way and frequency else None,
        "duty_factor": duty_factor(stance),
        "tripod_coordination": tripod_coordination(stance),
        "reflex_activity": reflex_activity(gait.retraction, gait.stumbling),
    }


def counted_stance(record: EpisodeRecord) -> BoolArray:
    """Stance of each leg (S, 6) as strides are counted in it; all of it of a body that stands."""
    gait = record.gait
    assert gait is not None
    places = np.column_stack([record.position_w[:, :2], record.yaw])
    if moved_mm(places[:1], places).max() < LEAST_WAY_MM:
        return np.ones_like(gait.stance)
    sampled_s = gait.interval_s * np.arange(len(gait.stance))
    sampled = [np.interp(sampled_s, record.time_s, column) for column in places.T]
    return step_raster(gait.stance, np.stack(sampled, axis=1), gait.interval_s)


def displacement_mm(position: FloatArray) -> float:
    """Distance from the first to the last of `position` (T, 2), mm."""
    return float(np.linalg.norm(position[-1] - position[0]))


def path_length_mm(position: FloatArray, time_s: FloatArray) -> float:
    """Length of the path through `position` (T, 2) every `PATH_SAMPLING_S`, and its end, mm."""
    due = np.arange(0.0, time_s[-1], PATH_SAMPLING_S)
    # Times are sums of decisions: a hair's breadth late is in time.
    kept = np.append(np.searchsorted(time_s, due - 1e-9), len(time_s) - 1)
    return float(np.linalg.norm(np.diff(position[kept], axis=0), axis=1).sum())


def speed_mm_s(record: EpisodeRecord, displacement: float) -> float:
    """Displacement ÷ time, mm/s: own duration, but the full horizon where the episode failed."""
    time = record.horizon_s if record.failed else record.duration_s
    return displacement / time if time > 0 else 0.0


def drift_deg(position: FloatArray, yaw: float) -> float | None:
    """Angle from heading `yaw` (rad) to the displacement, deg in (-180, 180]; None at rest."""
    dx, dy = position[-1] - position[0]
    if dx == 0 and dy == 0:
        return None
    angle = math.atan2(dy, dx) - yaw
    return math.degrees(math.atan2(math.sin(angle), math.cos(angle)))
