"""A fly that is driven by hand or by a policy, and changed while it walks."""

import dataclasses

import numpy as np
import pytest

from flyrl.anatomy import LEGS
from flyrl.envs.core import BatchedEnv
from flyrl.play.fly import PlayedFly
from flyrl.play.fly_setting import DISTANCE, PlayedFlyConfig
from flyrl.policies import load_bundle, save_bundle
from flyrl.tasks import Drives
from flyrl.terrains import KINDS, TERRAINS, Boxes, Terrain
from flyrl.terrains.geoms import FLAT_GROUND
from tests.controllers.own import Wave
from tests.play.noted import Noted, drawn

FAST = PlayedFlyConfig(physics="fast", seed=3)


@dataclasses.dataclass(frozen=True)
class Ridge(Terrain):
    """A low ridge in the way."""

    def boxes(self, rng, difficulty):
        return Boxes(np.array([[6.0, 0.0, 0.0]]), np.array([[0.5, 9.0, 0.1]]))


@pytest.fixture(scope="module")
def fly():
    """One fly for all tests that reset it."""
    return PlayedFly(FAST)


@pytest.fixture(scope="module")
def changed():
    """One fly for the tests that change what it is made of."""
    return PlayedFly(FAST)


@pytest.fixture(scope="module")
def strong():
    """One fly with muscles, pursuing its target."""
    return PlayedFly(PlayedFlyConfig(physics="fast", body="fly_muscles", policy="pursuit"))


def started(fly, drive=(0.0, 0.0), seed=3):
    fly.reset(seed)
    return drive_by(fly, drive)


def drive_by(fly, drive):
    for side, value in zip(("left", "right"), drive, strict=True):
        fly.change(f"drive_{side}", value)
    return fly


def walk(fly, decisions):
    """Places of all joints after each decision."""
    rows = []
    for _ in range(decisions):
        fly.step()
        rows.append(fly.data.qpos.copy())
    return np.array(rows)


def point(fly, ahead, aside=0.0):
    """Move the target to a place relative to the fly, mm."""
    fly.change("click", (fly.data.qpos[0] + ahead, fly.data.qpos[1] + aside))


def values(fly):
    return {label: value for (shown,) in drawn(fly, "values") for label, value in shown.items()}


def steered(fly):
    """Who steers, and the drive."""
    return tuple(fly.figures()[name] for name in ("steering", "drive_left", "drive_right"))


def test_it_moves_as_the_environment_does_under_the_same_drives(fly):
    env = BatchedEnv(FAST.env(), 1, 1)
    env.reset(seeds=[3])
    fly.reset(3)
    for drive in ((1.0, 1.0), (1.2, 0.4), (-0.5, 1.5)):
        drive_by(fly, drive)
        walk(fly, 2)
        for _ in range(2):
            env.step(Drives().of([drive]))
        np.testing.assert_array_equal(fly.env.flies._qpos, env.flies._qpos)
        np.testing.assert_array_equal(fly.data.qpos, env.flies._qpos[0])
    assert fly.time_s == pytest.approx(0.12)
    # what is drawn has no controller, and a camera on the thorax
    assert fly.model.numeric_data[0] == 0.0
    assert fly.model.body(fly.camera.trackbodyid).name == "Thorax"
    np.testing.assert_array_equal(fly.camera.lookat, fly.data.qpos[:3])


def test_the_same_actions_give_the_same_bits(fly, strong):
    for played in (fly, strong):
        runs = []
        for _ in range(2):
            played.reset(5)
            played.change("steering", "target-flat")
            rows = [walk(played, 2)]
            played.change("click", (-5.0, 3.0))
            rows.append(walk(played, 3))
            played.change("left", True)
            rows.append(walk(played, 2))
            runs.append(np.concatenate(rows))
        np.testing.assert_array_equal(*runs)


def test_arrow_keys_change_both_drives_by_a_tenth_within_the_bounds(fly):
    started(fly)
    for key, *drives in (("up", 0.1, 0.1), ("left", 0.0, 0.2), ("right", 0.1, 0.1)):
        fly.change(key, True)
        assert steered(fly) == ("by hand", *drives)
    for _ in range(20):
        fly.change("left", True)
    assert [slider[-1] for slider in drawn(fly, "slider")] == [-0.5, 1.5]
    fly.change("s", True)
    assert steered(fly) == ("by hand", 0.0, 0.0)


def test_a_policy_goes_to_where_the_target_was_put(fly):
    for side in (4.0, -4.0):
        fly.reset(3)
        fly.change("steering", "target-flat")
        point(fly, 5.0, side)
        # from 6.4 mm away
        walk(fly, 28)
        assert values(fly)["to the target, mm"] < 2.0


