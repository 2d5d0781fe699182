"""Central pattern generator: coupled phase oscillators, their gaits, and their descending drive.

Sources: Ijspeert et al. 2007, doi 10.1126/science.1138353; for the drive the turning task of
NeuroMechFly v2, Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y.
"""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from flyrl.anatomy import LEGS
from flyrl.controllers.compilation import kernel
from flyrl.validation import FloatArray, float_array, positive, random_seed

TWO_PI: Final = 2.0 * np.pi

TRIPOD_FREQUENCY_HZ: Final = 12.0
TRIPOD_AMPLITUDE: Final = 1.0
TRIPOD_COUPLING_WEIGHT: Final = 10.0
TRIPOD_CONVERGENCE_RATE: Final = 20.0
"""Rate at which magnitudes approach their amplitudes, 1/s."""


@kernel
def cpg_step(
    phases: FloatArray,
    magnitudes: FloatArray,
    freqs: FloatArray,
    amps: FloatArray,
    weights: FloatArray,
    biases: FloatArray,
    coefs: FloatArray,
    timestep: float,
    phase_rates: FloatArray,
) -> None:
    """Advance N oscillators in place by one explicit Euler step.

    Parameters
    ----------
    phases, magnitudes
        State, rad and -, shape (N,); changed in place.
    freqs, amps, coefs
        Intrinsic frequencies (Hz), amplitudes (-), convergence coefficients (1/s), shape (N,).
    weights, biases
        Coupling weights (1/s) and phase biases (rad), shape (N, N): row i receives from column j.
    timestep
        s.
    phase_rates
        Room for N numbers.
    """
    n = phases.size
    # All rates come from the old state, so magnitudes may not move before every rate is known.
    for i in range(n):
        rate = TWO_PI * freqs[i]
        for j in range(n):
            weight = weights[i, j]
            if weight != 0.0:  # half of a tripod's couplings are absent; a sine is dear
                rate += magnitudes[j] * weight * np.sin(phases[j] - phases[i] - biases[i, j])
        phase_rates[i] = rate
    for i in range(n):
        phases[i] += phase_rates[i] * timestep
        magnitudes[i] += coefs[i] * (amps[i] - magnitudes[i]) * timestep


