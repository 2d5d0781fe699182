"""Flies with a part missing: legs cut off, joints that cannot move, legs that feel nothing."""

import numpy as np
import pytest

from flyrl.anatomy import JOINTS, LEGS
from flyrl.bodies.fly import FlyConfig, build_fly, is_of_legs
from flyrl.controllers import Hybrid
from flyrl.simulation.physics import PHYSICS_PRESETS
from tests.simulation.test_callback import make_batch

TIBIA = "joint_RMTibia"


def walked(terrain="flat", seconds=0.6, **body):
    """States, every 10 ms, of a fly that was told to walk ahead."""
    batch = make_batch("hybrid", terrain, physics=PHYSICS_PRESETS["balanced"], **body)
    batch.set_command(np.ones((1, 2)))
    states = []
    for _ in range(round(seconds / 0.01)):
        batch.step(25)
        states.append(batch.state())
    return states


def way(states):
    return float(np.linalg.norm(states[-1].position_w[0, :2] - states[0].position_w[0, :2]))


def test_a_leg_that_was_cut_off_touches_nothing_and_the_fly_walks_on_worse():
    whole = walked()
    lesioned = walked(missing_legs=("LM",))
    forces = np.array([state.contact_forces_w[0].reshape(6, 18) for state in lesioned])
    touched = np.abs(forces).sum(axis=(0, 2)) > 0
    assert touched.tolist() == [leg != "LM" for leg in LEGS]
    assert 0.2 * way(whole) < way(lesioned) < way(whole)
    assert not lesioned[-1].is_unstable.any()


def test_a_leg_that_was_cut_off_weighs_next_to_nothing():
    whole, lesioned = (
        build_fly(FlyConfig(missing_legs=legs)).compile() for legs in ((), ("RH", "LF"))
    )
    # its haltere begins with a hind leg's letters, its antenna with a front leg's
    assert {"RHaltere", "LFuniculus"} <= {whole.body(i).name for i in range(whole.nbody)}
    for i in range(whole.nbody):
        of_leg = is_of_legs(whole.body(i).name, ("RH", "LF"))
        share = 1e-3 if of_leg else 1.0
        assert lesioned.body_mass[i] == pytest.approx(share * whole.body_mass[i]), i
    assert sum(is_of_legs(whole.body(i).name, ("RH", "LF")) for i in range(whole.nbody)) == 16


def test_a_leg_that_was_cut_off_is_in_no_hole():
    # with all legs on one side gone the others hang no deeper than what is not there
    states = walked(missing_legs=("RF", "RM", "RH"), seconds=0.3)
    retracted = np.array([state.retraction[0] for state in states])
    assert not retracted[:, 3:].any()


def test_a_fixed_joint_stays_where_it_is():
    states = walked(fixed_joints=((TIBIA, 1.2),))
    angles = np.array([state.joint_angles[0] for state in states])
    held = JOINTS.index(TIBIA)
    assert np.abs(angles[:, held] - 1.2).max() < np.deg2rad(1.2)
    assert np.ptp(angles[:, JOINTS.index("joint_LMTibia")]) > np.deg2rad(10)


def test_legs_that_feel_nothing_do_not_stumble():
    feeling, numb = (walked("blocks", senses_contact=senses) for senses in (True, False))
    assert any(state.stumbling.any() for state in feeling)
    assert not any(state.stumbling.any() for state in numb)
    assert not any(state.contact_forces_w.any() for state in numb)
    assert any(state.is_grounded.any() for state in feeling)
    assert not any(state.is_grounded.any() for state in numb)
    # they are on the ground all the same
    assert numb[-1].position_w[0, 2] > 0.5


@pytest.mark.parametrize("share", [0.0, 0.5])
@pytest.mark.parametrize("reflex", ["retraction", "stumbling"])
def test_a_reflex_grows_by_its_share_of_the_usual_rate(reflex, share):
    whole, weak = (each.parameters(1e-4) for each in (Hybrid(), Hybrid(**{reflex: share})))
    for name in ("retraction_rates", "stumbling_rates"):
        factor = (share, 1) if name.startswith(reflex) else 1
        np.testing.assert_array_equal(weak[name], whole[name] * factor)
