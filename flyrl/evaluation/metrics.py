"""Metrics of one episode, from its record.

Everything horizontal: distances in the world's xy plane, mm. A metric that an episode cannot have
(the time to a goal never reached, the efficiency of a path of no length) is None, never a made-up
number.

A failure is scored over the full horizon. A fly that falls after 1 s of a 3 s episode covered its
distance in 3 s, or falling early would raise the speed.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from flyrl.rollouts.records import EpisodeRecord, FloatArray

PATH_SAMPLING_S: Final = 0.1
"""A path is measured from point to point at least this far apart, s.

The thorax sways with every stride (1/12 s); measured more finely, straight walking is 20 % longer
than the way it covers.
"""

METRICS: Final[dict[str, str]] = {
    "return": "sum of rewards",
    "duration_s": "simulated time until the episode ended, s",
    "time_to_goal_s": "time until success, s; none without success",
    "displacement_mm": "distance from start to end, as the crow flies, mm",
    "advance_mm": "how far the fly came along the world's x axis, which traverse asks for, mm",
    "path_length_mm": "length of the path walked, from point to point every 0.1 s, mm",
    "path_efficiency": "displacement ÷ path length",
    "speed_mm_s": "displacement ÷ time, mm/s; failures over the full horizon",
    "drift_deg": "direction of displacement against the heading at the start, deg, left positive",
    "yaw_change_deg": "heading at the end minus heading at the start, deg, left positive",
    "goal_distance_mm": "distance left to the goal at the end, mm",
    "goal_progress_mm": "how much closer to the goal the fly ended than it started, mm",
}
"""Name of every metric of an episode, and what it means."""

COMPARED: Final = ("success", "time_to_goal_s", "speed_mm_s", "return")
"""What controllers are compared by, episode by episode, unless the task has metrics of its own."""

_COMPARED_IN_TASK: Final = {
    "traverse": ("success", "time_to_goal_s", "advance_mm", "return"),
    # to keep up what is asked takes as long as the episode, and is no question of speed
    "velocity": ("success", "return"),
    "heading": ("success", "return"),
}


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
    }


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
