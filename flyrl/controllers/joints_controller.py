"""No leg controller at all: the command is the joints' target angles and the legs' adhesion.

It is the published low-level environment (Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y),
and the way for a program's own oscillators, or for a recording, to move the fly.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from flyrl.anatomy import JOINTS, LEGS
from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import NUM_JOINTS, NUM_LEGS, Command, Controller, Step

JOINTS_COMMAND: Final = Command(
    (*JOINTS, *(f"adhesion_{leg}" for leg in LEGS)),
    (-np.pi,) * NUM_JOINTS + (0.0,) * NUM_LEGS,
    (np.pi,) * NUM_JOINTS + (1.0,) * NUM_LEGS,
)
"""Target angles, rad, then adhesion: 1 grips, 0 does not."""


@kernel
def joints_step(parameters: Any, state: Any, senses: Any, command: Any, output: Any) -> None:
    """Hand the command on."""
    for joint in range(NUM_JOINTS):
        output.angles[joint] = command[joint]
    for leg in range(NUM_LEGS):
        output.adhesion[leg] = command[NUM_JOINTS + leg]


@dataclass(frozen=True)
class Joints(Controller):
    """The command itself: 42 target angles, rad, ordered as `anatomy.JOINTS`, and 6 adhesions."""

    command: ClassVar[Command] = JOINTS_COMMAND
    step: ClassVar[Step] = staticmethod(joints_step)
