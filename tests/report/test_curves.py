from xml.etree import ElementTree as ET

import numpy as np
from PIL import Image

from flyrl.report.curves import learning_curve, write_learning_curve

EVALUATIONS = [
    {"decisions": 100.0, "success_rate": 0.25, "mean_return": -1.0},
    {"decisions": 200.0, "success_rate": 0.75, "mean_return": 2.0},
    {"decisions": 300.0, "success_rate": 0.5, "mean_return": 3.0},
]
TRAINING = [(64.0, -2.0), (128.0, 0.5)]


def _lines(axes):
    return {line.get_label(): line.get_xydata().tolist() for line in axes.get_lines()}


def test_success_is_drawn_over_the_decisions():
    upper, _ = learning_curve(EVALUATIONS, TRAINING).axes
    (points,) = _lines(upper).values()
    assert points == [[100, 0.25], [200, 0.75], [300, 0.5]]


def test_returns_of_training_and_held_out_episodes_are_drawn():
    _, lower = learning_curve(EVALUATIONS, TRAINING).axes
    assert _lines(lower) == {
        "training": [[64, -2.0], [128, 0.5]],
        "held-out": [[100, -1.0], [200, 2.0], [300, 3.0]],
    }


def test_the_best_evaluation_has_a_ring():
    upper, lower = learning_curve(EVALUATIONS, TRAINING).axes
    assert upper.collections[0].get_offsets().tolist() == [[200, 0.75]]
    assert lower.collections[0].get_offsets().tolist() == [[200, 2.0]]


def test_the_files_are_an_svg_and_a_png(tmp_path):
    svg, png = write_learning_curve(tmp_path, EVALUATIONS, TRAINING)
    assert ET.parse(svg).getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert np.ptp(np.asarray(Image.open(png).convert("L"))) > 100


def test_a_run_without_a_whole_episode_yet(tmp_path):
    assert len(write_learning_curve(tmp_path, EVALUATIONS[:1], [])) == 2


def test_nothing_to_draw_draws_nothing(tmp_path):
    assert write_learning_curve(tmp_path, [], []) == []
    assert list(tmp_path.iterdir()) == []
