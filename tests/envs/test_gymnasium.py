"""The environments as users of Gymnasium and Stable-Baselines3 meet them."""

import functools
import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_gymnasium
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import FlattenObservation
from stable_baselines3.common.env_checker import check_env as check_sb3

from flyrl import OUTCOMES
from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.envs.single import FlyrlEnv, FlyrlGoalEnv
from flyrl.envs.vector import FlyrlVectorEnv


def warnings_of(check: object, env: gymnasium.Env) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check(env)  # type: ignore[operator]
    env.close()
    return [str(warning.message) for warning in caught]


@pytest.mark.parametrize("check", [check_gymnasium, check_sb3])
def test_target_passes_the_checkers_without_a_warning(check: object) -> None:
    assert warnings_of(check, gymnasium.make("flyrl/Target-v0").unwrapped) == []


def test_target_goal_passes_gymnasiums_checker_without_a_warning() -> None:
    assert warnings_of(check_gymnasium, gymnasium.make("flyrl/TargetGoal-v0").unwrapped) == []


def test_target_goal_is_a_goal_env_to_sb3(capsys: pytest.CaptureFixture[str]) -> None:
    """Its checker also compares the rewards of `step` with those of `compute_reward`."""
    assert warnings_of(check_sb3, gymnasium.make("flyrl/TargetGoal-v0").unwrapped) == []
    assert "We detected your env to be a GoalEnv" in capsys.readouterr().out


def test_hybrid_turning_passes_gymnasiums_checker_with_one_warning() -> None:
    found = warnings_of(check_gymnasium, gymnasium.make("flyrl/HybridTurning-v0").unwrapped)
    assert len(found) == 1
    assert "symmetric" in found[0]


def test_hybrid_turning_passes_sb3s_checker() -> None:
    """SB3 also remarks on each of the four 2-D arrays of the literature's observation."""
    found = warnings_of(check_sb3, gymnasium.make("flyrl/HybridTurning-v0"))
    assert sum("symmetric" in message for message in found) == 1
    assert sum("unconventional shape" in message for message in found) == len(found) - 1 == 4


def test_flattened_hybrid_turning_passes_sb3s_checker_with_one_warning() -> None:
    found = warnings_of(check_sb3, FlattenObservation(gymnasium.make("flyrl/HybridTurning-v0")))
    assert len(found) == 1
    assert "symmetric" in found[0]


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


def test_reset_options_set_the_oscillators() -> None:
    env = gymnasium.make("flyrl/HybridTurning-v0")
    phases, magnitudes = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    env.reset(seed=0, options={"init_phases": phases, "init_magnitudes": magnitudes})
    fly = env.unwrapped.core.state
    np.testing.assert_array_equal(fly.phases[0], phases)
    np.testing.assert_array_equal(fly.magnitudes[0], magnitudes)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"init_phases": [0, 1]}, "6 finite numbers"),
        ({"init_magnitudes": [-1] * 6}, r"init_magnitudes\[0\] must be .* from 0 to 100, got -1"),
        ({"spawn_yaw": float("nan")}, "spawn_yaw must be a finite number .*, got nan"),
        ({"spawn_yaw": "north"}, "spawn_yaw must be a finite number .*, got 'north'"),
        ({"spawn_position": [0, 0, -1]}, "spawn_position must lie on the ground"),
        (
            {"spawn_position": [500, 0, 1]},
            "spawn_position must lie on .* with x from -100",
        ),
        ({"goal": [1e308, 0]}, r"goal\[0\] must be .*, got 1e\+308"),
        ({"goall": [1, 0]}, "has no 'goall'; did you mean 'goal'"),
        ({"goal": [1, 2, 3]}, "2 finite numbers"),
        ({"command": [1]}, "'command' must be 0 finite numbers"),
        ({"phases": [0] * 6}, "init_phases"),
    ],
)
def test_bad_reset_options_are_refused(options: dict[str, object], message: str) -> None:
    env = gymnasium.make("flyrl/Target-v0")
    with pytest.raises(ValueError, match=message):
        env.reset(options=options)


