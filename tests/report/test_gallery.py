"""The gallery page of the docs shows what can be drawn, as it is drawn now."""

import re
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from flyrl.report.controller_figures import adhesion_plot, rules_graph_plot
from flyrl.report.gallery import GALLERY
from flyrl.report.scene_figures import muscle_plot
from flyrl.resources import assets_folder

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "gallery.md").read_text()


@pytest.mark.parametrize("name", GALLERY)
def test_every_figure_is_on_the_page_with_the_command_that_draws_it(name):
    assert f"`flyrl figures {name}`" in PAGE
    shown = [path for path in named() if Path(path).stem == name]
    assert {Path(path).suffix for path in shown} & {".svg", ".png", ".mp4"}


def named():
    """Files that the page shows or links to, as paths from docs/."""
    return re.findall(r"[(\"](?:\.\./)?(gallery/[\w.]+)[)\"]", PAGE)


def test_what_the_page_shows_is_there_and_light():
    assert len(named()) > 30
    sizes = {path: (DOCS / path).stat().st_size for path in named()}
    assert sum(sizes.values()) < 6e6


def test_nothing_lies_there_that_the_page_does_not_show():
    hidden = (DOCS / "gallery" / ".gitignore").read_text().split()
    kept = {
        f"gallery/{path.name}"
        for path in (DOCS / "gallery").iterdir()
        if path.name not in hidden and path.suffix not in (".png", "") and path.name != ".gitignore"
    }
    assert kept <= set(named())


def test_every_video_has_a_poster_and_numbers():
    for mp4 in {path for path in named() if path.endswith(".mp4")}:
        assert {mp4.replace(".mp4", ".jpg"), mp4.replace(".mp4", ".csv")} <= set(named())


@pytest.mark.parametrize(
    ("name", "plot"),
    [
        ("adhesion", adhesion_plot),
        ("rules_graph", rules_graph_plot),
        ("muscle", partial(muscle_plot, assets_folder() / "muscles" / "human.png")),
    ],
)
def test_a_figure_still_shows_the_numbers_on_the_page(name, plot):
    shown = pd.read_csv(DOCS / "gallery" / f"{name}.csv")
    pd.testing.assert_frame_equal(plot().table, shown, check_dtype=False, rtol=1e-5)


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
