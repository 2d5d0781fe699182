"""The figure of a muscle."""

import numpy as np
import pytest

from flyrl.report.scene_figures import muscle_plot
from tests.muscles.images import save_profile


def test_it_shows_the_forces_and_what_they_add_up_to(tmp_path):
    save_profile(tmp_path / "pool.png", [0, 10, 30, 60])
    figure, table = muscle_plot(tmp_path / "pool.png")
    np.testing.assert_allclose(table["force"], [0, 10, 30, 60])
    np.testing.assert_allclose(table["tension"], [0.0, 0.1, 0.4, 1.0])
    strip, forces, curve = figure.axes
    assert strip.get_title(loc="left") == "pool.png: a pixel per motor neuron"
    assert forces.get_ylabel() == "255 - blue"
    np.testing.assert_allclose(curve.lines[0].get_ydata(), table["tension"])


def test_no_such_profile(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.png"):
        muscle_plot(tmp_path / "none.png")
