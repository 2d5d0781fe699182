"""Walks with their tables and videos, and recordings replayed."""

from types import SimpleNamespace

import numpy as np
import pytest

import flyrl
from flyrl.anatomy import JOINTS, LEGS
from flyrl.front.walks import _fictive_way
from tests.pictures import drawing

GRIPS = [f"adhesion_{leg}" for leg in LEGS]


@pytest.fixture(scope="module")
def walk():
    return flyrl.walk("cpg", seconds=0.5)


def test_a_driven_fly_gets_somewhere_and_one_without_a_drive_does_not(walk):
    still = flyrl.walk("cpg", drive=(0, 0), seconds=0.5).frame()
    way = walk.frame().x_mm.iloc[-1] - walk.frame().x_mm.iloc[0]
    assert way > 5.0
    assert abs(still.x_mm.iloc[-1] - still.x_mm.iloc[0]) < 1.0
    assert walk.outcome == "running"


def test_the_table_holds_what_the_engine_says(walk):
    table, last = walk.frame(), walk.states[-1]
    assert len(table) == len(walk.rows) == 626  # 0.5 s, every second step of 0.4 ms, and the start
    assert table.time_s.iloc[-1] == pytest.approx(0.5)
    row = table.iloc[-1]
    np.testing.assert_array_equal(row[list(JOINTS)], last.joint_angles[0])
    np.testing.assert_array_equal(row[["x_mm", "y_mm", "z_mm"]], last.position_w[0])
    np.testing.assert_array_equal(row[GRIPS], last.adhesion[0])
    assert row.yaw_rad == pytest.approx(last.yaw[0])
    assert row.fz_LM == pytest.approx(last.contact_forces_w[0, 6:12, 2].sum())
    assert (row.command_left, row.command_right) == (1.0, 1.0)


def test_stance_is_less_than_contact_and_legs_stand_about_half_of_the_time(walk):
    table = walk.frame()[200:]
    for leg in LEGS:
        in_contact = np.linalg.norm(table[[f"f{axis}_{leg}" for axis in "xyz"]], axis=1) > 1.0
        stands = table[f"stance_{leg}"].to_numpy(dtype=bool)
        assert (stands <= in_contact).all()
        assert 0.3 < stands.mean() < 0.9


def test_reflexes_of_the_hybrid_controller_are_in_the_table_and_a_cpg_has_none(walk):
    reflexes = "^(retracts|stumbles)_"
    mixed = flyrl.walk("hybrid", terrain="mixed", seconds=0.3).frame()
    assert set(np.unique(mixed.filter(regex=reflexes))) == {0.0, 1.0}
    assert not walk.frame().filter(regex=reflexes).to_numpy().any()


def test_a_drive_may_be_a_function_of_time_and_observation():
    seen = []

    def turn(time_s, observation):
        seen.append((time_s, observation["fly"].shape))
        return (1.2, 0.2)

    turned = flyrl.walk(drive=turn, seconds=0.3, every=0.02).frame()
    assert turned.yaw_rad.iloc[-1] - turned.yaw_rad.iloc[0] < -0.3
    assert seen[:2] == [(0.0, (4, 3)), (pytest.approx(0.02), (4, 3))]


def test_a_recording_moves_the_fly_as_it_was_recorded(walk):
    table = walk.frame()
    replayed = flyrl.walk(
        joints=table[list(JOINTS)].to_numpy(), adhesion=table[GRIPS].to_numpy(), rate_hz=1250
    )
    again = replayed.frame()
    assert len(again) == len(table)
    error = np.abs(again[list(JOINTS)].to_numpy() - table[list(JOINTS)].to_numpy())[100:]
    assert np.median(error) < 0.05
    assert again.x_mm.iloc[-1] - again.x_mm.iloc[0] > 4.0


