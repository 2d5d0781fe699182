import xml.etree.ElementTree as ET

import numpy as np
import pytest

from flyrl.evaluation.drive_map import DriveMap
from flyrl.report.exports import named_figures, standalone
from flyrl.report.html import report_context
from tests.report.test_close_up import walked
from tests.synthetic import make_results

LINK = "{http://www.w3.org/1999/xlink}href"
PAGE_FIGURE = (
    '<svg viewBox="0 0 691.2 72" xmlns="http://www.w3.org/2000/svg" role="img">'
    '<defs><path id="dot" d="M 0 0"/></defs>'
    '<a href="#episode-3"><use href="#dot" style="fill: var(--c0, #2563c9); opacity: 0.5"/></a>'
    "<text>a &amp; b</text></svg>"
)


@pytest.fixture(scope="module")
def figures():
    drives = np.linspace(-0.5, 1.5, 3)
    left, right = np.meshgrid(drives, drives, indexing="ij")
    results = make_results(("cpg", "hybrid"), episodes=5)
    context = report_context(
        results,
        examples=[walked("cpg")],
        drive_map=DriveMap(drives, left + right, right - left),
    )
    return named_figures(context)


def test_a_file_knows_no_page():
    svg = ET.fromstring(standalone(PAGE_FIGURE))
    assert (svg.get("width"), svg.get("height")) == ("691.2pt", "72pt")
    use = svg.find("{*}use")  # not within a link
    assert use.get(LINK) == "#dot"
    assert use.get("style") == "fill: #2563c9; opacity: 0.5"
    assert svg.findtext("{*}text") == "a & b"


def test_what_has_no_size_is_no_figure():
    with pytest.raises(ValueError, match="view box"):
        standalone("<svg></svg>")


def test_figures_have_plain_names(figures):
    assert set(figures) == {
        "success",
        "paths-flat",
        "time-flat-0",
        "gait-flat",
        "distributions-flat",
        "differences-flat",
        "drive-map",
    }


def test_doses_and_profiles_have_plain_names():
    context = {
        "success_svg": "success",
        "terrains": [{"name": "flat", "doses": [{"name": "push", "figure": "doses"}]}],
        "seeds": {"profiles": "profiles"},
        "drive_map": "",
        "steering": "",
        "curves": "curves",
    }
    assert named_figures(context) == {
        "success": "success",
        "doses-flat-push": "doses",
        "profiles": "profiles",
        "learning-curves": "curves",
    }


def test_every_figure_becomes_a_file_that_is_whole(figures):
    for name, svg in figures.items():
        text = standalone(svg)
        assert "var(" not in text
        root = ET.fromstring(text)
        assert root.get("width").endswith("pt")
        ids = {element.get("id") for element in root.iter()}
        used = [element.get(LINK, "#") for element in root.iter("{*}use")]
        assert all(link[1:] in ids for link in used), name
