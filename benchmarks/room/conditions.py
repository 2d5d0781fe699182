"""Where room is looked for: tasks, grounds and bodies."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from flyrl.bodies.fly import FLIES
from flyrl.simulation.randomisation import RandomisationConfig

_BODY: Final = FLIES["current"]


def _lesion(leg: str) -> dict[str, Any]:
    return {"body": replace(_BODY, missing_legs=(leg,))}


CONDITIONS: Final[Mapping[str, Mapping[str, Any]]] = {
    "flat": {},
    "gapped": {"terrain": "random_gapped"},
    "blocks": {"terrain": "random_blocks"},
    "mixed": {"terrain": "random_mixed"},
    "hills": {"terrain": "random_hills"},
    "slope_30": {"terrain": {"name": "slope", "angle_range_deg": (30.0, 30.0)}},
    "slope_60": {"terrain": {"name": "slope", "angle_range_deg": (60.0, 60.0)}},
    "front_leg_cut": _lesion("LF"),
    "middle_leg_cut": _lesion("LM"),
    "hind_leg_cut": _lesion("LH"),
    "adhesion_30": {"randomisation": RandomisationConfig(adhesion=(0.3, 0.3))},
    "latency_50_ms": {"randomisation": RandomisationConfig(drive_latency=(0.05, 0.05))},
    "pushes": {"task": "heading"},
    "path": {"task": "path"},
    "path_mixed": {"task": "path", "terrain": "random_mixed"},
    "traverse_blocks": {"task": "traverse", "terrain": "random_blocks"},
}
"""Settings of `EnvConfig` by condition; what is not named is as usual: the task `target`."""
