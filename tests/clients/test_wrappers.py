"""Gymnasium's own wrappers around the environments, single and vectorised."""

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
from tests.clients.usual import LIMIT, SETTINGS, make, make_vec
from tests.pictures import decoded, drawing


def walk(env, steps, seed=3):
    """Observations and the rest of every step with random actions."""
    first, _ = env.reset(seed=seed)
    rng = np.random.default_rng(0)
    shape = env.action_space.shape
    results = [env.step(rng.uniform(-1, 1, shape).astype(np.float32)) for _ in range(steps)]
    env.close()
    return [first, *(result[0] for result in results)], results


def test_episode_statistics_of_one_fly():
    observations, results = walk(RecordEpisodeStatistics(make()), LIMIT)
    episode = results[-1][4]["episode"]
    assert results[-1][2] or results[-1][3]
    assert episode["l"] == LIMIT == len(observations) - 1
    assert episode["r"] == pytest.approx(sum(result[1] for result in results), abs=1e-5)


def test_time_limit_of_one_fly():
    for limited in (make(max_episode_steps=5), TimeLimit(make(), max_episode_steps=5)):
        _, results = walk(limited, 5)
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


def film_one(folder):
    film(RecordVideo(make(render_mode="rgb_array"), str(folder)))


def film_many(folder):
    env = make_vec(render_mode="rgb_array", width=160, height=120)
    film(vector.RecordVideo(env, str(folder), video_aspect_ratio=(4, 1)))


def film_for_sb3(folder):
    view = {"render_mode": "rgb_array", "camera": "top", "width": 160, "height": 120}
    env = FlyrlVecEnv(num_envs=2, **view, **SETTINGS)
    env = VecVideoRecorder(env, str(folder), lambda step: step == 0, video_length=3)
    with drawing():
        env.reset()
    for _ in range(3):
        env.step(np.zeros((2, 2)))
    env.close()


# moviepy, with which Gymnasium writes videos, is not written with care about warnings
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::SyntaxWarning")
@pytest.mark.parametrize(
    ("record", "expected"),
    [
        (film_one, (5, 480, 640)),
        (film_many, (5, 120, 480)),
        (film_for_sb3, (4, 240, 160)),
    ],
)
def test_videos(record, expected, tmp_path):
    """Number, height and width of pictures."""
    record(tmp_path / "videos")
    (path,) = (tmp_path / "videos").glob("*.mp4")
    _, pictures = decoded(path)
    assert pictures.std() > 10
    assert pictures.shape[:3] == expected
