"""Worms in the environments, as users of Gymnasium and Stable-Baselines3 meet them."""

from dataclasses import replace

import numpy as np
import pytest

from flyrl.bodies.worm import CRAWLER, HANGER
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.tasks import TASKS, RewardTerm, Termination, extended


def test_the_time_limit_ends_an_episode_that_may_then_be_a_success():
    """Two worms that are to be straight, one of them already, and both relaxed."""
    env = BatchedEnv(EnvConfig(replace(TASKS["worm_hang"](), time_limit_s=0.1)), 2)
    drawn = [env.config.sample_episode(seed) for seed in (0, 1)]
    starts = [
        replace(drawn[0], joint_angles=(0.0,) * 4, command=(0.0,)),
        replace(drawn[1], joint_angles=(0.0,) * 4, command=(1.0,)),
    ]
    env.reset(episodes=starts)
    relaxed = np.zeros((2, 8))
    assert not env.step(relaxed).done.any()
    last = env.step(relaxed)
    assert last.truncated.tolist() == [True, True]
    assert last.outcome.tolist() == ["success", "timeout"]
    np.testing.assert_allclose(last.reward, [0.5, -1.0], atol=1e-6)


def test_all_muscles_at_once_cost_a_fifth_of_a_point_a_decision():
    env = BatchedEnv(EnvConfig("worm_hang"), 1)
    episode = replace(env.config.sample_episode(0), joint_angles=(0.0,) * 4, command=(0.0,))
    env.reset(episodes=[episode])
    # antagonists pull as hard as one another, so that the worm stays bent as told: half a point
    assert env.step(np.full((1, 8), 15)).reward[0] == pytest.approx(0.5 - 0.2, abs=1e-3)
    (share,) = [term for term in env.task.errors if term.name == "recruited_share"]
    assert share.compute(env.task_state()).tolist() == [1.0]


def test_the_reward_of_crawling_is_a_fifth_of_the_way_along_x():
    env = BatchedEnv(EnvConfig("worm_crawl"), 2)
    env.reset(seeds=[0, 1])
    before = env.state.position_w[:, 0]
    reward = env.step(np.full((2, 10), [15, 0] * 5)).reward
    way = env.state.position_w[:, 0] - before
    np.testing.assert_allclose(reward, 0.2 * way, atol=1e-12)
    assert np.abs(way).min() > 1e-4


def test_terms_of_a_users_own_see_the_worm():
    tail = RewardTerm("tail", 2.0, lambda state: state.worm.joint_angles[:, -1], "rad")
    curled = Termination("curled", lambda state: np.abs(state.worm.bend) > 0.5)
    task = extended(TASKS["worm_hang"](), {"mine:TAIL": tail, "mine:CURLED": curled}, {})
    env = BatchedEnv(EnvConfig(task), 1)
    env.reset(seeds=[0])
    outcomes = [str(env.step(np.array([[15, 0] * 4])).outcome[0]) for _ in range(20)]
    assert "curled" in outcomes
    assert env.task_state().totals["tail"] != 0.0


def test_an_episode_with_too_few_angles_is_refused_and_one_without_any_is_straight():
    env = BatchedEnv(EnvConfig("worm_hang"))
    episode = env.config.sample_episode(0)
    with pytest.raises(ValueError, match="joint_angles of the episode must be 4 angles, or none"):
        env.reset(episodes=[replace(episode, joint_angles=(0.1,))])
    env.reset(episodes=[replace(episode, joint_angles=())])
    np.testing.assert_array_equal(env.state.joint_angles, np.zeros((1, 4)))


def test_what_flies_alone_have_is_refused_by_name():
    env = BatchedEnv(EnvConfig("worm_crawl"))
    with pytest.raises(ValueError, match="task must be one for flies, got 'worm_crawl'"):
        _ = env.config.fly_scene
    with pytest.raises(TypeError, match="the bodies of the task 'worm_crawl' are no flies"):
        _ = env.flies
    assert env.batch.gait_logs is None
    assert env.config.creature == "worm"


def test_a_worm_has_its_usual_body_and_physics_and_takes_others():
    assert EnvConfig("worm_crawl").scene.body == CRAWLER
    assert EnvConfig("worm_hang_box").scene.body == HANGER
    assert EnvConfig("worm_crawl").steps_per_decision == 50
    finer = EnvConfig("worm_crawl", physics="balanced", body=replace(CRAWLER, segments=4))
    assert finer.steps_per_decision == 125
    assert finer.resolved_task.actions.size == 6
