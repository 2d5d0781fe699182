"""The comparison of controllers, from made-up walks."""

import numpy as np
import pandas as pd
import pytest
import yaml

from flyrl.report.walking_figures import STUDY, draw_comparison
from flyrl.resources import configs_folder


def episodes(speeds):
    """Rows of results: speeds by controller and terrain, the last of each a fall."""
    rows = [
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
    ]
    return pd.DataFrame(rows)


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
    means = [line.get_ydata()[0] for axes in (flat, mixed) for line in axes.lines]
    assert means == pytest.approx([13.0, 38.5 / 3, 13 / 3, 25 / 3])
    dots = np.concatenate([found.get_offsets()[:, 1] for found in mixed.collections])
    assert sorted(dots) == [1.0, 2.0, 3.0, 9.0, 11.0, 12.0]


def test_the_setting_is_that_of_the_experiment():
    path = configs_folder() / "experiment" / "controller_comparison.yaml"
    experiment = yaml.safe_load(path.read_text())
    assert {"override /task": STUDY.resolved_task.name} in experiment["defaults"]
    assert experiment["task"] == {"time_limit": STUDY.horizon_s}
    assert (*experiment["controllers"],) == STUDY.controllers
    assert (*experiment["terrains"],) == STUDY.terrains
    assert experiment["episodes"] == STUDY.episodes
