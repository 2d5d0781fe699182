"""Leg controllers: from a descending drive to the target angles and adhesion of six legs.

Three of them: the CPG alone, the CPG with reflexes ("hybrid"), and the rule-based controller. Each
exists twice, from the same kernels: as `control_step`, which works on two flat records and runs
inside the physics engine, and as the class `LegController`, which is meant to be read.
"""

from dataclasses import dataclass, replace
from typing import Annotated, Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from flyrl.anatomy import LEG_DOFS, LEGS
from flyrl.controllers.compilation import kernel
from flyrl.controllers.cpg import (
    TRIPOD_AMPLITUDE,
    TRIPOD_CONVERGENCE_RATE,
    TRIPOD_COUPLING_WEIGHT,
    TRIPOD_FREQUENCY_HZ,
    CPGNetwork,
    cpg_step,
    initial_oscillators,
    tripod_coupling_weights,
    tripod_phase_biases,
)
from flyrl.controllers.random import STATE_SIZE, seeded_stream
from flyrl.controllers.reflexes import (
    REFLEXES,
    Reflexes,
    ReflexesName,
    ReflexParameters,
    net_correction,
    reflex_step,
)
from flyrl.controllers.steps import PreprogrammedSteps, StepsName, adhesion_on, step_angles
from flyrl.controllers.turning import modulate, modulated
from flyrl.controllers.walknet import (
    MARGIN,
    RULE_WEIGHTS,
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    phase_increment,
    rule_matrices,
    walknet_step,
)
from flyrl.validation import FloatArray, Within, check_fields, positive, random_seed

ControllerName = Literal["cpg", "hybrid", "rule_based"]

CONTROLLERS: Final[tuple[ControllerName, ...]] = ("cpg", "hybrid", "rule_based")
"""Names of the controllers; the index is a controller's `kind` in its parameter record."""

TWO_PI: Final = 2.0 * np.pi

RULE_BASED_STEP_DURATION_S: Final = 1.0 / 12.0
"""Step duration of the rule-based controller with untethered steps: the CPG's cycle (spec 9)."""

_CPG: Final = CONTROLLERS.index("cpg")
_HYBRID: Final = CONTROLLERS.index("hybrid")
_RULE_BASED: Final = CONTROLLERS.index("rule_based")

_NUM_LEGS: Final = len(LEGS)
_NUM_DOFS: Final = len(LEG_DOFS)

PARAMETERS: Final = np.dtype(
    [
        ("kind", "f8"),
        ("timestep", "f8"),  # s
        # Oscillators
        ("frequency", "f8"),  # Hz, before the drive's sign
        ("coupling_weights", "f8", (6, 6)),
        ("phase_biases", "f8", (6, 6)),
        ("convergence_coefs", "f8", (6,)),
        # Recorded step
        ("neutral", "f8", (6, 7)),
        ("swing_start", "f8", (6,)),  # rad
        ("swing_end", "f8", (6,)),  # rad, as recorded
        ("adhesion_swing_end", "f8", (6,)),  # rad, as used for adhesion
        # Reflexes
        ("correction_vectors", "f8", (6, 7)),
        ("retraction_margin", "f8"),
        ("stumbling_force", "f8"),
        ("retraction_rates", "f8", (2,)),
        ("stumbling_rates", "f8", (2,)),
        ("persistence_threshold", "f8"),
        ("persistence_s", "f8"),
        ("retraction_ends_stumbling", "f8"),
        ("correction_cap", "f8"),
        ("gain_phases", "f8", (6, 5)),
        ("gain", "f8", (5,)),
        # Rules
        ("rule1_weights", "f8", (6, 6)),
        ("rule2_weights", "f8", (6, 6)),
        ("rule3_weights", "f8", (6, 6)),
        ("margin", "f8"),
        ("step_duration", "f8"),  # s
        ("phase_increment", "f8"),  # rad per time step
    ],
    align=True,
)
"""Record of everything constant that `control_step` needs, except the spline; all float64."""

