import multiprocessing
import warnings
from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from test_callback import late, make_batch, start, walk

from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.randomisation import Randomisation


def test_restoring_a_state_replays_its_future() -> None:
    """With a random stream, commands on their way and a log of the gait."""
    batch = make_batch("rule_based", queue_places=2, gait_places=100)
    start(batch, late(100))
    walk(batch, 50)
    beginning = batch.integration_state()

    def future() -> np.ndarray:
        batch.set_command(np.array([[0.0, 1.2]]))
        batch.step(400)
        return batch.integration_state()

    first = future()
    batch.restore(beginning)
    np.testing.assert_array_equal(future(), first)


def test_splitting_a_call_changes_no_bit() -> None:
    split = make_batch()
    for steps in (1, 20, 39):
        walk(split, steps)
    np.testing.assert_array_equal(split.integration_state(), walk(make_batch(), 60))


def test_reset_places_and_turns_the_fly() -> None:
    batch = make_batch()
    offset = batch.state().position_w[0] - [0.0, 0.0, 0.5]
    start(batch, {"spawn_position_w": (3.0, -1.0, 0.5), "spawn_yaw": np.pi / 2})
    state = batch.state()
    assert state.yaw[0] == pytest.approx(np.pi / 2)
    expected = [3.0 - offset[1], -1.0 + offset[0], 0.5 + offset[2]]
    np.testing.assert_allclose(state.position_w[0], expected, atol=1e-12)


def test_flies_that_are_reset_have_no_torque_of_another() -> None:
    """Of one that the same thread simulated, that is: which one is a matter of luck."""
    scene = make_batch().scene
    batch = FlyBatch(scene, num_sims=3, num_threads=2)
    for _ in range(10):
        start(batch)
        assert not batch.state().actuator_torques.any()
        walk(batch, 20)
        assert batch.state().actuator_torques.any(axis=1).all()


def test_orientation_is_that_of_the_state_after_the_step() -> None:
    batch = make_batch()
    walk(batch, 777)
    expected = np.zeros(9)
    mujoco.mju_quat2Mat(expected, batch._qpos[0, 3:7] / np.linalg.norm(batch._qpos[0, 3:7]))
    state = batch.state()
    np.testing.assert_allclose(state.rotation_w[0], expected.reshape(3, 3), atol=1e-12)
    assert abs(state.yaw[0]) > 0.1


@pytest.mark.parametrize("sizes", [(0, 1), (1, -1), (1.5, 1), (10**9, 1), (1, 100_000)])
def test_bad_sizes_are_refused(sizes) -> None:
    scene = make_batch().scene
    with pytest.raises(ValueError, match="num_"):
        FlyBatch(scene, *sizes)


def test_threads_of_another_process_are_an_error_and_not_a_hang() -> None:
    scene = make_batch().scene
    batch = FlyBatch(scene, 2, num_threads=2)
    start(batch)
    for call in (
        batch.step,
        lambda: start(batch),
        lambda: batch.restore(batch.integration_state()),
        lambda: batch.vary(np.arange(2), [Randomisation(mass=2.0)] * 2),
    ):
        assert "make it in the process that uses it" in _in_a_fork(call)


def test_in_a_fork_a_batch_can_be_freed_and_without_threads_it_runs() -> None:
    batches = [FlyBatch(make_batch().scene, 2, num_threads=2)]
    assert _in_a_fork(batches.clear) == "no error"
    assert _in_a_fork(make_batch().step) == "no error"


def _in_a_fork(call: Callable[[], object]) -> str:
    """Call in a child process; end it if it hangs."""
    reader, writer = multiprocessing.Pipe(duplex=False)

    def run() -> None:
        try:
            call()
            writer.send("no error")
        except RuntimeError as error:
            writer.send(str(error))

    child = multiprocessing.get_context("fork").Process(target=run)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that forking with threads may hang
        child.start()
    said = reader.recv() if reader.poll(20) else "hang"
    child.kill()
    child.join()
    return said


def test_leg_states_are_what_the_controller_of_one_simulation_does() -> None:
    batch = make_batch(num_sims=2)
    expected = {
        "grips": [1, 0, 1, 0, 0, 0],
        "retracts": [0, 1, 0, 0, 0, 0],
        "stumbles": [0, 0, 0, 0, 0, 1],
    }
    batch.output["adhesion"][1] = expected["grips"]
    batch.controllers["retraction"][1] = np.multiply(expected["retracts"], 2.5)
    batch.controllers["stumbling"][1] = np.multiply(expected["stumbles"], 0.1)
    states = batch.leg_states(1)
    batch.output["adhesion"][1] = 1
    assert {name: on.tolist() for name, on in states.items()} == expected
    assert not batch.leg_states(0)["retracts"].any()
