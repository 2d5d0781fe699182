"""Coupled oscillators."""

import numpy as np
import pytest

from flyrl import CPGNetwork
from flyrl.controllers.cpg import modulated, motor_neuron_activity

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


def test_arrays_given_and_handed_out_do_not_change():
    given = np.array([1.0, 2.0])
    two = network(init_phases=given)
    handed_out = two.curr_phases
    two.step()
    np.testing.assert_array_equal(given, [1.0, 2.0])
    np.testing.assert_array_equal(handed_out, [1.0, 2.0])
    assert (two.curr_phases != given).all()


def test_motor_neuron_activity_by_hand():
    np.testing.assert_allclose(motor_neuron_activity([2.0, 2.0], [0.0, np.pi / 2]), [2.0, 4.0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: network(timestep=np.inf), "timestep must be a finite number above 0, got inf"),
        (lambda: network(intrinsic_freqs=[]), "N of at least 1"),
        (lambda: network(coupling_weights=np.ones(2)), r"weights must have shape \(2, 2\)"),
        (lambda: network(convergence_coefs=[-1, 1]), "convergence_coefs must be at least 0"),
        (lambda: network(seed=-1), "seed must be an integer"),
        (lambda: network().reset(init_phases=[1.0]), r"init_phases must have shape \(2,\)"),
        (lambda: setattr(network(), "intrinsic_freqs", [1.0]), r"freqs must have shape \(2,\)"),
        (lambda: modulated((1.0, 1.0), -12.0), "frequency_hz must be .* above 0, got -12.0"),
    ],
)
def test_arguments_are_checked(call, message):
    with pytest.raises(ValueError, match=message):
        call()