def test_a_recording_is_resampled_linearly_and_grips_hold():
    pose = flyrl.PreprogrammedSteps().default_pose
    joints, grips = np.stack([pose, pose + 0.2]), np.stack([np.ones(6), np.zeros(6)])
    replayed = flyrl.walk(joints=joints, adhesion=grips, rate_hz=100, every=4e-4)
    assert len(replayed.rows) == 26  # 10 ms
    halfway = replayed.states[13].command[0]  # of the step before
    np.testing.assert_allclose(halfway[:42], pose + 0.2 * 12 * 4e-4 / 0.01)
    np.testing.assert_array_equal(halfway[42:], 1.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"joints": np.zeros((5, 42))}, "rate_hz must say"),
        ({"joints": np.zeros((5, 41)), "rate_hz": 100}, r"joints must have shape \(5, 42\)"),
        ({"joints": np.zeros((5, 42)), "adhesion": np.ones((4, 6)), "rate_hz": 9}, "adhesion must"),
        ({"adhesion": np.ones((4, 6))}, "adhesion and rate_hz go with joints"),
        ({"seconds": 0}, "seconds must be"),
        ({"controller": "hybird"}, "did you mean 'hybrid'"),
        *[
            ({"drive": drive}, r"drive must be 2 numbers \(left from -0.5 to 1.5, right .*, got")
            for drive in ((1, 1, 1), "x", (9, 9), (np.nan, 1))
        ],
        ({"drive": lambda time_s, observation: (1,)}, r"drive must be 2 numbers .*, got \(1,\)"),
        ({"joints": np.zeros((0, 42)), "rate_hz": 9}, r"joints must hold .* got shape \(0, 42\)"),
        ({"seconds": 0.1, "every": 0.3}, r"every must lie within 0.0004 and 0.1, got 0.3"),
        ({"every": 1e-5}, "every must lie within 0.0004 and"),
        *[
            ({"joints": np.zeros((5, 42)), "rate_hz": 9, name: value}, f"{name} must not be given")
            for name, value in (("controller", "cpg"), ("drive", (1, 1)), ("seconds", 1))
        ],
    ],
)
def test_what_is_no_walk_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        flyrl.walk(**given)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"path": "walk.avi"}, "suffix of 'walk.avi' must be one of '.mp4'"),
        ({"path": "walk.mp4", "size": (161, 120)}, r"size must be two even numbers, got \(161"),
        ({"path": "walk.mp4", "size": 160}, "size must be two even numbers, got 160"),
    ],
)
def test_what_is_no_mp4_is_refused_before_it_is_drawn(walk, given, message):
    with pytest.raises(ValueError, match=message):
        walk.video(**given)


def test_a_walk_is_filmed(walk, tmp_path):
    with drawing():
        path = walk.video(tmp_path / "walk.mp4", size=(160, 120))
    assert path.stat().st_size > 1000
    assert b"ftyp" in path.read_bytes()[:16]


def test_on_a_ball_a_walk_has_its_fictive_way():
    walk = flyrl.walk("cpg", (0.2, 1.2), body="tethered", terrain="ball", seconds=0.6, every=2e-3)
    frame = walk.frame()
    assert frame["fictive_x_mm"].iloc[0] == 0.0
    # it turns left, on a ball that turns right
    assert frame["fictive_yaw_rad"].iloc[-1] > 1.0
    way = np.hypot(np.diff(frame["fictive_x_mm"]), np.diff(frame["fictive_y_mm"])).sum()
    assert way > 3.0
    assert np.ptp(frame["x_mm"]) < 0.05
    assert "fictive_x_mm" not in flyrl.walk(seconds=0.01).frame()


def test_a_fictive_way_round_a_circle_ends_where_it_began():
    velocity = np.tile([10.0, 0.0, 2 * np.pi], (1001, 1))
    way = _fictive_way(SimpleNamespace(time=np.linspace(0, 1, 1001), fictive_velocity_b=velocity))
    assert way["fictive_yaw_rad"][-1] == pytest.approx(2 * np.pi)
    assert way["fictive_x_mm"][-1] == pytest.approx(0.0, abs=1e-4)
    # half round: the diameter of a circle of 10 mm
    assert way["fictive_y_mm"][500] == pytest.approx(10 / np.pi, abs=1e-4)
