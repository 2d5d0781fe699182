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
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Final

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
from flyrl.rollouts import BoolArray, EpisodeRecord, Gait
from flyrl.tasks import ERRORS, TASKS, Task
from flyrl.validation import FloatArray, one_of

PATH_SAMPLING_S: Final = 0.1
"""A path is measured from point to point at least this far apart, s.

The thorax sways with every stride (1/12 s); measured more finely, straight walking is 20 % longer
than the way it covers.
"""

LEAST_WAY_MM: Final = 2.0
"""A body that gets less far from its start has not walked, mm; standing, it slides by up to 1.8."""

_UNITS: Final = ("mm_s", "deg_s", "rad_s", "mm", "deg", "rad", "s")


class Measured:
    """An episode's record with what several metrics are made of."""

    def __init__(self, record: EpisodeRecord) -> None:
        self.record = record
        self.position = record.position_w[:, :2]
        self.displacement = float(np.linalg.norm(self.position[-1] - self.position[0]))
        self.path = path_length_mm(self.position, record.time_s)

        goal = np.array(record.episode.goal)
        ends = np.linalg.norm(self.position[[0, -1]] - goal, axis=1) if goal.size else ()
        self.goal_mm = tuple(map(float, ends)) or None
        """Distances to the goal at the start and at the end; None without a goal."""

    @property
    def speed_mm_s(self) -> float:
        """Displacement ÷ own duration, but the full horizon where the episode failed."""
        time = self.record.horizon_s if self.record.failed else self.record.duration_s
        return self.displacement / time if time > 0 else 0.0

    @property
    def gait(self) -> Gait:
        """The log of the gait, which is there where metrics of the gait are computed."""
        assert self.record.gait is not None
        return self.record.gait

    @cached_property
    def stance(self) -> BoolArray:
        """Stance of each leg (S, 6) as strides are counted in it."""
        return counted_stance(self.record)

    @cached_property
    def stride_frequency_hz(self) -> float | None:
        """Mean over the legs, 1/s."""
        return stride_frequency_hz(self.stance, self.gait.interval_s)

    @cached_property
    def has_way(self) -> bool:
        """Whether the body got so far that costs per mm mean something."""
        way = np.linalg.norm(self.position - self.position[0], axis=1)
        return bool(way.max() >= LEAST_WAY_MM)

    @property
    def stride_length_mm(self) -> float | None:
        """Way of the path in a stride."""
        frequency = self.stride_frequency_hz
        if not frequency or not self.has_way:
            return None
        return self.path / (len(self.stance) * self.gait.interval_s) / frequency


@dataclass(frozen=True)
class Metric:
    """A measure of an episode.

    Attributes
    ----------
    name
        Column in the tables.
    description
        What it is, with its unit.
    compute
        Value, or None where the episode has none.
    own_label
        Name with unit in figures, where it does not follow from `name`.
    lower_is_better
        Of two that are compared, whether the lower one is the better.
    smallest_effect
        Smallest difference of interest, in its unit; a smaller one is no one's win. The rule: of a
        share 0.05; of way and time about a stride of a fly (1 mm, 0.1 s), of speed that way in 1 s.
        Errors of tasks bring their own.
    needs_gait
        Whether it is computed from a log of the gait alone.
    """

    name: str
    description: str
    compute: Callable[[Measured], float | None]
    own_label: str = ""
    lower_is_better: bool = False
    smallest_effect: float = 0.0
    needs_gait: bool = False

    @property
    def label(self) -> str:
        """Name with unit, as in figures: "speed (mm/s)" of `speed_mm_s`."""
        if self.own_label:
            return self.own_label
        unit = next((each for each in _UNITS if self.name.endswith(f"_{each}")), "")
        name = self.name.removesuffix(f"_{unit}").replace("_", " ")
        return f"{name} ({unit.replace('_', '/')})" if unit else name