def test_reset_options_set_the_command() -> None:
    env = gymnasium.make("flyrl/Velocity-v0")
    observation, _ = env.reset(seed=0, options={"command": [10, 0.5, 4, -1, 4, -1, 4, -1]})
    core = env.unwrapped.core
    np.testing.assert_allclose(observation[core.task.slices()["command"]], [0.5, 0.05])
    assert core.episodes[0].command == (10, 0.5, 4, -1, 4, -1, 4, -1)
    with pytest.raises(ValueError, match="'command' must be 8 finite numbers"):
        env.reset(options={"command": [10, np.inf] * 4})


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


def drive_all(env: gymnasium.vector.VectorEnv, steps: int) -> list[tuple]:
    rng = np.random.default_rng(0)
    return [
        env.step(rng.uniform(-1, 1, (env.num_envs, 2)).astype(np.float32)) for _ in range(steps)
    ]


def test_the_vector_environment_equals_gymnasiums_over_single_ones() -> None:
    """Through ends of episodes too: both start the next episode on the step after the last."""
    env_id = "flyrl/Target-v0"
    settings = {"decision_interval": 0.1, "physics": "fast"}
    native = gymnasium.make_vec(env_id, num_envs=3, **settings)
    assert type(native.unwrapped).__name__ == "FlyrlVectorEnv"
    plain = gymnasium.make_vec(env_id, num_envs=3, vectorization_mode="sync", **settings)
    first, _ = native.reset(seed=7)
    expected, _ = plain.reset(seed=7)
    np.testing.assert_array_equal(first, expected)
    ends = 0
    for ours, theirs in zip(drive_all(native, 45), drive_all(plain, 45), strict=True):
        for mine, other in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(mine, other)
        np.testing.assert_array_equal(ours[4]["outcome"], theirs[4]["outcome"])
        ends += int((ours[2] | ours[3]).sum())
    assert ends >= 3


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_info_of_the_vector_environment_is_gymnasiums_over_single_ones(mode: AutoresetMode) -> None:
    settings = {
        "decision_interval": 0.1,
        "physics": "fast",
        "terrain": "random_blocks",
        "randomisation": "default",
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


def test_same_step_autoreset_hands_over_the_final_observation() -> None:
    native = gymnasium.make_vec("flyrl/Target-v0", num_envs=2, autoreset_mode="SameStep")
    native.reset(seed=0)
    for observation, _, terminated, truncated, info in drive_all(native, 150):
        done = terminated | truncated
        if done.any():
            i = int(np.flatnonzero(done)[0])
            assert info["final_obs"][i].shape == (46,)
            assert np.any(info["final_obs"][i] != observation[i])
            assert OUTCOMES[info["final_info"]["outcome"][i]] in ("timeout", "fall", "success")
            return
    pytest.fail("no episode ended")


def test_sb3_vec_env_marks_ends_as_sb3_does() -> None:
    env = FlyrlVecEnv(EnvConfig(), 2, num_threads=1, seed=5)
    env.reset()
    still = np.tile(env.core.task.actions.of(np.zeros(2)), (2, 1)).astype(np.float32)
    total = np.zeros(2)
    for step in range(150):
        observation, reward, done, infos = env.step(still)
        total += reward
        assert done.all() == (step == 149)
    for i, info in enumerate(infos):
        assert info["TimeLimit.truncated"]
        assert info["episode"]["l"] == 150
        assert info["episode"]["r"] == pytest.approx(total[i], abs=1e-4)
        assert env.outcomes[info["outcome"]] == "timeout"
        assert info["difficulty"] == 1.0
        assert np.any(info["terminal_observation"] != observation[i])


def test_sb3_vec_env_starts_as_the_single_environment_with_its_seed() -> None:
    batch = FlyrlVecEnv(EnvConfig(), 2, num_threads=1, seed=5)
    single = gymnasium.make("flyrl/Target-v0")
    np.testing.assert_array_equal(np.asarray(batch.reset())[1], single.reset(seed=6)[0])


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


def upturn(env: FlyrlEnv | FlyrlVectorEnv | FlyrlVecEnv) -> None:
    env.core.flies._qpos[0, 3:7] = [0, 1, 0, 0]


def test_a_goal_env_tells_in_info_what_a_failure_costs() -> None:
    env = gymnasium.make("flyrl/TargetGoal-v0").unwrapped
    assert isinstance(env, FlyrlGoalEnv)
    _, info = env.reset(seed=0)
    assert (info["is_failure"], info["decisions_lost"]) == (False, 0)
    upturn(env)
    observation, reward, terminated, truncated, info = env.step(np.zeros(2, dtype=np.float32))
    assert (reward, terminated, truncated) == (-150, True, False)
    assert env.outcomes[info["outcome"]] == "fall"
    assert (info["is_failure"], info["decisions_lost"]) == (True, 149)
    goals = observation["achieved_goal"], observation["desired_goal"]
    assert env.compute_reward(*goals, info) == reward
    assert env.compute_terminated(*goals, info)


def test_an_sb3_vec_env_tells_in_infos_what_a_failure_costs() -> None:
    env = FlyrlVecEnv(EnvConfig("target_goal"), 2, num_threads=1, seed=5)
    env.reset()
    upturn(env)
    observation, rewards, dones, infos = env.step(np.zeros((2, 2)))
    assert dones.tolist() == [True, False]
    assert not infos[0]["TimeLimit.truncated"]
    assert [env.outcomes[info["outcome"]] for info in infos] == ["fall", "running"]
    assert [info["is_failure"] for info in infos] == [True, False]
    assert [info["decisions_lost"] for info in infos] == [149, 0]
    assert isinstance(observation, dict)
    observation["achieved_goal"][0] = infos[0]["terminal_observation"]["achieved_goal"]
    observation["desired_goal"][0] = infos[0]["terminal_observation"]["desired_goal"]
    goals = observation["achieved_goal"], observation["desired_goal"]
    (again,) = env.env_method("compute_reward", *goals, np.array(infos), indices=[0])
    np.testing.assert_array_equal(again, rewards)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_a_vector_env_tells_in_info_what_a_failure_costs(mode: AutoresetMode) -> None:
    env = FlyrlVectorEnv(2, task="target_goal", autoreset_mode=mode)
    _, info = env.reset(seed=5)
    assert info["is_failure"].tolist() == [False, False]
    upturn(env)
    _, rewards, terminated, _, info = env.step(np.zeros((2, 2), dtype=np.float32))
    assert rewards.tolist() == [-150, -1]
    assert terminated.tolist() == [True, False]
    told = info["final_info"] if mode == AutoresetMode.SAME_STEP else info
    assert told["is_failure"].tolist() == [True, False]
    assert told["decisions_lost"].tolist() == [149, 0]
    if mode == AutoresetMode.NEXT_STEP:
        info = env.step(np.zeros((2, 2), dtype=np.float32))[-1]
        assert info["is_failure"].tolist() == [False, False]
        assert info["decisions_lost"].tolist() == [0, 0]


def test_goals_of_a_task_without_goals_are_refused() -> None:
    env = FlyrlVecEnv(EnvConfig("target"), 1, num_threads=1)
    with pytest.raises(ValueError, match="'target' has no goals"):
        env.env_method("compute_terminated", np.zeros((1, 2)), np.zeros((1, 2)), {})


def test_ids_are_found_without_an_import() -> None:
    code = (
        "import gymnasium; env = gymnasium.make('flyrl:flyrl/Target-v0', terrain='flat'); "
        "print(env.reset(seed=0)[0].shape)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "(46,)"


def test_importing_flyrl_imports_neither_torch_nor_matplotlib() -> None:
    heavy = ("torch", "matplotlib", "hydra", "stable_baselines3")
    code = f"import sys, flyrl; print([m for m in {heavy} if m in sys.modules])"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_unknown_terrain_is_refused_by_make() -> None:
    with pytest.raises(ValueError, match="gapped"):
        gymnasium.make("flyrl/Target-v0", terrain="gaped")


def test_a_picture_shows_the_fly() -> None:
    env = gymnasium.make("flyrl/Target-v0", render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    env.close()
    assert picture.shape == (480, 640, 3)
    assert picture.std() > 10
