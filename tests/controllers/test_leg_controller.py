"""The composed controllers: against the written-out specification, and engine against class."""

import dataclasses

import numpy as np
import pytest

from flyrl.controllers.leg_controller import (
    ControllerConfig,
    LegController,
    LegObservation,
    control_step,
    initial_state,
    pack_parameters,
)
from tests.controllers import oracle
from tests.controllers.observations import random_drives, random_observations

TIMESTEP = 1e-4
TOLERANCE = {"rtol": 0, "atol": 1e-12}

CURRENT = ControllerConfig("hybrid", "untethered")
CLASSIC = ControllerConfig("hybrid", "tethered")
CALM = LegObservation(0.0, np.full(6, -1.0), np.zeros((36, 3)), np.array([1.0, 0.0, 0.0]))


def kernel_step(parameters, coefficients, state, drive, observation):
    state["drive"] = drive
    state["contact_forces_w"] = observation.contact_forces_w
    control_step(
        parameters,
        coefficients,
        state,
        observation.thorax_z,
        observation.end_effector_z,
        observation.heading_w,
    )


FIELDS = (
    "phases",
    "magnitudes",
    "retraction",
    "stumbling",
    "net_correction",
    "targets",
    "adhesion",
)


def joined(*arrays):
    """One vector, to be kept: a comparison at the end is quicker than many on the way."""
    return np.concatenate([np.ravel(array) for array in arrays])


def run(config, num_steps, drive=(1.0, 1.0), observation=CALM, timestep=TIMESTEP, **initial):
    parameters, coefficients = pack_parameters(config, timestep)
    state = initial_state(config, **initial)
    for _ in range(num_steps):
        kernel_step(parameters, coefficients, state, drive, observation)
    return state


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("name", "config"), [("current", CURRENT), ("classic", CLASSIC)])
def test_hybrid_follows_the_specification(name, config, seed):
    num_steps = 6000
    expected = oracle.Hybrid(name, oracle.Steps(config.steps), oracle.Oscillators(TIMESTEP, seed))
    parameters, coefficients = pack_parameters(config, TIMESTEP)
    state = initial_state(config, seed)

    drives, ours, theirs = random_drives(num_steps, seed), [], []
    for drive, observation in zip(drives, random_observations(num_steps, seed), strict=True):
        expected.step(drive, observation)
        kernel_step(parameters, coefficients, state, drive, observation)
        ours.append(joined(*(state[field] for field in FIELDS)))
        theirs.append(
            joined(
                expected.oscillators.theta,
                expected.oscillators.r,
                expected.retraction,
                expected.stumbling,
                expected.net,
                expected.targets,
                expected.adhesion,
            )
        )
    np.testing.assert_allclose(ours, theirs, **TOLERANCE)

    events = expected.events
    assert events.retracted > 1000
    assert events.stumbled > 1000
    assert events.stumbling_while_retracting > 50
    if name == "current":
        assert events.persisted > 20
        assert events.capped > 20


@pytest.mark.parametrize(
    "config",
    [
        ControllerConfig("cpg", "untethered"),
        ControllerConfig("cpg", "tethered"),
        CURRENT,
        CLASSIC,
        ControllerConfig("hybrid", "tethered", reflexes="current"),
        ControllerConfig("rule_based", "untethered"),
        ControllerConfig("rule_based", "tethered"),
        ControllerConfig("rule_based", "untethered", step_duration_s=0.06),
    ],
    ids=lambda config: f"{config.name}-{config.steps}-{config.reflexes}",
)
def test_engine_and_class_do_the_same(config):
    num_steps, seed = 2000, 5
    controller = LegController(config, TIMESTEP, seed)
    parameters, coefficients = pack_parameters(config, TIMESTEP)
    state = initial_state(config, seed)

    drives, ours, theirs = random_drives(num_steps, seed), [], []
    for drive, observation in zip(drives, random_observations(num_steps, seed), strict=True):
        controller.step(drive, observation)
        kernel_step(parameters, coefficients, state, drive, observation)
        ours.append(
            joined(
                controller.phases,
                controller.magnitudes,
                controller.reflexes.retraction,
                controller.reflexes.stumbling,
                controller.net_correction,
                controller.targets,
                controller.adhesion,
            )
        )
        theirs.append(joined(*(state[field] for field in FIELDS)))
    np.testing.assert_allclose(ours, theirs, **TOLERANCE)


