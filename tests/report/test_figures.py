import re

import numpy as np
import pandas as pd
import pytest

from flyrl.report.figures import (
    distributions_figure,
    doses_figure,
    outlines,
    success_figure,
    swarm,
)
from flyrl.report.style import colours, inline, svg_text, themed
from tests.report.conftest import NAMES, texts
from tests.synthetic import HORIZON_S, make_results


@pytest.fixture(scope="module")
def figures(text):
    """The figures of the page, by name: each has ids of its own."""
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
    # the same results make the same figure
    again = inline(svg_text(success_figure(results.summaries)), "success")
    assert again.strip() == figures["success"]


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
    figure = distributions_figure(many, "flat", HORIZON_S, ["time_to_goal_s", "speed_mm_s"])
    svg = inline(svg_text(figure), "many")
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


@pytest.mark.parametrize(("quantity", "values"), [("push", ("0", "8")), ("legs", ("none", "LF"))])
def test_doses_show_success_in_per_cent(quantity, values):
    varied = make_results(("target-ppo", "hybrid"), episodes=3, vary={"push": (0, 8)})
    labels = [f"{quantity}={value}" for value in values]
    for row in varied.summaries:
        row["condition"] = labels[row["condition"] == "push=8"]
    figure = doses_figure(varied.summaries, "flat", quantity, labels, ["success"])
    assert {"success (%)", "100", *values} <= set(texts(figure))
    rates = [row["success_rate"]["value"] for row in varied.summaries]
    lines = {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}
    np.testing.assert_allclose(lines["target-ppo"], 100 * np.array(rates[::2]))


def test_names_are_text_not_markup_nor_mathematics():
    results = make_results(("cpg", "hybrid"), episodes=2)
    for row in results.summaries:
        row["controller"] = row["controller"].replace("cpg", "<b>$x_1$&")
    assert "<b>$x_1$&" in texts(success_figure(results.summaries))


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
