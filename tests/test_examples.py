"""Controllers as Python loops over the joints, beside the same controllers in the engine."""

import gymnasium
import numpy as np
import pytest

import examples.cpg_loop
import examples.hybrid_loop
import examples.rule_based_loop
import flyrl
from examples.stairs import Stairs

LOOPS = {
    "cpg": examples.cpg_loop.walk,
    "rule_based": examples.rule_based_loop.walk,
    "hybrid": examples.hybrid_loop.walk,
}
SECONDS = 0.5


def path_in_the_engine(controller, terrain, seed, num_steps):
    env = gymnasium.make("flyrl/HybridTurning-v0", terrain=terrain, controller=controller)
    env.reset(seed=seed)
    path = []
    for _ in range(num_steps):
        env.step(np.ones(2, np.float32))
        path.append(env.unwrapped.core.state.position_w[0])
    return np.array(path)


@pytest.mark.parametrize("terrain", ["flat", "mixed"])
@pytest.mark.parametrize("controller", LOOPS)
def test_a_loop_in_python_walks_as_the_controller_in_the_engine(controller, terrain):
    """Seed 3: on mixed ground, reflexes tell a leg to turn beyond half a turn."""
    for seed in (0, 3):
        path = LOOPS[controller](terrain, SECONDS, seed)
        native = path_in_the_engine(controller, terrain, seed, len(path))
        np.testing.assert_allclose(path, native, rtol=0, atol=1e-9)
        assert np.linalg.norm(path[-1, :2] - path[0, :2]) > 0.5


def test_a_fly_climbs_stairs():
    def climbed(drive):
        frame = flyrl.walk("hybrid", drive, terrain=Stairs(step_height=0.1), seconds=1.0).frame()
        return frame["z_mm"].iloc[-1] - frame["z_mm"].iloc[100]

    assert climbed((1, 1)) > 0.25
    assert climbed((0, 0)) < 0.1


def test_uneven_stairs_differ_from_episode_to_episode_within_their_hull():
    stairs = Stairs(unevenness=0.3, random=True)
    hull = stairs.hull()
    first, second = (stairs.draw(seed).boxes for seed in (0, 1))
    assert (first.tops != second.tops).all()
    for boxes in (first, second):
        assert (boxes.tops <= hull.tops).all()
