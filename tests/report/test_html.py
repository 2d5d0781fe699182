import re
from collections import Counter
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from flyrl.evaluation.summary import summarise
from flyrl.report import write_report
from flyrl.report.html import format_report
from tests.report.conftest import NAMES, Page, film, gaited, texts
from tests.synthetic import make_results

OF_A_TERRAIN = {"distributions", "differences", "paths"}


@pytest.fixture(scope="module")
def few():
    """Results that are quickly reported."""
    return make_results(NAMES, episodes=2)


@pytest.fixture(scope="module")
def alone():
    return make_results(("hybrid",), episodes=1)


def test_every_terrain_has_its_page_and_every_link_its_target(page):
    pages = [attrs.get("id") for attrs in page.of("section") if attrs.get("class") == "page"]
    assert pages == ["summary", "flat", "gapped", "setup", "episodes", "method"]
    ids = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    links = {attrs["href"] for attrs in page.of("a")}
    assert {link for link in links if link[1:] not in ids} == {
        f"#episode={terrain}/{episode}" for terrain in ("flat", "gapped") for episode in range(8)
    }


def test_nothing_comes_from_elsewhere(page, text):
    keys = ("src", "href", "xlink:href", "action", "data", "poster")
    addresses = [attrs.get(key) or "" for _, attrs in page.tags for key in keys]
    assert not [address for address in addresses if re.match(r"(https?:)?//", address)]
    assert "@import" not in text
    assert not re.search(r"url\(\s*['\"]?(https?:)?//", text)


def test_ids_are_unique(page):
    ids = Counter(attrs["id"] for _, attrs in page.tags if "id" in attrs)
    # Matplotlib defines a marker once per panel, each time the same.
    assert all(re.search(r"-m[0-9a-f]{10}$", name) for name, count in ids.items() if count > 1)


def test_each_figure_is_a_file_that_is_whole_and_knows_no_page(report, page):
    files = {path.stem: path.read_text() for path in (report.parent / "figures").iterdir()}
    assert set(files) == {
        *(f"{name}-{terrain}" for name in OF_A_TERRAIN for terrain in ("flat", "gapped")),
        *("success", "gait-flat", "time-flat-0", "drive-map", "steering", "learning-curves"),
    }
    assert len(page.of("svg")) == len(files) + 1  # the control loop
    for svg in files.values():
        assert "var(" not in svg
        root = ET.fromstring(svg)
        assert root.get("width").endswith("pt")
        assert not root.findall(".//{*}a")


def test_a_report_stands_where_nothing_can_be_written_beside_it(alone, tmp_path, capsys):
    (tmp_path / "figures").write_text("in the way")
    assert write_report(alone, tmp_path).exists()
    assert "lacks figures or tables beside it" in capsys.readouterr().err


def test_a_report_with_conditions_names_them_wherever_it_ranks():
    """The better one is no better with a push, since nobody gets anywhere."""
    vary = {"push": (0, 8)}
    results = make_results(("cpg", "target-ppo"), episodes=6, vary=vary, reference="cpg")
    rows = results.episodes.copy()
    is_pushed = rows["condition"] == "push=8"
    rows["outcome"] = rows["outcome"].astype(str).mask(is_pushed, "fall").astype("category")
    rows["success"] &= ~is_pushed
    rows["time_to_goal_s"] = rows["time_to_goal_s"].mask(is_pushed)
    summary = summarise(rows, results.protocol, np.random.default_rng(0))
    text = format_report(replace(results, episodes=rows, summaries=summary))
    words = Page(text).words
    assert "With nothing changed (push=0): target-ppo is best on flat." in words
    assert "the leaders are the same under 0 of 1 on flat" in words
    table = text[text.index('<table id="conditions">') :]
    usual, pushed = re.findall(r"<tr>\s*<td>(push=\d.*?)</tr>", table, re.DOTALL)[:2]
    assert ("target-ppo" in usual, "cpg" in usual.split("range")[0]) == (True, False)
    assert "target-ppo" in pushed and "cpg" in pushed and "success: 0" in pushed
    success, doses = re.findall(r"<figure>\s*(<svg.*?</svg>)", text, re.DOTALL)
    assert "nothing changed (push=0)" in success
    assert "success (%)" in texts(doses)
    assert "Force sideways after 1 s, µN" in words
    table = text[text.index('id="interactions-flat"') :]
    cells = re.findall(r"<td.*?</td>", table[: table.index("</table>")], re.DOTALL)
    assert "push=8" in cells[1]
    # all that it was better by is lost
    assert f'data-value="{-summary[1]["success_rate"]["value"]}"' in cells[2]


