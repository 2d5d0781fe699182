import re
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest

from flyrl.evaluation.results import trajectory
from flyrl.evaluation.statistics import Interval
from flyrl.report.figures import (
    distributions_figure,
    doses_figure,
    outlines,
    paired_figure,
    profiles_figure,
    success_figure,
    swarm,
)
from flyrl.report.paths import Walk, aligned_figure, ground_figure
from flyrl.report.style import colours
from flyrl.terrains import Gapped
from tests.synthetic import HORIZON_S, make_results, walk

NAMES = ("target-ppo", "cpg", "hybrid", "zero")


@pytest.fixture(scope="module")
def results():
    return make_results(NAMES, terrains=("flat", "gapped"), episodes=6)


@pytest.fixture(scope="module")
def figures(results):
    gapped = Gapped()

    def walks(terrain):
        records = {name: [walk(name, terrain, i) for i in range(4)] for name in NAMES}
        return {
            name: [Walk(r.index, trajectory(r), r.episode.goal, r.outcome) for r in own]
            for name, own in records.items()
        }

    return {
        "success": success_figure(results.summaries),
        "distributions": distributions_figure(
            results.episodes, "flat", HORIZON_S, ["time_to_goal_s", "speed_mm_s", "return"]
        ),
        "paired": paired_figure(results.episodes, results.summaries, "flat", HORIZON_S),
        "aligned": aligned_figure(walks("flat"), "flat"),
        "ground": ground_figure(walks("gapped"), gapped, gapped.compiled()),
    }


KINDS = ("success", "distributions", "paired", "aligned", "ground")


def texts(svg):
    return ["".join(node.itertext()).strip() for node in ET.fromstring(svg).iter() if is_text(node)]


def is_text(node):
    return node.tag.endswith("}text")


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_is_one_well_formed_svg(figures, kind):
    assert ET.fromstring(figures[kind]).tag == "{http://www.w3.org/2000/svg}svg"


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_names_its_controllers(figures, kind):
    expected = [name for name in NAMES if kind != "paired" or name != "hybrid"]
    assert set(expected) <= set(texts(figures[kind]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_scales_with_the_page(figures, kind):
    head = figures[kind].split(">", 1)[0]
    assert "viewBox" in head
    assert "width" not in head


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_takes_its_colours_from_the_page(figures, kind):
    svg = figures[kind]
    assert "var(--ink" in svg
    assert "#01fe" not in svg.lower()  # no marker colour is left
    assert "#ffffff" not in svg.lower()  # no background of its own


def test_ids_of_different_figures_differ(figures):
    ids = [re.findall(r'\bid="([^"]+)"', svg) for svg in figures.values()]
    together = [name for names in ids for name in set(names)]
    assert len(together) == len(set(together))


@pytest.mark.parametrize("kind", KINDS)
def test_every_reference_inside_a_figure_has_its_target(figures, kind):
    svg = figures[kind]
    targets = set(re.findall(r'\bid="([^"]+)"', svg))
    references = re.findall(r'<use href="#([^"]+)"', svg) + re.findall(r"url\(#([^)]+)\)", svg)
    assert references
    assert set(references) <= targets


def test_a_dot_leads_to_its_episode(results, figures):
    links = re.findall(r'<a href="([^"]+)"', figures["distributions"])
    metrics = 3
    for episode in range(6):
        assert links.count(f"#episode=flat/{episode}") == metrics * len(NAMES)
    assert len(links) == metrics * len(NAMES) * 6


def test_the_end_of_a_path_leads_to_its_episode(figures):
    for kind, terrain in (("aligned", "flat"), ("ground", "gapped")):
        links = re.findall(r'<a href="([^"]+)"', figures[kind])
        assert set(links) == {f"#episode={terrain}/{episode}" for episode in range(4)}


def test_many_episodes_are_outlined_in_colours_of_the_page(results):
    many = pd.concat([results.episodes] * 70)
    svg = distributions_figure(many, "flat", HORIZON_S, ["time_to_goal_s", "speed_mm_s"])
    assert "<image" not in svg  # pixels do not follow the theme
    assert "<a href" not in svg
    assert len(svg) < 200_000
    for colour in colours(NAMES).values():
        assert f"fill: var(--{colour}," in svg


def test_an_outline_is_as_high_as_the_root_of_its_episodes():
    values = np.array([0.5, 0.5, 0.5, 0.5, 1.5])
    is_success = np.array([True, False, False, False, True])
    whole, successes = outlines(values, is_success, np.array([0.0, 1.0, 2.0, 3.0]))
    np.testing.assert_allclose(whole, [0.32, 0.16, np.nan])
    np.testing.assert_allclose(successes, [0.08, 0.16, np.nan])


def test_doses_tell_success_in_per_cent():
    varied = make_results(("target-ppo", "hybrid"), episodes=3, vary={"push": (0, 8)})
    labels = ["push=0", "push=8"]
    shown = texts(doses_figure(varied.summaries, "flat", "push", labels, ["success"]))
    assert "success (%)" in shown
    assert {"0", "100"} <= set(shown)


def test_profiles_are_as_wide_as_other_figures(figures):
    svg = profiles_figure({"ppo": [Interval(0.5, 0.25, 0.75, 5)] * 2}, [0.0, 1.0])
    widths = {re.search(r'viewBox="0 0 (\S+)', each)[1] for each in (svg, figures["success"])}
    assert len(widths) == 1
    assert {"0", "100", "success of at least (%)"} <= set(texts(svg))


def test_titles_of_paths_are_not_cut_off():
    record = walk("cpg", "flat", 0)
    own = Walk(0, trajectory(record), record.episode.goal, record.outcome)
    svg = ET.fromstring(aligned_figure({"cpg": [own]}, "flat"))
    (title,) = (node for node in svg.iter() if is_text(node) and node.text.strip() == "cpg")
    assert float(title.get("y")) > 9  # its baseline; a line has 10 points


def test_same_results_same_figure(results, figures):
    assert success_figure(results.summaries) == figures["success"]


def test_success_shows_counts(results, figures):
    row = results.summaries[0]
    assert f"{row['successes']}/{row['episodes']}" in texts(figures["success"])


def test_names_are_text_not_markup_nor_mathematics():
    results = make_results(("cpg", "hybrid"), episodes=2)
    for row in results.summaries:
        row["controller"] = row["controller"].replace("cpg", "<b>$x_1$&")
    assert "<b>$x_1$&" in texts(success_figure(results.summaries))


def test_no_comparison_no_paired_figure():
    results = make_results(("hybrid",), episodes=2)
    assert paired_figure(results.episodes, results.summaries, "flat", HORIZON_S) == ""


def test_swarm_keeps_lonely_dots_on_the_line():
    np.testing.assert_array_equal(swarm(np.array([0.0, 5.0, 10.0])), 0)


def test_swarm_spreads_equal_values_evenly():
    offsets = swarm(np.array([2.0, 2.0, 2.0]))
    np.testing.assert_allclose(np.diff(np.sort(offsets)), 0.09)
    assert offsets.sum() == pytest.approx(0)


def test_swarm_stays_within_its_row():
    assert np.abs(swarm(np.zeros(1000))).max() <= 0.32
