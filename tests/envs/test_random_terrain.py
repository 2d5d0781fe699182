"""Grounds that are drawn anew in every episode."""

import dataclasses

import gymnasium
import mujoco
import numpy as np
import pytest

import flyrl  # noqa: F401  (registers the ids)
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.rendering import FlyRenderer
from flyrl.simulation.scene import build_scene
from flyrl.terrains import KINDS, TERRAINS, Terrain
from tests.pictures import drawing

RANDOM = [name for name, config in TERRAINS.items() if config.random]
DRIVES = np.array([[1.0, 1.0], [0.6, 1.0], [1.0, 0.2]])
_HEIGHTS, _GAPS = {"height_range": (0.0, 0.5)}, {"gap_range": (0.0, 0.6)}
ROUGH = {"gapped": _GAPS, "blocks": _HEIGHTS, "mixed": {**_HEIGHTS, **_GAPS}}


def walk(env: BatchedEnv, decisions: int, actions: np.ndarray = DRIVES) -> np.ndarray:
    """Physics after some decisions."""
    for _ in range(decisions):
        env.step(actions[: env.num_envs])
    return env.flies.integration_state()


def alone(terrain: Terrain, env: BatchedEnv, sim: int) -> BatchedEnv:
    """The episode of one simulation, where the ground was compiled as it is."""
    episode = env.episodes[sim]
    fixed = dataclasses.replace(terrain, random=False, seed=episode.ground_seed)
    single = BatchedEnv(EnvConfig(terrain=fixed), 1, 1)
    single.reset(episodes=[episode])
    return single


@pytest.mark.parametrize("name", ["gapped", "blocks", "mixed"])
def test_a_fly_walks_as_where_its_ground_was_compiled(name: str) -> None:
    terrain = KINDS[name](random=True, **ROUGH[name])
    env = BatchedEnv(EnvConfig(terrain=terrain), 3, 2)
    env.reset(seeds=[5, 6, 7])
    singles = [alone(terrain, env, sim) for sim in range(3)]
    together = walk(env, 8)
    for sim, single in enumerate(singles):
        np.testing.assert_array_equal(together[sim], walk(single, 8, DRIVES[sim : sim + 1])[0])


@pytest.mark.parametrize("name", ["gapped", "blocks", "mixed"])
def test_everything_that_touches_is_found(name: str) -> None:
    """Flies put anywhere, as deep as they can stick: no contact is missed."""
    terrain = KINDS[name](random=True, **ROUGH[name])
    env = BatchedEnv(EnvConfig(terrain=terrain), 2, 1)
    env.reset(seeds=[0, 1])
    rng = np.random.default_rng(0)
    count = 0
    for sim in range(2):
        varied = env.flies._batch.get_model(sim)
        compiled = alone(terrain, env, sim).batch.scene.model
        found = [mujoco.MjData(model) for model in (varied, compiled)]
        for _ in range(30):
            pose = env.flies._qpos[sim].copy()
            pose[:3] = rng.uniform((-4, -10, 0.2), (22, 10, 2.2))
            pose[3:7] = rng.normal(size=4)
            for model, data in zip((varied, compiled), found, strict=True):
                data.qpos[:] = pose
                mujoco.mj_forward(model, data)
            one, other = found
            count += one.ncon
            np.testing.assert_array_equal(one.contact.geom, other.contact.geom)
            np.testing.assert_array_equal(one.contact.dist, other.contact.dist)
            np.testing.assert_array_equal(one.contact.pos, other.contact.pos)
    assert count > 300


@pytest.mark.parametrize("name", ["random_gapped", "random_blocks", "random_mixed"])
def test_no_box_sits_where_mujoco_would_ignore_its_position(name: str) -> None:
    """A geom compiled at the origin of the world would stay there."""
    model = build_scene(EnvConfig(terrain=name).scene).model
    at_origin = model.geom_sameframe == mujoco.mjtSameFrame.mjSAMEFRAME_BODY
    is_box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
    assert is_box.sum() >= 27
    assert not (at_origin & is_box).any()


