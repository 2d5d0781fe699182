"""The gallery page of the docs shows what can be drawn, as it is drawn now."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flyrl.report.gallery import GALLERY, muscle_plot
from tests.muscles.creatures import save_profile

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "gallery.md").read_text()


SHOWN = re.findall(r"[(\"](?:\.\./)?(gallery/[\w.]+)[)\"]", PAGE)
"""Files that the page shows or links to, as paths from docs/."""


def test_every_figure_is_on_the_page_with_the_command_that_draws_it_and_is_light():
    for name in GALLERY:
        assert f"`flyrl figures {name}`" in PAGE
        kinds = {Path(path).suffix for path in SHOWN if Path(path).stem == name}
        assert kinds & {".svg", ".png", ".mp4"}
        # a video has its poster and numbers
        assert ".mp4" not in kinds or {".jpg", ".csv"} < kinds
    assert sum((DOCS / path).stat().st_size for path in {*SHOWN}) < 6e6


@pytest.mark.parametrize("name", ["adhesion", "rules_graph", "muscle"])
def test_a_figure_still_shows_the_numbers_on_the_page(name):
    shown = pd.read_csv(DOCS / "gallery" / f"{name}.csv")
    pd.testing.assert_frame_equal(GALLERY[name]().table, shown, check_dtype=False, rtol=1e-5)


def test_the_gallery_shows_what_it_says():
    """Of what was walked, from the numbers of the page."""
    turn, bare, gripping, hybrid = (
        pd.read_csv(DOCS / "gallery" / f"{name}.csv")
        for name in ("turn_video", "walk_cpg_without_adhesion", "walk_cpg", "walk_hybrid")
    )
    assert turn["yaw_deg"].iloc[-1] < -180  # a circle to the right
    weight, held = (table.filter(like="force_uN").sum(axis=1).mean() for table in (bare, gripping))
    assert weight == pytest.approx(10, rel=0.15)
    assert held > 5 * weight
    for reflex in ("retracts", "stumbles"):
        assert hybrid.filter(like=reflex).to_numpy().any()
        assert not gripping.filter(like=reflex).to_numpy().any()
    speeds = pd.read_csv(DOCS / "gallery" / "comparison.csv")
    medians = speeds.groupby(["terrain", "controller"])["speed_mm_s"].median()
    for terrain in ("gapped", "blocks", "mixed"):
        for other in ("cpg", "rule_based"):
            assert medians[terrain, "hybrid"] > 1.4 * medians[terrain, other]
    assert medians["flat"].idxmax() == "cpg"


def test_a_muscle_is_drawn_with_its_forces_and_what_they_add_up_to(tmp_path):
    save_profile(tmp_path / "pool.png", [0, 10, 30, 60])
    figure, table = muscle_plot(tmp_path / "pool.png")
    np.testing.assert_allclose(table["force"], [0, 10, 30, 60])
    np.testing.assert_allclose(table["tension"], [0.0, 0.1, 0.4, 1.0])
    strip, forces, curve = figure.axes
    assert strip.get_title(loc="left") == "pool.png: a pixel per motor neuron"
    assert forces.get_ylabel() == "255 - blue"
    np.testing.assert_allclose(curve.lines[0].get_ydata(), table["tension"])
    with pytest.raises(FileNotFoundError, match=r"none\.png"):
        muscle_plot(tmp_path / "none.png")
