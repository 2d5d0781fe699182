"""The examples: controllers as Python loops beside those in the engine; a task of one's own."""

import gymnasium
import numpy as np
import pytest

import examples.cpg_loop
import examples.forage
import examples.hybrid_loop
import examples.rule_based_loop
import flyrl
from examples.stairs import Stairs
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.policies.laws import fixed_policy

LOOPS = {
    "cpg": examples.cpg_loop.walk,
    "rule_based": examples.rule_based_loop.walk,
    "hybrid": examples.hybrid_loop.walk,
}


def path_in_the_engine(controller, terrain, seed, num_steps):
    env = gymnasium.make("flyrl/HybridTurning-v0", terrain=terrain, controller=controller)
    env.reset(seed=seed)
    path = []
    for _ in range(num_steps):
        env.step(np.ones(2, np.float32))
        path.append(env.unwrapped.core.state.position_w[0])
    return np.array(path)


@pytest.mark.parametrize(
    ("controller", "terrain", "seed", "seconds"),
    [
        *((controller, "flat", 0, 0.25) for controller in LOOPS),
        # there, reflexes tell a leg to turn beyond half a turn
        ("hybrid", "mixed", 3, 0.5),
    ],
)
def test_a_loop_in_python_walks_as_the_controller_in_the_engine(controller, terrain, seed, seconds):
    path = LOOPS[controller](terrain, seconds, seed)
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


def test_the_task_of_the_example_leads_from_source_to_source():
    config = EnvConfig(examples.forage.forage, physics="fast")
    env = BatchedEnv(config, 1, 1)
    env.reset(seeds=[0])
    places = np.reshape(env.episodes[0].command, (3, 2))
    starts = np.vstack([env.episodes[0].spawn_position_w[:2], places[:-1]])
    np.testing.assert_allclose(np.linalg.norm(places - starts, axis=1), 5.0)
    np.testing.assert_array_equal(env.flies.props()[0, :, :2], places)
    pursuit = fixed_policy("pursuit", env.task)
    found, outcome = [0.0], "running"
    while outcome == "running":
        action, _ = pursuit.predict(env.observe())
        outcome = str(env.step(action).outcome[0])
        found.append(float(env.task_state().totals["found"][0]))
    assert outcome == "success"
    assert sorted(set(found)) == [0.0, 1.0, 2.0, 3.0]


def test_the_task_of_the_example_checks_its_parameters():
    with pytest.raises(
        ValueError, match=r"task\.sources must be a whole number from 1 to 20, got 0"
    ):
        flyrl.make(examples.forage.forage, sources=0)
    env = flyrl.make("examples.forage:forage", sources=2, apart=10)
    assert env.unwrapped.core.task.parameters["sources"] == 2
    assert env.unwrapped.core.task.name == "examples.forage:forage"