def _error(name: str, description: str = "", smallest_effect: float = 0.0) -> Metric:
    """Metric of an error of a task."""
    return Metric(
        name,
        description,
        lambda walk: walk.record.errors.get(name),
        _ERROR_LABELS.get(name, ""),
        lower_is_better=True,
        smallest_effect=smallest_effect,
    )


_ERROR_LABELS: Final = {
    "path_error_mm": "distance to path (mm)",
    "recruited_share": "share of neurons recruited",
}

SUCCESS: Final = Metric(
    "success", "whether the task was solved", lambda walk: walk.record.success, smallest_effect=0.05
)

_of_gait = partial(Metric, needs_gait=True)

# fmt: off
_TABLE: Final = (
    Metric("return", "sum of rewards", lambda walk: walk.record.return_),
    Metric("duration_s", "simulated time until the episode ended, s",
           lambda walk: walk.record.duration_s),
    Metric("time_to_goal_s", "time until success, s; none without success",
           lambda walk: walk.record.duration_s if walk.record.success else None,
           lower_is_better=True, smallest_effect=0.1),
    Metric("displacement_mm", "straight distance from start to end, mm",
           lambda walk: walk.displacement),
    Metric("advance_mm", "way along the world's x axis, which traverse and worm_crawl ask for, mm",
           lambda walk: walk.position[-1, 0] - walk.position[0, 0],
           "way along +x (mm)", smallest_effect=1.0),
    Metric("path_length_mm", "length of the path, from point to point every 0.1 s, mm",
           lambda walk: walk.path),
    # the chord of a sampled path is never longer than the path; rounding may say so
    Metric("path_efficiency", "displacement ÷ path length",
           lambda walk: min(1.0, walk.displacement / walk.path) if walk.path > 0 else None),
    Metric("speed_mm_s", "displacement ÷ time, mm/s; failures over the full horizon",
           lambda walk: walk.speed_mm_s, smallest_effect=1.0),
    Metric("drift_deg",
           "direction of displacement against the heading at the start, deg, left positive",
           lambda walk: drift_deg(walk.position, float(walk.record.yaw[0]))),
    Metric("yaw_change_deg", "heading at the end minus heading at the start, deg, left positive",
           lambda walk: math.degrees(float(walk.record.yaw[-1] - walk.record.yaw[0])),
           "change of heading (deg)"),
    Metric("goal_distance_mm", "distance left to the goal at the end, mm",
           lambda walk: walk.goal_mm and walk.goal_mm[1], "way left to goal (mm)"),
    Metric("goal_progress_mm", "how much closer to the goal the end was than the start, mm",
           lambda walk: walk.goal_mm and walk.goal_mm[0] - walk.goal_mm[1],
           "way gained to goal (mm)"),
    *(_error(name, *about) for name, about in ERRORS.items()),
    _of_gait("work_nj_per_mm", "work of the servos ÷ path length, nJ/mm",
             lambda walk: walk.gait.work_nj / walk.path if walk.has_way else None,
             "work per way (nJ/mm)"),
    _of_gait("slip_share",
             "way of a leg's tip on the ground while it grips ÷ path length, mean of the legs",
             lambda walk: float(walk.gait.slip_mm.mean()) / walk.path if walk.has_way else None,
             "slip per way"),
    _of_gait("stride_frequency_hz",
             "strides per second, from touchdown to touchdown, mean of the legs; none while the "
             "body stands",
             lambda walk: walk.stride_frequency_hz, "stride frequency (Hz)"),
    _of_gait("stride_length_mm", "path length ÷ time ÷ stride frequency, mm",
             lambda walk: walk.stride_length_mm),
    _of_gait("duty_factor", "share of a stride that the leg stands, mean of the legs",
             lambda walk: duty_factor(walk.stance)),
    _of_gait("tripod_coordination",
             "how far the legs of a tripod swing together: 1 as one, 0 never",
             lambda walk: tripod_coordination(walk.stance)),
    _of_gait("reflex_activity", "share of the time that a reflex corrects a leg, mean of the legs",
             lambda walk: reflex_activity(walk.gait.retraction, walk.gait.stumbling)),
    Metric("drive_variation",
           "change of the drives (of a worm, its tensions) per second, on average, 1/s",
           lambda walk: drive_variation(walk.record.drive, walk.record.time_s),
           "change of drive (1/s)"),
)
# fmt: on