STATE: Final = np.dtype(
    [
        ("last_time", "f8"),  # s; for the engine's callback, not touched here
        ("drive", "f8", (2,)),  # at the legs
        ("command", "f8", (2,)),  # drive as last commanded; see the module latency
        ("latency", "f8"),  # time steps from the command to the legs
        ("clock", "f8"),  # time steps since the start, counted where there is latency
        ("num_pending", "f8"),  # commands on their way
        ("first_pending", "f8"),  # where the oldest of them stands in the queue
        ("phases", "f8", (6,)),
        ("magnitudes", "f8", (6,)),
        ("freqs", "f8", (6,)),
        ("amps", "f8", (6,)),
        ("scratch", "f8", (6,)),
        ("retraction", "f8", (6,)),
        ("stumbling", "f8", (6,)),
        ("persistence", "f8", (6,)),  # s
        ("net_correction", "f8", (6,)),
        ("targets", "f8", (42,)),  # rad
        ("adhesion", "f8", (6,)),  # 1 on, 0 off
        ("has_started", "f8"),
        ("is_stepping", "f8", (6,)),
        ("rule1_scores", "f8", (6,)),
        ("rule2_scores", "f8", (6,)),
        ("rule3_scores", "f8", (6,)),
        ("random", "f8", (STATE_SIZE,)),
        ("contact_forces_w", "f8", (36, 3)),  # µN, from the previous step
    ],
    align=True,
)
"""Record of everything that changes while a controller runs; all float64."""


@dataclass(frozen=True)
class ControllerConfig:
    """Which leg controller, on which recorded step, with which figures.

    Attributes
    ----------
    name
        "cpg", "hybrid" (the CPG with reflexes) or "rule_based".
    steps
        "untethered" (goes with the current body) or "tethered" (with the classic body).
    reflexes
        "current" or "classic"; None for the set that goes with the steps. Only hybrid uses it.
    frequency_hz
        Frequency of the oscillators.
    coupling_weight
        Weight between oscillators of different tripods, 1/s.
    convergence_rate
        Rate at which magnitudes follow the drive, 1/s.
    step_duration_s
        Duration of a step of the rule-based controller; None for 1/12 s on untethered steps and
        the recording's duration on tethered ones.
    retraction, stumbling
        Factors on how quickly that reflex's corrections grow; 0 switches it off.

    Raises
    ------
    ValueError
        If a name is unknown or a figure is negative.
    """

    name: ControllerName = "hybrid"
    steps: StepsName = "untethered"
    reflexes: ReflexesName | None = None
    frequency_hz: Annotated[float, Within(1e-3, 1e3)] = TRIPOD_FREQUENCY_HZ
    coupling_weight: Annotated[float, Within(0, 1e3)] = TRIPOD_COUPLING_WEIGHT
    convergence_rate: Annotated[float, Within(0, 1e3)] = TRIPOD_CONVERGENCE_RATE
    step_duration_s: Annotated[float | None, Within(1e-3, 1e3)] = None
    retraction: Annotated[float, Within(0, 100)] = 1.0
    stumbling: Annotated[float, Within(0, 100)] = 1.0

    def __post_init__(self) -> None:
        check_fields(self, "controller")

    @property
    def follows_drive(self) -> bool:
        """Whether the drive changes how it walks, so that a policy can steer it."""
        return self.name != "rule_based"

    @property
    def reflex_parameters(self) -> ReflexParameters:
        """The reflexes' figures."""
        own: ReflexesName = "current" if self.steps == "untethered" else "classic"
        figures = REFLEXES[self.reflexes or own]
        growth, decay = figures.retraction_rates
        retraction_rates = (self.retraction * growth, decay)
        growth, decay = figures.stumbling_rates
        stumbling_rates = (self.stumbling * growth, decay)
        return replace(figures, retraction_rates=retraction_rates, stumbling_rates=stumbling_rates)

    def load_steps(self) -> PreprogrammedSteps:
        """Load the recorded steps, lasting as long as a step of the rule-based controller."""
        duration = self.step_duration_s
        if duration is None and self.steps == "untethered":
            duration = RULE_BASED_STEP_DURATION_S
        return PreprogrammedSteps(self.steps, duration)


