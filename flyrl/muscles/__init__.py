"""Motor-pool muscles: recruit neurons, get tension; and where muscles act in a model.

After cortex, Simulated Muscles, R. McIntyre (2012-14).
"""

from flyrl.muscles.attachment import AttachedMuscle as AttachedMuscle
from flyrl.muscles.attachment import Creature as Creature
from flyrl.muscles.attachment import attach_muscles as attach_muscles
from flyrl.muscles.attachment import load_creature as load_creature
from flyrl.muscles.attachment import movement as movement
from flyrl.muscles.muscle import MotorPool as MotorPool
from flyrl.muscles.muscle import Muscle as Muscle
from flyrl.muscles.muscle import PackedMuscles as PackedMuscles
from flyrl.muscles.muscle import pack_muscles as pack_muscles
