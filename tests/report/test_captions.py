"""What is written onto pictures."""

import numpy as np
import pytest

from flyrl.report.captions import (
    clock_text,
    ending_text,
    scale_length,
    tension_bars,
    titled,
    with_legend,
    with_scale_bar,
)

GREY = np.full((360, 480, 3), 128, np.uint8)


def test_the_clock_tells_time_and_speed_and_an_end_that_is_not_filmed():
    assert clock_text(1.239, 0.25) == "t = 1.24 s   0.25 \N{MULTIPLICATION SIGN} real time"
    assert clock_text(0.0, 1.0) == "t = 0.00 s   real time"
    assert ending_text("left_arena", 1.5, 2.0) == "left arena at 1.50 s"
    assert ending_text("success", 2.31, 2.0) == "t = 2.00 s; success at 2.31 s"


@pytest.mark.parametrize(
    ("pixels_per_mm", "expected"),
    [
        (50.0, (2, 100)),  # 5 mm would take 250 px of 480
        (52.9, (1, 53)),  # 2 mm would take 105.8, of which 105.6 are the most
        (2.1, (50, 105)),
        (5000.0, (0.1, 500)),
    ],
)
def test_a_scale_bar_has_the_longest_round_length_that_fits(pixels_per_mm, expected):
    assert scale_length(pixels_per_mm, 480) == expected


def test_a_scale_bar_is_as_long_as_it_says():
    white = (with_scale_bar(GREY, 50.0) == 255).all(axis=2)
    assert white.sum(axis=1).max() == 100


def test_captions_keep_to_their_corners():
    upper_left, lower_left, lower_right = np.s_[:90, :240], np.s_[300:, :240], np.s_[240:, 240:]
    entries = [(name, "what it means") for name in ("grips", "retracts", "stumbles")]
    for corner, picture in (
        (upper_left, titled(GREY, "walk_cpg", clock_text(1.0, 0.25))),
        (lower_left, with_scale_bar(GREY, 50.0, ", force 30 µN/mm")),
        (lower_right, with_legend(GREY, entries)),
    ):
        is_changed = (picture != GREY).any(axis=2)
        assert is_changed[corner].sum() == is_changed.sum() > 1000


def test_the_font_knows_what_is_written():
    """A sign that it lacks would be drawn as the box that stands for another it lacks."""
    signs = [titled(GREY, sign) for sign in ("\N{MULTIPLICATION SIGN}", "µ", "°", "\ue000")]
    for sign in signs[:-1]:
        assert (sign != signs[-1]).any()


def red(picture):
    red, green, blue = (picture[..., i].astype(int) for i in range(3))
    return (red > 150) & (green < 90) & (blue < 90)


@pytest.mark.parametrize(("tension", "filled"), [(0, 0), (0.01, 3), (0.5, 150), (1, 300)])
def test_a_bar_fills_with_red_in_proportion_to_tension(tension, filled):
    picture = red(tension_bars(GREY, [tension]))
    # in the lower right corner, from the left
    left, top = 480 - 16 - 300, 360 - 16 - 20
    assert picture[top : top + 20, left : left + filled].all()
    assert picture.sum() == 20 * filled


def test_bars_of_several_muscles_stand_one_below_the_other():
    filled = red(tension_bars(GREY, [0.1, 0.4])).sum(axis=1)
    assert filled[filled > 0].tolist() == [30] * 20 + [120] * 20
