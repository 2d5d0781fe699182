import dataclasses

import numpy as np
import pytest

from flyrl.report import Video
from flyrl.report.sections import player, terrain_section, trainings_section
from flyrl.report.video import HOLD_FRAMES
from tests.report.test_close_up import straight


def video(frames, controller="cpg", frame_s=0.01):
    return Video(controller, "flat", 0, "timeout", frames, frame_s, b"film", b"still")


def test_the_clock_and_the_curves_run_as_long_as_the_longest_video():
    films = [video(31), video(61, "hybrid")]
    section = player(films, [straight()])
    assert (section["videos"], section["frames"]) == (films, 61)
    # without the frames that stand still, 10 ms each
    assert section["end_s"] == section["until_s"] == pytest.approx((60 - HOLD_FRAMES) * 0.01)
    led = player(films, [straight()], leading=films[1:])
    assert (led["videos"], led["has_lead"], led["frames"]) == (films[:1], True, 31)
    assert led["until_s"] == section["until_s"]  # of the curves, which are of all
    # without videos they show the whole episode
    assert player([], [straight()])["until_s"] == pytest.approx(1.0)


def test_curves_stand_with_the_video_of_their_episode(results):
    films = [video(61), dataclasses.replace(video(99), terrain="mixed")]
    walked = [straight(index=1)]
    section = terrain_section(results, results.protocol["terrains"][0], films, walked)
    shown = [(each["episode"], each["videos"], each["walked"]) for each in section["players"]]
    assert shown == [(0, films[:1], []), (1, [], walked)]


def test_a_worm_has_no_legs_whose_colours_mean_something_and_films_in_real_time():
    worm = dataclasses.replace(straight(), creature="worm", drive=np.zeros((51, 8)))
    section = player([video(31, frame_s=0.04)], [worm])
    assert section["legend"] == []
    assert section["slowdown"] == pytest.approx(1.0)
    assert section["end_s"] == pytest.approx((30 - HOLD_FRAMES) * 0.04)


def test_a_policy_file_is_said_to_record_what_it_does_as_far_as_that_fits():
    given = [None, [], {"settings": 3}, {"settings": {"algo": "ppo"}}, {"algo": "x" * 9999}]
    learned = [{"name": "a", "kind": "learned", "training": training} for training in given]
    *without, long = trainings_section(learned)
    assert [[*row.values()] for row in without] == [["a", *["not recorded"] * 4]] * 4
    assert len(long["algo"]) < 500


@pytest.mark.parametrize("left", [0, 3])
def test_the_report_says_what_leaving_the_arena_means(results, left):
    rows = results.episodes.copy()
    rows["outcome"] = "timeout"
    rows.loc[rows.index[:left], "outcome"] = "left_arena"
    terrain = results.protocol["terrains"][0]
    section = terrain_section(dataclasses.replace(results, episodes=rows), terrain, [], [])
    assert section["edge"].startswith(f"{left} of 24 episodes ended because") == (left > 0)
