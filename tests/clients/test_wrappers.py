"""Gymnasium's own wrappers around the environments, single and vectorised."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.wrappers import (
    RecordEpisodeStatistics,
    RecordVideo,
    TimeLimit,
    vector,
)
from stable_baselines3.common.vec_env import VecVideoRecorder

from flyrl import OUTCOMES
from flyrl.envs.sb3 import FlyrlVecEnv
from tests.pictures import decoded, drawing

ID = "flyrl:flyrl/Target-v0"
# an episode is 30 decisions long at most
SETTINGS = {"decision_interval": 0.1, "physics": "fast"}


def make():
    return gymnasium.make(ID, **SETTINGS)


def make_vec(mode=None, **settings):
    return gymnasium.make_vec(ID, num_envs=3, vectorization_mode=mode, **SETTINGS, **settings)


def walk(env, steps, seed=3):
    """Observations and the rest of every step with random actions."""
    first, _ = env.reset(seed=seed)
    rng = np.random.default_rng(0)
    shape = env.action_space.shape
    results = [env.step(rng.uniform(-1, 1, shape).astype(np.float32)) for _ in range(steps)]
    env.close()
    return [first, *(result[0] for result in results)], results


def test_episode_statistics_of_one_fly():
    observations, results = walk(RecordEpisodeStatistics(make()), 30)
    episode = results[-1][4]["episode"]
    assert results[-1][2] or results[-1][3]
    assert episode["l"] == 30 == len(observations) - 1
    assert episode["r"] == pytest.approx(sum(result[1] for result in results), abs=1e-5)


@pytest.mark.parametrize("by_make", [True, False])
def test_time_limit_of_one_fly(by_make):
    limited = gymnasium.make(ID, max_episode_steps=5, **SETTINGS) if by_make else None
    _, results = walk(limited or TimeLimit(make(), max_episode_steps=5), 5)
    assert [result[3] for result in results] == [False] * 4 + [True]
    assert results[-1][4]["outcome"] == OUTCOMES.index("running")


def test_time_limit_of_many_flies_is_that_of_single_ones():
    _, native = walk(make_vec(max_episode_steps=5), 14)
    _, single = walk(make_vec("sync", max_episode_steps=5), 14)
    for ours, theirs in zip(native, single, strict=True):
        for mine, other in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(mine, other)
    assert sum(result[3].sum() for result in native) == 6


def test_time_limit_with_reset_in_the_same_step():
    _, results = walk(make_vec(max_episode_steps=5, autoreset_mode="SameStep"), 10)
    ends = [step for step, result in enumerate(results) if result[3].all()]
    assert ends == [4, 9]
    assert results[4][4]["_final_obs"].all()


def test_episode_statistics_of_many_flies_are_those_of_single_ones():
    native, single = (vector.RecordEpisodeStatistics(make_vec(mode)) for mode in (None, "sync"))
    walk(native, 32)
    walk(single, 32)
    assert len(native.return_queue) >= 3
    np.testing.assert_array_equal(native.length_queue, single.length_queue)
    np.testing.assert_allclose(native.return_queue, single.return_queue, rtol=0, atol=1e-9)


def test_normalised_observations_of_many_flies_are_those_of_single_ones():
    native, _ = walk(vector.NormalizeObservation(make_vec()), 10)
    single, _ = walk(vector.NormalizeObservation(make_vec("sync")), 10)
    np.testing.assert_array_equal(native, single)


@pytest.mark.parametrize("mode", [None, "sync"])
def test_many_flies_as_tensors(mode):
    env = vector.NumpyToTorch(make_vec(mode))
    _, info = env.reset(seed=3)
    assert info["outcome"].tolist() == [OUTCOMES.index("running")] * 3
    assert env.step(torch.zeros(3, 2))[-1]["is_success"].dtype == torch.bool


def film(env):
    with drawing():
        walk(env, 4)


def frames(path):
    """Number, height and width of the pictures of a video."""
    _, pictures = decoded(path)
    assert pictures.std() > 10
    return pictures.shape[:3]


# moviepy, with which Gymnasium writes videos, is not written with care about warnings
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::SyntaxWarning")
def test_video_of_one_fly(tmp_path):
    env = gymnasium.make(ID, render_mode="rgb_array", **SETTINGS)
    film(RecordVideo(env, str(tmp_path / "videos")))
    assert frames(tmp_path / "videos" / "rl-video-episode-0.mp4") == (5, 480, 640)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::SyntaxWarning")
def test_video_of_many_flies(tmp_path):
    env = make_vec(render_mode="rgb_array")
    film(vector.RecordVideo(env, str(tmp_path / "videos"), video_aspect_ratio=(4, 1)))
    assert frames(tmp_path / "videos" / "rl-video-episode-0.mp4") == (5, 480, 1920)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::SyntaxWarning")
def test_sb3s_video_of_many_flies(tmp_path):
    view = {"render_mode": "rgb_array", "camera": "top", "width": 160, "height": 120}
    env = FlyrlVecEnv(num_envs=2, **view, **SETTINGS)
    env = VecVideoRecorder(env, str(tmp_path), lambda step: step == 0, video_length=3)
    with drawing():
        env.reset()
    for _ in range(3):
        env.step(np.zeros((2, 2)))
    env.close()
    assert frames(tmp_path / "rl-video-step-0-to-step-3.mp4") == (4, 240, 160)
