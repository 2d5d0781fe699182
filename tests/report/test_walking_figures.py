"""Figures of walks: the comparison from made-up ones, gaits and slopes from few short ones."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flyrl.report import walking_figures
from flyrl.report.walking_figures import draw_comparison

DOCS = Path(__file__).parents[2] / "docs"


def episodes(speeds):
    """Rows of results: speeds by controller and terrain, the last of each a fall."""
    return pd.DataFrame(
        {
            "terrain": terrain,
            "controller": controller,
            "episode": episode,
            "outcome": "fall" if episode == len(values) - 1 else "timeout",
            "duration_s": 1.5,
            "displacement_mm": 1.5 * value,
            "speed_mm_s": value,
            "return": 0.0,
        }
        for (terrain, controller), values in speeds.items()
        for episode, value in enumerate(values)
    )


def test_every_episode_is_a_dot_and_the_line_their_mean():
    plot = draw_comparison(
        episodes(
            {
                ("flat", "cpg"): [14.0, 15.0, 10.0],
                ("flat", "hybrid"): [13.0, 13.5, 12.0],
                ("mixed", "cpg"): [3.0, 9.0, 1.0],
                ("mixed", "hybrid"): [11.0, 12.0, 2.0],
            }
        )
    )
    assert len(plot.table) == 12
    assert "return" not in plot.table
    flat, mixed = plot.figure.axes
    assert [axes.get_title(loc="left") for axes in (flat, mixed)] == ["flat", "mixed"]
    # after the line from quartile to quartile
    means = [line.get_xdata()[0] for axes in (flat, mixed) for line in axes.lines[1::2]]
    assert means == pytest.approx([13.0, 38.5 / 3, 13 / 3, 25 / 3])
    dots = np.concatenate([found.get_offsets()[:, 0] for found in mixed.collections])
    assert sorted(dots) == [1.0, 2.0, 3.0, 9.0, 11.0, 12.0]


def test_every_gait_carries_every_fly_as_in_the_gallery(monkeypatch):
    monkeypatch.setattr(walking_figures, "FLIES", 2)
    figure, drawn = walking_figures.gaits_plot()
    stored = pd.read_csv(DOCS / "gallery" / "gaits.csv")
    stored = stored[stored["episode"] < 2].reset_index(drop=True)
    assert list(stored["gait"].unique()) == ["tripod", "tetrapod", "wave"]
    pd.testing.assert_frame_equal(drawn, stored, atol=0.1)
    for axes, gait in zip(figure.axes[::2], stored["gait"].unique(), strict=True):
        assert axes.get_title(loc="left") == gait
        assert len(axes.collections) == 6  # bars of every leg


def test_feet_that_hold_on_carry_the_fly_up_steeper_slopes(monkeypatch):
    monkeypatch.setattr(walking_figures, "PUBLISHED", {0: 30, 20: 60})
    monkeypatch.setattr(walking_figures, "STARTS", 2)
    monkeypatch.setattr(walking_figures, "STEP_DEG", 15)
    (slippery, sticky) = walking_figures.falling_slopes("hybrid")
    assert ((slippery >= 15) & (slippery <= 45)).all()
    assert (sticky > slippery).all()
    assert np.median(sticky) >= 60