@kernel
def control_step(
    parameters: Any,
    coefficients: FloatArray,
    state: Any,
    thorax_z: float,
    end_effector_z: FloatArray,
    heading_w: FloatArray,
) -> None:
    """Advance a leg controller in place by one physics step.

    Reads the drive and the contact forces from the state, and writes target angles, adhesion and
    everything that the controller carries over. The rule-based controller ignores the drive.

    Parameters
    ----------
    parameters
        Record of type `PARAMETERS`, from `pack_parameters`.
    coefficients
        Spline of the recorded steps, from `pack_parameters`, shape (6, N - 1, 7, 4).
    state
        Record of type `STATE`, from `initial_state`.
    thorax_z, end_effector_z
        Heights after the previous step, mm, number and shape (6,).
    heading_w
        Unit vector after the previous step, world frame, shape (3,).
    """
    if parameters.kind == _RULE_BASED:
        walknet_step(
            state.phases,
            state.is_stepping,
            state.rule1_scores,
            state.rule2_scores,
            state.rule3_scores,
            state.random,
            parameters.rule1_weights,
            parameters.rule2_weights,
            parameters.rule3_weights,
            parameters.swing_end,
            parameters.margin,
            parameters.phase_increment,
            state.has_started == 0.0,
        )
        state.has_started = 1.0
    else:
        modulate(state.drive, parameters.frequency, state.freqs, state.amps)
        if parameters.kind == _HYBRID:
            reflex_step(
                state.retraction,
                state.stumbling,
                state.persistence,
                thorax_z,
                end_effector_z,
                state.contact_forces_w,
                heading_w,
                parameters.retraction_margin,
                parameters.stumbling_force,
                parameters.retraction_rates,
                parameters.stumbling_rates,
                parameters.persistence_threshold,
                parameters.persistence_s,
                parameters.retraction_ends_stumbling,
                parameters.timestep,
            )
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

    for leg in range(_NUM_LEGS):
        theta = state.phases[leg] % TWO_PI
        angles = state.targets[leg * _NUM_DOFS : (leg + 1) * _NUM_DOFS]
        step_angles(coefficients, parameters.neutral, leg, theta, state.magnitudes[leg], angles)
        if parameters.kind == _HYBRID:
            correction = net_correction(
                state.retraction[leg],
                state.stumbling[leg],
                parameters.correction_cap,
                theta,
                parameters.gain_phases[leg],
                parameters.gain,
            )
            state.net_correction[leg] = correction
            for dof in range(_NUM_DOFS):
                angles[dof] += correction * parameters.correction_vectors[leg, dof]
        grips = adhesion_on(theta, parameters.swing_start[leg], parameters.adhesion_swing_end[leg])
        state.adhesion[leg] = 1.0 if grips else 0.0