def test_no_text_of_a_stranger_becomes_an_element(hostile_report, page):
    text = hostile_report.read_text(encoding="utf-8")
    hostile = Page(text)
    assert {tag for tag, _ in hostile.tags} <= {tag for tag, _ in page.tags} - {"img", "b"}
    assert len(hostile.of("script")) == len(page.of("script"))
    attributes = {name for _, attrs in hostile.tags for name in attrs}
    assert not [name for name in attributes if name.startswith("on")]
    assert any("{{ 7 * 7 }}" in each for each in hostile.texts)
    assert not re.search("[\x00-\x08\x0b-\x1f\u202a-\u202e\ud800-\udfff]", text)


def test_files_beside_a_report_stay_in_their_folders(hostile_report):
    above = hostile_report.parent.parent
    files = {path.relative_to(above) for path in above.rglob("*") if path.is_file()}
    assert {str(path.parent) for path in files} == {"report", "report/figures", "report/tables"}
    for path in (hostile_report.parent / "figures").iterdir():
        tags = {element.tag for element in ET.parse(path).iter()}
        assert not [tag for tag in tags if tag.endswith(("script", "img"))]


@pytest.mark.parametrize(
    "words",
    [
        "flyrl-evaluate policies=[runs/target-ppo] episodes=20 note='<b>&'",
        "Preset balanced, version 2",
        "Differences under 5 % in success",
        "success thorax within 1 mm of the target",
        "failure fall, left arena, unstable",
        "time limit 3 s",
        "progress 0.2 mm closer to the target",
        "target_direction 2 cos and sin of the target's bearing",
        "ppo 102400 7 learning_rate 0.0006, hidden_layers [64, 64], num_envs 32",
        "mean over 4 starts",
        "displacement ÷ path length",  # path_efficiency
        "filled dot: success; ring: time out; cross: fall; triangle: left arena",
        "Dark rings: goals.",
        "tarsi while the leg grips",
        "tibia while the retraction reflex corrects it",
    ],
)
def test_a_report_says(page, words):
    assert words in page.words


def test_attributes_hold_hashes_and_what_metrics_mean_and_how_sure_differences_are(page, text):
    assert "0123456789abcdef" * 4 in [attrs.get("title") for attrs in page.of("code")]
    headings = [attrs.get("title", "") for attrs in page.of("th")]
    assert any("work of the servos" in text for text in headings)
    # nobody has a duty factor
    assert not any("leg stands" in text for text in [*headings, page.words])
    assert re.search(r"better in \d+ % of the episodes.*corrected 0\.\d+; d = ", text)


def test_the_loop_has_the_parts_of_the_body(text, other):
    """That of a worm is in test_wording."""
    for report, actuators in ((text, "servos"), (other, "muscles")):
        loop = f"policy, leg controller, {actuators}, body and ground, and senses back"
        assert f'aria-label="Control loop: {loop} to the policy"' in report


def test_rough_ground_is_drawn_below_the_paths(text):
    _, flat, gapped = text.split("<h3>Paths</h3>")
    assert "<image" not in flat and "moved to start at the origin" in flat
    assert "<image" in gapped and "gaps are bare" in gapped


def test_the_matrix_shows_where_a_policy_was_trained(results, page):
    cells = [attrs for _, attrs in page.tags if "--share" in attrs.get("style", "")]
    own = [row for row in results.summaries if row["controller"] == "target-ppo"]
    rates = [row["success_rate"]["value"] for row in own]
    assert [cell["style"] for cell in cells] == [f"--share: {rate}" for rate in rates]
    assert [cell["class"] for cell in cells] == ["shade", "shade home"]