@pytest.mark.parametrize("steps", ["untethered", "tethered"])
def test_cpg_alone_has_no_reflexes(steps):
    config = ControllerConfig("cpg", steps)
    in_trouble = random_observations(1, 0)[0]
    in_trouble = dataclasses.replace(
        in_trouble,
        end_effector_z=np.array([-2.0, -1, -1, -1, -1, -1]),
        contact_forces_w=np.full((36, 3), -50.0),
    )
    troubled = run(config, 500, observation=in_trouble)
    calm = run(config, 500)
    assert not troubled["retraction"].any()
    assert not troubled["stumbling"].any()
    np.testing.assert_array_equal(troubled["targets"], calm["targets"])


def test_rule_based_follows_the_specification():
    steps = oracle.Steps("untethered")
    expected = oracle.Walknet(TIMESTEP, 1 / 12, steps.swing_end, seed=2)
    config = ControllerConfig("rule_based")
    parameters, coefficients = pack_parameters(config, TIMESTEP)
    state = initial_state(config, seed=2)
    ours, theirs = [], []
    for _ in range(5000):
        expected.step()
        kernel_step(parameters, coefficients, state, (1.0, 1.0), CALM)
        ours.append(joined(state["phases"], state["adhesion"], state["targets"]))
        targets = [steps.angles(i, expected.phases[i], 1.0) for i in range(6)]
        adhesion = [steps.adhesion(i, expected.phases[i]) for i in range(6)]
        theirs.append(joined(expected.phases, adhesion, *targets))
    np.testing.assert_array_equal(np.array(ours)[:, :12], np.array(theirs)[:, :12])
    np.testing.assert_allclose(ours, theirs, **TOLERANCE)
    assert expected.num_random_choices > 0


def test_rule_based_ignores_the_drive():
    config = ControllerConfig("rule_based")
    walking, undriven = run(config, 3000), run(config, 3000, drive=(0.0, -0.5))
    np.testing.assert_array_equal(walking["targets"], undriven["targets"])
    assert len(set(walking["phases"])) > 1


@pytest.mark.parametrize(
    ("steps", "step_duration_s", "expected"),
    [
        ("untethered", None, 1 / 12),
        ("tethered", None, 0.1278),
        ("untethered", 0.2, 0.2),
        ("tethered", 0.2, 0.2),
    ],
)
def test_rule_based_step_duration(steps, step_duration_s, expected):
    config = ControllerConfig("rule_based", steps, step_duration_s=step_duration_s)
    parameters, _ = pack_parameters(config, TIMESTEP)
    assert parameters["step_duration"] == pytest.approx(expected, rel=1e-12)
    # The first step's leg is the only one to move in the first time step.
    phases = run(config, 1)["phases"]
    assert phases.max() == pytest.approx(2 * np.pi * TIMESTEP / expected, rel=1e-12)
    assert np.count_nonzero(phases) == 1


@pytest.mark.parametrize(
    ("steps", "reflexes", "retraction_rate"),
    [
        ("untethered", None, 800),
        ("tethered", None, 500),
        ("untethered", "classic", 500),
        ("tethered", "current", 800),
    ],
)
def test_reflexes_go_with_the_steps_unless_named(steps, reflexes, retraction_rate):
    parameters, _ = pack_parameters(ControllerConfig("hybrid", steps, reflexes), TIMESTEP)
    assert parameters["retraction_rates"][0] == retraction_rate


def test_only_current_hybrid_grips_later():
    extensions = {}
    for name, steps in [("hybrid", "untethered"), ("hybrid", "tethered"), ("cpg", "untethered")]:
        parameters, _ = pack_parameters(ControllerConfig(name, steps), TIMESTEP)
        late = parameters["adhesion_swing_end"] - parameters["swing_end"]
        extensions[name, steps] = late.tolist()
    assert extensions == {
        ("hybrid", "untethered"): pytest.approx([np.pi / 4] * 6),
        ("hybrid", "tethered"): [0.0] * 6,
        ("cpg", "untethered"): [0.0] * 6,
    }


def test_zero_drive_settles_in_the_neutral_pose():
    state = run(CURRENT, 10_000, drive=(0.0, 0.0))
    assert state["magnitudes"].max() < 1e-8
    neutral = initial_state(CURRENT)["targets"]
    np.testing.assert_allclose(state["targets"], neutral, rtol=0, atol=1e-7)


def test_a_controller_means_the_same_at_a_coarser_time_step():
    trouble = dataclasses.replace(CALM, end_effector_z=np.array([-2.0, -1, -1, -1, -1, -1]))
    phases = np.array([0.0, np.pi, 0.0, np.pi, 0.0, np.pi])
    initial = {"init_phases": phases, "init_magnitudes": np.ones(6)}
    fine = run(CURRENT, 1000, observation=trouble, **initial)
    coarse = run(CURRENT, 200, observation=trouble, timestep=5e-4, **initial)
    np.testing.assert_allclose(coarse["phases"], fine["phases"], atol=1e-9)
    np.testing.assert_allclose(coarse["retraction"], fine["retraction"], atol=1e-9)
    np.testing.assert_allclose(coarse["targets"], fine["targets"], atol=1e-9)
    assert fine["retraction"][0] == pytest.approx(80.0)


