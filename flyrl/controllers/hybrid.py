"""The hybrid controller: the CPG with two reflexes, retraction and stumbling.

Source: Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from flyrl.anatomy import LEG_DOFS, RIGHT_LEG_MIRROR, SENSED_SEGMENTS
from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import NUM_LEGS, SENSES, Step, record_of
from flyrl.controllers.cpg import TWO_PI
from flyrl.controllers.cpg_controller import OscillatorController, cpg_controller_step
from flyrl.controllers.reflexes import (
    PLAIN_REFLEX_PARAMETERS,
    REFLEXES,
    ReflexesName,
    net_correction,
    reflex_step,
)
from flyrl.controllers.steps import step_values
from flyrl.validation import FloatArray, Within, float_array

_NUM_DOFS: Final = len(LEG_DOFS)

Five = tuple[float, float, float, float, float]
Seven = tuple[float, float, float, float, float, float, float]
Segment = Literal["Tibia", "Tarsus1", "Tarsus2", "Tarsus3", "Tarsus4", "Tarsus5"]


@kernel
def hybrid_step(parameters: Any, state: Any, senses: Any, command: Any, output: Any) -> None:
    """Advance the reflexes and the CPG; let every leg follow both."""
    reflex_step(parameters, state, senses)
    cpg_controller_step(parameters, state, senses, command, output)
    for leg in range(NUM_LEGS):
        correction = net_correction(parameters, state, leg, state.phases[leg] % TWO_PI)
        state.net_correction[leg] = correction
        for dof in range(_NUM_DOFS):
            output.angles[leg * _NUM_DOFS + dof] += (
                correction * parameters.correction_vectors[leg, dof]
            )


@dataclass(frozen=True)
class Hybrid(OscillatorController):
    """The CPG with two reflexes; see `OscillatorController` for its oscillators.

    Attributes
    ----------
    reflexes
        Values of the reflexes: "current" or "classic"; None takes those that go with the steps.
    retraction, stumbling
        Factors on how quickly that reflex's corrections grow; 0 switches it off.
    front, middle, hind
        Shift of a left leg's target angles per unit of correction, rad, ordered as
        `anatomy.LEG_DOFS`. None takes the value of `reflexes`, here and below.
    mirror_right
        Whether right legs shift as mirror images of left legs, or by the same angles.
    retraction_rates, stumbling_rates
        Growth while triggered and decay otherwise, 1/s.
    cap
        Largest correction that is used.
    persistence_threshold
        Retraction amount above which retracting a leg makes it persist.
    persistence_s
        How long a leg then keeps being retracted, s.
    gain
        Gain on the correction at five phases: start of swing, its middle, its (extended) end,
        middle of stance, end of stance. Linear in between.
    swing_extension
        How much later than recorded a swing ends, for the gain's third phase and for adhesion, rad.
    retraction_ends_stumbling
        Whether the stumbling amount is dropped to 0 while a leg is being retracted.
    retraction_margin
        How much further below the thorax than the third lowest leg the lowest must be, mm.
    stumbling_force
        Contact force along the heading below which a leg stumbles, µN; not above 0.
    stumbling_segments
        Segments of `anatomy.SENSED_SEGMENTS` whose contact counts.
    """

    reflexes: ReflexesName | None = None
    retraction: Annotated[float, Within(0, 100)] = 1.0
    stumbling: Annotated[float, Within(0, 100)] = 1.0
    front: Annotated[Seven | None, Within(-10, 10)] = None
    middle: Annotated[Seven | None, Within(-10, 10)] = None
    hind: Annotated[Seven | None, Within(-10, 10)] = None
    mirror_right: bool | None = None
    retraction_rates: Annotated[tuple[float, float] | None, Within(0, 1e6)] = None
    stumbling_rates: Annotated[tuple[float, float] | None, Within(0, 1e6)] = None
    cap: Annotated[float | None, Within(0, 1e9)] = None
    persistence_threshold: Annotated[float | None, Within(0, 1e9)] = None
    persistence_s: Annotated[float | None, Within(0, 10)] = None
    gain: Annotated[Five | None, Within(-100, 100)] = None
    swing_extension: Annotated[float | None, Within(0, TWO_PI)] = None
    retraction_ends_stumbling: bool | None = None
    retraction_margin: Annotated[float | None, Within(0, 10)] = None
    stumbling_force: Annotated[float | None, Within(-1e6, 0)] = None
    stumbling_segments: tuple[Segment, ...] | None = None

    further_state: ClassVar[tuple[str, ...]] = (
        *OscillatorController.further_state,
        "retraction",
        "stumbling",
        "persistence",  # time for which a leg keeps being retracted, s
        "net_correction",
    )
    step: ClassVar[Step] = staticmethod(hybrid_step)

    def parameters(self, timestep: float) -> np.void:
        """Constants that the kernel takes."""
        published = REFLEXES[
            self.reflexes or ("classic" if self.steps == "tethered" else "current")
        ]
        own = {name: getattr(self, name) for name in published}
        reflexes = published | {name: value for name, value in own.items() if value is not None}
        steps = self.load_steps()
        left = np.array([reflexes["front"], reflexes["middle"], reflexes["hind"]])
        right = left * RIGHT_LEG_MIRROR if reflexes["mirror_right"] else left
        start, end = np.zeros(NUM_LEGS), np.full(NUM_LEGS, TWO_PI)
        swing_end, extended = steps.swing_ends, steps.swing_ends + reflexes["swing_extension"]
        points = (start, swing_end / 2, extended, (swing_end + TWO_PI) / 2, end)
        # first: a record that began as the CPG's does would count as one to Numba
        values = {
            "correction_vectors": np.concatenate([left, right]),  # rad per unit of correction
            "retraction_rates": np.multiply(reflexes["retraction_rates"], (self.retraction, 1.0)),
            "stumbling_rates": np.multiply(reflexes["stumbling_rates"], (self.stumbling, 1.0)),
            # 1 where contact counts, else 0
            "stumbling_sensors": np.isin(SENSED_SEGMENTS, reflexes["stumbling_segments"]),
            "gain_phases": np.stack(points, axis=1),  # rad
            **{name: reflexes[name] for name in PLAIN_REFLEX_PARAMETERS},
        }
        oscillators = self.oscillator_values(timestep)
        return record_of(
            {**values, **oscillators, **step_values(steps, reflexes["swing_extension"])}
        )


class Reflexes:
    """The two reflexes of all six legs, without the oscillators, for a loop in Python.

    Attributes
    ----------
    retraction, stumbling : array
        Amounts, shape (6,), from 0.
    vectors : array
        Shift of each leg's target angles per unit of correction, rad, shape (6, 7).
    grip_starts : array
        Phases at which legs grip again, rad, shape (6,).

    Parameters
    ----------
    timestep
        s.
    controller
        Settings of the reflexes.

    Raises
    ------
    ValueError
        If the time step is not above 0.
    """

    def __init__(self, timestep: float, controller: Hybrid) -> None:
        self._parameters = controller.parameters(timestep)
        self._state = controller.initial_state()
        self._senses: np.void = np.zeros(1, dtype=SENSES)[0]
        self.retraction: FloatArray = self._state["retraction"]
        self.stumbling: FloatArray = self._state["stumbling"]
        self.vectors: FloatArray = self._parameters["correction_vectors"]
        self.grip_starts: FloatArray = self._parameters["grip_start"]

    def step(
        self,
        thorax_z: float,
        end_effector_z: ArrayLike,
        contact_forces_w: ArrayLike,
        heading_w: ArrayLike,
    ) -> None:
        """Advance by one time step under an observation.

        Parameters
        ----------
        thorax_z, end_effector_z
            Heights, mm, number and shape (6,), ordered as `anatomy.LEGS`.
        contact_forces_w
            µN, world frame, shape (36, 3), ordered as `anatomy.CONTACT_SEGMENTS`.
        heading_w
            Unit vector, world frame, shape (3,).

        Raises
        ------
        ValueError
            If an array has the wrong shape or is not finite.
        """
        # On a fresh record, so that arrays handed out before keep the values of their time.
        self._state = self._state.copy()
        sensed = {
            "thorax_z": thorax_z,
            "end_effector_z": end_effector_z,
            "contact_forces_w": contact_forces_w,
            "heading_w": heading_w,
        }
        for name, values in sensed.items():
            self._senses[name] = float_array(name, values, SENSES[name].shape)
        reflex_step(self._parameters, self._state, self._senses)
        self.retraction, self.stumbling = self._state["retraction"], self._state["stumbling"]

    def net_corrections(self, phases: ArrayLike) -> FloatArray:
        """Each leg's correction at its phase (rad, any number), shape (6,)."""
        thetas = float_array("phases", phases, (NUM_LEGS,)) % TWO_PI
        legs = range(NUM_LEGS)
        return np.array(
            [net_correction(self._parameters, self._state, leg, thetas[leg]) for leg in legs]
        )
