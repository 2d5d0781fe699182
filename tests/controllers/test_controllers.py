"""The built-in controllers: their kernels against the written-out specification."""

import numpy as np
import pytest

from flyrl.controllers import CPG, Hybrid, RuleBased
from flyrl.controllers.cpg import GAIT_PHASES, gait_phase_biases
from tests.controllers import oracle
from tests.controllers.kernels import CALM, Legs, Observation
from tests.controllers.observations import random_drives, random_observations

TIMESTEP = 1e-4
TOLERANCE = {"rtol": 0, "atol": 1e-12}

CURRENT = Hybrid("untethered")
CLASSIC = Hybrid("tethered")


FIELDS = (
    "phases", "magnitudes", "retraction", "stumbling", "net_correction", "angles", "adhesion"
)  # fmt: skip


def joined(*arrays):
    """One vector, to be kept: a comparison at the end is quicker than many on the way."""
    return np.concatenate([np.ravel(array) for array in arrays])


def run(controller, num_steps, drive=(1.0, 1.0), observation=CALM, timestep=TIMESTEP, **initial):
    legs = Legs(controller, timestep, **initial)
    for _ in range(num_steps):
        legs.step(drive, observation)
    return legs


@pytest.mark.parametrize(("name", "config"), [("current", CURRENT), ("classic", CLASSIC)])
def test_hybrid_follows_the_specification(name, config):
    num_steps, seed = 6000, 1
    expected = oracle.Hybrid(name, oracle.Steps(config.steps), oracle.Oscillators(TIMESTEP, seed))
    legs = Legs(config, TIMESTEP, seed=seed)

    drives, ours, theirs = random_drives(num_steps, seed), [], []
    for drive, observation in zip(drives, random_observations(num_steps, seed), strict=True):
        expected.step(drive, observation)
        legs.step(drive, observation)
        ours.append(joined(*(legs[field] for field in FIELDS)))
        oscillators = expected.oscillators
        amounts = expected.retraction, expected.stumbling, expected.net
        outputs = expected.targets, expected.adhesion
        theirs.append(joined(oscillators.theta, oscillators.r, *amounts, *outputs))
    np.testing.assert_allclose(ours, theirs, **TOLERANCE)

    events = expected.events
    assert events.retracted > 1000
    assert events.stumbled > 1000
    assert events.stumbling_while_retracting > 50
    if name == "current":
        assert events.persisted > 20
        assert events.capped > 20


def test_cpg_alone_has_no_reflexes():
    config = CPG()
    in_trouble = random_observations(1, 0)[0]
    in_trouble = in_trouble._replace(
        end_effector_z=np.array([-2.0, -1, -1, -1, -1, -1]),
        contact_forces_w=np.full((36, 3), -50.0),
    )
    troubled = run(config, 500, observation=in_trouble)
    calm = run(config, 500)
    np.testing.assert_array_equal(troubled["angles"], calm["angles"])


def test_rule_based_follows_the_specification_and_ignores_the_drive():
    steps = oracle.Steps("untethered")
    expected = oracle.Walknet(TIMESTEP, 1 / 12, steps.swing_end, seed=2)
    legs = Legs(RuleBased(), TIMESTEP, seed=2)
    ours, theirs = [], []
    for drive in random_drives(5000, 2):
        expected.step()
        legs.step(drive)
        ours.append(joined(legs["phases"], legs["adhesion"], legs["angles"]))
        targets = [steps.angles(i, expected.phases[i], 1.0) for i in range(6)]
        adhesion = [steps.adhesion(i, expected.phases[i]) for i in range(6)]
        theirs.append(joined(expected.phases, adhesion, *targets))
    np.testing.assert_array_equal(np.array(ours)[:, :12], np.array(theirs)[:, :12])
    np.testing.assert_allclose(ours, theirs, **TOLERANCE)
    assert expected.num_random_choices > 0


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
    # The first step's leg is the only one to move in the first time step.
    phases = run(RuleBased(steps, step_duration_s), 1)["phases"]
    assert phases.max() == pytest.approx(2 * np.pi * TIMESTEP / expected, rel=1e-12)
    assert np.count_nonzero(phases) == 1


def test_reflexes_go_with_the_steps_unless_named():
    for *names, retraction_rate in (
        ("untethered", None, 800),
        ("tethered", None, 500),
        ("untethered", "classic", 500),
        ("tethered", "current", 800),
    ):
        parameters = Hybrid(names[0], reflexes=names[1]).parameters(TIMESTEP)
        assert parameters["retraction_rates"][0] == retraction_rate


def test_zero_drive_settles_in_the_neutral_pose():
    state = run(CURRENT, 10_000, drive=(0.0, 0.0))
    assert state["magnitudes"].max() < 1e-8
    neutral = CURRENT.load_steps().default_pose
    np.testing.assert_allclose(state["angles"], neutral, rtol=0, atol=1e-7)


