"""The gait as the engine logs it, beside what can be read off the flies after every step."""

import mujoco
import numpy as np
import pytest

from flyrl.controllers.gait_log import CONTACT_THRESHOLD, STANCE_SPEED, unpack
from flyrl.simulation.flies import FlyBatch
from tests.simulation.test_callback import make_batch

STEPS_PER_SAMPLE = 5  # 1 ms at 2e-4 s


def with_log(places: int, terrain: str = "flat") -> FlyBatch:
    """A fly that logs its gait, walking ahead."""
    batch = make_batch(terrain=terrain, gait_places=places)
    batch.set_command(np.ones((1, 2)))
    return batch


def test_a_fly_with_a_log_walks_as_one_without() -> None:
    logged, plain = with_log(100, "gapped"), make_batch(terrain="gapped")
    plain.set_command(np.ones((1, 2)))
    for batch in (logged, plain):
        batch.step(1000)
    np.testing.assert_array_equal(logged._qpos, plain._qpos)
    np.testing.assert_array_equal(logged._qvel, plain._qvel)


def test_sums_and_samples_are_those_of_the_steps() -> None:
    batch = with_log(200, "gapped")
    assert batch.gait_logs is not None
    work, slip, rasters = 0.0, np.zeros(6), []
    was_grounded, tips_before, sampled_tips = np.zeros(6), np.zeros((6, 2)), np.full((6, 2), np.nan)
    for step in range(750):
        before = batch.state()
        batch.step()
        # forces, torques and reflexes are of the step from the pose before
        state = batch.state()
        forces_w = state.contact_forces_w.reshape(1, 6, 6, 3).sum(axis=2)
        grounded = state.is_grounded
        assert (grounded == (np.linalg.norm(forces_w, axis=2) > CONTACT_THRESHOLD)).all()
        power = state.actuator_torques[0] * before.joint_velocities[0]
        work += power[power > 0].sum() * 2e-4
        tips = before.end_effectors_w[0, :, :2]
        slides = (grounded[0] * was_grounded * state.adhesion[0]).astype(bool)
        slip[slides] += np.linalg.norm(tips - tips_before, axis=1)[slides]
        if step % STEPS_PER_SAMPLE == 0:
            way = np.linalg.norm(tips - sampled_tips, axis=1)
            stance = grounded * ~(way >= STANCE_SPEED * 1e-3)
            flags = (stance, state.adhesion, state.retraction, state.stumbling)
            rasters.append([flag[0] > 0 for flag in flags])
            sampled_tips = tips
        was_grounded, tips_before = grounded[0], tips
    log = batch.gait_logs[0]
    assert work > 0 and (slip > 0).all()
    assert log["work"] == pytest.approx(work, rel=1e-9)
    np.testing.assert_allclose(log["slip"], slip, rtol=1e-9)
    samples = unpack(batch.gait_samples(0, 0))
    expected = np.array(rasters)
    assert len(expected) == 150
    assert expected[:, 2].any()  # a gap was met
    for k, name in enumerate(("stance", "adhesion", "retraction", "stumbling")):
        np.testing.assert_array_equal(samples[name], expected[:, k])


def test_samples_come_out_in_parts() -> None:
    whole, parts = with_log(100), with_log(7)
    whole.step(500)
    taken = []
    for _ in range(20):
        parts.step(25)
        taken.append(parts.gait_samples(0, 5 * len(taken)))
    np.testing.assert_array_equal(np.concatenate(taken), whole.gait_samples(0, 0))


@pytest.mark.parametrize(
    ("places", "message"), [(7, "of 8 samples, the last 7 are kept"), (0, "gait_places is 0")]
)
def test_samples_that_are_not_kept_are_an_error(places, message) -> None:
    batch = with_log(places)
    batch.step(STEPS_PER_SAMPLE * 8)
    with pytest.raises(ValueError, match=message):
        batch.gait_samples(0, 0)


def test_forward_at_the_same_time_advances_no_controller_and_logs_no_step_twice() -> None:
    batch = with_log(100)
    batch.step(10)
    data = batch._batch.get_data(0)
    before = data.userdata.copy()
    mujoco.mj_forward(batch.scene.model, data)
    once = data.userdata.copy()
    mujoco.mj_forward(batch.scene.model, data)
    np.testing.assert_array_equal(data.userdata, once)
    phases = [each.view(batch.scene.userdata)[0]["controller"]["phases"] for each in (before, once)]
    assert (phases[0] != phases[1]).all()
