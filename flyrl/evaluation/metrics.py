"""Metrics of one episode, from its record.

Everything horizontal: distances in the world's xy plane, mm. A metric that an episode cannot have
(the time to a goal never reached, the efficiency of a path of no length) is None, never a made-up
number.

A failure is scored over the full horizon. A fly that falls after 1 s of a 3 s episode covered its
distance in 3 s, or falling early would raise the speed; and for the other 2 s it was as far off as
can be. How it walked (strides, slip, work) is measured over the time it did.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, Literal

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
from flyrl.rollouts import BoolArray, EpisodeRecord
from flyrl.tasks import ERRORS, TASKS, Task
from flyrl.validation import FloatArray, one_of

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
    **{name: description for name, (description, _) in ERRORS.items()},
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

_GENERAL: Final = frozenset({"success", *METRICS}) - ERRORS.keys()
"""Metrics that are no error of a task."""


def lower_is_better(metric: str) -> bool:
    """Whether a metric that controllers are compared by is better the lower it is.

    So are the time to a goal and every error of a task.
    """
    return metric == "time_to_goal_s" or metric not in _GENERAL


SMALLEST_EFFECTS: Final[dict[str, float]] = {
    "success": 0.05,
    "time_to_goal_s": 0.1,
    "speed_mm_s": 1.0,
    "advance_mm": 1.0,
    **{name: effect for name, (_, effect) in ERRORS.items()},
}
"""Smallest difference of interest by metric, in its unit; a smaller one is no one's win.

The rule: of a share 0.05; of way and time about a stride of a fly (1 mm, 0.1 s), of speed that way
in 1 s. Errors of tasks bring their own.
"""


def decisive_metrics(task: Task | str) -> tuple[str, ...]:
    """Metrics that decide who is best in a task, one after the other; see `flyrl.tasks.Task`.

    Of a name that is not built in, those of most tasks.
    """
    return task.decisive if isinstance(task, Task) else _attributes(task, "decisive")


def compared_metrics(task: Task | str) -> tuple[str, ...]:
    """Names of the metrics that controllers are compared by in a task, `success` first."""
    own = task.compared if isinstance(task, Task) else _attributes(task, "compared")
    return tuple(dict.fromkeys(("success", *own, *decisive_metrics(task), "return")))


def _attributes(name: str, attribute: str) -> tuple[str, ...]:
    owner = TASKS[name]() if name in TASKS else Task
    found: tuple[str, ...] = getattr(owner, attribute)
    return found


def recorded_metrics(
    protocol: Mapping[str, Any], key: Literal["decisive", "compared"]
) -> list[str]:
    """The `decisive_metrics`, or `compared_metrics`, of the task of a protocol.

    One from before they were recorded is of a built-in task.
    """
    of_task = decisive_metrics if key == "decisive" else compared_metrics
    return list(protocol[key] if key in protocol else of_task(protocol["task"]))


def meanings(protocol: Mapping[str, Any]) -> dict[str, str]:
    """Meaning of every metric by name, with those of the errors of a protocol's task."""
    table = protocol.get("table") or {}
    return {**METRICS, **{each["name"]: each["description"] for each in table.get("errors", ())}}


def check_metrics(task: Task) -> None:
    """Check that a task's errors have names of their own, and that it is compared by metrics.

    Raises
    ------
    ValueError
        If not.
    """
    own = [term.name for term in task.errors]
    for name in own:
        if name in _GENERAL:
            raise ValueError(f"an error of {task.name} must not have the name of the metric {name}")
    for name in (*task.decisive, *task.compared):
        one_of(f"metric that decides {task.name}", name, [*sorted(_GENERAL), *own])


def episode_metrics(record: EpisodeRecord) -> dict[str, float | None]:
    """All metrics of `METRICS` for one episode, in that order, then errors of a user's own task."""
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
        **{name: value for name, value in record.errors.items() if name not in ERRORS},
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
