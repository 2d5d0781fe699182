"""How a fly walked, in figures: pure functions of sampled trajectories.

The same functions judge flyrl and the reference, so that a difference between them is one of
walking. A statistic that an episode cannot have (the stride of a fly that is stuck) is None.

Speed, straightness and drift count the whole episode, with the drop onto the ground and the CPG's
start, as the published figures do. What belongs to the gait is counted after `SETTLING_S`.

Steps are told by the extreme positions of the feet along the body, not by contact: hind feet touch
the ground all through their swing, in the reference too.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from flyrl.evaluation.metrics import path_length_mm

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SETTLING_S: Final = 0.2
"""s from the start that count for neither gait, slip nor energy: the fly drops and gets going."""

MIN_PROTRACTION: Final = 0.2
"""mm; a foot that comes forward by less, from the thorax, has made no step."""

MIN_WAY: Final = 0.1
"""mm; over a shorter path, nothing is given per distance."""

FALL_TILT: Final = np.deg2rad(75.0)
"""rad; a thorax tilted further than this from level has fallen, as in flyrl's tasks."""

TRIPODS: Final = ((1, 3, 5), (4, 0, 2))
"""Legs of each tripod, the middle one first; 0 to 5 are LF, LM, LH, RF, RM, RH."""

STATISTICS: Final[dict[str, str]] = {
    "speed": "distance from start to end ÷ time, mm/s",
    "straightness": "distance from start to end ÷ length of the path",
    "yaw_drift": "change of yaw ÷ time, left positive, deg/s",
    "stride_length": "way of a foot from one anterior extreme to the next, mean, mm",
    "stride_frequency": "strides of a leg per s while it strides",
    "duty_factor": "share of its strides that a leg touches the ground",
    "tripod": "tripod coordination strength (Wosnitza et al. 2013)",
    "slip": "way of all six feet while on the ground, mm per mm of path",
    "fall": "1 if the fly fell over, else 0",
    "energy": "positive work of the 42 servos, nJ per mm of path",
}
"""Name of every statistic of an episode, and what it means."""


@dataclass(frozen=True)
class Trajectory:
    """One episode, sampled evenly from its start on.

    Attributes
    ----------
    time
        s, (t,).
    position_w
        Thorax, mm, (t, 3).
    yaw
        rad, (t,); may wrap.
    upright
        The world's up direction along that of the thorax, 1 when level, (t,).
    end_effectors_w
        Origins of the six Tarsus5, mm, (t, 6, 3), ordered as anatomy.LEGS.
    contact
        Whether a leg, tibia to Tarsus5, is pushed by more than 1 µN, (t, 6).
    power
        Sum over the 42 servos of torque · velocity where positive, nJ/s, (t,).
    """

    time: Array
    position_w: Array
    yaw: Array
    upright: Array
    end_effectors_w: Array
    contact: Mask
    power: Array

    def after(self, start: float) -> "Trajectory":
        """What is left from `start` s on."""
        # times are sums: a hair's breadth early is in time
        kept = self.time >= start - 1e-9
        return Trajectory(**{name: values[kept] for name, values in vars(self).items()})


def walking_statistics(walk: Trajectory) -> dict[str, float | None]:
    """All of `STATISTICS` for one episode, in that order."""
    seconds = float(walk.time[-1] - walk.time[0])
    displacement = float(np.linalg.norm(walk.position_w[-1, :2] - walk.position_w[0, :2]))
    path = _path_length(walk)
    turned = np.unwrap(walk.yaw)
    gait = walk.after(SETTLING_S)
    way = _path_length(gait) if len(gait.time) > 1 else 0.0
    work = float((gait.power[1:] * np.diff(gait.time)).sum())  # by the rectangle rule
    lengths, durations, contacts = find_strides(gait)
    has_strides = lengths.size > 0
    return {
        "speed": displacement / seconds if seconds > 0 else None,
        "straightness": min(1.0, displacement / path) if path >= MIN_WAY else None,
        "yaw_drift": float(np.rad2deg(turned[-1] - turned[0]) / seconds) if seconds > 0 else None,
        "stride_length": float(lengths.mean()) if has_strides else None,
        "stride_frequency": float(1.0 / durations.mean()) if has_strides else None,
        "duty_factor": float(contacts.sum() / durations.sum()) if has_strides else None,
        "tripod": tripod_strength(gait),
        "slip": foot_way(gait) / way if way >= MIN_WAY else None,
        "fall": float((walk.upright < np.cos(FALL_TILT)).any()),
        "energy": work / way if way >= MIN_WAY else None,
    }


