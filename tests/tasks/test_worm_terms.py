"""What the tasks for worms compute, against numbers worked out by hand."""

import dataclasses

import numpy as np

from flyrl.simulation.worms import WormState
from flyrl.tasks import worm as terms
from flyrl.tasks.terms import compass
from tests.tasks.test_terms import task_state


def worm_state(n: int = 1, joints: int = 2, **changes: object) -> WormState:
    state = WormState(
        time=np.zeros(n),
        position_w=np.zeros((n, 3)),
        velocity_w=np.zeros((n, 3)),
        yaw=np.zeros(n),
        joint_angles=np.zeros((n, joints)),
        joint_velocities=np.zeros((n, joints)),
        neurons=np.zeros((n, 2 * joints)),
        tensions=np.zeros((n, 2 * joints)),
        is_unstable=np.zeros(n, dtype=bool),
    )
    return dataclasses.replace(
        state, **{name: np.asarray(value, dtype=float) for name, value in changes.items()}
    )


def test_the_heading_is_a_cosine_and_a_sine() -> None:
    state = task_state(worm_state(2, yaw=[np.pi / 6, -np.pi / 2]))
    np.testing.assert_allclose(compass(state), [[np.sqrt(0.75), 0.5], [0.0, -1.0]], atol=1e-12)


def test_the_bend_error_is_the_sum_of_the_angles_less_the_command() -> None:
    worm = worm_state(2, joint_angles=[[0.5, 0.25], [-0.5, 0.1]])
    state = task_state(worm, command=[[1.0], [-1.4]])
    np.testing.assert_allclose(terms.bend_error(state), [[-0.25], [1.0]])
    np.testing.assert_allclose(terms.absolute_bend_error(state), [0.25, 1.0])
    np.testing.assert_allclose(terms.bend_error_deg(state), [14.323945, 57.29578])


def test_a_worm_has_bent_if_it_is_off_by_less_than_a_tenth() -> None:
    worm = worm_state(3, joint_angles=[[0.0, 0.099], [-0.099, 0.0], [0.0, 0.101]])
    state = task_state(worm, command=[[0.0]] * 3)
    assert terms.has_bent(state, 0.1).tolist() == [True, True, False]


def test_a_worm_has_crawled_once_it_has_come_far_enough() -> None:
    state = task_state(worm_state(3), progress=[35.9, 36.0, -40.0])
    assert terms.has_crawled(state, way=36.0).tolist() == [False, True, False]


def test_the_recruited_share_does_not_count_the_first_neurons() -> None:
    # of (16 - 1) + (16 - 1) + (6 - 1) + (6 - 1) = 40
    worm = worm_state(3, neurons=[[0, 0, 0, 0], [15, 15, 5, 5], [3, 0, 5, 2]])
    share = terms.recruited_share(task_state(worm), pools=(16, 16, 6, 6))
    np.testing.assert_allclose(share, [0.0, 1.0, 0.25])


def test_of_pools_with_one_neuron_each_no_share_is_recruited() -> None:
    share = terms.recruited_share(task_state(worm_state(2)), pools=(1, 1, 1, 1))
    assert share.tolist() == [0.0, 0.0]


def test_a_joint_of_5_rad_per_s_is_shown_as_1() -> None:
    state = task_state(worm_state(joint_velocities=[[5.0, -2.5]]))
    np.testing.assert_allclose(terms.joint_velocities(state), [[1.0, -0.5]])
