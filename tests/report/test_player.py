import dataclasses
import json
import re

import numpy as np
import pytest

from flyrl.report import Video
from flyrl.report.episodes import players
from flyrl.report.html import format_report
from flyrl.report.video import HOLD_FRAMES
from tests.report.test_html import Page
from tests.report.test_time_curves import walked
from tests.synthetic import make_results


def video(frames, controller="cpg", terrain="flat"):
    return Video(controller, terrain, 0, "timeout", frames, 0.01, b"film", b"still")


@pytest.fixture(scope="module")
def page():
    results = make_results(("cpg", "hybrid"), episodes=2)
    videos = [video(31), video(61, "hybrid")]
    return Page(format_report(results, videos=videos, examples=[walked()]))


def attributes(page, wanted, **having):
    """Those of the one element of a kind that has others."""
    (found,) = (
        attrs
        for tag, attrs in page.tags
        if tag == wanted and all(attrs.get(key) == value for key, value in having.items())
    )
    return found


def test_the_clock_runs_as_long_as_the_longest_video():
    (section,) = players([video(31), video(61, "hybrid"), video(99, "cpg", "mixed")], [], "flat")
    assert section["frames"] == 61
    # without the frames that stand still, 10 ms each
    assert section["end_s"] == pytest.approx((60 - HOLD_FRAMES) * 0.01)
    assert [each["frames"] for each in section["videos"]] == [31, 61]


def test_curves_end_with_the_film():
    (section,) = players([video(61)], [walked()], "flat")
    assert section["curves"]["until_s"] == pytest.approx(0.4)


def test_without_videos_curves_show_the_whole_episode():
    (section,) = players([], [walked()], "flat")
    assert section["videos"] == []
    assert section["curves"]["until_s"] == pytest.approx(1.0)


def test_without_examples_there_are_videos_alone():
    (section,) = players([video(61)], [], "flat")
    assert section["curves"] is None


def test_curves_are_of_the_episode_that_is_filmed():
    filmed, other = players([video(61)], [walked(index=1)], "flat")
    assert (filmed["episode"], filmed["curves"]) == (0, None)
    assert (other["episode"], other["videos"]) == (1, [])


def test_a_terrain_has_a_slider_over_the_frames_of_its_videos(page):
    slider = attributes(page, "input", type="range")
    assert (slider["min"], slider["max"], slider["step"]) == ("0", "60", "1")
    assert slider["aria-label"]
    assert [attrs["data-frames"] for tag, attrs in page.tags if tag == "video"] == ["31", "61"]


def test_the_page_says_where_the_time_is_in_its_curves(page):
    figure = attributes(page, "figure", **{"class": "run-along"})
    panels = json.loads(figure["data-panels"])
    assert [len(box) for box in panels] == [4] * 4
    assert float(figure["data-until-s"]) == pytest.approx(0.4)


def test_the_page_tells_what_the_colours_of_legs_mean(page):
    texts = " ".join(page.texts)
    for words in ("tarsi while the leg grips", "tibia while the retraction", "femur while the stu"):
        assert words in texts
    styles = {attrs.get("style", "") for tag, attrs in page.tags if tag == "span"}
    assert sum(bool(re.search(r"#[0-9a-f]{6}$", style)) for style in styles) == 3


def test_a_worm_has_no_legs_whose_colours_mean_something_and_films_in_real_time():
    worm = dataclasses.replace(walked(), creature="worm", drive=np.zeros((51, 8)))
    film = dataclasses.replace(video(31), frame_s=0.04)
    (section,) = players([film], [worm], "flat")
    assert section["legend"] == []
    assert section["slowdown"] == pytest.approx(1.0)
    assert section["end_s"] == pytest.approx((30 - HOLD_FRAMES) * 0.04)