def test_a_key_takes_the_steering_from_a_policy_at_its_drive(fly):
    fly.reset(3)
    fly.change("steering", "pursuit")
    point(fly, 9.0)
    fly.step()
    _, left, right = steered(fly)
    assert left > 1.0
    # nobody is there any more: a policy steers on
    fly.relax()
    assert steered(fly) == ("pursuit", left, right)
    fly.change("down", True)
    assert steered(fly) == ("by hand", pytest.approx(left - 0.1), pytest.approx(right - 0.1))
    fly.relax()
    assert steered(fly) == ("by hand", 0, 0)


def test_a_policy_that_arrives_gets_another_target(fly):
    targets = []
    for _ in range(2):
        fly.reset(3)
        fly.change("steering", "pursuit")
        point(fly, 1.005)
        walk(fly, 8)
        targets.append([fly.figures()[f"target_{axis}_mm"] for axis in "xy"])
        assert DISTANCE[0] - 2 < values(fly)["to the target, mm"] < DISTANCE[1] + 2
    assert targets[0] == targets[1]


def test_flat_ground_has_no_edge(fly):
    started(fly, (1.0, 1.0))
    fly.env.flies._qpos[0, 0] = 1000.0
    fly.change("click", (1020.0, 3.0))
    walk(fly, 3)
    assert fly.outcome == "running"
    assert fly.figures()["target_x_mm"] == 1020.0
    assert fly.model.geom(FLAT_GROUND).size[:2].tolist() == [0, 0]  # MuJoCo's endless plane


def test_reaching_the_target_pays_once_and_ends_nothing(fly):
    started(fly)
    point(fly, 1.005)
    paid = []
    for _ in range(8):
        fly.change("up", True)
        walk(fly, 2)
        paid.append(values(fly)["success"])
    # the last "success" is that of the return
    assert paid[-1] == 2.0
    assert sorted(set(paid)) == [0.0, 2.0]
    assert fly.outcome == "running"


def test_what_fell_stays_with_its_reason_until_it_is_reset(fly):
    for spoil, outcome in (
        (lambda flies: flies._qpos[0, 3:7].__setitem__(slice(None), [0, 1, 0, 0]), "fall"),
        (lambda flies: flies._qvel.__setitem__((0, 20), 1e13), "unstable"),
    ):
        started(fly, (1.0, 1.0))
        before = fly.data.qpos.copy()
        spoil(fly.env.flies)
        walk(fly, 3)
        assert fly.figures()["outcome"] == outcome
        assert fly.hint == f"The walk has ended: {outcome}. Reset starts again."
        assert fly.time_s == pytest.approx(0.02)
        assert all(np.isfinite(list(values(fly).values())))
        # what blew up is seen as it was before
        assert np.array_equal(fly.data.qpos, before) == (outcome == "unstable")
    fly.reset(3)
    fly.step()
    assert fly.outcome == "running"


def test_rough_ground_ends_and_a_target_moves_within_it_alone(changed):
    changed.change("terrain", "blocks")
    changed.change("click", (20.0, -15.0))
    for outside in ((24.0, 0.0), (0.0, 19.0), (float("nan"), 0.0), (float("inf"), 0.0)):
        changed.change("click", outside)
    assert [changed.figures()[f"target_{axis}_mm"] for axis in "xy"] == [20.0, -15.0]
    np.testing.assert_array_equal(changed.data.mocap_pos[0, :2], [20.0, -15.0])
    changed.env.flies._qpos[0, 0] = 26.0
    changed.step()
    assert changed.outcome == "left_arena"
    changed.change("terrain", "flat")


def test_other_legs_physics_reflexes_and_grip_leave_the_fly_where_it_is(changed):
    fly = started(changed, (1.0, 0.8))
    walk(fly, 10)
    model = fly.model
    for name, value in (
        ("controller", "rule_based"),
        ("controller", "rule_based_steered"),
        ("controller", "cpg"),
        ("controller", "hybrid"),
        ("gait", "wave"),
        ("retraction", False),
        ("stumbling", False),
        ("adhesion", False),
        ("physics", "balanced"),
    ):
        before, time_s, drive = fly.data.qpos.copy(), fly.time_s, steered(fly)
        fly.change(name, value)
        np.testing.assert_array_equal(fly.data.qpos, before)
        assert (fly.time_s, steered(fly)) == (time_s, drive)
        assert fly.figures()[name] == value
        assert ("ignores the drive" in fly.hint) == (value == "rule_based")
        fly.step()
        assert fly.time_s == pytest.approx(time_s + 0.02)
        assert not np.array_equal(fly.data.qpos, before)
    scene = fly.env.config.fly_scene
    assert (scene.controller.retraction, scene.controller.stumbling) == (0.0, 0.0)
    assert (scene.body.adhesion_gain, scene.physics.timestep) == (0.0, 4e-4)
    assert fly.model is model


