"""Coupled oscillators."""

import numpy as np
import pytest

from flyrl import CPGNetwork
from flyrl.controllers.cpg import (
    gait_coupling_weights,
    gait_phase_biases,
    motor_neuron_activity,
    three_oscillators,
)

TWO_PI = 2 * np.pi


def network(n=2, **arguments):
    defaults = {
        "timestep": 1e-3,
        "intrinsic_freqs": np.ones(n),
        "intrinsic_amps": np.ones(n),
        "coupling_weights": np.zeros((n, n)),
        "phase_biases": np.zeros((n, n)),
        "convergence_coefs": np.full(n, 10.0),
    }
    return CPGNetwork(**{**defaults, **arguments})


def tripod(seed=0):
    return network(
        6,
        timestep=1e-4,
        intrinsic_freqs=np.full(6, 12.0),
        coupling_weights=gait_coupling_weights(),
        phase_biases=gait_phase_biases(),
        convergence_coefs=np.full(6, 20.0),
        seed=seed,
    )


def circular_distance(a, b):
    return np.abs((a - b + np.pi) % TWO_PI - np.pi)


def test_one_euler_step_by_hand():
    two = network(
        timestep=0.1,
        intrinsic_freqs=[1.0, 2.0],
        intrinsic_amps=[1.0, 3.0],
        coupling_weights=[[0, 4], [5, 0]],
        phase_biases=[[0, np.pi / 2], [-np.pi / 2, 0]],
        convergence_coefs=[2.0, 1.0],
        init_phases=[0.0, np.pi],
        init_magnitudes=[0.5, 2.0],
    )
    two.step()
    # sin(π - 0 - π/2) = 1, from magnitude 2; sin(0 - π + π/2) = -1, from magnitude 0.5.
    np.testing.assert_allclose(
        two.curr_phases, [0.1 * (TWO_PI + 4 * 2), np.pi + 0.1 * (2 * TWO_PI - 5 * 0.5)]
    )
    np.testing.assert_allclose(two.curr_magnitudes, [0.5 + 0.1 * 2 * 0.5, 2.0 + 0.1 * 1 * 1.0])


def test_three_oscillators_settle_a_third_of_a_cycle_apart():
    three = three_oscillators()
    for _ in range(10_000):
        three.step()
    steps = np.diff(three.curr_phases)
    np.testing.assert_allclose(circular_distance(steps, np.deg2rad(120)), 0, atol=1e-3)
    np.testing.assert_allclose(three.curr_magnitudes, [1, 1.1, 1.2], atol=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_tripods_settle_in_antiphase(seed):
    six = tripod(seed)
    for _ in range(10_000):
        six.step()
    phases = six.curr_phases
    np.testing.assert_allclose(circular_distance(phases[[0, 2, 4]], phases[0]), 0, atol=1e-6)
    np.testing.assert_allclose(circular_distance(phases[[1, 3, 5]], phases[0]), np.pi, atol=1e-6)


def test_tripod_biases():
    # Rows and columns LF LM LH RF RM RH; tripods LF LH RM and LM RF RH.
    expected = [
        [0, 1, 0, 1, 0, 1],
        [1, 0, 1, 0, 1, 0],
        [0, 1, 0, 1, 0, 1],
        [1, 0, 1, 0, 1, 0],
        [0, 1, 0, 1, 0, 1],
        [1, 0, 1, 0, 1, 0],
    ]
    np.testing.assert_array_equal(gait_phase_biases() / np.pi, expected)
    np.testing.assert_array_equal(gait_coupling_weights(), 10 * np.array(expected))


def test_a_single_oscillator_runs_at_its_frequency():
    one = network(1, intrinsic_freqs=[3.0], init_phases=[0.5], init_magnitudes=[0.0])
    for _ in range(1000):
        one.step()
    assert one.curr_phases == pytest.approx([0.5 + TWO_PI * 3])
    assert one.curr_magnitudes == pytest.approx([1 - (1 - 10 * 1e-3) ** 1000])


def test_a_negative_frequency_runs_backwards():
    one = network(1, intrinsic_freqs=[-3.0], init_phases=[0.5])
    one.step()
    assert one.curr_phases == pytest.approx([0.5 - TWO_PI * 3 * 1e-3])


def test_error_falls_with_the_time_step():
    def final_state(timestep):
        three = network(
            3,
            timestep=timestep,
            intrinsic_freqs=[1.0, 1.3, 0.8],
            coupling_weights=np.full((3, 3), 2.0),
            phase_biases=[[0, 1, 2], [-1, 0, 1], [-2, -1, 0]],
            convergence_coefs=[5.0, 5.0, 5.0],
            init_phases=[0.0, 1.0, 4.0],
            init_magnitudes=[0.1, 0.2, 0.3],
        )
        for _ in range(round(0.5 / timestep)):
            three.step()
        return np.concatenate([three.curr_phases, three.curr_magnitudes])

    exact = final_state(1e-3 / 128)
    errors = [np.abs(final_state(1e-3 / k) - exact).max() for k in (1, 2, 4)]
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.1)


