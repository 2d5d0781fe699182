"""The hybrid controller: the CPG with two reflexes, retraction and stumbling.

Source: Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y.
"""

from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from flyrl.anatomy import CONTACT_SEGMENTS, LEG_DOFS, LEGS, SENSED_SEGMENTS
from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import NUM_LEGS, Step
from flyrl.controllers.cpg import cpg_step, modulate
from flyrl.controllers.cpg_controller import (
    OSCILLATOR_PARAMETERS,
    OSCILLATOR_STATE,
    OscillatorController,
)
from flyrl.controllers.reflexes import (
    REFLEXES,
    TWO_PI,
    ReflexesName,
    ReflexParameters,
    net_correction,
    reflex_step,
)
from flyrl.controllers.steps import pack_step, step_fields, take_steps
from flyrl.validation import FloatArray, Within, float_array, positive

_NUM_DOFS: Final = len(LEG_DOFS)

Five = tuple[float, float, float, float, float]
Seven = tuple[float, float, float, float, float, float, float]
Segment = Literal["Tibia", "Tarsus1", "Tarsus2", "Tarsus3", "Tarsus4", "Tarsus5"]

_REFLEX_PARAMETERS: Final = [
    ("correction_vectors", "f8", (NUM_LEGS, _NUM_DOFS)),
    ("retraction_margin", "f8"),
    ("stumbling_force", "f8"),
    ("retraction_rates", "f8", (2,)),
    ("stumbling_rates", "f8", (2,)),
    ("persistence_threshold", "f8"),
    ("persistence_s", "f8"),
    ("retraction_ends_stumbling", "f8"),
    ("stumbling_sensors", "f8", (len(SENSED_SEGMENTS),)),
    ("correction_cap", "f8"),
    ("gain_phases", "f8", (NUM_LEGS, 5)),
    ("gain", "f8", (5,)),
]

_STATE: Final = np.dtype(
    [
        *OSCILLATOR_STATE,
        ("retraction", "f8", (NUM_LEGS,)),
        ("stumbling", "f8", (NUM_LEGS,)),
        ("persistence", "f8", (NUM_LEGS,)),  # s
        ("net_correction", "f8", (NUM_LEGS,)),
    ]
)


@kernel
def hybrid_step(parameters: Any, state: Any, senses: Any, command: Any, output: Any) -> None:
    """Advance the reflexes and the CPG; let every leg follow both."""
    reflex_step(
        state.retraction,
        state.stumbling,
        state.persistence,
        senses.thorax_z,
        senses.end_effector_z,
        senses.contact_forces_w,
        senses.heading_w,
        parameters.retraction_margin,
        parameters.stumbling_force,
        parameters.retraction_rates,
        parameters.stumbling_rates,
        parameters.persistence_threshold,
        parameters.persistence_s,
        parameters.retraction_ends_stumbling,
        parameters.stumbling_sensors,
        parameters.timestep,
    )
    # as in `cpg_controller`: a kernel of both would take two types of records, of which Numba warns
    modulate(command, parameters.frequency, parameters.amplitude, state.freqs, state.amps)
    cpg_step(
        state.phases,
        state.magnitudes,
        state.freqs,
        state.amps,
        parameters.coupling_weights,
        parameters.phase_biases,
        parameters.convergence_coefs,
        parameters.timestep,
        state.scratch,
    )
    take_steps(
        parameters.coefficients,
        parameters.neutral,
        parameters.swing_start,
        parameters.grip_start,
        state.phases,
        state.magnitudes,
        output,
    )
    for leg in range(NUM_LEGS):
        correction = net_correction(
            state.retraction[leg],
            state.stumbling[leg],
            parameters.correction_cap,
            state.phases[leg] % TWO_PI,
            parameters.gain_phases[leg],
            parameters.gain,
        )
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
    front, middle, hind, mirror_right, retraction_rates, stumbling_rates, cap
        As in `ReflexParameters`, as are the following; None takes the value of `reflexes`.
    persistence_threshold, persistence_s, gain, swing_extension, retraction_ends_stumbling
        See above.
    retraction_margin, stumbling_force, stumbling_segments
        See above.
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
    stumbling_force: Annotated[float | None, Within(-1e6, 1e6)] = None
    stumbling_segments: tuple[Segment, ...] | None = None

    step: ClassVar[Step] = staticmethod(hybrid_step)

    @property
    def reflex_parameters(self) -> ReflexParameters:
        """Values of the reflexes."""
        own: ReflexesName = "classic" if self.steps == "tethered" else "current"
        published = REFLEXES[self.reflexes or own]
        own_values = {
            field.name: value
            for field in fields(ReflexParameters)
            if (value := getattr(self, field.name)) is not None
        }
        published = replace(published, **own_values)
        growth, decay = published.retraction_rates
        retraction_rates = (self.retraction * growth, decay)
        growth, decay = published.stumbling_rates
        stumbling_rates = (self.stumbling * growth, decay)
        return replace(
            published, retraction_rates=retraction_rates, stumbling_rates=stumbling_rates
        )

    def parameters(self, timestep: float) -> np.void:
        """Constants that the kernel takes."""
        steps, reflexes = self.load_steps(), self.reflex_parameters
        fields = [*OSCILLATOR_PARAMETERS, *step_fields(steps), *_REFLEX_PARAMETERS]
        record: np.void = np.zeros(1, dtype=fields)[0]
        self.pack_oscillators(record, timestep)
        pack_step(record, steps, reflexes.swing_extension)
        record["correction_vectors"] = reflexes.leg_vectors()
        record["retraction_margin"] = reflexes.retraction_margin
        record["stumbling_force"] = reflexes.stumbling_force
        record["retraction_rates"] = reflexes.retraction_rates
        record["stumbling_rates"] = reflexes.stumbling_rates
        record["persistence_threshold"] = reflexes.persistence_threshold
        record["persistence_s"] = reflexes.persistence_s
        record["retraction_ends_stumbling"] = reflexes.retraction_ends_stumbling
        record["stumbling_sensors"] = reflexes.stumbling_sensors()
        record["correction_cap"] = reflexes.cap
        record["gain_phases"] = reflexes.gain_phases(steps.swing_ends)
        record["gain"] = reflexes.gain
        return record

    def initial_state(
        self,
        seed: int = 0,
        init_phases: ArrayLike | None = None,
        init_magnitudes: ArrayLike | None = None,
    ) -> np.void:
        """Oscillators as an episode starts, and reflexes at rest."""
        record: np.void = np.zeros(1, dtype=_STATE)[0]
        self.start_oscillators(record, seed, init_phases, init_magnitudes)
        return record


