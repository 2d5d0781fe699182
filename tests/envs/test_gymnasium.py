"""The environments as users of Gymnasium and Stable-Baselines3 meet them."""

import functools
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_gymnasium
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.env_checker import check_env as check_sb3

import flyrl
from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.front.environments import ENV_IDS
from flyrl.simulation.randomisation import RANDOMISATIONS
from flyrl.tasks import TASKS, Task


def warnings_of(check: Callable[..., None], *arguments: Any, **options: Any) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check(*arguments, **options)
    return [str(warning.message) for warning in caught]


@functools.cache
def drawn_ids() -> set[str]:
    """The first id of every scene: pictures of the others are of the same."""
    scenes = {EnvConfig(task).scene: env_id for env_id, task in reversed(ENV_IDS.items())}
    return set(scenes.values())


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_the_checkers_remark_only_on_what_the_literature_has(env_id, capsys):
    """The range of the bare drive is not symmetric, and four arrays of its observation are 2-D.

    Of a GoalEnv, SB3's also compares the rewards of `step` with those of `compute_reward`.
    """
    is_bare = env_id in ("flyrl/HybridTurning-v0", "flyrl/Joints-v0", "flyrl/JointsBox-v0")
    env = gymnasium.make(env_id, physics=None if "Worm" in env_id else "fast").unwrapped
    if env_id != "flyrl/Joints-v0":  # a dict of actions is none of SB3's
        found = warnings_of(check_sb3, env)
        assert ("to be a GoalEnv" in capsys.readouterr().out) == (env_id == "flyrl/TargetGoal-v0")
        assert sum("symmetric" in message for message in found) == is_bare
        assert sum("unconventional shape" in message for message in found) == 4 * is_bare
        assert len(found) == 5 * is_bare
    found = warnings_of(check_gymnasium, env, skip_render_check=env_id not in drawn_ids())
    assert all(is_bare and "symmetric" in message for message in found)
    assert len(found) <= 1


def test_hybrid_turning_is_the_mdp_of_the_literature() -> None:
    env = gymnasium.make("flyrl/HybridTurning-v0", terrain="mixed")
    assert env.action_space == gymnasium.spaces.Box(-0.5, 1.5, (2,), np.float32)
    shapes = {name: space.shape for name, space in env.observation_space.spaces.items()}
    assert shapes == {
        "joints": (3, 42),
        "fly": (4, 3),
        "contact_forces": (36, 3),
        "end_effectors": (6, 3),
        "fly_orientation": (3,),
    }
    for space in env.observation_space.spaces.values():
        assert np.isfinite(space.low).all()
        assert np.isfinite(space.high).all()
    env.reset(seed=0)
    *_, info = env.step(np.array([1.0, 1.0], dtype=np.float32))
    assert info["time_s"] == pytest.approx(env.unwrapped.config.scene.physics.timestep)


HALVES = [0.0, 0.5, 1.0, 0.0, 0.5, 1.0]
ANGLES = [0.1, -0.2, 0.3, 0.0]  # of a worm: 0.2 in all


@pytest.mark.parametrize(
    ("task", "options", "shown"),
    [
        ("target", {"init_phases": [np.pi / 2] * 6}, {"phases": [0] * 6 + [1] * 6}),
        ("target", {"init_magnitudes": HALVES}, {"magnitudes": HALVES}),
        ("velocity", {"command": [10, 0.5, 4, -1, 4, -1, 4, -1]}, {"command": [0.5, 0.05]}),
        (
            "worm_hang",
            {"joint_angles": ANGLES, "command": [0.7]},
            {"joint_angles": ANGLES, "command": [0.7], "bend_error": [-0.5]},
        ),
        (
            "worm_crawl",
            {"spawn_position": [3.0, -4.0, 0.0], "spawn_yaw": 2.0},
            {"heading": [np.cos(2.0), np.sin(2.0)]},
        ),
    ],
)
def test_reset_options_replace_what_is_drawn_and_are_shown(task, options, shown) -> None:
    env = flyrl.make(task)
    observation, _ = env.reset(seed=0, options=options)
    core = env.unwrapped.core
    given = {name.replace("position", "position_w"): value for name, value in options.items()}
    assert core.episodes[0] == replace(core.config.sample_episode(0), **given)
    for name, values in shown.items():
        found = observation[core.task.slices()[name]]
        np.testing.assert_allclose(found, values, rtol=1e-6, atol=1e-6)
    if "spawn_position" in options:
        np.testing.assert_allclose(core.state.position_w[0, :2], [3.0, -4.0])


