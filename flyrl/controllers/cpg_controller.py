"""The CPG alone: six coupled oscillators, each of which takes the recorded steps of one leg.

Source: Ijspeert et al. 2007, doi 10.1126/science.1138353; Wang-Chen et al. 2024,
doi 10.1038/s41592-024-02497-y.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import (
    DRIVE,
    DRIVE_HIGH,
    DRIVE_LOW,
    NUM_LEGS,
    Command,
    Controller,
    Step,
    record_of,
)
from flyrl.controllers.cpg import (
    TRIPOD_AMPLITUDE,
    TRIPOD_CONVERGENCE_RATE,
    TRIPOD_COUPLING_WEIGHT,
    TRIPOD_FREQUENCY_HZ,
    TWO_PI,
    cpg_step,
    gait_coupling_weights,
    gait_phase_biases,
    initial_oscillators,
    modulate,
)
from flyrl.controllers.steps import PreprogrammedSteps, StepsName, step_values, take_steps
from flyrl.validation import FloatArray, Within, check_fields, positive, random_seed

Gait = Literal["tripod", "tetrapod", "wave"]

_BIAS_TOLERANCE: Final = 0.02
"""rad; of phase biases that are written with few digits."""

Six = tuple[float, float, float, float, float, float]
SixBySix = tuple[Six, Six, Six, Six, Six, Six]


@kernel
def cpg_controller_step(
    parameters: Any, state: Any, senses: Any, command: Any, output: Any
) -> None:
    """Advance the CPG and let every leg follow its oscillator."""
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
    take_steps(parameters, state, output)


@dataclass(frozen=True)
class OscillatorController(Controller):
    """Settings of six oscillators, each of which takes the steps of one leg.

    Attributes
    ----------
    steps
        Recorded step: "untethered" (goes with the current body) or "tethered" (with the classic
        body); None takes the body's.
    gait
        Order in which the legs step: "tripod", "tetrapod" or "wave" (see `cpg.GAIT_PHASES`).
    frequency_hz
        Frequency of the oscillators, of all or of each leg (6,).
    amplitude
        Magnitude that the oscillators approach at a drive of 1, of all or of each leg.
    convergence_rate
        Rate at which magnitudes follow the drive, 1/s, of all or of each leg.
    coupling_weight
        Weight between oscillators that are not in phase, 1/s.
    phase_biases
        rad, (6, 6): entry (i, j) is the lead of leg j over leg i, and (j, i) its opposite, modulo
        2π, where each influences the other; None takes the gait's.
    coupling_weights
        1/s, (6, 6): entry (i, j) is the influence of leg j on leg i; None takes the gait's.
    amplitude_range
        Least and greatest drive of a side; a negative one steps backwards.

    Raises
    ------
    ValueError
        If a name is unknown or a value is out of its range.
    """

    steps: StepsName | None = None
    gait: Gait = "tripod"
    frequency_hz: Annotated[float | Six, Within(1e-3, 1e3)] = TRIPOD_FREQUENCY_HZ
    amplitude: Annotated[float | Six, Within(0, 10)] = TRIPOD_AMPLITUDE
    convergence_rate: Annotated[float | Six, Within(0, 1e3)] = TRIPOD_CONVERGENCE_RATE
    coupling_weight: Annotated[float, Within(0, 1e3)] = TRIPOD_COUPLING_WEIGHT
    phase_biases: Annotated[SixBySix | None, Within(-100, 100)] = None
    coupling_weights: Annotated[SixBySix | None, Within(-1e3, 1e3)] = None
    amplitude_range: Annotated[tuple[float, float], Within(-10, 10)] = (DRIVE_LOW, DRIVE_HIGH)

    further_state: ClassVar[tuple[str, ...]] = ("freqs", "amps", "scratch")
    """Fields of the state, (6,) each, beside "phases" and "magnitudes"; 0 at the start."""

    def __post_init__(self) -> None:
        check_fields(self, "controller")
        if not self.amplitude_range[0] < self.amplitude_range[1]:
            raise ValueError(
                f"controller.amplitude_range must be (least, greatest), got {self.amplitude_range}"
            )
        if self.phase_biases is not None:
            self._check_phase_biases(np.array(self.phase_biases))

    @property
    def command(self) -> Command:  # type: ignore[override]
        """The descending drive to the left and right legs, within `amplitude_range`."""
        low, high = self.amplitude_range
        return DRIVE._replace(low=(low, low), high=(high, high))

    def load_steps(self) -> PreprogrammedSteps:
        """Load the recorded steps."""
        return PreprogrammedSteps(self.steps or "untethered")

    def oscillator_values(self, timestep: float) -> dict[str, Any]:
        """Fields of the parameters that hold oscillators; ValueError unless `timestep` > 0."""
        biases, six = self.phase_biases, np.ones(NUM_LEGS)
        return {
            "timestep": positive("timestep", timestep),  # s
            "frequency": six * self.frequency_hz,  # Hz, before the drive's sign
            "amplitude": six * self.amplitude,  # at a drive of 1
            "coupling_weights": self._resolved_weights(),
            "phase_biases": gait_phase_biases(self.gait) if biases is None else biases,
            "convergence_coefs": six * self.convergence_rate,
        }

    def _resolved_weights(self) -> FloatArray:
        if self.coupling_weights is not None:
            return np.array(self.coupling_weights)
        return gait_coupling_weights(self.gait, self.coupling_weight)

    def _check_phase_biases(self, biases: FloatArray) -> None:
        """Raise ValueError unless legs that influence each other have opposite leads, modulo 2π."""
        is_coupled = self._resolved_weights() != 0.0
        rest = np.remainder(biases + biases.T + np.pi, TWO_PI) - np.pi
        for i, j in np.argwhere(is_coupled & is_coupled.T & (np.abs(rest) > _BIAS_TOLERANCE)):
            raise ValueError(
                f"controller.phase_biases must be 0 modulo 2 pi in the sum of ({i}, {j}) and "
                f"({j}, {i}), which are coupled, got {biases[i, j]:g} and {biases[j, i]:g}"
            )

    def initial_state(
        self,
        seed: int = 0,
        init_phases: ArrayLike | None = None,
        init_magnitudes: ArrayLike | None = None,
    ) -> np.void:
        """Oscillators as an episode starts, as given or drawn from a seed; all else is 0.

        Raises
        ------
        ValueError
            If the seed is no seed, or a given array has the wrong shape or is not finite.
        """
        random, amps = np.random.RandomState(random_seed(seed)), np.full(NUM_LEGS, self.amplitude)
        phases, magnitudes = initial_oscillators(random, amps, init_phases, init_magnitudes)
        zeros = dict.fromkeys(self.further_state, np.zeros(NUM_LEGS))
        return record_of({"phases": phases, "magnitudes": magnitudes, **zeros})


@dataclass(frozen=True)
class CPG(OscillatorController):
    """The CPG alone, without reflexes; see `OscillatorController`."""

    step: ClassVar[Step] = staticmethod(cpg_controller_step)

    def parameters(self, timestep: float) -> np.void:
        """Constants that the kernel takes."""
        return record_of({**self.oscillator_values(timestep), **step_values(self.load_steps())})
