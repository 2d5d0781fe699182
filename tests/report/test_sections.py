import dataclasses

import numpy as np
import pytest

from flyrl.report import Video
from flyrl.report.sections import by_episode, player, terrain_section, trainings_section
from flyrl.report.video import HOLD_FRAMES
from tests.report.test_close_up import straight


def video(frames, controller="cpg", frame_s=0.01):
    return Video(controller, "flat", 0, "timeout", frames, frame_s, b"film", b"still")


def test_the_clock_and_the_curves_run_as_long_as_the_longest_video():
    films = [video(31), video(61, "hybrid")]
    section = player("flat", films, [straight()])
    assert (section["videos"], section["frames"]) == (films, 61)
    # without the frames that stand still, 10 ms each
    assert section["end_s"] == section["until_s"] == pytest.approx((60 - HOLD_FRAMES) * 0.01)
    led = player("flat", films, [straight()], leading=films[1:])
    assert (led["videos"], led["has_lead"], led["frames"]) == (films[:1], True, 31)
    assert led["until_s"] == section["until_s"]  # of the curves, which are of all


def test_without_videos_curves_show_the_whole_episode():
    section = player("flat", [], [straight(index=1)])
    assert (section["videos"], section["episode"]) == ([], 1)
    assert section["until_s"] == pytest.approx(1.0)


def test_curves_stand_with_the_video_of_their_episode():
    elsewhere = dataclasses.replace(video(99), terrain="mixed")
    walked = straight(index=1)
    assert by_episode([video(61), elsewhere], [walked], "flat") == {
        0: ([video(61)], []),
        1: ([], [walked]),
    }


def test_a_worm_has_no_legs_whose_colours_mean_something_and_films_in_real_time():
    worm = dataclasses.replace(straight(), creature="worm", drive=np.zeros((51, 8)))
    section = player("flat", [video(31, frame_s=0.04)], [worm])
    assert section["legend"] == []
    assert section["slowdown"] == pytest.approx(1.0)
    assert section["end_s"] == pytest.approx((30 - HOLD_FRAMES) * 0.04)


@pytest.mark.parametrize("training", [None, [], {"settings": 3}, {"settings": {"algo": "ppo"}}])
def test_a_policy_file_without_settings_is_said_to_have_none(training):
    (row,) = trainings_section([{"name": "a", "kind": "learned", "training": training}])
    assert [*row.values()] == ["a", *["not recorded"] * 4]


def test_long_settings_are_cut():
    (row,) = trainings_section([{"name": "a", "kind": "learned", "training": {"algo": "x" * 9999}}])
    assert len(row["algo"]) < 500


@pytest.mark.parametrize("left", [0, 3])
def test_the_report_says_what_leaving_the_arena_means(results, left):
    rows = results.episodes.copy()
    rows["outcome"] = "timeout"
    rows.loc[rows.index[:left], "outcome"] = "left_arena"
    terrain = results.protocol["terrains"][0]
    section = terrain_section(dataclasses.replace(results, episodes=rows), terrain, [], [])
    assert section["edge"].startswith(f"{left} of 24 episodes ended because") == (left > 0)
