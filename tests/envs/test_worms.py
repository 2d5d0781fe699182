"""Worms in the environments, as users of Gymnasium and Stable-Baselines3 meet them."""

import warnings
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, MultiDiscrete
from gymnasium.utils.env_checker import check_env as check_gymnasium
from stable_baselines3.common.env_checker import check_env as check_sb3

import flyrl  # noqa: F401  (registers the ids)
from flyrl.bodies.worm import CRAWLER, HANGER
from flyrl.controllers import Hybrid
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.simulation.randomisation import Randomisation, RandomisationConfig
from flyrl.simulation.rendering import RenderingUnavailableError
from flyrl.tasks import Neurons, RewardTerm, Termination, extended, task_named
from tests.tasks.test_worm import WORM_TASKS

IDS = {
    "flyrl/WormCrawl-v0": "worm_crawl",
    "flyrl/WormCrawlBox-v0": "worm_crawl_box",
    "flyrl/WormHang-v0": "worm_hang",
    "flyrl/WormHangBox-v0": "worm_hang_box",
}
EVERY_ID = pytest.mark.parametrize("env_id", IDS)
EVERY_TASK = pytest.mark.parametrize("task", WORM_TASKS)


def short(task, decisions=4):
    return replace(task_named(task), time_limit_s=decisions * 0.05)


def draws(env, seed, decision):
    """A random action for a worm with a seed, in a decision."""
    rng = np.random.default_rng([seed, decision])
    actions = env.task.actions
    assert isinstance(actions, Neurons)
    if actions.is_integer:
        return rng.integers(0, actions.pools)
    return rng.uniform(-1, 1, actions.size)


def roll_out(env, seeds, decisions=6):
    """Observations (decisions, n, k) and rewards (decisions, n)."""
    env.reset(seeds=seeds)
    transitions = [
        env.step(np.array([draws(env, seed, decision) for seed in seeds]))
        for decision in range(decisions)
    ]
    return (
        np.array([transition.observation for transition in transitions]),
        np.array([transition.reward for transition in transitions]),
    )


# ------------------------------------------------------------------ Gymnasium and SB3


@EVERY_ID
@pytest.mark.parametrize("check", [check_gymnasium, check_sb3])
def test_every_task_passes_the_checkers_without_a_warning(env_id, check):
    env = gymnasium.make(env_id).unwrapped
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check(env)
    assert [str(warning.message) for warning in caught] == []


@EVERY_ID
def test_the_action_space_is_that_of_the_task(env_id):
    space = gymnasium.make(env_id).action_space
    muscles = 10 if "Crawl" in env_id else 8
    if "Box" in env_id:
        assert space == Box(-1.0, 1.0, (muscles,), np.float32)
    else:
        assert space == MultiDiscrete([16] * muscles)


@EVERY_ID
def test_the_vector_environment_equals_gymnasiums_over_single_ones(env_id):
    """Through ends of episodes too, which come after three decisions."""
    asked = {"task": short(IDS[env_id], 3)}
    native = gymnasium.make_vec(env_id, num_envs=2, **asked)
    assert type(native.unwrapped).__name__ == "FlyrlVectorEnv"
    plain = gymnasium.make_vec(env_id, num_envs=2, vectorization_mode="sync", **asked)
    np.testing.assert_array_equal(native.reset(seed=7)[0], plain.reset(seed=7)[0])
    native.action_space.seed(1)
    ends = 0
    for _ in range(8):
        actions = native.action_space.sample()
        ours, theirs = native.step(actions), plain.step(actions)
        for mine, other in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(mine, other)
        np.testing.assert_array_equal(ours[4]["outcome"], theirs[4]["outcome"])
        ends += int((ours[2] | ours[3]).sum())
    assert ends == 4


def test_sb3_gets_the_worms_of_the_single_environment():
    batch = FlyrlVecEnv(EnvConfig(short("worm_hang", 2)), 2, num_threads=1, seed=5)
    single = gymnasium.make("flyrl/WormHang-v0")
    np.testing.assert_array_equal(batch.reset()[1], single.reset(seed=6)[0])
    actions = np.arange(16).reshape(2, 8)
    np.testing.assert_array_equal(batch.step(actions)[0][1], single.step(actions[1])[0])
    _, _, done, infos = batch.step(actions)
    assert done.tolist() == [True, True]
    assert [info["episode"]["l"] for info in infos] == [2, 2]