def test_another_terrain_starts_the_episode_anew(changed):
    fly = started(changed, (1.0, 0.8), seed=4)
    walk(fly, 2)
    model = fly.model
    fly.change("terrain", "blocks")
    env = BatchedEnv(fly.config.env(), 1, 1)
    env.reset(seeds=[4])
    np.testing.assert_array_equal(fly.data.qpos, env.flies._qpos[0])
    # the marker stands on the block that the target lies on
    x, y = env.episodes[0].goal
    top = TERRAINS["blocks"].top_at(env.flies.ground(0), x, y)
    np.testing.assert_allclose(fly.data.mocap_pos[0], [x, y, top + 0.02])
    assert fly.model is not model
    assert (fly.time_s, fly.seed, fly.figures()["drive_left"]) == (0.0, 4, 1.0)


def test_legs_and_ground_of_the_users_own_are_walked_with_and_stay_choices():
    names = {"controller": "tests.controllers.own:Wave", "terrain": f"{__name__}:Ridge"}
    fly = started(PlayedFly(PlayedFlyConfig(physics="fast", **names)), (1.0, 1.0))
    walk(fly, 2)
    scene = fly.env.config.fly_scene
    assert (scene.controller, scene.terrain) == (Wave(), Ridge())
    assert fly.outcome == "running"
    for (key, name), other in zip(names.items(), ("hybrid", "flat"), strict=True):
        fly.change(key, other)
        fly.step()
        assert name in next(options for each, _, options, _ in drawn(fly, "choice") if each == key)
        fly.change(key, name)
        assert fly.figures()[key] == name


def test_what_is_not_allowed_is_told_and_changes_nothing(fly):
    started(fly, (0.5, 0.5))
    before = fly.figures()
    for name, value, message in (
        ("controller", "hybird", "controller must be one of .*hybrid.* got 'hybird'"),
        ("controller", "tests.controllers.own:Height", "must be one that takes a drive, got .*He"),
        ("physics", "worm", "physics must be one of 'reference', 'balanced', 'fast'"),
        ("terrain", "sand", "terrain must be one of 'flat'.* got 'sand'"),
        ("steering", "velocity-flat", "steering must be one of 'by hand'.*'velocity-flat'"),
        ("drive_left", 1.6, "drive_left must lie within -0.5 and 1.5, got 1.6"),
        ("adhesion", "no", "adhesion must be True or False, got 'no'"),
    ):
        with pytest.raises(ValueError, match=message):
            fly.change(name, value)
    with pytest.raises(ValueError, match="seed must be an integer from 0"):
        fly.reset(-1)
    assert fly.figures() == before


def test_a_policy_that_decides_at_other_times_is_refused(tmp_path):
    bundle = load_bundle("target-flat")
    env = {**bundle.env, "task": {**bundle.env["task"], "decision_interval": 0.05}}
    save_bundle(dataclasses.replace(bundle, env=env), tmp_path / "slow.safetensors")
    with pytest.raises(ValueError, match=r"decides every 0\.05 s; it must be 0\.02 s"):
        PlayedFly(PlayedFlyConfig(policy=str(tmp_path / "slow.safetensors")))


def test_the_panel_tells_of_legs_and_rewards(fly):
    started(fly, (1.0, 1.0))
    walk(fly, 10)
    ((labels, phases, lengths),) = drawn(fly, "dials")
    assert labels == LEGS
    assert (phases.shape, lengths.shape) == ((6,), (6,))
    ((labels, rows, places, span_s),) = drawn(fly, "raster")
    # a fifth of the second is known, in which legs stood and swung
    assert (labels, rows.shape, places, span_s) == (LEGS, (6, 20), 100, 1.0)
    assert (rows.any(axis=1) & ~rows.all(axis=1)).any()
    assert [list(shares) for (shares,) in drawn(fly, "bars")] == [list(LEGS)] * 2
    for (shown,), time_s in zip(drawn(fly, "values", "Reward"), (0.02, 0.2), strict=True):
        assert list(shown) == ["progress", "success", "time", "drive_change", "work", "sum"]
        *parts, whole = shown.values()
        assert parts[1:3] == pytest.approx([0.0, -0.5 * time_s])
        assert whole == pytest.approx(sum(parts))
    options = {name: options for name, _, options, _ in drawn(fly, "choice")}
    assert options["steering"] == ("by hand", "pursuit", "target-any", "target-flat")
    assert options["terrain"] == tuple(KINDS)


def test_all_muscles_are_on_the_panel(strong):
    strong.reset(0)
    walk(strong, 2)
    panel = Noted(strong)
    assert panel.titles[-7:] == ["Muscles", *(f"Muscles of {leg}" for leg in LEGS)]
    ((bars,),) = drawn(strong, "bars", "Muscles of RH")
    assert list(bars)[:2] == ["Coxa +", "Coxa -"]
    np.testing.assert_array_equal(list(bars.values()), strong.env.state.muscle_tensions[0, 70:])
