"""Where room is looked for: tasks, grounds and bodies."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from flyrl.bodies.fly import FLIES, LegMuscles
from flyrl.simulation.randomisation import RANDOMISATIONS, RandomisationConfig

_BODY: Final = FLIES["current"]
_ROUGH: Final = "random_mixed"
_TIGHT: Final = {"name": "slalom", "spacing": (3.0, 5.0), "turn": 120.0, "time_limit": 3.0}
_TIGHTER: Final = {**_TIGHT, "spacing": (2.0, 4.0), "turn": 150.0}
_LESION: Final = RANDOMISATIONS["lesion"]
_LATENCY: Final = RandomisationConfig(drive_latency=(0.05, 0.05))
_LITTLE_ADHESION: Final = RandomisationConfig(adhesion=(0.3, 0.3))
_WEAK_LEFT: Final = replace(FLIES["fly_muscles"], muscles=LegMuscles(left=0.5))

CONDITIONS: Final[Mapping[str, Mapping[str, Any]]] = {
    "flat": {},
    "gapped": {"terrain": "random_gapped"},
    "blocks": {"terrain": "random_blocks"},
    "mixed": {"terrain": _ROUGH},
    "hills": {"terrain": "random_hills"},
    "any": {"terrain": "any"},
    "slope_30": {"terrain": {"name": "slope", "angle_range_deg": (30.0, 30.0)}},
    "slope_60": {"terrain": {"name": "slope", "angle_range_deg": (60.0, 60.0)}},
    "stairs": {"terrain": {"name": "examples.stairs:Stairs"}},
    "front_leg_cut": {"body": replace(_BODY, missing_legs=("LF",))},
    "middle_leg_cut": {"body": replace(_BODY, missing_legs=("LM",))},
    "hind_leg_cut": {"body": replace(_BODY, missing_legs=("LH",))},
    "any_leg_cut": {"terrain": "any", "randomisation": _LESION},
    "weak_left_side": {"body": _WEAK_LEFT},
    "adhesion_30": {"randomisation": _LITTLE_ADHESION},
    "latency_50_ms": {"randomisation": _LATENCY},
    "unfiltered": {"task": "target_unfiltered"},
    "unfiltered_mixed": {"task": "target_unfiltered", "terrain": _ROUGH},
    "pushes": {"task": "heading"},
    "pushes_any": {"task": "heading", "terrain": "any"},
    "slalom": {"task": "slalom"},
    "slalom_tight": {"task": _TIGHT},
    "slalom_tighter": {"task": _TIGHTER},
    "slalom_tighter_any": {"task": _TIGHTER, "terrain": "any"},
    "slalom_tighter_weak_left_side": {"task": _TIGHTER, "body": _WEAK_LEFT},
    "slalom_tighter_adhesion_30": {"task": _TIGHTER, "randomisation": _LITTLE_ADHESION},
    "slalom_tighter_unfiltered": {"task": {**_TIGHTER, "drive_time_constant": 0.0}},
    "slalom_tight_latency_50_ms": {"task": _TIGHT, "randomisation": _LATENCY},
    "slalom_tight_hills": {"task": _TIGHT, "terrain": "random_hills"},
    "slalom_tight_any": {"task": _TIGHT, "terrain": "any"},
    "slalom_tight_mixed": {"task": _TIGHT, "terrain": _ROUGH},
    "slalom_mixed": {"task": {"name": "slalom", "spacing": (3.0, 5.0)}, "terrain": _ROUGH},
    "chase": {"task": "chase"},
    "chase_fast": {"task": {"name": "chase", "speed": 14.0}},
    "chase_mixed": {"task": "chase", "terrain": _ROUGH},
    "stop": {"task": "stop"},
    "stop_precisely": {"task": {"name": "stop", "reach": 0.5, "kept": 1.0}},
    "stop_mixed": {"task": "stop", "terrain": _ROUGH},
    "path": {"task": "path"},
    "narrow_path": {"task": {"name": "path", "width": 2.0}},
    "path_mixed": {"task": "path", "terrain": _ROUGH},
    "velocity": {"task": "velocity"},
    "velocity_any_leg_cut": {"task": "velocity", "randomisation": _LESION},
    "traverse_blocks": {"task": "traverse", "terrain": "random_blocks"},
}  # fmt: skip
"""Settings of `EnvConfig` by condition; what is not named is as usual: the task `target`."""