@pytest.fixture(scope="module")
def other(few):
    """Text of a report without videos or paths: of three seeds of a training, one with a curve."""
    crash = {"controller": "mine", "terrain": "flat", "condition": "push=8"}
    training = {"algo": "ppo", "settings": {}}
    learned = {"kind": "learned", "training": training, "policy": "learned with ppo"}
    protocol = {
        **few.protocol,
        "crashes": [{**crash, "error": "KeyError: '<nothing>'"}],
        "entrants": [{**entrant, **learned} for entrant in few.protocol["entrants"]],
        "body": {"muscles": {"force": 1}},
    }
    with_reflexes = gaited("cpg")
    with_reflexes.gait.retraction[10:20, 2] = True
    return format_report(
        replace(few, protocol=protocol, trajectories={}),
        examples=[with_reflexes],
        curves={"cpg": [{"decisions": 100.0, "success_rate": 0.5, "mean_return": 1.0}]},
        note="Videos are left out: no GL.",
    )


def test_sections_stand_where_they_have_content(text, other):
    for heading in ("Over seeds", "Who is missing", "its retraction reflex"):
        assert heading not in text and heading in other
    assert "as published" not in text
    assert "<h3>Paths</h3>" not in other and "<video" not in other
    assert "Videos are left out: no GL." in Page(other).texts
    # curves without a video, and nothing to play
    assert (other.count('class="run-along"'), other.count("<input")) == (1, 0)
    assert "2 pairs: an interval needs at least 5" in other
    assert "mine on flat (push=8) raised <code>KeyError: &#39;&lt;nothing&gt;&#39;</code>" in other
    assert f'title="{", ".join(NAMES)}">learned with ppo</td>\n<td>3</td>' in other
    assert "success of at least (%)" in other
    assert "learned with ppo, n = 1" in other  # the others have no curve


def test_the_reason_why_an_episode_was_chosen_stands_with_its_video(few):
    protocol = {**few.protocol, "film": {"flat": {"episode": 0}}}
    words = Page(format_report(replace(few, protocol=protocol), videos=[film("cpg")])).words
    assert words.index("Episode 0: the first, since") < words.index("Everybody on episode 0")


def test_a_report_leads_with_where_the_learned_one_alone_succeeds(few):
    other, first = "cpg", few.summaries[0]["controller"]
    pair = {"controller": first, "reference": other, "episode": 0}
    chosen = {
        "flat": {**pair, "metric": "speed_mm_s", "values": [2.0, 1.0]},
        "mixed": {**pair, "metric": "success", "values": [1.0, 0.0]},
    }
    films = [film(name, terrain) for terrain in chosen for name in (other, first)]
    page = format_report(replace(few, protocol={**few.protocol, "film": chosen}), videos=films)
    summary, *grounds = page.split('<section class="page"')[1:4]
    assert f"On mixed. Episode 0: the first in which {first} " in summary
    assert summary.index(f"></span>{first} ") < summary.index(f"></span>{other} ")
    # those on flat stay there, and nothing is embedded twice
    assert [part.count("<video") for part in (summary, *grounds)] == [2, 2, 0]


def test_a_published_study_stands_beside_ours():
    names = ("cpg", "rule_based", "hybrid")
    results = make_results(names, ("flat", "gapped"), episodes=8, study="controller_comparison")
    text = format_report(results)
    assert "hybrid walks further than rule_based on gapped" in text
    # nobody walked on mixed
    assert re.search(
        r"hybrid walks further than cpg on mixed</td>\s*<td[^>]*></td>\s*<.*>not tested<", text
    )
    assert "13.8, 4.20, 4.00, 2.90" in Page(text).words


def test_one_controller_alone_gives_a_report_also_of_results_from_before_tasks_had_tables(alone):
    old = replace(alone, protocol={k: v for k, v in alone.protocol.items() if k != "table"})
    text = format_report(old)
    assert "Compared with" not in text
    assert "Task and policies" in text