def pack_parameters(config: ControllerConfig, timestep: float) -> tuple[np.void, FloatArray]:
    """Build a controller's constants as `control_step` takes them.

    Parameters
    ----------
    config
        The controller.
    timestep
        Physics time step, s.

    Returns
    -------
    tuple
        A record of type `PARAMETERS`, and the spline coefficients, shape (6, N - 1, 7, 4).

    Raises
    ------
    ValueError
        If the time step is not above 0.
    """
    steps = config.load_steps()
    reflexes = config.reflex_parameters
    rules = rule_matrices(construct_rules_graph(), RULE_WEIGHTS)
    extension = reflexes.swing_extension if config.name == "hybrid" else 0.0

    record: np.void = np.zeros(1, dtype=PARAMETERS)[0]
    record["kind"] = CONTROLLERS.index(config.name)
    record["timestep"] = positive("timestep", timestep)
    record["frequency"] = config.frequency_hz
    record["coupling_weights"] = tripod_coupling_weights(config.coupling_weight)
    record["phase_biases"] = tripod_phase_biases()
    record["convergence_coefs"] = config.convergence_rate
    record["neutral"] = steps.neutral_angles
    record["swing_start"] = steps.swing_starts
    record["swing_end"] = steps.swing_ends
    record["adhesion_swing_end"] = steps.swing_ends + extension
    record["correction_vectors"] = reflexes.leg_vectors()
    record["retraction_margin"] = reflexes.retraction_margin
    record["stumbling_force"] = reflexes.stumbling_force
    record["retraction_rates"] = reflexes.retraction_rates
    record["stumbling_rates"] = reflexes.stumbling_rates
    record["persistence_threshold"] = reflexes.persistence_threshold
    record["persistence_s"] = reflexes.persistence_s
    record["retraction_ends_stumbling"] = reflexes.retraction_ends_stumbling
    record["correction_cap"] = reflexes.cap
    record["gain_phases"] = reflexes.gain_phases(steps.swing_ends)
    record["gain"] = reflexes.gain
    record["rule1_weights"], record["rule2_weights"], record["rule3_weights"] = rules
    record["margin"] = MARGIN
    record["step_duration"] = steps.duration
    record["phase_increment"] = phase_increment(timestep, steps.duration)
    return record, steps.coefficients


def initial_state(
    config: ControllerConfig,
    seed: int = 0,
    init_phases: ArrayLike | None = None,
    init_magnitudes: ArrayLike | None = None,
    latency_steps: int = 0,
) -> np.void:
    """Build the state in which a controller starts, as `control_step` takes it.

    Parameters
    ----------
    config
        The controller.
    seed
        Of the initial oscillators where these are not given, or of the rule-based controller's
        draws.
    init_phases, init_magnitudes
        Initial oscillators, rad and -, shape (6,); the rule-based controller has none.
    latency_steps
        Time steps from a command of the drive to its arrival, inside the engine.

    Returns
    -------
    record
        Of type `STATE`: legs at rest in the neutral pose, no drive, and a `last_time` of -1 s.

    Raises
    ------
    ValueError
        If the seed is no seed, or a given array has the wrong shape or is not finite.
    """
    record: np.void = np.zeros(1, dtype=STATE)[0]
    record["last_time"] = -1.0
    record["latency"] = latency_steps
    record["random"] = seeded_stream(seed)
    phases, magnitudes = initial_oscillators(
        np.random.RandomState(random_seed(seed)),
        np.full(_NUM_LEGS, TRIPOD_AMPLITUDE),
        init_phases,
        init_magnitudes,
    )
    if config.name == "rule_based":
        record["magnitudes"] = 1.0  # a step is always taken in full
    else:
        record["phases"] = phases
        record["magnitudes"] = magnitudes
    record["targets"] = PreprogrammedSteps(config.steps).default_pose
    record["adhesion"] = 1.0
    return record


@dataclass(frozen=True)
class LegObservation:
    """What the reflexes sense, after the previous physics step.

    Attributes
    ----------
    thorax_z
        Height of the thorax, mm.
    end_effector_z
        Heights of the legs' tips, mm, shape (6,), ordered as `anatomy.LEGS`.
    contact_forces_w
        µN, world frame, shape (36, 3), ordered as `anatomy.CONTACT_SEGMENTS`.
    heading_w
        Unit vector, world frame, shape (3,).
    """

    thorax_z: float
    end_effector_z: FloatArray
    contact_forces_w: FloatArray
    heading_w: FloatArray


