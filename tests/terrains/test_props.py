"""Props stand where an episode says, move as they are told, and stop a fly if they are solid."""

import dataclasses

import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.rendering import FlyRenderer
from flyrl.simulation.scene import SceneConfig
from flyrl.tasks import TASKS
from flyrl.terrains import NOWHERE, Prop
from tests.pictures import drawing

POST = Prop("post", "cylinder", (0.5, 4.0), is_solid=True)
GHOST = Prop("ghost", "cylinder", (0.5, 4.0))


def to_and_fro(starts, time_s, command):
    """10 mm/s along y."""
    return starts + np.outer(10.0 * time_s, (0.0, 1.0, 0.0))


BALL = Prop("ball", "sphere", (1.0,), path=to_and_fro)


def task_with(*props):
    return dataclasses.replace(TASKS["hybrid_turning"](), props=props, decision_interval_s=0.02)


def started(task, places, n=2, **settings):
    env = BatchedEnv(EnvConfig(task, **settings), n, 1)
    episodes = [env.config.sample_episode(seed) for seed in range(n)]
    flat = tuple(np.ravel(places).astype(float))
    env.reset(
        episodes=[
            dataclasses.replace(each, props=flat, spawn_position_w=(0.0, 0.0, 0.5))
            for each in episodes
        ]
    )
    return env


def walked(env, decisions=40):
    for _ in range(decisions):
        env.step(np.ones((env.num_envs, 2)))
    return env.state.position_w[:, :2]


def test_a_solid_prop_stops_a_fly_that_a_ghost_does_not():
    # a post of 1 mm, straight ahead at 5 mm
    (ghost, post) = (walked(started(task_with(prop), [[5.0, 0.0, 2.0]])) for prop in (GHOST, POST))
    assert (ghost[:, 0] > 7.0).all()
    distances = np.linalg.norm(post - (5.0, 0.0), axis=1)
    assert (distances > 0.7).all()


def test_without_solid_props_a_fly_walks_as_without_any():
    bare = walked(started(task_with(), []), 10)
    np.testing.assert_array_equal(bare, walked(started(task_with(GHOST), [[2.0, 0.0, 2.0]]), 10))


def test_props_start_where_each_episode_says_and_move_along_their_path():
    env = started(task_with(BALL), [[20.0, -5.0, 1.0]])
    episode = dataclasses.replace(env.episodes[1], props=(20.0, 5.0, 1.0))
    env.reset(ids=[1], episodes=[episode])
    walked(env, 10)
    expected = [[20.0, -3.0, 1.0], [20.0, 7.0, 1.0]]
    np.testing.assert_allclose(env.flies.props()[:, 0], expected)
    np.testing.assert_allclose(env.task_state().props[:, 0], expected)


def test_a_restored_environment_goes_on_with_its_props():
    task = task_with(POST, dataclasses.replace(BALL, is_solid=True))
    first = started(task, [[6.0, 1.0, 2.0], [3.0, -4.0, 1.0]])
    walked(first, 5)
    second = BatchedEnv(first.config, 2, 1)
    second.restore(first.snapshot())
    np.testing.assert_array_equal(walked(first, 10), walked(second, 10))


def test_the_marker_of_a_target_stands_at_the_goal():
    env = BatchedEnv(EnvConfig("target", terrain="blocks"), 2, 1)
    env.reset(seeds=[0, 1])
    goals = [episode.goal for episode in env.episodes]
    np.testing.assert_array_equal(env.flies.props()[:, 0, :2], goals)
    env.set_goals(np.array([[3.0, 4.0]]), ids=[1])
    np.testing.assert_array_equal(env.flies.props()[:, 0, :2], [goals[0], (3.0, 4.0)])


def test_a_picture_shows_where_props_are():
    env = started(task_with(Prop("ball", "sphere", (1.0,), (1.0, 0.0, 1.0, 1.0))), [NOWHERE], n=1)
    with drawing():
        renderer = FlyRenderer(env.config.fly_scene, 160, 120, "top")

    def pink():
        red, green, blue = np.moveaxis(renderer.render(env.flies).astype(int), -1, 0)
        return ((red - green > 60) & (blue - green > 60)).sum()

    assert pink() == 0
    env.flies.set_props(np.array([0]), np.array([[[0.0, 3.0, 1.0]]]))
    assert pink() > 20
    renderer.close()


def test_an_episode_must_place_all_props():
    with pytest.raises(
        ValueError, match="props of the episode must be x, y and z of 1 props, got 0"
    ):
        started(task_with(POST), [])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"size": (1.0, 2.0)}, "size of prop 'p' must be 1 numbers for a sphere"),
        ({"shape": "marker", "is_solid": True}, "is_solid of prop 'p' must be False for a marker"),
    ],
)
def test_what_is_not_allowed_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Prop(**{"name": "p", "shape": "sphere", "size": (1.0,), **arguments})


def test_props_must_differ_in_name():
    with pytest.raises(ValueError, match="props must differ in name, got post, post"):
        SceneConfig(props=(POST, POST))