def test_what_else_is_drawn_is_what_fixed_ground_gets() -> None:
    episodes = []
    for name in ("mixed", "random_mixed"):
        env = BatchedEnv(EnvConfig(terrain=name), 2, 1)
        env.reset(seeds=[3, 4])
        env.reset()
        episodes.append(env.episodes)
    assert episodes[0] == episodes[1]


def test_every_episode_has_a_ground_of_its_own() -> None:
    env = BatchedEnv(EnvConfig(terrain="random_blocks"), 2, 1)

    def tops() -> list[float]:
        return [float(env.flies.ground(sim).boxes.tops[1]) for sim in range(2)]

    env.reset(seeds=[0, 1])
    first = tops()
    env.reset(ids=[1])
    assert tops()[0] == first[0]
    assert len({*first, *tops()}) == 3
    env.reset(seeds=[0, 1])
    assert tops() == first


@pytest.mark.parametrize("name", RANDOM)
def test_no_fly_starts_in_the_ground(name: str) -> None:
    env = BatchedEnv(EnvConfig(terrain=name), 8, 1)
    env.reset(seeds=list(range(8)))
    for sim in range(8):
        model, data = env.flies._batch.get_model(sim), env.flies._batch.get_data(sim)
        mujoco.mj_forward(model, data)
        assert data.ncon == 0


def test_a_snapshot_before_the_first_reset() -> None:
    env = BatchedEnv(EnvConfig(terrain="random_gapped"), 2, 1)
    env.reset(seeds=[1], ids=[1])
    env.restore(env.snapshot())
    assert env.episodes[0] is None
    assert env.episodes[1].ground_seed == 2**32 + 1


def test_reset_tells_the_ground_and_takes_one() -> None:
    env = gymnasium.make("flyrl/Target-v0", terrain="random_gapped")
    _, info = env.reset(seed=3)
    assert info["ground"] == 2**32 + 3
    _, info = env.reset(seed=3, options={"ground": 8})
    assert info["ground"] == 8
    ground = env.unwrapped.core.flies.ground(0)
    expected = TERRAINS["random_gapped"].draw(8).boxes
    np.testing.assert_array_equal(ground.boxes.centres, expected.centres)
    *_, info = env.step(np.zeros(2, dtype=np.float32))
    assert info["ground"] == 8
    assert "ground" not in gymnasium.make("flyrl/Target-v0").reset(seed=3)[1]


def test_a_picture_shows_the_simulations_own_ground() -> None:
    terrain = TERRAINS["random_mixed"]
    env = BatchedEnv(EnvConfig(terrain=terrain), 2, 1)
    env.reset(seeds=[0, 1])
    single = alone(terrain, env, 1)
    with drawing():
        renderers = [FlyRenderer(each.config.scene, 160, 120) for each in (env, single)]
    other = renderers[0].render(env.flies, 0)
    own, expected = renderers[0].render(env.flies, 1), renderers[1].render(single.flies, 0)
    for renderer in renderers:
        renderer.close()
    np.testing.assert_array_equal(own, expected)
    assert np.any(own != other)


def test_the_difficulty_of_an_episode_is_a_factor_on_the_heights_of_its_ground() -> None:
    config = EnvConfig(task="traverse", terrain="random_blocks")
    env, twin = (BatchedEnv(config, 1, num_threads=1) for _ in range(2))
    rise = []
    for difficulty in (0.0, 0.5, 1.0):
        env.difficulty = difficulty
        env.reset(seeds=[3])
        twin.restore(env.snapshot())
        tops = [each.flies.ground(0).boxes.tops for each in (env, twin)]
        np.testing.assert_array_equal(*tops)
        rise.append(np.ptp(tops[0]))
    np.testing.assert_allclose(rise, [0, rise[2] / 2, rise[2]], atol=1e-12)
    assert rise[2] > 0.3