METRICS: Final = {metric.name: metric for metric in _TABLE}
"""Metrics of every episode, by name, in the order of the tables."""


def metric_named(name: str) -> Metric:
    """`success`, one of `METRICS`, or an error of a user's own task."""
    return SUCCESS if name == "success" else METRICS.get(name) or _error(name)


def metric_label(name: str) -> str:
    """Label of a metric in figures and tables."""
    return metric_named(name).label


def smallest_effects(task: Task) -> dict[str, float]:
    """Smallest difference of interest by metric, in its unit."""
    general = {each.name: each.smallest_effect for each in (SUCCESS, *METRICS.values())}
    own = {term.name: term.smallest_effect for term in task.errors}
    return {name: effect for name, effect in general.items() if effect} | own


def decisive_metrics(task: Task | str) -> tuple[str, ...]:
    """Metrics that decide who is best in a task, one after the other; see `flyrl.tasks.Task`.

    Of a name that is not built in, those of most tasks.
    """
    if isinstance(task, str):
        return TASKS[task]().decisive if task in TASKS else Task.decisive
    return task.decisive


def compared_metrics(task: Task) -> tuple[str, ...]:
    """Names of the metrics that controllers are compared by in a task, `success` first."""
    return tuple(dict.fromkeys(("success", *task.compared, *task.decisive, "return")))


def descriptions(protocol: Mapping[str, Any]) -> dict[str, str]:
    """Description of every metric by name, with those of the errors of a protocol's task."""
    own = (protocol.get("table") or {}).get("errors", ())
    return {
        **{name: metric.description for name, metric in METRICS.items()},
        **{each["name"]: each["description"] for each in own},
    }


def check_metrics(task: Task) -> None:
    """Check that a task's errors have names of their own, and that it is compared by metrics.

    Raises
    ------
    ValueError
        If not.
    """
    general = sorted({"success", *METRICS} - ERRORS.keys())
    own = [term.name for term in task.errors]
    for name in own:
        if name in general:
            raise ValueError(f"an error of {task.name} must not have the name of the metric {name}")
    for name in (*task.decisive, *task.compared):
        one_of(f"metric that decides {task.name}", name, [*general, *own])


def episode_metrics(record: EpisodeRecord) -> dict[str, float | None]:
    """All metrics of `METRICS` for one episode, in that order, then errors of a user's own task."""
    walk = Measured(record)
    names = dict.fromkeys((*METRICS, *record.errors))
    found: dict[str, float | None] = {}
    for metric in map(metric_named, names):
        is_known = record.gait is not None or not metric.needs_gait
        value = metric.compute(walk) if is_known else None
        found[metric.name] = None if value is None else float(value)
    return found


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


def path_length_mm(position: FloatArray, time_s: FloatArray) -> float:
    """Length of the path through `position` (T, 2) every `PATH_SAMPLING_S`, and its end, mm."""
    due = np.arange(0.0, time_s[-1], PATH_SAMPLING_S)
    # Times are sums of decisions: a hair's breadth late is in time.
    kept = np.append(np.searchsorted(time_s, due - 1e-9), len(time_s) - 1)
    return float(np.linalg.norm(np.diff(position[kept], axis=0), axis=1).sum())


def drift_deg(position: FloatArray, yaw: float) -> float | None:
    """Angle from heading `yaw` (rad) to the displacement, deg in (-180, 180]; None at rest."""
    dx, dy = position[-1] - position[0]
    if dx == 0 and dy == 0:
        return None
    angle = math.atan2(dy, dx) - yaw
    return math.degrees(math.atan2(math.sin(angle), math.cos(angle)))