def test_a_diverged_simulation_cannot_crash_the_engine():
    nowhere = Observation(np.nan, np.full(6, np.nan), np.full((36, 3), np.nan), np.full(3, np.nan))
    state = run(CURRENT, 3, drive=(np.nan, np.inf), observation=nowhere)
    assert np.isnan(state["angles"]).any()
    assert not state["retraction"].any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: CPG("swimming"), "controller.steps must be one of .*'tethered'.*, got 'swimming'"),
        (lambda: CPG(frequency_hz=-12.0), "frequency_hz must be .* from 0.001 to 1000, got -12.0"),
        (lambda: CPG(phase_biases=((0.0,) * 6,) * 5), "phase_biases must be a list of 6, got"),
        (lambda: CPG(amplitude_range=(1, -1)), "amplitude_range must be .least, greatest."),
        (lambda: CPG().parameters(0.0), "timestep must be a finite number above 0, got 0.0"),
        (lambda: CPG().initial_state(1.5), "seed must be an integer from 0 .* got 1.5"),
        (lambda: CPG().initial_state(0, np.zeros(5)), r"init_phases must have shape \(6,\), got"),
        (lambda: CPG().initial_state(0, None, -np.ones(6)), "init_magnitudes must be at least 0"),
        (lambda: Hybrid(reflexes="fast"), "reflexes must be one of .*'current'.* got 'fast'"),
        (lambda: Hybrid(stumbling_segments=("Coxa",)), r"stumbling_segments\[0\] must be one of"),
        (lambda: Hybrid(stumbling_force=5.0), "stumbling_force must be .* from -1e.06 to 0, got 5"),
        (lambda: CPG(phase_biases=np.ones((6, 6))), r"phase_biases must be 0 modulo 2 pi .*0, 1"),
        (lambda: RuleBased(edges=(("LF", "LM", "rule4"),)), r"edges\[0\]\[2\] must be one of"),
    ],
)  # fmt: skip
def test_what_is_not_allowed_is_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_phase_biases_are_of_any_gait_and_need_not_agree_where_legs_are_not_coupled():
    for gait in GAIT_PHASES:
        biases = gait_phase_biases(gait).round(2)
        own = CPG(phase_biases=biases, coupling_weights=np.ones((6, 6)))
        np.testing.assert_array_equal(own.parameters(TIMESTEP)["phase_biases"], biases)
    for settings in ({"coupling_weight": 0.0}, {"coupling_weights": np.tri(6, k=-1)}):
        assert CPG(phase_biases=np.ones((6, 6)), **settings).phase_biases == ((1.0,) * 6,) * 6


def test_arrays_are_taken_as_lists_are():
    of_arrays = CPG(frequency_hz=np.full(6, 10), coupling_weights=np.eye(6))
    of_lists = CPG(frequency_hz=[10.0] * 6, coupling_weights=np.eye(6).tolist())
    assert of_arrays == of_lists
    assert hash(of_arrays) == hash(of_lists)


def test_values_of_each_leg_reach_the_kernel():
    six = tuple(range(1, 7))
    record = CPG(frequency_hz=six, amplitude=six, convergence_rate=six).parameters(TIMESTEP)
    for name in ("frequency", "amplitude", "convergence_coefs"):
        np.testing.assert_array_equal(record[name], six)
    # left legs at the left drive, right legs at the right one
    legs = run(CPG(amplitude=six, convergence_rate=1e3), 300, drive=(1.0, 0.5))
    np.testing.assert_allclose(legs["magnitudes"], [1, 2, 3, 2, 2.5, 3])


@pytest.mark.parametrize(
    ("gait", "in_phase"),
    [("tripod", [0, 2, 4]), ("tetrapod", [2, 4]), ("wave", [2])],
)
def test_a_gait_is_where_the_oscillators_settle(gait, in_phase):
    """Legs in phase with the left hind one; the others of the tetrapod a third of a cycle off."""
    legs = run(CPG(gait=gait), 20_000, init_phases=np.linspace(0, 1, 6))
    shares = np.mod(legs["phases"] - legs["phases"][2], 2 * np.pi) / (2 * np.pi)
    together = np.flatnonzero(np.minimum(shares, 1 - shares) < 0.01)
    assert together.tolist() == in_phase
    if gait != "tripod":
        np.testing.assert_allclose(np.mod(shares + 0.01, 1) - 0.01, GAIT_PHASES[gait], atol=0.01)


def test_reflexes_take_values_of_ones_own():
    own = Hybrid(cap=5.0, stumbling_segments=("Tarsus5",), hind=(0, 0, 0, 0, 0, 0.5, 0))
    record, usual = own.parameters(TIMESTEP), CURRENT.parameters(TIMESTEP)
    assert record["cap"] == 5.0
    np.testing.assert_array_equal(record["retraction_rates"], usual["retraction_rates"])
    forces = np.zeros((36, 3))
    forces[5, 0] = -2.0  # the left front tarsus's last segment
    observation = CALM._replace(contact_forces_w=forces)
    assert run(own, 10, observation=observation)["stumbling"][0] > 0
    assert run(CURRENT, 10, observation=observation)["stumbling"][0] == 0
    assert record["correction_vectors"][2, 5] == 0.5


def test_rules_take_weights_and_a_graph_of_ones_own():
    record = RuleBased(rule1=-3.0, edges=(("LF", "RF", "rule1"),)).parameters(TIMESTEP)
    expected = np.zeros((6, 6))
    expected[0, 3] = -3.0
    np.testing.assert_array_equal(record["rule_weights"][0], expected)
    assert not record["rule_weights"][1:].any()