@kernel
def modulate(
    drive: FloatArray,
    frequency: FloatArray,
    amplitude: FloatArray,
    freqs: FloatArray,
    amps: FloatArray,
) -> None:
    """Write the oscillators' intrinsic frequencies and amplitudes under a drive.

    Parameters
    ----------
    drive
        Left and right, shape (2,). A side's amplitude is the drive's size; a negative drive makes
        it step backwards, and zero (of positive sign) lets its magnitude decay.
    frequency, amplitude
        Stepping frequency, Hz, and amplitude at a drive of 1, shape (6,).
    freqs
        Output, Hz, shape (6,), left legs first.
    amps
        Output, shape (6,), left legs first.
    """
    legs_per_side = freqs.size // 2
    for i in range(freqs.size):
        side = drive[i // legs_per_side]
        freqs[i] = frequency[i] if side >= 0.0 else -frequency[i]
        amps[i] = abs(side) * amplitude[i]


def modulated(drive: ArrayLike, frequency_hz: float) -> tuple[FloatArray, FloatArray]:
    """Intrinsic frequencies (Hz) and amplitudes under a drive, each of shape (6,).

    Raises
    ------
    ValueError
        If the drive is not two finite numbers or the frequency is not above 0.
    """
    checked = float_array("drive", drive, (2,))
    freqs, amps = np.empty(len(LEGS)), np.empty(len(LEGS))
    frequency = np.full(len(LEGS), positive("frequency_hz", frequency_hz))
    modulate(checked, frequency, np.ones(len(LEGS)), freqs, amps)
    return freqs, amps


GAIT_PHASES: Final[dict[str, tuple[float, ...]]] = {
    "tripod": (0.0, 1 / 2, 0.0, 1 / 2, 0.0, 1 / 2),
    "tetrapod": (1 / 3, 2 / 3, 0.0, 2 / 3, 0.0, 1 / 3),
    "wave": (4 / 6, 5 / 6, 0.0, 1 / 6, 2 / 6, 3 / 6),
}
"""Gaits: where each leg is in its cycle as the left hind leg begins its own, a share, ordered as
`anatomy.LEGS`. In the tripod gait `anatomy.TRIPODS` take turns. On each side a wave goes from back
to front. In the tetrapod gait two legs swing at a time, a third of a cycle apart; in the wave gait
each leg swings by itself, the sides half a cycle apart (Wilson 1966, doi
10.1146/annurev.en.11.010166.000535)."""


def gait_phase_biases(gait: str = "tripod") -> FloatArray:
    """Phase biases of one of `GAIT_PHASES`, rad, shape (6, 6)."""
    phases = TWO_PI * np.array(GAIT_PHASES[gait])
    biases: FloatArray = np.mod(phases - phases[:, np.newaxis], TWO_PI)
    return biases


def gait_coupling_weights(
    gait: str = "tripod", weight: float = TRIPOD_COUPLING_WEIGHT
) -> FloatArray:
    """Coupling weights of a gait, 1/s, shape (6, 6): between all legs that are not in phase."""
    return np.where(gait_phase_biases(gait) > 0, weight, 0.0)


def motor_neuron_activity(magnitudes: ArrayLike, phases: ArrayLike) -> FloatArray:
    """Activity of motor neurons that oscillators drive, r (1 + sin θ), elementwise."""
    return np.asarray(magnitudes, dtype=np.float64) * (1.0 + np.sin(phases))


_SHAPED: Final = {
    **dict.fromkeys(("intrinsic_freqs", "curr_phases", "curr_magnitudes"), (1, -math.inf)),
    **dict.fromkeys(("intrinsic_amps", "convergence_coefs"), (1, 0.0)),
    **dict.fromkeys(("coupling_weights", "phase_biases"), (2, -math.inf)),
}
"""Arrays of a network: name -> number of dimensions, each of length N, and least value."""


class CPGNetwork:
    """A network of N coupled oscillators, each with a phase and a magnitude.

    Its arrays can be assigned at any time; they are checked, and copied.

    Attributes
    ----------
    curr_phases, curr_magnitudes
        State, rad (not wrapped) and 1, shape (N,).

    Parameters
    ----------
    timestep
        s.
    intrinsic_freqs
        Hz, shape (N,); a negative one runs backwards.
    intrinsic_amps
        Magnitudes that the oscillators approach, shape (N,), not negative.
    coupling_weights
        1/s, shape (N, N): entry (i, j) is the influence of oscillator j on i.
    phase_biases
        rad, shape (N, N): the lead of j over i at which j does not influence i.
    convergence_coefs
        Rates at which magnitudes approach their amplitudes, 1/s, shape (N,), not negative.
    init_phases, init_magnitudes
        Initial state, shape (N,). Where not given: phases U(0, 2π), then magnitudes
        U(0, 1) · amplitude, drawn in that order.
    seed
        Of the `numpy.random.RandomState` that draws them.

    Raises
    ------
    ValueError
        If an argument has the wrong shape, is not finite, or is negative where it may not be.
    """

    curr_phases: FloatArray
    curr_magnitudes: FloatArray

    def __init__(
        self,
        timestep: float,
        intrinsic_freqs: ArrayLike,
        intrinsic_amps: ArrayLike,
        coupling_weights: ArrayLike,
        phase_biases: ArrayLike,
        convergence_coefs: ArrayLike,
        init_phases: ArrayLike | None = None,
        init_magnitudes: ArrayLike | None = None,
        seed: int = 0,
    ) -> None:
        self.num_cpgs = n = np.size(intrinsic_freqs)
        if n == 0:
            raise ValueError("intrinsic_freqs must have shape (N,) with N of at least 1, got none")
        self.timestep = positive("timestep", timestep)
        self.intrinsic_freqs: Any = intrinsic_freqs
        self.intrinsic_amps: Any = intrinsic_amps
        self.coupling_weights: Any = coupling_weights
        self.phase_biases: Any = phase_biases
        self.convergence_coefs: Any = convergence_coefs
        self.random_state = np.random.RandomState(random_seed(seed))
        self.reset(init_phases, init_magnitudes)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _SHAPED:
            dimensions, least = _SHAPED[name]
            value = float_array(name, value, (self.num_cpgs,) * dimensions, minimum=least)
        super().__setattr__(name, value)

    def reset(
        self, init_phases: ArrayLike | None = None, init_magnitudes: ArrayLike | None = None
    ) -> None:
        """Set the state, drawing what is not given from the network's own generator.

        Parameters
        ----------
        init_phases
            rad, shape (N,), or None for U(0, 2π).
        init_magnitudes
            Shape (N,), not negative, or None for U(0, 1) · amplitude.

        Raises
        ------
        ValueError
            If a given array has the wrong shape, is not finite, or has a negative magnitude.
        """
        self.curr_phases, self.curr_magnitudes = initial_oscillators(
            self.random_state, self.intrinsic_amps, init_phases, init_magnitudes
        )

    def step(self) -> None:
        """Advance by one time step (explicit Euler)."""
        # On fresh arrays, so that those handed out before keep the values of their time.
        phases, magnitudes = self.curr_phases.copy(), self.curr_magnitudes.copy()
        cpg_step(
            phases,
            magnitudes,
            self.intrinsic_freqs,
            self.intrinsic_amps,
            self.coupling_weights,
            self.phase_biases,
            self.convergence_coefs,
            self.timestep,
            np.empty(self.num_cpgs),
        )
        vars(self).update(curr_phases=phases, curr_magnitudes=magnitudes)


def initial_oscillators(
    random_state: np.random.RandomState,
    amps: FloatArray,
    init_phases: ArrayLike | None,
    init_magnitudes: ArrayLike | None,
) -> tuple[FloatArray, FloatArray]:
    """Initial phases (rad) and magnitudes of N oscillators: those given, else random ones.

    Raises
    ------
    ValueError
        If a given array has the wrong shape, is not finite, or has a negative magnitude.
    """
    n = amps.size
    if init_phases is None:
        phases = random_state.uniform(0.0, TWO_PI, n)
    else:
        phases = float_array("init_phases", init_phases, (n,))
    if init_magnitudes is None:
        magnitudes = random_state.uniform(0.0, 1.0, n) * amps
    else:
        magnitudes = float_array("init_magnitudes", init_magnitudes, (n,), minimum=0.0)
    return phases, magnitudes


def three_oscillators(seed: int = 0) -> CPGNetwork:
    """Build the three-oscillator demonstration of spec section 4: a chain, 120° apart, at 1 Hz.

    It settles one third of a cycle apart, at magnitudes 1, 1.1 and 1.2, within its 10 s.
    """
    chain = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    order = np.arange(3)
    return CPGNetwork(
        timestep=1e-3,
        intrinsic_freqs=np.ones(3),
        intrinsic_amps=[1.0, 1.1, 1.2],
        coupling_weights=chain,
        phase_biases=chain * np.sign(order - order[:, np.newaxis]) * np.deg2rad(120.0),
        convergence_coefs=np.ones(3),
        seed=seed,
    )