def test_phases_then_magnitudes_are_drawn():
    random = np.random.RandomState(7)
    phases = random.uniform(0, TWO_PI, 2)
    magnitudes = random.uniform(0, 1, 2) * [2.0, 3.0]
    two = network(intrinsic_amps=[2.0, 3.0], seed=7)
    np.testing.assert_array_equal(two.curr_phases, phases)
    np.testing.assert_array_equal(two.curr_magnitudes, magnitudes)


def test_reset_goes_on_drawing():
    random = np.random.RandomState(7)
    random.uniform(size=4)
    two = network(seed=7)
    two.reset()
    np.testing.assert_array_equal(two.curr_phases, random.uniform(0, TWO_PI, 2))


def test_reset_takes_given_values():
    two = network()
    two.reset([1.0, 2.0], [0.3, 0.4])
    np.testing.assert_array_equal(two.curr_phases, [1.0, 2.0])
    np.testing.assert_array_equal(two.curr_magnitudes, [0.3, 0.4])


def test_arrays_given_and_handed_out_do_not_change():
    given = np.array([1.0, 2.0])
    two = network(init_phases=given)
    handed_out = two.curr_phases
    two.step()
    np.testing.assert_array_equal(given, [1.0, 2.0])
    np.testing.assert_array_equal(handed_out, [1.0, 2.0])
    assert (two.curr_phases != given).all()


def test_assigned_amplitudes_take_effect():
    two = network(init_magnitudes=[1.0, 1.0])
    two.intrinsic_amps = [0, 1]
    two.step()
    np.testing.assert_allclose(two.curr_magnitudes, [1 - 10 * 1e-3, 1.0])


def test_motor_neuron_activity_by_hand():
    np.testing.assert_allclose(motor_neuron_activity([2.0, 2.0], [0.0, np.pi / 2]), [2.0, 4.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"timestep": 0}, "timestep must be a finite number above 0, got 0"),
        ({"timestep": np.inf}, "timestep must be a finite number above 0, got inf"),
        ({"intrinsic_freqs": np.ones((2, 1))}, r"intrinsic_freqs must have shape \(2,\)"),
        ({"intrinsic_freqs": []}, "N of at least 1"),
        ({"intrinsic_freqs": [1, np.nan]}, "intrinsic_freqs must be finite"),
        ({"intrinsic_freqs": ["a", "b"]}, "intrinsic_freqs must be numbers"),
        (
            {"intrinsic_amps": np.ones(3)},
            r"intrinsic_amps must have shape \(2,\), got shape \(3,\)",
        ),
        ({"intrinsic_amps": [1, -1]}, "intrinsic_amps must be at least 0"),
        ({"coupling_weights": np.ones(2)}, r"coupling_weights must have shape \(2, 2\)"),
        ({"phase_biases": np.ones((2, 3))}, r"phase_biases must have shape \(2, 2\)"),
        ({"convergence_coefs": [-1, 1]}, "convergence_coefs must be at least 0"),
        ({"init_phases": [0]}, r"init_phases must have shape \(2,\), got shape \(1,\)"),
        ({"init_magnitudes": [0, -1]}, "init_magnitudes must be at least 0"),
        ({"seed": -1}, "seed must be an integer"),
    ],
)
def test_arguments_are_checked(arguments, message):
    with pytest.raises(ValueError, match=message):
        network(**arguments)


def test_assignments_are_checked():
    two = network()
    with pytest.raises(ValueError, match=r"intrinsic_freqs must have shape \(2,\)"):
        two.intrinsic_freqs = [1.0]


def test_reset_is_checked():
    with pytest.raises(ValueError, match=r"init_phases must have shape \(2,\)"):
        network().reset(init_phases=[1.0])
