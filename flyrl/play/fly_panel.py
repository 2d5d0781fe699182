"""The panel of a played fly."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import LEG_DOFS, LEGS
from flyrl.controllers.gait_log import SAMPLING_S, unpack
from flyrl.play.fly_setting import CHOICES, PlayedFlyConfig
from flyrl.play.fly_walk import GAIT_SPAN_S
from flyrl.play.panel import (
    Bars,
    Button,
    Choice,
    Dials,
    Line,
    Raster,
    Section,
    Slider,
    Switch,
    Values,
    Widget,
)
from flyrl.tasks import DRIVE_HIGH, DRIVE_LOW, RUNNING, UNSTABLE
from flyrl.tasks.terms import CORRECTION_CAP
from flyrl.validation import FloatArray

LEFT, RIGHT, STEERING, STOP = "left", "right", "steering", "stop"
"""Names of the widgets that steer; those that make another scene are keys of `PlayedFlyConfig`."""

GAIT_PLACES: Final = 100
"""Parts that the gait's span is shown in."""

_ENDS: Final = {
    "fall": "It fell over",
    "left_arena": "It left the arena",
    UNSTABLE: "The physics blew up",
}


@dataclass(frozen=True)
class FlyView:
    """What a panel tells of a fly.

    Attributes
    ----------
    config
        What it is made of.
    steering, pilots
        Who steers, and who could.
    drive
        Left and right.
    speed_mm_s, distance_mm
        How fast it is, and how far from the target.
    outcome
        "running", or how it has ended.
    phases, magnitudes, retraction, stumbling
        Of the legs as in `FlyState`, (6,).
    gait
        Samples of `flyrl.controllers.gait_log`, oldest first, (T,).
    rewards, returns
        Of the last decision and since the start, by name of the term.
    tensions
        Of the legs' muscles as in `FlyState`, (84,); (0,) without muscles.
    """

    config: PlayedFlyConfig
    steering: str
    pilots: tuple[str, ...]
    drive: tuple[float, float]
    speed_mm_s: float
    distance_mm: float
    outcome: str
    phases: FloatArray
    magnitudes: FloatArray
    retraction: FloatArray
    stumbling: FloatArray
    gait: NDArray[np.uint32]
    rewards: Mapping[str, float]
    returns: Mapping[str, float]
    tensions: FloatArray


def fly_sections(view: FlyView) -> tuple[Section, ...]:
    """What the panel shows: how it fares, steering, legs, scene, reward, and muscles if any."""
    return (
        Section("Fly", _fares(view)),
        Section("Steering", _steering(view)),
        Section("Legs", _legs(view)),
        Section("Scene", _scene(view)),
        Section("Reward", _reward(view)),
        *_muscles(view.tensions),
    )


def gait_rows(samples: NDArray[np.uint32]) -> tuple[str, ...]:
    """Which leg stands when, as rows of a `Raster`: a leg each, `GAIT_PLACES` long, latest last.

    Parameters
    ----------
    samples
        Of `flyrl.controllers.gait_log`, oldest first, (T,). What is older than `GAIT_SPAN_S` must
        not be among them.
    """
    per_place = round(GAIT_SPAN_S / SAMPLING_S / GAIT_PLACES)
    known = len(samples) // per_place
    latest = samples[len(samples) - known * per_place :]
    stands = unpack(latest)["stance"].reshape(known, per_place, len(LEGS)).mean(axis=1) >= 0.5
    return tuple(
        "".join("1" if is_so else "0" for is_so in leg).rjust(GAIT_PLACES) for leg in stands.T
    )


def _fares(view: FlyView) -> tuple[Widget, ...]:
    values = Values(("speed, mm/s", "to the target, mm"), (view.speed_mm_s, view.distance_mm))
    if view.outcome == RUNNING:
        return (values,)
    end = _ENDS.get(view.outcome, view.outcome)
    return (Line(f"{end} ({view.outcome}). Reset to go on."), values)


def _steering(view: FlyView) -> tuple[Widget, ...]:
    left, right = view.drive
    widgets: list[Widget] = [
        Choice(STEERING, "who steers", view.pilots, view.steering),
        Slider(LEFT, "drive, left", DRIVE_LOW, DRIVE_HIGH, left),
        Slider(RIGHT, "drive, right", DRIVE_LOW, DRIVE_HIGH, right),
        Button(STOP, "Stop"),
    ]
    if view.config.controller == "rule_based":
        widgets.append(Line("The rules heed no drive: they walk straight on."))
    return tuple(widgets)


def _legs(view: FlyView) -> tuple[Widget, ...]:
    is_ruled = view.config.controller == "rule_based"
    phases = tuple(np.mod(view.phases, 2 * np.pi).round(3).tolist())
    magnitudes = tuple(_shares(view.magnitudes, 1.0 if is_ruled else DRIVE_HIGH))
    widgets: list[Widget] = [
        Line("phases of the steps" if is_ruled else f"oscillators, up to {DRIVE_HIGH:g}"),
        Dials(LEGS, phases, magnitudes),
        Line("legs that stand"),
        Raster(LEGS, gait_rows(view.gait), GAIT_SPAN_S),
    ]
    if view.config.controller == "hybrid":
        for name, amounts in (("retraction", view.retraction), ("stumbling", view.stumbling)):
            widgets.append(Line(f"{name}, up to {CORRECTION_CAP:g}"))
            widgets.append(Bars(LEGS, tuple(_shares(amounts, CORRECTION_CAP))))
    return tuple(widgets)


def _scene(view: FlyView) -> tuple[Widget, ...]:
    config = view.config
    labels = {"controller": "leg controller"}
    choices = (
        Choice(key, labels.get(key, key), options, getattr(config, key))
        for key, options in CHOICES.items()
    )
    of_hybrid = "" if config.controller == "hybrid" else " (hybrid alone)"
    return (
        *choices,
        Switch("retraction", f"retraction reflex{of_hybrid}", config.retraction),
        Switch("stumbling", f"stumbling reflex{of_hybrid}", config.stumbling),
        Switch("adhesion", "adhesion", config.adhesion),
    )


def _reward(view: FlyView) -> tuple[Widget, ...]:
    return (
        Line("of the last decision"),
        _summed(view.rewards),
        Line("since the start"),
        _summed(view.returns),
    )


def _summed(terms: Mapping[str, float]) -> Values:
    values = (*terms.values(), sum(terms.values()))
    # -0.0 becomes 0.0
    return Values((*terms, "sum"), tuple(round(value, 3) + 0.0 for value in values))


def _muscles(tensions: FloatArray) -> tuple[Section, ...]:
    """Mean tension of each leg, and a section per leg with all its muscles, to be unfolded."""
    if not tensions.size:
        return ()
    legs = tensions.reshape(len(LEGS), 2 * len(LEG_DOFS))
    labels = tuple(f"{dof} {way}" for dof in LEG_DOFS for way in "+-")
    return (
        Section("Muscles", (Bars(LEGS, tuple(_shares(legs.mean(axis=1), 1.0))),)),
        *(
            Section(f"Muscles of {leg}", (Bars(labels, tuple(_shares(row, 1.0))),), is_open=False)
            for leg, row in zip(LEGS, legs, strict=True)
        ),
    )


def _shares(values: FloatArray, largest: float) -> list[float]:
    return [round(float(value), 3) for value in np.clip(values / largest, 0.0, 1.0)]