class LegController:
    """A leg controller composed of the public classes: the readable twin of `control_step`.

    Attributes
    ----------
    phases, magnitudes : array
        Of each leg's step, rad and -, shape (6,), ordered as `anatomy.LEGS`.
    net_correction : array
        Of each leg by its reflexes, shape (6,).
    targets : array
        Target joint angles, rad, shape (42,), ordered as `anatomy.JOINTS`.
    adhesion : array
        1 where a leg grips, else 0, shape (6,).

    Parameters
    ----------
    config
        The controller.
    timestep
        s.
    seed, init_phases, init_magnitudes
        As in `initial_state`.

    Raises
    ------
    ValueError
        As in `pack_parameters` and `initial_state`.
    """

    def __init__(
        self,
        config: ControllerConfig,
        timestep: float,
        seed: int = 0,
        init_phases: ArrayLike | None = None,
        init_magnitudes: ArrayLike | None = None,
    ) -> None:
        self.config = config
        self.steps = config.load_steps()
        self.cpg = CPGNetwork(
            timestep,
            np.full(_NUM_LEGS, config.frequency_hz),
            np.full(_NUM_LEGS, TRIPOD_AMPLITUDE),
            tripod_coupling_weights(config.coupling_weight),
            tripod_phase_biases(),
            np.full(_NUM_LEGS, config.convergence_rate),
            init_phases,
            init_magnitudes,
            seed,
        )
        self.reflexes = Reflexes(timestep, config.reflex_parameters, self.steps.swing_ends)
        self.coordinator = RuleBasedSteppingCoordinator(
            timestep, construct_rules_graph(), RULE_WEIGHTS, self.steps, seed=seed
        )
        self.net_correction = np.zeros(_NUM_LEGS)
        self.targets = self.steps.default_pose
        self.adhesion = np.ones(_NUM_LEGS)

    @property
    def phases(self) -> FloatArray:
        """Phase of each leg's step, rad, shape (6,)."""
        if self.config.name == "rule_based":
            return self.coordinator.leg_phases
        return self.cpg.curr_phases

    @property
    def magnitudes(self) -> FloatArray:
        """Magnitude of each leg's step, shape (6,)."""
        if self.config.name == "rule_based":
            return np.ones(_NUM_LEGS)
        return self.cpg.curr_magnitudes

    def step(self, drive: ArrayLike, observation: LegObservation) -> None:
        """Advance by one time step.

        Parameters
        ----------
        drive
            Left and right, shape (2,); the rule-based controller ignores it.
        observation
            Of the state after the previous step; only the hybrid controller looks at it.

        Raises
        ------
        ValueError
            If an array has the wrong shape or is not finite.
        """
        if self.config.name == "rule_based":
            self.coordinator.step()
        else:
            freqs, amps = modulated(drive, self.config.frequency_hz)
            self.cpg.intrinsic_freqs, self.cpg.intrinsic_amps = freqs, amps
            if self.config.name == "hybrid":
                self.reflexes.step(
                    observation.thorax_z,
                    observation.end_effector_z,
                    observation.contact_forces_w,
                    observation.heading_w,
                )
            self.cpg.step()
        self._command_legs()

    def _command_legs(self) -> None:
        is_hybrid = self.config.name == "hybrid"
        phases, magnitudes = self.phases, self.magnitudes
        angles = np.array(
            [
                self.steps.get_joint_angles(leg, phases[i], magnitudes[i])
                for i, leg in enumerate(LEGS)
            ]
        )
        swing_ends = self.steps.swing_ends
        if is_hybrid:
            self.net_correction = self.reflexes.net_corrections(phases)
            angles += self.net_correction[:, np.newaxis] * self.reflexes.vectors
            swing_ends = swing_ends + self.reflexes.parameters.swing_extension
        self.targets = angles.flatten()
        self.adhesion = np.array(
            [
                float(adhesion_on(phases[i], self.steps.swing_starts[i], swing_ends[i]))
                for i in range(_NUM_LEGS)
            ]
        )