def test_a_picture_shows_the_worm():
    env = gymnasium.make("flyrl/WormCrawl-v0", render_mode="rgb_array")
    env.reset(seed=0)
    try:
        picture = env.render().astype(int)
    except RenderingUnavailableError as error:
        pytest.skip(str(error))
    env.close()
    assert picture.shape == (480, 640, 3)
    # the only red thing
    assert 0.005 < (picture[..., 0] - picture[..., 1] > 30).mean() < 0.3


# ------------------------------------------------------------------ exact bookkeeping


@EVERY_TASK
@pytest.mark.parametrize("num_threads", [1, 2])
def test_a_batch_gives_the_bits_of_single_environments(task, num_threads):
    config = EnvConfig(task, randomisation=RandomisationConfig(sensor_noise=0.1))
    observations, rewards = roll_out(BatchedEnv(config, 3, num_threads), [11, 12, 13])
    single = BatchedEnv(config, 1, 1)
    for i, seed in enumerate([11, 12, 13]):
        alone = roll_out(single, [seed])
        np.testing.assert_array_equal(observations[:, [i]], alone[0])
        np.testing.assert_array_equal(rewards[:, [i]], alone[1])


@EVERY_TASK
def test_a_restored_environment_goes_on_with_the_same_bits(task):
    config = EnvConfig(task, randomisation=RandomisationConfig(sensor_noise=0.1))
    env, twin = BatchedEnv(config, 2, num_threads=2), BatchedEnv(config, 2, num_threads=1)
    roll_out(env, [3, 4])
    twin.restore(env.snapshot())
    for decision in range(4):
        actions = np.array([draws(env, seed, decision) for seed in (5, 6)])
        ours, theirs = (each.step(actions) for each in (env, twin))
        np.testing.assert_array_equal(ours.observation, theirs.observation)
        np.testing.assert_array_equal(ours.reward, theirs.reward)
    np.testing.assert_array_equal(env.reset(ids=[1]), twin.reset(ids=[1]))


def test_steps_of_some_leave_the_others_where_they_are():
    env = BatchedEnv(EnvConfig("worm_crawl"), 3)
    env.reset(seeds=[0, 1, 2])
    before = env.state
    env.step(np.full((3, 10), 15), ids=np.array([0, 2]))
    np.testing.assert_allclose(env.state.time, [0.05, 0.0, 0.05])
    np.testing.assert_array_equal(env.state.joint_angles[1], before.joint_angles[1])
    assert env.state.neurons[:, 0].tolist() == [15, 0, 15]


def test_an_unstable_worm_ends_its_own_episode_alone():
    env, twin = (BatchedEnv(EnvConfig("worm_crawl"), 3) for _ in range(2))
    actions = np.full((3, 10), 3)
    for each in (env, twin):
        each.reset(seeds=[0, 1, 2])
        each.step(actions)
    env.batch._qvel[1, 5] = 1e13
    transition, expected = env.step(actions), twin.step(actions)
    assert transition.outcome.tolist() == ["running", "unstable", "running"]
    assert transition.terminated.tolist() == [False, True, False]
    assert np.isfinite(transition.observation).all()
    assert np.isfinite(transition.reward).all()
    np.testing.assert_array_equal(transition.observation[[0, 2]], expected.observation[[0, 2]])
    env.reset(ids=[1])
    assert env.step(actions).outcome.tolist() == ["running"] * 3


# ------------------------------------------------------------------ episodes


def test_the_time_limit_ends_an_episode_that_may_then_be_a_success():
    """Two worms that are to be straight, one of them already, and both relaxed."""
    env = BatchedEnv(EnvConfig(short("worm_hang", 2)), 2)
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
    rewards = [
        env.step(np.array([draws(env, seed, decision) for seed in (0, 1)])).reward
        for decision in range(5)
    ]
    way = env.state.position_w[:, 0] - before
    np.testing.assert_allclose(np.sum(rewards, axis=0), 0.2 * way, atol=1e-12)
    assert np.abs(way).min() > 0.01


def test_terms_of_a_users_own_see_the_worm():
    tail = RewardTerm("tail", 2.0, lambda state: state.worm.joint_angles[:, -1], "rad")
    curled = Termination("curled", lambda state: np.abs(state.worm.bend) > 0.5)
    task = extended(task_named("worm_hang"), {"mine:TAIL": tail, "mine:CURLED": curled}, {})
    env = BatchedEnv(EnvConfig(task), 1)
    env.reset(seeds=[0])
    outcomes = [str(env.step(np.array([[15, 0] * 4])).outcome[0]) for _ in range(20)]
    assert "curled" in outcomes
    assert env.task_state().totals["tail"] != 0.0


