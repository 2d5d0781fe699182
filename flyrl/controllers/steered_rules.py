"""The stepping rules with a drive: a side's steps are as long, and lead where, its drive says.

The rules decide which leg steps next, as without a drive; the drive acts as it does on the CPG.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final

import numpy as np

from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import NUM_LEGS, Step
from flyrl.controllers.cpg import TRIPOD_CONVERGENCE_RATE
from flyrl.controllers.rule_based import RuleBased, advance_rules
from flyrl.controllers.steps import take_step
from flyrl.validation import Within

_LEGS_PER_SIDE: Final = NUM_LEGS // 2


@kernel
def steered_rules_step(parameters: Any, state: Any, senses: Any, command: Any, output: Any) -> None:
    """Advance the coordination; let each side's magnitude follow its drive, and its legs step."""
    advance_rules(parameters, state)
    for side in range(2):
        state.strength[side] += parameters.followed * (command[side] - state.strength[side])
    for leg in range(NUM_LEGS):
        strength, phase = state.strength[leg // _LEGS_PER_SIDE], state.phases[leg]
        if strength < 0.0:
            # the recorded step in reverse, whose swing comes first all the same
            phase = parameters.grip_start[leg] - phase
        state.magnitudes[leg] = abs(strength)
        take_step(parameters, leg, phase, state.magnitudes[leg], output)


@dataclass(frozen=True)
class SteeredRules(RuleBased):
    """Walknet's rules 1 to 3, whose steps follow a drive; no model of the literature.

    The magnitude of a side's steps approaches the size of its drive, and a negative drive has its
    legs step backwards. A drive of (1, 1) leads to `RuleBased`.

    Attributes
    ----------
    convergence_rate
        Rate at which magnitudes follow the drive, 1/s; the CPG's by default.
    """

    convergence_rate: Annotated[float, Within(0, 1e3)] = TRIPOD_CONVERGENCE_RATE

    follows_command: ClassVar[bool] = True
    step: ClassVar[Step] = staticmethod(steered_rules_step)

    def parameter_values(self, timestep: float) -> dict[str, Any]:
        """Fields of the parameters."""
        # first: at the end, Numba would take the record for a subtype of the one without, and warn;
        # share of the difference to the drive, per physics step, explicit as the CPG's
        followed = {"followed": self.convergence_rate * timestep}
        return {**followed, **super().parameter_values(timestep)}

    def state_values(self, seed: int) -> dict[str, Any]:
        """Fields of the state as an episode starts, without a drive yet."""
        strength = {"strength": np.zeros(2)}  # of each side's steps
        magnitudes = {"magnitudes": np.zeros(NUM_LEGS)}
        return {**strength, **super().state_values(seed), **magnitudes}