def test_a_path_leads_to_its_own_end() -> None:
    env = gymnasium.make("flyrl/Path-v0")
    straight = np.stack([np.arange(49) * 0.5, np.zeros(49)], axis=1).ravel().tolist()
    env.reset(seed=0, options={"command": straight})
    assert env.unwrapped.core.episodes[0].goal == (24.0, 0.0)
    for options in ({"goal": [3, 4]}, {"goal": [3, 4], "command": straight}):
        with pytest.raises(ValueError, match="'goal' must be the last point of the command"):
            env.reset(options=options)


def test_resets_without_a_seed_go_on_in_the_seeds_own_order() -> None:
    def goals(seed: int) -> list[tuple[float, ...]]:
        env = gymnasium.make("flyrl/Target-v0")
        env.reset(seed=seed)
        found = [env.unwrapped.core.episodes[0].goal]
        for _ in range(2):
            env.reset()
            found.append(env.unwrapped.core.episodes[0].goal)
        return found

    assert goals(3) == goals(3)
    assert len(set(goals(3))) == 3
    assert goals(3) != goals(4)


def short(name: str) -> Task:
    return replace(TASKS[name](), time_limit_s=0.15)


@pytest.mark.parametrize(
    "settings",
    [
        {"task": "target", "decision_interval": 0.1, "physics": "fast", "randomisation": "default"},
        {"task": short("worm_crawl")},
        {"task": short("worm_hang_box")},
    ],
)
def test_many_are_what_gymnasium_and_sb3_have_of_single_ones(settings: dict[str, Any]) -> None:
    """Through ends of episodes too, which SB3's marks as Monitor does."""
    native = flyrl.make_vec(num_envs=2, **settings)
    plain = flyrl.make_vec(num_envs=2, vectorization_mode="sync", **settings)
    same_step = flyrl.make_vec(num_envs=2, autoreset_mode="SameStep", **settings)
    vec = flyrl.make_sb3(num_envs=2, seed=7, **settings)
    first, *others = (env.reset(seed=7)[0] for env in (plain, native, same_step))
    for other in (*others, vec.reset()):
        np.testing.assert_array_equal(other, first)
    native.action_space.seed(1)
    limit = native.spec.max_episode_steps
    total = np.zeros(2)
    for step in range(limit + 4):
        actions = native.action_space.sample()
        ours, theirs = native.step(actions), plain.step(actions)
        for mine, other in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(mine, other)
        if step < limit:
            same, (_, rewards, done, infos) = same_step.step(actions), vec.step(actions)
            np.testing.assert_array_equal(done, ours[2] | ours[3])
            np.testing.assert_array_equal(same[1], ours[1])
            np.testing.assert_array_equal(rewards, ours[1].astype(np.float32))
            total += ours[1]
            for i in np.flatnonzero(done):
                for shown in (same[4]["final_obs"][i], infos[i]["terminal_observation"]):
                    np.testing.assert_array_equal(shown, ours[0][i])
                assert infos[i]["outcome"] == ours[4]["outcome"][i]
                assert infos[i]["TimeLimit.truncated"] == ours[3][i]
                assert infos[i]["episode"]["l"] == step + 1
                assert infos[i]["episode"]["r"] == pytest.approx(total[i])
                assert infos[i]["difficulty"] == 1.0
        if done.any():
            break
    assert done.any()
    assert native.step(actions)[1][done].tolist() == [0.0] * done.sum()


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_info_of_the_vector_environment_is_gymnasiums_over_single_ones(mode: AutoresetMode) -> None:
    settings = {
        "decision_interval": 0.1,
        "physics": "fast",
        "terrain": "random_blocks",
        "randomisation": replace(RANDOMISATIONS["default"], missing_leg=("LF", "RH")),
        "max_episode_steps": 3,
    }
    make = functools.partial(gymnasium.make_vec, "flyrl/TargetGoal-v0", 3, **settings)
    native = make(autoreset_mode=mode)
    plain = make(vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode})
    infos = [(native.reset(seed=7)[1], plain.reset(seed=7)[1])]
    actions = np.zeros((3, 2), dtype=np.float32)
    for step in range(6):
        if step == 1:  # so that the first ends apart from the others
            native.reset(options={"reset_mask": np.array([True, False, False])})
            plain.envs[0].reset()
        infos.append((native.step(actions)[-1], plain.step(actions)[-1]))
    for ours, theirs in infos:
        assert_equal_info(ours, theirs)
    ends = [ours["_final_info"].tolist() for ours, _ in infos if "final_info" in ours]
    others_first = [[False, True, True], [True, False, False], [False, True, True]]
    assert ends == (others_first if mode == AutoresetMode.SAME_STEP else [])


