import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation import EvaluationConfig, evaluate, make_entrants
from flyrl.report import video as films
from flyrl.report.video import FPS, HEIGHT, HOLD_FRAMES, WIDTH, encode, record_videos
from flyrl.simulation.marks import PLAIN, Overlay
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.tasks import TASKS
from flyrl.terrains import TERRAINS
from tests.pictures import decoded, drawing

CONFIG = EvaluationConfig(
    task=replace(TASKS["target"](), time_limit_s=0.1),
    controllers=("cpg",),
    episodes=2,
    num_threads=1,
)


def worms(task, controller):
    task = replace(TASKS[task](), time_limit_s=0.2)
    return replace(CONFIG, task=task, controllers=(controller,), episodes=1)


def read(mp4, tmp_path):
    """What ffmpeg says about a video, and its frames."""
    path = tmp_path / "video.mp4"
    path.write_bytes(mp4)
    return decoded(path)


def recorded(config, **options):
    """Videos of an evaluation; skips the test where nothing can draw."""
    found, note = record_videos(config, make_entrants(config), **options)
    if note is not None:
        pytest.skip(note)
    return found


def walked(config, number, terrain=None):
    """An environment on one episode, its entrant's policy, and what is filmed of them."""
    (entrant,) = make_entrants(config)
    terrain = terrain or config.terrain_configs[0]
    episode = config.draw_episodes(terrain)[number]
    settings = entrant.env(config, terrain)
    pace = films.FLY_PACE if settings.creature == "fly" else films.WORM_PACE
    pictures = films._walk(BatchedEnv(settings, 1, 1), entrant, episode, pace.frame_s)
    return settings, episode, entrant.policy, pictures


def test_a_video_is_h264_that_plays_at_once_and_jumps_fast(tmp_path):
    shades = np.linspace(40, 200, 45).astype(np.uint8)
    mp4 = encode([np.full((48, 64, 3), shade, np.uint8) for shade in shades])
    facts, frames = read(mp4, tmp_path)
    assert re.search(rf"Video: h264 .*yuv420p.*, {FPS} fps", facts)
    assert [int(frame.mean()) for frame in frames] == pytest.approx(shades, abs=3)
    assert mp4.index(b"moov") < mp4.index(b"mdat")  # before it is loaded
    # the table of keyframes: version and flags, how many, and their numbers, from 1
    table = np.frombuffer(mp4, ">u4", 5, mp4.index(b"stss") + 4)
    assert table.tolist() == [0, 3, 1, 21, 41]


def test_a_video_that_is_too_large_is_made_coarser():
    rng = np.random.default_rng(0)
    noise = list(rng.integers(0, 255, (8, 96, 128, 3), np.uint8))
    fine = encode(noise)
    assert len(encode(noise, max_bytes=len(fine) - 1)) < len(fine)


@pytest.fixture(scope="module")
def video():
    (entrant,) = make_entrants(CONFIG)
    with drawing():
        return films.record_video(CONFIG, entrant, CONFIG.terrain_configs[0], 1)


def test_a_video_shows_the_evaluated_episode_every_10_ms_and_holds_its_end(video, tmp_path):
    assert (video.controller, video.terrain, video.episode) == ("cpg", "flat", 1)
    assert video.outcome == evaluate(CONFIG).episodes.iloc[1]["outcome"]
    _, frames = read(video.mp4, tmp_path)
    assert len(frames) == video.num_frames == 11 + HOLD_FRAMES
    assert video.shown_s == pytest.approx(0.1)
    first, last = frames[0].astype(float), frames[10].astype(float)
    assert first.std() > 10
    assert np.abs(first - last)[100:].mean() > 1  # something moves


def test_a_randomised_fly_is_filmed_on_its_own_ground_between_decisions_as_it_walks():
    random = replace(TERRAINS["random_blocks"], height_range=(0.3, 0.5))
    drawn = RandomisationConfig(mass=(2.0, 2.0), drive_latency=(0.03, 0.03))
    # a filtered drive would change with every finer decision
    task = replace(CONFIG.task, drive_time_constant_s=0.0)
    config = replace(CONFIG, task=task, randomisation=drawn)
    settings, episode, policy, pictures = walked(config, 1, random)
    filmed = [flies.state().position_w[0] for flies, *_ in pictures]
    fixed = replace(random, random=False, seed=episode.ground_seed)
    finer = replace(settings, terrain=fixed, decision_interval=films.FLY_PACE.frame_s)
    env = BatchedEnv(finer, 1, 1)
    observation = env.reset(episodes=[episode])
    positions = [env.state.position_w[0]]
    for _ in range(10):
        env.step(policy.predict(observation)[0])
        positions.append(env.state.position_w[0])
    np.testing.assert_array_equal(filmed, positions)


