"""Recorded steps: the joint angles of each leg over one step cycle, scaled by a magnitude.

Two recordings of real flies: "tethered" (Lobato-Rios et al. 2022, doi 10.1038/s41592-022-01466-7)
and "untethered" (Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y).
"""

import functools
from types import MappingProxyType
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.anatomy import LEG_DOFS, LEGS
from flyrl.controllers.compilation import kernel
from flyrl.resources import assets_folder
from flyrl.validation import FloatArray, float_array, one_of, positive

StepsName = Literal["tethered", "untethered"]

STEPS: Final[tuple[StepsName, ...]] = get_args(StepsName)
"""Names of the recordings."""

TWO_PI: Final = 2.0 * np.pi


@kernel
def step_angles(
    coefficients: FloatArray,
    neutral: FloatArray,
    leg: int,
    phase: float,
    magnitude: float,
    angles: FloatArray,
) -> None:
    """Write one leg's joint angles at a phase and magnitude.

    Parameters
    ----------
    coefficients
        Periodic cubic spline, shape (6, N - 1, 7, 4): leg, interval between samples, degree of
        freedom, power (cubic first), as in `PreprogrammedSteps.coefficients`.
    neutral
        Angles at magnitude 0, rad, shape (6, 7).
    leg
        Index into `anatomy.LEGS`.
    phase
        rad, any number.
    magnitude
        0 holds the neutral pose, 1 replays the recording.
    angles
        Output, rad, shape (7,), ordered as `anatomy.LEG_DOFS`.
    """
    num_intervals = coefficients.shape[1]
    width = TWO_PI / num_intervals
    theta = phase % TWO_PI
    # Clamped as a float: rounding can give the end of the cycle, and a diverged simulation NaN.
    position = theta / width
    if not position >= 0.0:
        position = 0.0
    interval = int(min(position, num_intervals - 1.0))
    x = theta - interval * width
    for dof in range(coefficients.shape[2]):
        recorded = (
            (coefficients[leg, interval, dof, 0] * x + coefficients[leg, interval, dof, 1]) * x
            + coefficients[leg, interval, dof, 2]
        ) * x + coefficients[leg, interval, dof, 3]
        angles[dof] = neutral[leg, dof] + magnitude * (recorded - neutral[leg, dof])


@kernel
def adhesion_on(phase: float, swing_start: float, swing_end: float) -> bool:
    """Whether a leg grips at a phase (rad, any number): not inside its swing."""
    theta = phase % TWO_PI
    return not (swing_start < theta < swing_end)


def step_values(steps: "PreprogrammedSteps", swing_extension: float = 0.0) -> dict[str, FloatArray]:
    """Fields of a controller's parameters that hold a recorded step.

    Parameters
    ----------
    steps
        The step.
    swing_extension
        How much later than recorded a leg grips again, rad.
    """
    return {
        "coefficients": steps.coefficients,
        "neutral": steps.neutral_angles,  # rad
        "swing_start": steps.swing_starts,  # rad
        "grip_start": steps.swing_ends + swing_extension,  # rad, where a leg grips again
    }


@kernel
def take_step(parameters: Any, leg: int, phase: float, magnitude: float, output: Any) -> None:
    """Write one leg's joint angles and grip; see `take_steps`."""
    num_dofs = parameters.neutral.shape[1]
    theta = phase % TWO_PI
    angles = output.angles[leg * num_dofs : (leg + 1) * num_dofs]
    step_angles(parameters.coefficients, parameters.neutral, leg, theta, magnitude, angles)
    grips = adhesion_on(theta, parameters.swing_start[leg], parameters.grip_start[leg])
    output.adhesion[leg] = 1.0 if grips else 0.0


@kernel
def take_steps(parameters: Any, state: Any, output: Any) -> None:
    """Write every leg's joint angles and grip at its phase and magnitude.

    Parameters
    ----------
    parameters
        Record with the fields of `step_values`.
    state
        Record with "phases", rad, any number, and "magnitudes", 1; shape (6,).
    output
        Record of type `controller.OUTPUT`, written.
    """
    for leg in range(len(parameters.neutral)):
        take_step(parameters, leg, state.phases[leg], state.magnitudes[leg], output)


@functools.cache
def _recording(steps: StepsName) -> tuple[float, tuple[FloatArray, ...]]:
    """Duration, and what the attributes of `PreprogrammedSteps` hold, read once per process."""
    # Imported here because SciPy takes longer to import than all of flyrl.
    from scipy.interpolate import CubicSpline  # noqa: PLC0415

    with np.load(assets_folder() / "steps" / f"{steps}.npz", allow_pickle=False) as file:
        angles = file["angles"]  # (6, 7, N)
        duration = angles.shape[2] * file["timestep"].item()
        spline = CubicSpline(
            np.linspace(0.0, TWO_PI, angles.shape[2]), angles, axis=2, bc_type="periodic"
        )
        arrays = (
            # SciPy: (power, interval, leg, dof); kernels: the four numbers of one curve together.
            np.ascontiguousarray(spline.c.transpose(2, 1, 3, 0)),
            np.ascontiguousarray(spline(file["neutral_phase"].item())),
            file["swing_start_s"] / duration * TWO_PI,
            file["stance_start_s"] / duration * TWO_PI,
        )
        return duration, tuple(map(_read_only, arrays))