class Reflexes:
    """The two reflexes of all six legs.

    Attributes
    ----------
    retraction, stumbling : array
        Amounts, shape (6,), from 0.
    persistence : array
        Time for which each leg keeps being retracted, s, shape (6,).
    vectors : array
        Shift of each leg's target angles per unit of correction, rad, shape (6, 7).

    Parameters
    ----------
    timestep
        s.
    parameters
        E.g. `CLASSIC` or `CURRENT`.
    swing_ends
        Phase at which each leg's recorded swing ends, rad, shape (6,).

    Raises
    ------
    ValueError
        If the time step is not above 0 or the swing ends are not six phases.
    """

    def __init__(
        self, timestep: float, parameters: ReflexParameters, swing_ends: ArrayLike
    ) -> None:
        self.timestep = positive("timestep", timestep)
        self.parameters = parameters
        self.vectors = parameters.leg_vectors()
        self._gain_phases = parameters.gain_phases(float_array("swing_ends", swing_ends, (6,)))
        self._gain = np.array(parameters.gain)
        self._stumbling_sensors = parameters.stumbling_sensors()
        self._retraction_rates = np.array(parameters.retraction_rates)
        self._stumbling_rates = np.array(parameters.stumbling_rates)
        self.retraction = np.zeros(len(LEGS))
        self.stumbling = np.zeros(len(LEGS))
        self.persistence = np.zeros(len(LEGS))

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
        p = self.parameters
        # On fresh arrays, so that those handed out before keep the values of their time.
        self.retraction = self.retraction.copy()
        self.stumbling = self.stumbling.copy()
        self.persistence = self.persistence.copy()
        reflex_step(
            self.retraction,
            self.stumbling,
            self.persistence,
            float_array("thorax_z", thorax_z, ()).item(),
            float_array("end_effector_z", end_effector_z, (len(LEGS),)),
            float_array("contact_forces_w", contact_forces_w, (len(CONTACT_SEGMENTS), 3)),
            float_array("heading_w", heading_w, (3,)),
            p.retraction_margin,
            p.stumbling_force,
            self._retraction_rates,
            self._stumbling_rates,
            p.persistence_threshold,
            p.persistence_s,
            float(p.retraction_ends_stumbling),
            self._stumbling_sensors,
            self.timestep,
        )

    def net_corrections(self, phases: ArrayLike) -> FloatArray:
        """Each leg's correction at its phase (rad, any number), shape (6,)."""
        thetas = float_array("phases", phases, (len(LEGS),)) % TWO_PI
        return np.array(
            [
                net_correction(
                    self.retraction[leg],
                    self.stumbling[leg],
                    self.parameters.cap,
                    thetas[leg],
                    self._gain_phases[leg],
                    self._gain,
                )
                for leg in range(len(LEGS))
            ]
        )
