import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from flyrl.report.curves import (
    learning_curve,
    learning_curves,
    write_learning_curve,
    write_learning_curves,
)
from tests.report.conftest import EVALUATIONS, texts

TRAINING = [(64.0, -2.0), (128.0, 0.5)]


def _lines(axes):
    return {line.get_label(): line.get_xydata().tolist() for line in axes.get_lines()}


def test_success_returns_and_the_best_evaluation_are_drawn():
    upper, lower = learning_curve(EVALUATIONS, TRAINING).axes
    (points,) = _lines(upper).values()
    assert points == [[100, 0.25], [200, 0.75], [300, 0.5]]
    assert _lines(lower) == {
        "training": [[64, -2.0], [128, 0.5]],
        "held-out": [[100, -1.0], [200, 2.0], [300, 3.0]],
    }
    rings = [axes.collections[0].get_offsets().tolist() for axes in (upper, lower)]
    assert rings == [[[200, 0.75]], [[200, 2.0]]]


def test_nothing_to_draw_draws_nothing_and_one_evaluation_is_enough(tmp_path):
    assert write_learning_curve(tmp_path, [], []) == []
    assert write_learning_curves(tmp_path, [("a", []), ("b", [[]])]) == []
    assert list(tmp_path.iterdir()) == []
    assert len(write_learning_curve(tmp_path, EVALUATIONS[:1], [])) == 2


def _run(*rows):
    keys = ("decisions", "success_rate", "mean_return")
    return [dict(zip(keys, map(float, row), strict=True)) for row in rows]


TWO_GROUPS = [
    (
        "algo=ppo",
        [
            _run((100, 0.0, 1), (200, 0.5, 2), (300, 1.0, 4)),
            _run((100, 0.5, 3), (250, 0.5, 5), (300, 0.5, 5), (400, 1.0, 6)),
        ],
    ),
    ("algo=sac", [_run((150, 0.25, 0))]),
]


def _points(axes, colour):
    lines = [line for line in axes.get_lines() if line.get_color() == colour]
    return [line.get_xydata().tolist() for line in lines]


def _legend(figure):
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    return {text: line.get_color() for text, line in zip(texts, legend.get_lines(), strict=True)}


def test_every_run_is_drawn_and_the_mean_where_all_were_evaluated():
    figure = learning_curves(TWO_GROUPS)
    upper, lower = figure.axes
    colour = _legend(figure)["algo=ppo, n = 2"]
    first, second, mean = _points(upper, colour)
    assert first == [[100, 0.0], [200, 0.5], [300, 1.0]]
    assert second == [[100, 0.5], [250, 0.5], [300, 0.5], [400, 1.0]]
    assert mean == [[100, 0.25], [300, 0.75]]
    assert _points(lower, colour)[2] == [[100, 2.0], [300, 4.5]]


def test_runs_without_a_common_evaluation_have_no_mean_but_a_legend():
    figure = learning_curves([("a", [_run((100, 0.5, 1)), _run((200, 0.5, 1))])])
    assert list(_legend(figure)) == ["a, n = 2"]
    assert _points(figure.axes[0], _legend(figure)["a, n = 2"])[2] == []


def test_a_group_without_evaluations_keeps_its_colour_for_later():
    legend = _legend(learning_curves([("algo=ppo", []), TWO_GROUPS[1]]))
    assert legend == {"algo=sac, n = 1": _legend(learning_curves(TWO_GROUPS))["algo=sac, n = 1"]}


def test_nine_groups_look_different():
    groups = [(str(index), [_run((100, 0.5, 1))]) for index in range(9)]
    lines = learning_curves(groups).axes[0].get_lines()
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 9


def test_long_labels_stay_within_the_figure():
    label = " ".join(f"algo.setting_{index}={index}" for index in range(20))
    figure = learning_curves([(label, [_run((100, 0.5, 1))])] * 4)
    FigureCanvasAgg(figure).draw()
    box = figure.legends[0].get_window_extent()
    assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
    assert all(axes.get_window_extent().height > 100 for axes in figure.axes)


def test_the_same_curves_are_the_same_bytes_and_text_stays_text(tmp_path):
    written = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        svg, png = write_learning_curves(tmp_path / name, TWO_GROUPS, "target $flat$")
        written.append((svg.read_bytes(), png.read_bytes()))
    assert written[0] == written[1]
    assert {"target $flat$", "held-out success"} <= set(texts(svg.read_text()))
    assert np.ptp(np.asarray(Image.open(png).convert("L"))) > 100