def test_reset_options_set_angles_and_command():
    env = gymnasium.make("flyrl/WormHang-v0")
    options = {"joint_angles": [0.1, -0.2, 0.3, 0.0], "command": [0.7]}
    observation, _ = env.reset(seed=0, options=options)
    shown = env.unwrapped.core.task.slices()
    np.testing.assert_allclose(observation[shown["joint_angles"]], options["joint_angles"])
    np.testing.assert_allclose(observation[shown["command"]], [0.7])
    # 0.1 - 0.2 + 0.3 - 0.7
    np.testing.assert_allclose(observation[shown["bend_error"]], [-0.5], rtol=1e-6)


def test_reset_options_set_place_and_heading():
    env = gymnasium.make("flyrl/WormCrawl-v0")
    options = {"spawn_position": [3.0, -4.0, 0.0], "spawn_yaw": 2.0}
    observation, _ = env.reset(seed=0, options=options)
    np.testing.assert_allclose(observation[:2], [np.cos(2.0), np.sin(2.0)], rtol=1e-6)
    np.testing.assert_allclose(env.unwrapped.core.state.position_w[0, :2], [3.0, -4.0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"init_phases": [1] * 6}, "init_phases of an episode of a worm must be"),
        ({"init_magnitudes": [1] * 6}, "init_magnitudes of an episode of a worm must be"),
        ({"pushes": [1.0, 5.0]}, "'pushes' must be 0 finite numbers"),
        ({"ground": 3}, "ground of an episode of a worm must be None, got 3"),
        ({"randomisation": {"mass": 2.0}}, "randomisation of an episode of a worm must be of its"),
        ({"joint_angles": [0.1]}, "'joint_angles' must be 4 finite numbers"),
        ({"joint_angles": [0.1, 0.2, np.nan, 0.0]}, "'joint_angles' must be 4 finite numbers"),
        ({"command": [0.1, 0.2]}, "'command' must be 1 finite numbers"),
        ({"goal": [1.0, 2.0]}, "'goal' must be 0 finite numbers"),
        ({"spawn_position": [1.0, 0, 0]}, "spawn_position of a hanging worm must be 0, got"),
        ({"spawn_yaw": 0.5}, "spawn_yaw of a hanging worm must be 0, got 0.5"),
    ],
)
def test_reset_options_that_a_worm_does_not_have(options, message):
    env = gymnasium.make("flyrl/WormHang-v0")
    with pytest.raises(ValueError, match=message):
        env.reset(seed=0, options=options)


def test_an_episode_with_too_few_angles_is_refused_and_one_without_any_is_straight():
    env = BatchedEnv(EnvConfig("worm_hang"))
    episode = env.config.sample_episode(0)
    with pytest.raises(ValueError, match="joint_angles of the episode must be 4 angles, or none"):
        env.reset(episodes=[replace(episode, joint_angles=(0.1,))])
    env.reset(episodes=[replace(episode, joint_angles=())])
    np.testing.assert_array_equal(env.state.joint_angles, np.zeros((1, 4)))


def test_a_fly_has_no_angles_of_a_worm():
    env = BatchedEnv(EnvConfig(physics="fast"))
    episode = replace(env.config.sample_episode(0), joint_angles=(0.1,))
    with pytest.raises(ValueError, match=r"joint_angles of an episode of a fly must be \(\), got"):
        env.reset(episodes=[episode])


def test_noise_of_the_senses_is_drawn_with_the_episode():
    """A command is known without noise."""
    clear, noisy = (
        BatchedEnv(EnvConfig("worm_hang", randomisation=RandomisationConfig(sensor_noise=noise)))
        for noise in (0.0, 0.5)
    )
    first, seen = (env.reset(seeds=[4])[0] for env in (clear, noisy))
    differs = seen != first
    shown = clear.task.slices()
    assert not differs[shown["command"]].any()
    assert differs[shown["joint_angles"]].all()
    np.testing.assert_array_equal(noisy.reset(seeds=[4])[0], seen)
    assert noisy.episodes[0].randomisation == Randomisation(sensor_noise=0.5)


# ------------------------------------------------------------------ what does not fit