def assert_equal_info(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    assert ours.keys() == theirs.keys()
    for key, mine in ours.items():
        if isinstance(mine, dict):
            assert_equal_info(mine, theirs[key])
        elif mine.dtype == object:
            np.testing.assert_equal(mine.tolist(), theirs[key].tolist())
        else:
            np.testing.assert_array_equal(mine, theirs[key], err_msg=key)
            assert mine.dtype == theirs[key].dtype, key


def test_info_has_the_same_keys_after_reset_and_step() -> None:
    env = gymnasium.make("flyrl/Target-v0", terrain="random_blocks", randomisation="default")
    _, first = env.reset(seed=0)
    assert first.keys() == env.step(np.zeros(2, dtype=np.float32))[-1].keys()


def test_an_sb3_vec_env_computes_rewards_of_goals_for_every_fly() -> None:
    env = FlyrlVecEnv(EnvConfig("target_goal"), 2, num_threads=1, seed=5)
    achieved, desired = np.zeros((3, 2)), np.array([[0.0, 0.05], [1.0, 0.0], [0.2, 0.2]])
    infos = [{"is_failure": lost > 0, "decisions_lost": lost} for lost in (0, 0, 7)]
    (rewards,) = env.env_method("compute_reward", achieved, desired, infos, indices=[0])
    assert rewards.tolist() == [0, -1, -8]
    ends = env.env_method("compute_terminated", achieved, desired, infos)
    assert [each.tolist() for each in ends] == 2 * [[True, False, True]]
    with pytest.raises(NotImplementedError, match="no method 'render'"):
        env.env_method("render")
    with pytest.raises(ValueError, match="'target' has no goals"):
        FlyrlVecEnv().env_method("compute_terminated", achieved, desired, infos)
    # infos tell what a failure costs
    env.reset()
    env.core.flies._qpos[0, 3:7] = [0, 1, 0, 0]  # upside down
    observation, rewards, dones, infos = env.step(np.zeros((2, 2)))
    assert dones.tolist() == [True, False]
    assert not infos[0]["TimeLimit.truncated"]
    assert [env.outcomes[info["outcome"]] for info in infos] == ["fall", "running"]
    assert [info["is_failure"] for info in infos] == [True, False]
    assert [info["decisions_lost"] for info in infos] == [149, 0]
    observation["achieved_goal"][0] = infos[0]["terminal_observation"]["achieved_goal"]
    observation["desired_goal"][0] = infos[0]["terminal_observation"]["desired_goal"]
    goals = observation["achieved_goal"], observation["desired_goal"]
    (again,) = env.env_method("compute_reward", *goals, np.array(infos), indices=[0])
    np.testing.assert_array_equal(again, rewards)


def test_ids_are_found_without_an_import_and_load_no_heavy_package() -> None:
    heavy = ("torch", "matplotlib", "hydra", "stable_baselines3", "flyrl.training", "flyrl.report")
    code = (
        "import sys, gymnasium; env = gymnasium.make('flyrl:flyrl/Target-v0', terrain='flat'); "
        "import flyrl.evaluation; "
        f"print(env.reset(seed=0)[0].shape, [name for name in {heavy} if name in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "(47,) []"
