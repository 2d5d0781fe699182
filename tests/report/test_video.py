import dataclasses
import re

import mujoco
import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation import EvaluationConfig, evaluate, make_entrants
from flyrl.report import video as video_module
from flyrl.report.video import (
    BAR_WIDTH,
    FILMED,
    FLY_PACE,
    FPS,
    HEIGHT,
    HOLD_FRAMES,
    WIDTH,
    WORM_PACE,
    _walk,
    encode,
    measured,
    record_video,
    record_videos,
)
from flyrl.simulation.marks import PLAIN, Overlay
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.tasks import TASKS
from flyrl.terrains import TERRAINS
from tests.pictures import decoded, drawing

CONFIG = EvaluationConfig(
    task=dataclasses.replace(TASKS["target"](), time_limit_s=0.1),
    controllers=("cpg",),
    episodes=2,
    num_threads=1,
)


def read(mp4, tmp_path):
    """What ffmpeg says about a video, and its frames."""
    path = tmp_path / "video.mp4"
    path.write_bytes(mp4)
    return decoded(path)


@pytest.fixture(scope="module")
def video():
    (entrant,) = make_entrants(CONFIG)
    with drawing():
        return record_video(CONFIG, entrant, CONFIG.terrain_configs[0], 1)


def test_pictures_come_back(tmp_path):
    shades = (40, 120, 200)
    pictures = [np.full((48, 64, 3), shade, np.uint8) for shade in shades]
    facts, frames = read(encode(pictures), tmp_path)
    assert re.search(rf"Video: h264 .*yuv420p.*, {FPS} fps", facts)
    assert [int(frame.mean()) for frame in frames] == pytest.approx(shades, abs=3)


def test_a_video_starts_playing_before_it_is_loaded():
    data = encode([np.zeros((48, 64, 3), np.uint8)] * 3)
    assert data.index(b"moov") < data.index(b"mdat")


def test_a_browser_has_few_pictures_to_decode_where_it_jumps_to():
    mp4 = encode([np.zeros((48, 64, 3), np.uint8)] * 45)
    # the table of keyframes: version and flags, how many, and their numbers, from 1
    table = np.frombuffer(mp4, ">u4", 5, mp4.index(b"stss") + 4)
    assert table.tolist() == [0, 3, 1, 21, 41]


def test_a_video_that_is_too_large_is_made_coarser():
    rng = np.random.default_rng(0)
    noise = list(rng.integers(0, 255, (8, 96, 128, 3), np.uint8))
    fine = encode(noise)
    assert len(encode(noise, max_bytes=len(fine) - 1)) < len(fine)


def test_a_video_shows_the_evaluated_episode(video):
    row = evaluate(CONFIG).episodes.iloc[1]
    assert (video.controller, video.terrain, video.episode) == ("cpg", "flat", 1)
    assert video.outcome == row["outcome"]


def test_a_film_shows_the_fly_on_its_own_ground():
    (entrant,) = make_entrants(CONFIG)
    random = dataclasses.replace(TERRAINS["random_blocks"], height_range=(0.3, 0.5))
    episode = CONFIG.draw_episodes(random)[0]
    fixed = dataclasses.replace(random, random=False, seed=episode.ground_seed)
    walks = [
        [
            flies.state().position_w[0].copy()
            for flies, *_ in _walk(env, entrant, each, FLY_PACE.frame_s)
        ]
        for env, each in (
            (BatchedEnv(entrant.env(CONFIG, random), 1, 1), episode),
            (BatchedEnv(entrant.env(CONFIG, fixed), 1, 1), episode),
        )
    ]
    assert len(walks[0]) == 11
    np.testing.assert_array_equal(*walks)


def test_a_video_has_a_frame_every_10_ms_and_holds_the_end(video, tmp_path):
    _, frames = read(video.mp4, tmp_path)
    assert len(frames) == video.num_frames == 11 + HOLD_FRAMES
    assert video.shown_s == pytest.approx(0.1)


def test_a_video_shows_something_that_moves(video, tmp_path):
    _, frames = read(video.mp4, tmp_path)
    first, last = frames[0].astype(float), frames[10].astype(float)
    assert first.std() > 10
    assert np.abs(first - last)[100:].mean() > 1


def test_a_randomised_fly_is_filmed_between_decisions_as_it_walks():
    drawn = RandomisationConfig(mass=(2.0, 2.0), drive_latency=(0.03, 0.03))
    # a filtered drive would change with every finer decision
    task = dataclasses.replace(CONFIG.task, drive_time_constant_s=0.0)
    config = dataclasses.replace(CONFIG, task=task, randomisation=drawn)
    (entrant,) = make_entrants(config)
    terrain = config.terrain_configs[0]
    episode = config.draw_episodes(terrain)[1]
    settings = entrant.env(config, terrain)
    filmed = [
        flies.state().position_w[0]
        for flies, *_ in _walk(BatchedEnv(settings, 1, 1), entrant, episode, FLY_PACE.frame_s)
    ]
    finer = BatchedEnv(dataclasses.replace(settings, decision_interval=FLY_PACE.frame_s), 1, 1)
    observation = finer.reset(episodes=[episode])
    walked = [finer.state.position_w[0]]
    for _ in range(10):
        finer.step(entrant.policy.predict(observation)[0])
        walked.append(finer.state.position_w[0])
    np.testing.assert_array_equal(filmed, walked)


