import re

import numpy as np
import pandas as pd
import pytest

from flyrl.report.figures import (
    distributions_figure,
    doses_figure,
    outlines,
    paired_figure,
    success_figure,
    swarm,
)
from flyrl.report.style import THEME, colours, stylesheet, themed
from tests.report.conftest import NAMES, texts
from tests.synthetic import HORIZON_S, make_results


@pytest.fixture(scope="module")
def figures(report):
    """The figures of the page, by name: each has ids of its own."""
    text = report.read_text(encoding="utf-8")
    svgs = re.findall(r'<svg viewBox="[^"]*" xmlns.*?</svg>', text, re.DOTALL)
    return {re.search(r'id="(.*?)-figure_1"', svg)[1]: svg for svg in svgs}


def test_every_figure_scales_with_the_page_and_takes_its_colours_from_it(figures):
    assert len(figures) == 12
    for svg in figures.values():
        assert texts(svg)
        assert "width" not in svg.split(">", 1)[0]
        light = re.findall(r"(?<!, )#[0-9a-f]{6}", svg)
        assert light == []  # no colour of its own but as what stands in where there is no page


def test_every_reference_inside_a_figure_has_its_target(figures):
    for svg in figures.values():
        targets = set(re.findall(r'\bid="([^"]+)"', svg))
        references = re.findall(r'<use href="#([^"]+)"', svg) + re.findall(r"url\(#([^)]+)", svg)
        assert references
        assert set(references) <= targets


def test_controllers_and_counts_are_named(results, figures):
    assert set(NAMES) <= set(texts(figures["success"]))
    assert set(NAMES) - {"hybrid"} <= set(texts(figures["differences-flat"]))
    row = results.summaries[0]
    assert f"{row['successes']}/{row['episodes']}" in texts(figures["success"])


def test_a_dot_leads_to_its_episode(figures):
    links = re.findall(r'<a href="([^"]+)"', figures["distributions-flat"])
    metrics = 3
    assert len(links) == metrics * len(NAMES) * 8
    for episode in range(8):
        assert links.count(f"#episode=flat/{episode}") == metrics * len(NAMES)
    for terrain in ("flat", "gapped"):
        links = re.findall(r'<a href="([^"]+)"', figures[f"paths-{terrain}"])
        assert set(links) == {f"#episode={terrain}/{episode}" for episode in range(8)}


def test_many_episodes_are_outlined_in_colours_of_the_page(results):
    many = pd.concat([results.episodes] * 70)
    svg = distributions_figure(many, "flat", HORIZON_S, ["time_to_goal_s", "speed_mm_s"])
    assert "<image" not in svg  # pixels do not follow the theme
    assert "<a href" not in svg
    assert len(svg) < 200_000
    for colour in colours(NAMES).values():
        assert f"fill: {themed(colour)}" in svg


def test_an_outline_is_as_high_as_the_root_of_its_episodes():
    values = np.array([0.5, 0.5, 0.5, 0.5, 1.5])
    is_success = np.array([True, False, False, False, True])
    whole, successes = outlines(values, is_success, np.array([0.0, 1.0, 2.0, 3.0]))
    np.testing.assert_allclose(whole, [0.32, 0.16, np.nan])
    np.testing.assert_allclose(successes, [0.08, 0.16, np.nan])


@pytest.mark.parametrize(
    ("vary", "labels"),
    [({"push": (0, 8)}, ["push=0", "push=8"]), ({"legs": ("none", "LF")}, ["legs=none"])],
)
def test_doses_show_success_in_per_cent(vary, labels):
    varied = make_results(("target-ppo", "hybrid"), episodes=3, vary={"push": (0, 8)})
    if "legs" in vary:  # what cannot be ordered stands side by side
        for row in varied.summaries:
            row["condition"] = "legs=none"
    shown = texts(doses_figure(varied.summaries, "flat", "push", labels, ["success"]))
    assert {"success (%)", "100", *(label.split("=")[1] for label in labels)} <= set(shown)


def test_same_results_same_figure(results, figures):
    assert success_figure(results.summaries).strip() == figures["success"]


def test_names_are_text_not_markup_nor_mathematics():
    results = make_results(("cpg", "hybrid"), episodes=2)
    for row in results.summaries:
        row["controller"] = row["controller"].replace("cpg", "<b>$x_1$&")
    assert "<b>$x_1$&" in texts(success_figure(results.summaries))


def test_no_comparison_no_paired_figure():
    results = make_results(("hybrid",), episodes=2)
    assert paired_figure(results.episodes, results.summaries, "flat", HORIZON_S) == ""


def test_swarm_spreads_equal_values_evenly_and_leaves_lonely_ones():
    np.testing.assert_array_equal(swarm(np.array([0.0, 5.0, 10.0])), 0)
    offsets = swarm(np.array([2.0, 2.0, 2.0]))
    np.testing.assert_allclose(np.diff(np.sort(offsets)), 0.09)
    assert offsets.sum() == pytest.approx(0)
    assert np.abs(swarm(np.zeros(1000))).max() <= 0.32  # within its row


def test_fixed_controllers_keep_their_colour_in_any_company():
    chosen = colours(["ppo", "sac", "cpg", "rule_based", "hybrid", "pursuit", "zero"])
    assert chosen["hybrid"] == colours(["hybrid"])["hybrid"]
    assert len(set(chosen.values())) == len(chosen)


def test_colours_of_the_theme_become_variables_with_light_and_dark_values():
    assert themed("stroke: #1d232b; fill: #ff0000") == "stroke: var(--ink, #1d232b); fill: #ff0000"
    light, dark = stylesheet().split("prefers-color-scheme: dark", 1)
    for name, values in THEME.items():
        assert f"--{name}: {values[0]}" in light
        assert f"--{name}: {values[1]}" in dark
