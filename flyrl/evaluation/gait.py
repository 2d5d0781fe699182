"""Measures of a gait: strides, duty factor, coordination of the tripods, slip, cost.

Each function takes plain arrays; a figure that a gait cannot have (the length of a stride that was
never taken) is None. Rasters have a row per sample and a column per leg, ordered as `anatomy.LEGS`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import LEGS, TRIPODS
from flyrl.rollouts import BoolArray
from flyrl.validation import FloatArray

BLIP_S: Final = 0.01
"""Stance and swing phases shorter than half of this are filtered out, s."""

LEAST_STRIDE_MM: Final = 0.15
"""Least movement of the body from touchdown to touchdown of a leg, mm: half of that at drive 0.3.

Legs that lose and regain the ground, or their grip, take no stride with less.
"""

ARM_MM: Final = 1.0
"""Distance from the thorax at which a turn on the spot counts as movement, mm: about a leg."""

Interval = tuple[int, int]


def moved_mm(start: FloatArray, end: FloatArray) -> FloatArray:
    """Movement of the body between places (..., 3): x and y in mm, yaw in rad; mm, shape (...)."""
    dx, dy, turn = np.moveaxis(end - start, -1, 0)
    return np.asarray(np.hypot(dx, dy) + ARM_MM * np.abs(turn))


def step_raster(stance: BoolArray, places: FloatArray, interval_s: float) -> BoolArray:
    """Stance (S, 6) without blips, and without swings that do not end a stride.

    Parameters
    ----------
    places
        Of the body: x and y in mm, yaw in rad, shape (S, 3).
    """
    raster = without_blips(stance, interval_s)
    for leg, found in enumerate(swings(raster)):
        before = 0
        for start, end in found:
            if moved_mm(places[before], places[end]) < LEAST_STRIDE_MM:
                raster[start:end, leg] = True
            before = end
    return raster


def without_blips(stance: BoolArray, interval_s: float) -> BoolArray:
    """A raster (S, 6) without what is shorter than half of `BLIP_S`."""
    from scipy import ndimage  # noqa: PLC0415 - slow to import

    window = 2 * round(BLIP_S / interval_s / 2) + 1
    if len(stance) == 0:
        return stance
    filtered = ndimage.median_filter(stance.astype(np.uint8), size=(window, 1), mode="nearest")
    return np.asarray(filtered, dtype=bool)


def touchdowns(stance: BoolArray) -> list[NDArray[np.intp]]:
    """Samples at which each leg touches down, in order."""
    steps = np.diff(stance.astype(np.int8), axis=0)
    return [np.flatnonzero(steps[:, leg] == 1) + 1 for leg in range(stance.shape[1])]


def swings(stance: BoolArray) -> list[list[Interval]]:
    """Whole swings of each leg: samples of lift-off and of touchdown."""
    steps = np.diff(stance.astype(np.int8), axis=0)
    found = []
    for leg, ends in enumerate(touchdowns(stance)):
        starts = np.flatnonzero(steps[:, leg] == -1) + 1
        after = np.searchsorted(ends, starts, side="right")
        found.append(
            [
                (int(start), int(ends[i]))
                for start, i in zip(starts, after, strict=True)
                if i < len(ends)
            ]
        )
    return found


def stride_frequency_hz(stance: BoolArray, interval_s: float) -> float | None:
    """Strides per second, from touchdown to touchdown: mean over the legs that took one."""
    rates = [
        (len(downs) - 1) / ((downs[-1] - downs[0]) * interval_s)
        for downs in touchdowns(stance)
        if len(downs) > 1
    ]
    return float(np.mean(rates)) if rates else None


def duty_factor(stance: BoolArray) -> float | None:
    """Share of a leg's strides that it stands: mean over the legs that took one."""
    shares = [
        stance[downs[0] : downs[-1], leg].mean()
        for leg, downs in enumerate(touchdowns(stance))
        if len(downs) > 1
    ]
    return float(np.mean(shares)) if shares else None


def tripod_coordination(stance: BoolArray) -> float | None:
    """Overlap of the swings of a tripod's legs: 1 as one, 0 never all three.

    For each swing of a middle leg and the swings of its partners that are nearest to it in time:
    the time during which all three swing, over that from the first lift-off to the last touchdown.
    The mean over all swings of both middle legs.

    Notes
    -----
    Wosnitza et al. 2013, doi 10.1242/jeb.078139.
    """
    found = dict(zip(LEGS, swings(stance), strict=True))
    strengths = []
    for legs in TRIPODS:
        middle = next(leg for leg in legs if leg.endswith("M"))
        partners = [leg for leg in legs if leg != middle]
        if not all(found[leg] for leg in partners):
            continue
        for swing in found[middle]:
            three = [swing, *(_nearest(found[leg], swing) for leg in partners)]
            starts, ends = zip(*three, strict=True)
            together, whole = min(ends) - max(starts), max(ends) - min(starts)
            strengths.append(max(0, together) / whole)
    return float(np.mean(strengths)) if strengths else None


def _nearest(candidates: list[Interval], swing: Interval) -> Interval:
    return min(candidates, key=lambda other: abs(sum(other) - sum(swing)))


def reflex_activity(retraction: BoolArray, stumbling: BoolArray) -> float | None:
    """Share of the time that a reflex corrects a leg, mean over the legs."""
    return float((retraction | stumbling).mean()) if len(retraction) else None


def drive_variation(drive: FloatArray, time_s: FloatArray) -> float | None:
    """Change of the drives per second, mean of left and right, 1/s; 0 if they are held.

    Parameters
    ----------
    drive
        Left and right, shape (T, 2); the first, before any decision, does not count.
    time_s
        Since the start, shape (T,).
    """
    if len(drive) < 3:
        return None
    changes = np.abs(np.diff(drive[1:], axis=0)).sum(axis=0)
    return float(changes.mean() / (time_s[-1] - time_s[1]))