def test_a_worm_is_filmed_between_decisions_as_it_crawls():
    """25 frames a second in real time, of decisions that are held for 50 ms each."""
    settings, episode, policy, pictures = walked(worms("worm_crawl", "worm_cpg"), 0)
    filmed, times, outcomes = zip(
        *((each.state().joint_angles[0], time_s, outcome) for each, time_s, outcome in pictures),
        strict=True,
    )
    np.testing.assert_allclose(times, [0.0, 0.04, 0.08, 0.12, 0.16, 0.2])
    assert outcomes == ("running",) * 5 + ("timeout",)
    env = BatchedEnv(settings, 1, 1)
    observation, state = env.reset(episodes=[episode]), None
    crawled = [env.state.joint_angles[0]]
    for _ in range(4):
        action, state = policy.predict(observation, state)
        env.batch.set_command(action)
        for _ in range(5):  # 10 ms each
            env.batch.step(10)
            crawled.append(env.batch.state().joint_angles[0])
    np.testing.assert_array_equal(filmed, crawled[::4])


def test_of_a_contrast_its_two_are_filmed_and_where_there_is_none_everybody():
    three, grounds = ("cpg", "hybrid", "zero"), ("flat", "mixed")
    config = replace(CONFIG, controllers=three, terrains=grounds, film="contrast")
    two = {"episode": 1, "controller": "zero", "reference": "cpg", "metric": "success"}
    videos = recorded(config, chosen={"flat": two, "mixed": {"episode": 0}})
    assert sorted((each.terrain, each.controller, each.episode) for each in videos) == [
        *(("flat", name, 1) for name in ("cpg", "zero")),
        *(("mixed", name, 0) for name in three),
    ]


def test_a_video_of_a_worm_shows_its_tensions(tmp_path):
    (video,) = recorded(worms("worm_hang", "worm_reflex"))
    assert video.num_frames == 6 + HOLD_FRAMES
    assert video.shown_s == pytest.approx(0.2)
    _, frames = read(video.mp4, tmp_path)
    # eight bars in the corner, whose inner parts fill with red
    corner = np.s_[HEIGHT - 16 - 8 * 13 : HEIGHT - 16, WIDTH - 16 - films.BAR_WIDTH : WIDTH - 16]
    bars = (frames[i][corner].astype(int) for i in (0, 5))
    red = [((bar[..., 0] > 150) & (bar[..., 1] < 90)).mean() for bar in bars]
    assert red[0] < 0.01
    assert red[1] > 0.02


def test_videos_of_all_that_is_asked_for_share_the_bytes_of_a_report(video, monkeypatch):
    monkeypatch.setattr(films, "ALL_BYTES", 40_000)
    config = replace(CONFIG, controllers=("cpg", "zero"), film=(1, 0))
    videos = recorded(config, missing={("zero", "flat")})
    assert [(each.controller, each.episode) for each in videos] == [("cpg", 1), ("cpg", 0)]
    assert len(video.mp4) > 20_000
    assert max(len(each.mp4) for each in videos) <= 20_000


def test_videos_are_the_same_whatever_the_number_of_threads():
    small = replace(films.FILMED, width=160, height=120)
    config = replace(CONFIG, controllers=("cpg", "zero"))
    alone, together = (recorded(replace(config, num_threads=n), view=small) for n in (1, 2))
    assert [each.controller for each in together] == ["cpg", "zero"]
    assert together == alone


def test_without_gl_one_line_says_so_and_work_goes_on(monkeypatch, capsys):
    monkeypatch.delattr(mujoco, "GLContext", raising=False)  # as MUJOCO_GL=disable leaves it
    found, note = record_videos(CONFIG, make_entrants(CONFIG))
    assert found == []
    assert note.startswith("Videos are left out: no GL library can draw here (MUJOCO_GL switches")
    assert capsys.readouterr().err == f"{note}\n"


def test_a_plain_view_has_no_scale_bar():
    picture = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    assert films.measured(picture, 40.0, PLAIN) is picture
    assert (films.measured(picture, 40.0, Overlay()) != picture).any()