@pytest.mark.parametrize(
    ("task", "action", "message"),
    [
        ("worm_crawl", np.zeros((2, 8)), r"action has shape \(2, 8\); it must be \(2, 10\)"),
        ("worm_crawl", np.zeros(10), r"action has shape \(10,\); it must be \(2, 10\)"),
        ("worm_crawl", np.full((2, 10), 0.5), "action must be whole numbers, got 0.5"),
        ("worm_crawl", np.full((2, 10), np.nan), "action must be finite; got nan"),
        ("worm_crawl_box", np.full((2, 10), np.inf), "action must be finite; got inf"),
    ],
)
def test_bad_actions_are_refused_and_move_nothing(task, action, message):
    env = BatchedEnv(EnvConfig(task), 2)
    env.reset(seeds=[0, 1])
    before = env.batch.integration_state()
    with pytest.raises(ValueError, match=message):
        env.step(action)
    np.testing.assert_array_equal(env.batch.integration_state(), before)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"task": "worm_crawl", "body": "current"},
            r"body must be a worm in the task 'worm_crawl' \(worm_crawler, worm_hanger\), got Fly",
        ),
        (
            {"task": "target", "body": "worm_crawler"},
            r"body must be a fly in the task 'target' \(current, .*, tethered\), got Worm",
        ),
        ({"task": "worm_crawl", "body": "worm"}, "body must be one of .*'worm_crawler'.*'worm'"),
        (
            {"task": task_named("worm_crawl"), "body": replace(CRAWLER, segments=4)},
            "body must have 10 muscles in the task 'worm_crawl', got 6",
        ),
        (
            {"task": "worm_crawl", "body": "worm_hanger"},
            "mount of a worm in the task 'worm_crawl' must be one of 'crawling', got 'hanging'",
        ),
        (
            {"task": "worm_hang", "body": replace(HANGER, mount="free")},
            "mount of a worm in a scene must be one of 'crawling', 'hanging', got 'free'",
        ),
        (
            {"task": "worm_hang", "body": replace(HANGER, muscles="one")},
            "muscles of a worm in a scene must be one of 'pairs', got 'one'",
        ),
        ({"task": "worm_crawl", "terrain": "gapped"}, "terrain of a worm must be one of 'flat'"),
        (
            {"task": "worm_crawl", "controller": "hybrid"},
            "controller of a worm must be None, got 'hybrid'",
        ),
        (
            {"task": "worm_crawl", "controller": Hybrid()},
            "controller of a worm must be None, got Hybrid",
        ),
        (
            {"task": "worm_crawl", "randomisation": "default"},
            "randomisation of a worm must be of sensor_noise alone, got .*friction",
        ),
        ({"task": "worm_crawl", "physics": "wrom"}, "physics must be one of .*mean 'worm'"),
        ({"task": "target", "physics": "worm"}, "physics must be one of .*, got 'worm'"),
        ({"task": "target", "physics": ""}, "physics must be one of .*, got ''"),
        ({"task": "target", "body": ""}, "body must be one of .*, got ''"),
        (
            {"task": "worm_crawl", "decision_interval": 0.0305},
            "it must be a positive multiple of the physics time step, 0.001 s",
        ),
    ],
)
def test_settings_that_do_not_fit_the_body_are_refused_by_name(settings, message):
    with pytest.raises(ValueError, match=message):
        EnvConfig(**settings)


def test_what_flies_alone_have_is_refused_by_name():
    env = BatchedEnv(EnvConfig("worm_crawl"))
    with pytest.raises(ValueError, match="task must be one for flies, got 'worm_crawl'"):
        _ = env.config.fly_scene
    with pytest.raises(TypeError, match="the bodies of the task 'worm_crawl' are no flies"):
        _ = env.flies
    assert env.gait_logs is None
    assert env.config.creature == "worm"


def test_a_worm_has_its_usual_body_and_physics_and_takes_others():
    assert EnvConfig("worm_crawl").scene.body == CRAWLER
    assert EnvConfig("worm_hang_box").scene.body == HANGER
    assert EnvConfig("worm_crawl").steps_per_decision == 50
    finer = EnvConfig("worm_crawl", physics="balanced", body=replace(CRAWLER, segments=4))
    assert finer.steps_per_decision == 125
    assert finer.resolved_task.actions.size == 6


@EVERY_TASK
def test_equal_settings_make_equal_environments(task):
    assert EnvConfig(task) == EnvConfig(task)
    assert EnvConfig(task) != EnvConfig(task, decision_interval=0.1)