def test_given_oscillators_win_over_the_seed():
    phases, magnitudes = np.arange(6.0), np.linspace(0, 1, 6)
    state = initial_state(CURRENT, 3, phases, magnitudes)
    np.testing.assert_array_equal(state["phases"], phases)
    np.testing.assert_array_equal(state["magnitudes"], magnitudes)


def test_seed_draws_phases_then_magnitudes():
    random = np.random.RandomState(3)
    phases, magnitudes = random.uniform(0, 2 * np.pi, 6), random.uniform(0, 1, 6)
    state = initial_state(CURRENT, 3)
    np.testing.assert_array_equal(state["phases"], phases)
    np.testing.assert_array_equal(state["magnitudes"], magnitudes)


def test_rule_based_starts_at_phase_zero_with_full_steps():
    state = initial_state(ControllerConfig("rule_based"), 3)
    np.testing.assert_array_equal(state["phases"], np.zeros(6))
    np.testing.assert_array_equal(state["magnitudes"], np.ones(6))


def test_state_continues_exactly_from_a_copy():
    config = ControllerConfig("rule_based")
    parameters, coefficients = pack_parameters(config, TIMESTEP)
    state = initial_state(config, 1)
    for _ in range(3000):
        kernel_step(parameters, coefficients, state, (1.0, 1.0), CALM)
    copy = np.array([state])[0]
    for _ in range(3000):
        kernel_step(parameters, coefficients, state, (1.0, 1.0), CALM)
    for _ in range(3000):
        kernel_step(parameters, coefficients, copy, (1.0, 1.0), CALM)
    assert copy.tobytes() == state.tobytes()


def test_a_diverged_simulation_cannot_crash_the_engine():
    nowhere = LegObservation(
        np.nan, np.full(6, np.nan), np.full((36, 3), np.nan), np.full(3, np.nan)
    )
    state = run(CURRENT, 3, drive=(np.nan, np.inf), observation=nowhere)
    assert np.isnan(state["targets"]).any()
    assert not state["retraction"].any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "ballistic"}, "name must be one of .*'hybrid'.* got 'ballistic'"),
        ({"steps": "swimming"}, "steps must be one of 'tethered', 'untethered', got 'swimming'"),
        ({"reflexes": "fast"}, "reflexes must be one of .*'current'.* got 'fast'"),
        ({"frequency_hz": -12.0}, "frequency_hz must be .* from 0.001 to 1000, got -12.0"),
        ({"coupling_weight": -1.0}, "coupling_weight must be .* from 0 to 1000, got -1.0"),
        ({"convergence_rate": -20.0}, "convergence_rate must be .* from 0 to 1000, got -20.0"),
        ({"step_duration_s": 0.0}, "step_duration_s must be .* from 0.001 to 1000, got 0.0"),
        ({"frequency_hz": 1e9}, "controller.frequency_hz must be .*, got 1000000000.0"),
    ],
)
def test_config_rejects(arguments, message):
    with pytest.raises(ValueError, match=message):
        ControllerConfig(**arguments)


@pytest.mark.parametrize("timestep", [0.0, -1e-4, np.nan, "1e-4"])
def test_time_step_must_be_above_zero(timestep):
    with pytest.raises(ValueError, match="timestep must be a finite number above 0"):
        pack_parameters(CURRENT, timestep)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, "seed must be an integer from 0 .* got -1"),
        ({"seed": 1.5}, "seed must be an integer from 0 .* got 1.5"),
        ({"init_phases": np.zeros(5)}, r"init_phases must have shape \(6,\), got shape \(5,\)"),
        ({"init_magnitudes": np.full(6, -0.1)}, "init_magnitudes must be at least 0"),
        ({"init_phases": np.full(6, np.nan)}, "init_phases must be finite"),
    ],
)
def test_initial_state_rejects(arguments, message):
    with pytest.raises(ValueError, match=message):
        initial_state(CURRENT, **arguments)


def test_class_rejects_a_drive_of_wrong_shape():
    with pytest.raises(ValueError, match=r"drive must have shape \(2,\), got shape \(3,\)"):
        LegController(CURRENT, TIMESTEP).step([1, 1, 1], CALM)


def test_class_rejects_an_observation_of_wrong_shape():
    wrong = dataclasses.replace(CALM, contact_forces_w=np.zeros((30, 3)))
    with pytest.raises(ValueError, match=r"contact_forces_w must have shape \(36, 3\)"):
        LegController(CURRENT, TIMESTEP).step([1, 1], wrong)