class PreprogrammedSteps:
    """One recorded step cycle of every leg, as a function of phase and magnitude.

    Attributes
    ----------
    name : str
        Name of the recording.
    legs, dofs_per_leg : list of str
        The orders of `anatomy.LEGS` and `anatomy.LEG_DOFS`.
    duration : float
        Time of one step cycle, s.
    swing_period : mapping of str to array
        For each leg the phases at which its swing starts and ends, rad, shape (2,). Read-only.
    neutral_pos : mapping of str to array
        For each leg the joint angles at magnitude 0, rad, shape (7, 1). Read-only.
    coefficients : array
        The spline in the form that `step_angles` takes, shape (6, N - 1, 7, 4). Read-only.
    neutral_angles : array
        Joint angles at magnitude 0, rad, shape (6, 7). Read-only.
    swing_starts, swing_ends : array
        Phases, rad, shape (6,), ordered as `anatomy.LEGS`. Read-only.

    Parameters
    ----------
    steps
        "tethered" (1278 samples, 0.1278 s) or "untethered" (45 samples, 0.135 s).
    duration
        Time in which to play one step cycle, s; the recording's if None. Phases do not change.

    Raises
    ------
    ValueError
        If the recording is unknown or the duration is not above 0.
    """

    def __init__(self, steps: StepsName = "untethered", duration: float | None = None) -> None:
        one_of("steps", steps, STEPS)
        recorded, arrays = _recording(steps)
        self.name = steps
        self.legs: list[str] = list(LEGS)
        self.dofs_per_leg: list[str] = list(LEG_DOFS)
        self.duration = recorded if duration is None else positive("duration", duration)
        self.coefficients, self.neutral_angles, self.swing_starts, self.swing_ends = arrays
        swings = _read_only(np.stack([self.swing_starts, self.swing_ends], axis=1))
        self.swing_period = MappingProxyType(dict(zip(LEGS, swings, strict=True)))
        neutral = self.neutral_angles[..., np.newaxis]
        self.neutral_pos = MappingProxyType(dict(zip(LEGS, neutral, strict=True)))

    @property
    def default_pose(self) -> FloatArray:
        """The 42 neutral joint angles, rad, ordered as `anatomy.JOINTS`."""
        return self.neutral_angles.flatten()

    def get_joint_angles(
        self, leg: str, phase: ArrayLike, magnitude: ArrayLike = 1.0
    ) -> FloatArray:
        """Joint angles of a leg.

        Parameters
        ----------
        leg
            Name of the leg.
        phase
            rad, any number or array of shape (n,).
        magnitude
            Number or array of shape (n,); 0 gives the neutral pose, 1 the recording.

        Returns
        -------
        array
            rad, shape (7,) or, if phase or magnitude is an array, (7, n).

        Raises
        ------
        ValueError
            If the leg is unknown, or the phases and magnitudes are not finite or do not match.
        """
        index = LEGS.index(one_of("leg", leg, LEGS))
        given = _vector("phase", phase), _vector("magnitude", magnitude)
        try:
            phases, magnitudes = np.broadcast_arrays(*given)
        except ValueError:
            raise ValueError(
                f"phase and magnitude must match in length, got shapes {given[0].shape} "
                f"and {given[1].shape}"
            ) from None
        angles = np.empty((phases.size, len(LEG_DOFS)))
        for row, theta, r in zip(angles, phases.flat, magnitudes.flat, strict=True):
            step_angles(self.coefficients, self.neutral_angles, index, theta, r, row)
        return angles.T.copy() if phases.ndim else angles[0]

    def get_adhesion_onoff(self, leg: str, phase: ArrayLike) -> bool | NDArray[np.bool_]:
        """Whether a leg grips: off while it swings, on otherwise.

        Parameters
        ----------
        leg
            Name of the leg.
        phase
            rad, any number or array of shape (n,).

        Returns
        -------
        bool or array
            One truth value, or an array of shape (n,).

        Raises
        ------
        ValueError
            If the leg is unknown or a phase is not finite.
        """
        index = LEGS.index(one_of("leg", leg, LEGS))
        theta = _vector("phase", phase) % TWO_PI
        grips = ~((self.swing_starts[index] < theta) & (theta < self.swing_ends[index]))
        return grips if grips.ndim else bool(grips)


def _vector(name: str, value: ArrayLike) -> FloatArray:
    array = float_array(name, value, np.shape(value))
    if array.ndim > 1:
        raise ValueError(f"{name} must be a number or have shape (n,), got shape {array.shape}")
    return array


def _read_only(array: FloatArray) -> FloatArray:
    array.setflags(write=False)
    return array