def test_a_worm_is_filmed_between_decisions_as_it_crawls():
    """25 frames a second in real time, of decisions that are held for 50 ms each."""
    task = dataclasses.replace(TASKS["worm_crawl"](), time_limit_s=0.2)
    config = EvaluationConfig(task=task, controllers=("worm_cpg",), episodes=1, num_threads=1)
    (entrant,) = make_entrants(config)
    (terrain,) = config.terrain_configs
    (episode,) = config.draw_episodes(terrain)
    settings = entrant.env(config, terrain)
    env = BatchedEnv(settings, 1, 1)
    filmed, times, outcomes = zip(
        *(
            (worms.state().joint_angles[0], time_s, outcome)
            for worms, time_s, outcome in _walk(env, entrant, episode, WORM_PACE.frame_s)
        ),
        strict=True,
    )
    np.testing.assert_allclose(times, [0.0, 0.04, 0.08, 0.12, 0.16, 0.2])
    assert outcomes == ("running",) * 5 + ("timeout",)
    observation, state = env.reset(episodes=[episode]), None
    crawled = [env.state.joint_angles[0]]
    for _ in range(4):
        action, state = entrant.policy.predict(observation, state)
        env.batch.set_command(action)
        for _ in range(5):  # 10 ms each
            env.batch.step(10)
            crawled.append(env.batch.state().joint_angles[0])
    np.testing.assert_array_equal(filmed, crawled[::4])


def test_a_video_of_a_worm_shows_its_tensions(tmp_path):
    task = dataclasses.replace(TASKS["worm_hang"](), time_limit_s=0.2)
    config = EvaluationConfig(task=task, controllers=("worm_reflex",), episodes=1, num_threads=1)
    videos, note = record_videos(config, make_entrants(config))
    if note is not None:
        pytest.skip(note)
    assert videos[0].num_frames == 6 + HOLD_FRAMES
    assert videos[0].shown_s == pytest.approx(0.2)
    _, frames = read(videos[0].mp4, tmp_path)
    # eight bars in the corner, whose inner parts fill with red
    bars = [
        frame[HEIGHT - 16 - 8 * 13 : HEIGHT - 16, WIDTH - 16 - BAR_WIDTH : WIDTH - 16].astype(int)
        for frame in (frames[0], frames[5])
    ]
    red = [((bar[..., 0] > 150) & (bar[..., 1] < 90)).mean() for bar in bars]
    assert red[0] < 0.01
    assert red[1] > 0.02


@pytest.fixture(scope="module")
def videos():
    """Of two episodes of two controllers, one of which is missing, within 40 kB."""
    config = dataclasses.replace(CONFIG, controllers=("cpg", "zero"), film=(1, 0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(video_module, "ALL_BYTES", 40_000)
        found, note = record_videos(config, make_entrants(config), missing={("zero", "flat")})
    if note is not None:
        pytest.skip(note)
    return found


def test_everyone_is_filmed_on_the_episodes_that_are_asked_for_but_where_missing(videos):
    assert [(video.controller, video.episode) for video in videos] == [("cpg", 1), ("cpg", 0)]


def test_videos_are_the_same_whatever_the_number_of_threads():
    config = dataclasses.replace(CONFIG, controllers=("cpg", "zero"))
    small = dataclasses.replace(FILMED, width=160, height=120)
    by_threads = [
        record_videos(replaced, make_entrants(replaced), view=small)
        for replaced in (config, dataclasses.replace(config, num_threads=2))
    ]
    if (note := by_threads[0][1]) is not None:
        pytest.skip(note)
    (alone, _), (together, _) = by_threads
    assert [each.controller for each in together] == ["cpg", "zero"]
    assert together == alone


def test_many_videos_share_the_bytes_of_a_report(video, videos):
    assert len(video.mp4) > 20_000
    assert max(len(each.mp4) for each in videos) <= 20_000


def test_without_gl_one_line_says_so_and_work_goes_on(monkeypatch, capsys):
    monkeypatch.delattr(mujoco, "GLContext", raising=False)  # as MUJOCO_GL=disable leaves it
    found, note = record_videos(CONFIG, make_entrants(CONFIG))
    assert found == []
    assert note.startswith("Videos are left out: no GL library can draw here (MUJOCO_GL switches")
    assert capsys.readouterr().err == f"{note}\n"


def test_a_plain_view_has_no_scale_bar():
    picture = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    assert measured(picture, 40.0, PLAIN) is picture
    assert (measured(picture, 40.0, Overlay()) != picture).any()