def _path_length(walk: Trajectory) -> float:
    """Horizontal length of the path through points every 0.1 s, and its end, mm."""
    return path_length_mm(walk.position_w[:, :2], walk.time - walk.time[0])


def foot_way(walk: Trajectory) -> float:
    """Horizontal way of the feet between samples that both have contact, all legs, mm.

    It is the origin of Tarsus5 that is followed, so a foot that rolls counts too.
    """
    moved = np.linalg.norm(np.diff(walk.end_effectors_w[:, :, :2], axis=0), axis=2)
    return float(moved[walk.contact[1:] & walk.contact[:-1]].sum())


def steps(walk: Trajectory) -> list[NDArray[np.intp]]:
    """Steps of each leg: samples of anterior, posterior and next anterior extreme, six of (n, 3).

    Extremes are those of the foot's position from the thorax along the heading, between which it
    comes forward by `MIN_PROTRACTION` or more. Swing is from the posterior extreme to the anterior
    one, stance before it.
    """
    offset_w = walk.end_effectors_w[:, :, :2] - walk.position_w[:, None, :2]
    forward = np.stack([np.cos(walk.yaw), np.sin(walk.yaw)], axis=1)
    along = np.einsum("tli,ti->tl", offset_w, forward)
    found = []
    for position in along.T:
        anterior, _ = find_peaks(position, prominence=MIN_PROTRACTION)
        rows = [
            (start, start + position[start:end].argmin(), end)
            for start, end in pairwise(anterior.tolist())
        ]
        found.append(np.array(rows, dtype=np.intp).reshape(-1, 3))
    return found


def find_strides(walk: Trajectory) -> tuple[Array, Array, Array]:
    """Strides of all legs, each from one anterior extreme to the next.

    Returns
    -------
    Horizontal length, mm, duration, s, and s with contact of each, (n,).
    """
    rows = []
    for leg, found in enumerate(steps(walk)):
        for start, _, end in found:
            way = walk.end_effectors_w[end, leg, :2] - walk.end_effectors_w[start, leg, :2]
            duration = walk.time[end] - walk.time[start]
            touching = walk.contact[start:end, leg].mean()
            rows.append((float(np.linalg.norm(way)), duration, touching * duration))
    lengths, durations, contacts = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    return lengths, durations, contacts


def tripod_strength(walk: Trajectory) -> float | None:
    """How well the legs of a tripod swing together, from 0 to 1.

    Tripod coordination strength of Wosnitza et al. 2013 (doi:10.1242/jeb.078139): the time that
    all three legs of a tripod swing at once ÷ the time from the first one's start of swing to the
    last one's end. Here a group is a swing of the middle leg with that swing of each other leg
    that overlaps it most; without overlap it counts 0. Mean over both tripods; None without any
    whole swing of a middle leg. Recorded swings (untethered) that start at once have 0.82.
    """
    swings = [found[:, 1:] for found in steps(walk)]
    strengths = []
    for middle, *others in TRIPODS:
        for swing in swings[middle]:
            group = [swing]
            for leg in others:
                starts, ends = swings[leg].T
                overlap = np.minimum(ends, swing[1]) - np.maximum(starts, swing[0])
                if overlap.size:
                    group.append(swings[leg][overlap.argmax()])
            starts, ends = np.array(group).T
            together = max(0, ends.min() - starts.max()) if len(group) == 3 else 0
            strengths.append(together / (ends.max() - starts.min()))
    return float(np.mean(strengths)) if strengths else None


def trajectory(samples: dict[str, Any]) -> Trajectory:
    """Trajectory from arrays by the names of its attributes; more names may be there."""
    names = [name for name in Trajectory.__dataclass_fields__ if name != "contact"]
    arrays = {name: np.asarray(samples[name], dtype=np.float64) for name in names}
    return Trajectory(**arrays, contact=np.asarray(samples["contact"], dtype=bool))
