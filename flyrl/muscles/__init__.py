"""Motor-pool muscles: recruit neurons, get tension; and where muscles act in a model.

After cortex, Simulated Muscles, R. McIntyre (2012-14).
"""

from flyrl.muscles.attachment import (
    AttachedMuscle,
    Creature,
    attach_muscles,
    load_creature,
    movement,
)
from flyrl.muscles.muscle import MotorPool, Muscle, PackedMuscles, pack_muscles

__all__ = [
    "AttachedMuscle",
    "Creature",
    "MotorPool",
    "Muscle",
    "PackedMuscles",
    "attach_muscles",
    "load_creature",
    "movement",
    "pack_muscles",
]
