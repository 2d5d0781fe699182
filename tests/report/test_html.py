import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest

from flyrl.evaluation.drive_map import DriveMap
from flyrl.evaluation.metrics import metric_label
from flyrl.evaluation.statistics import Interval
from flyrl.evaluation.summary import Leader, summarise
from flyrl.report import Video, write_report
from flyrl.report.html import format_report
from flyrl.report.sections import terrain_section
from flyrl.report.wording import (
    changes_text,
    effects_text,
    format_number,
    headline,
    held_out_text,
    leader_cells,
    level_text,
    rates,
    shared_text,
    signed,
    training_note,
)
from tests.report.hostile import hostile_results
from tests.report.test_close_up import walked
from tests.synthetic import make_results

NAMES = ("target-ppo", "cpg", "hybrid", "pursuit", "zero")
VOID = {"meta", "link", "br", "hr", "img", "input", "source"}


class Page(HTMLParser):
    """Collects what a test asks for, and checks that every tag is closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.texts = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    def count(self, tag):
        return sum(name == tag for name, _ in self.tags)


@pytest.fixture(scope="module")
def results():
    return make_results(NAMES, terrains=("flat", "gapped"), episodes=8)


@pytest.fixture(scope="module")
def few():
    """Results that are quickly reported."""
    return make_results(NAMES[:3], episodes=2)


@pytest.fixture(scope="module")
def text(results):
    return format_report(results, note="Videos are left out: no GL.")


def test_the_report_says_which_preset_of_the_physics(text):
    assert "Preset balanced, version 2" in text


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


def test_every_tag_is_closed(page):
    assert page.count("html") == 1


def test_every_controller_is_in_the_summary_table(page):
    values = [attrs.get("data-value") for tag, attrs in page.tags if tag == "td"]
    assert set(NAMES) <= set(values)


def test_every_terrain_has_its_page(page):
    pages = [attrs.get("id") for tag, attrs in page.tags if attrs.get("class") == "page"]
    assert pages == ["summary", "flat", "gapped", "setup", "episodes", "method"]


def test_every_link_has_its_target(page):
    ids = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    links = [attrs["href"] for tag, attrs in page.tags if tag == "a"]
    assert links
    assert {link for link in links if link[1:] not in ids} == {
        f"#episode={terrain}/{episode}" for terrain in ("flat", "gapped") for episode in range(8)
    }


def test_figures_stand_inside_the_page(page):
    # success and the control loop once, then distributions, pairs and paths per terrain
    assert page.count("svg") == 2 + 3 * 2
    assert page.count("img") == 0


def test_nothing_comes_from_elsewhere(page, text):
    for _, attrs in page.tags:
        for key in ("src", "href", "xlink:href", "action", "data", "poster"):
            assert not re.match(r"(https?:)?//", attrs.get(key) or "")
    assert "@import" not in text
    assert not re.search(r"url\(\s*['\"]?(https?:)?//", text)


def test_ids_are_unique(page):
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    defined_twice = {name for name in ids if ids.count(name) > 1}
    # Matplotlib defines a marker once per panel, each time the same.
    assert all(re.search(r"-m[0-9a-f]{10}$", name) for name in defined_twice)


def lead(terrain, *names):
    return Leader(terrain, names, "success", 1.0)


@pytest.mark.parametrize(
    ("leaders", "sentence"),
    [
        ([lead("flat", "a")], "a is best on flat."),
        ([lead("flat", "a"), lead("mixed", "b")], "a is best on flat; b is best on mixed."),
        (
            [lead("flat", "a", "b"), lead("blocks", "a"), lead("mixed", "a")],
            "a and b are level at the top on flat; a is best on blocks and mixed.",
        ),
        (
            [lead("flat", "a", "b"), lead("mixed", "b", "a")],
            "a and b are level at the top on flat and mixed.",
        ),
        ([lead("flat", "a", "b", "c")], "No meaningful difference between controllers on flat."),
    ],
)
def test_the_headline_says_who_wins_where(leaders, sentence):
    assert headline(leaders, 3) == sentence


def test_the_headline_names_its_condition():
    assert headline([lead("flat", "a")], 2, "missing_legs=none").startswith(
        "With missing_legs=none"
    )


def test_the_headline_says_how_often_other_conditions_agree():
    leaders = [
        replace(lead(terrain, *names), condition=condition)
        for terrain, condition, *names in (
            ("blocks", "push=8", "a", "b"), ("blocks", "push=0", "a"), ("blocks", "push=4", "a"),
            ("flat", "push=0", "a", "b"), ("flat", "push=8", "b", "a"),
        )
    ]  # fmt: skip
    assert changes_text(leaders, "push=0") == (
        "Of the other conditions, the leaders are the same under 1 of 2 on blocks and 1 of 1 on "
        "flat."
    )
    assert changes_text(leaders[1:2], "push=0") == ""


def test_the_headline_names_the_smallest_effects_in_force():
    protocol = {"smallest_effects": {"success": 0.05, "time_to_goal_s": 0.1, "recruited_share": 0}}
    metrics = ("success", "time_to_goal_s", "recruited_share")
    labels = {metric: metric_label(metric) for metric in metrics}
    assert level_text(effects_text(metrics, labels, protocol)) == (
        "Differences under 5\u00a0% in success or 0.1\u00a0s in time to goal count as none."
    )
    assert level_text("") == ""


@pytest.fixture(scope="module")
def varied():
    """Results in which the better one is no better with a push, since nobody gets anywhere."""
    vary = {"push": (0, 8)}
    results = make_results(("cpg", "target-ppo"), episodes=6, vary=vary, reference="cpg")
    rows = results.episodes.copy()
    is_pushed = rows["condition"] == "push=8"
    rows["outcome"] = rows["outcome"].astype(str).mask(is_pushed, "fall").astype("category")
    rows["success"] &= ~is_pushed
    rows["time_to_goal_s"] = rows["time_to_goal_s"].mask(is_pushed)
    summary = summarise(rows, results.protocol, np.random.default_rng(0))
    return replace(results, episodes=rows, summaries=summary)


def test_a_report_with_conditions_names_them_wherever_it_ranks(varied):
    text = format_report(varied)
    words = " ".join(Page(text).texts)
    assert "With nothing changed (push=0): target-ppo is best on flat." in words
    assert "the leaders are the same under 0 of 1 on flat" in words
    table = text[text.index('<table id="conditions">') :]
    usual, pushed = re.findall(r"<tr><td>(push=\d.*?)</tr>", table, re.DOTALL)[:2]
    assert ("target-ppo" in usual, "cpg" in usual.split("range")[0]) == (True, False)
    assert "target-ppo" in pushed and "cpg" in pushed and "success: 0" in pushed
    (figure,) = re.findall(r"<figure>\s*(<svg.*?</svg>)", text, re.DOTALL)[:1]
    assert "nothing changed (push=0)" in figure


def test_a_report_with_conditions_holds_the_interactions(varied):
    text = format_report(varied)
    table = text[text.index('id="interactions-flat"') :]
    cells = re.findall(r"<td.*?</td>", table[: table.index("</table>")], re.DOTALL)
    rate = varied.summaries[1]["success_rate"]["value"]
    assert "push=8" in cells[1]
    assert f'data-value="{-rate}"' in cells[2]  # all that it was better by is lost


def test_training_seeds_are_counted_with_a_caution_at_one():
    entrant = {"kind": "learned", "policy": "learned with ppo", "training": {"settings": {}}}
    both = [{**entrant, "name": name} for name in ("a", "b")]
    assert training_note({"entrants": both}) == "Learned with ppo: 2 training seeds."
    assert "1 training seed (other seeds" in training_note({"entrants": both[:1]})


def test_nothing_is_claimed_of_an_unknown_training():
    known = {"name": "a", "kind": "learned", "training": {"settings": {"seed": 1}}}
    unknown = {"name": "b", "kind": "own"}
    assert held_out_text({"entrants": [known, unknown]}) == (
        "As recorded, a trained in flyrl, on episodes of other seeds. Nothing is recorded of the "
        "episodes that b may know."
    )


def test_a_task_without_a_target_has_no_same_target():
    assert (
        shared_text({}, {"flat": [{"goal": [], "command": [1, 2]}]}) == "same start, same command"
    )


def test_a_controller_alone_wins_nothing():
    assert headline([lead("flat", "a")], 1) == "a on flat."


def test_a_lead_is_told_with_its_interval():
    difference = Interval(-0.25, -0.5, -0.125, 9)
    leader = Leader("flat", ("a",), "time_to_goal_s", 1.0, "b", 1.25, difference)
    assert leader_cells(leader) == {
        "value": "1.00", "next": "1.25", "difference": "\u22120.25 [\u22120.50, \u22120.12]"
    }  # fmt: skip


def test_a_lead_in_success_is_told_in_per_cent():
    leader = Leader("flat", ("a",), "success", 0.5, "b", 0.25, Interval(0.25, 0.125, 0.5, 9))
    assert leader_cells(leader) == {
        "value": "50.0\u00a0%", "next": "25.0\u00a0%", "difference": "+25.0 [+12.5, +50.0]"
    }  # fmt: skip


def test_rates_count_episodes(results):
    text = rates(results.summaries, results.protocol)
    flat, gapped = (
        next(
            row
            for row in results.summaries
            if row["controller"] == "target-ppo" and row["terrain"] == terrain
        )
        for terrain in ("flat", "gapped")
    )
    first, second = text.split(" and ", 1)
    assert first.startswith(f"target-ppo succeeds in {flat['successes']} of 8 episodes on flat (")
    assert second.startswith(f"{gapped['successes']} of 8 episodes on gapped (")
    assert text.count("95\u00a0% interval") == 4
    assert "Best of the others is pursuit, in " in text


def test_without_a_learned_policy_the_best_controller_is_spoken_of():
    results = make_results(("cpg", "hybrid", "pursuit"), episodes=8)
    assert rates(results.summaries, results.protocol).startswith("pursuit succeeds")


def test_the_command_is_shown_and_escaped(page, text):
    assert "flyrl-evaluate policies=[runs/target-ppo] episodes=20 note='<b>&'" in page.texts
    assert "<b>&'" not in text


def test_names_are_escaped():
    results = make_results(("cpg", "hybrid"), episodes=2)
    evil = "<script>alert(1)</script>"
    results.episodes["controller"] = (
        results.episodes["controller"].astype(str).str.replace("cpg", evil)
    )
    for row in results.summaries:
        row["controller"] = row["controller"].replace("cpg", evil)
    for entrant in results.protocol["entrants"]:
        entrant["name"] = entrant["name"].replace("cpg", evil)
    text = format_report(results)
    assert evil not in text
    assert evil in Page(text).texts


@pytest.fixture(scope="module")
def hostile_report(tmp_path_factory):
    return write_report(hostile_results(), tmp_path_factory.mktemp("hostile") / "report")


def test_no_text_of_a_stranger_becomes_an_element(hostile_report):
    text = hostile_report.read_text(encoding="utf-8")
    page, plain = Page(text), Page(format_report(make_results(NAMES[:3], episodes=2)))
    shown = {tag for tag, _ in page.tags}
    assert shown - {tag for tag, _ in plain.tags} <= {"ul", "li"}  # those of a crash
    assert page.count("script") == plain.count("script")
    attributes = {name for _, attrs in page.tags for name in attrs}
    assert not [name for name in attributes if name.startswith("on")]
    assert any("{{ 7 * 7 }}" in each for each in page.texts)
    assert not re.search("[\x00-\x08\x0b-\x1f\u202a-\u202e\ud800-\udfff]", text)


def test_files_beside_a_report_stay_in_their_folders(hostile_report):
    files = {path.relative_to(hostile_report.parent.parent) for path in
             hostile_report.parent.parent.rglob("*") if path.is_file()}  # fmt: skip
    assert {str(path.parent) for path in files} == {"report", "report/figures", "report/tables"}
    for path in (hostile_report.parent / "figures").iterdir():
        tags = {element.tag for element in ElementTree.parse(path).iter()}
        assert not [tag for tag in tags if tag.endswith(("script", "img"))]


def test_policies_are_named_with_their_hashes(page):
    titles = [attrs.get("title") for tag, attrs in page.tags if tag == "code"]
    assert "0123456789abcdef" * 4 in titles


def test_a_missing_interval_is_explained():
    results = make_results(("cpg", "hybrid"), episodes=3)
    assert "3 pairs: an interval needs at least 5" in format_report(results)


def test_without_videos_the_note_says_why(page):
    assert page.count("video") == page.count("input") == 0
    assert any("no GL" in text for text in page.texts)


def test_videos_are_carried_along():
    results = make_results(("cpg", "hybrid"), episodes=2)
    videos = [
        Video("cpg", "flat", 1, "left_arena", 31, 0.01, b"film", b"still"),
        Video("cpg", "mixed", 1, "fall", 31, 0.01, b"another", b"one"),
    ]
    page = Page(format_report(results, videos=videos))
    (attrs,) = (attrs for tag, attrs in page.tags if tag == "video")
    assert attrs["src"] == "data:video/mp4;base64,ZmlsbQ=="
    assert attrs["poster"] == "data:image/jpeg;base64,c3RpbGw="
    assert any("left arena" in text for text in page.texts)


def test_results_without_paths_give_a_report_without_them(results):
    bare = type(results)(results.protocol, results.episodes, results.summaries)
    text = format_report(bare)
    # the control loop, success; distributions and pairs of two terrains
    assert Page(text).count("svg") == 2 + 2 * 2
    assert "<h3>Paths</h3>" not in text


def test_one_controller_alone_gives_a_report():
    text = format_report(make_results(("hybrid",), episodes=1))
    assert "Compared with" not in text


@pytest.fixture(scope="module")
def alone():
    return make_results(("hybrid",), episodes=1)


def test_the_report_lies_in_its_folder(alone, tmp_path):
    path = write_report(alone, tmp_path / "new")
    assert path == tmp_path / "new" / "report.html"
    assert path.read_text(encoding="utf-8").startswith("<!doctype html>")


def test_figures_and_tables_lie_beside_the_report(alone, tmp_path):
    page = Page(write_report(alone, tmp_path).read_text(encoding="utf-8"))
    figures = {path.name for path in (tmp_path / "figures").iterdir()}
    assert figures == {"success.svg", "paths-flat.svg", "distributions-flat.svg"}
    assert page.count("svg") == len(figures) + 1  # the control loop
    tables = {path.name for path in (tmp_path / "tables").iterdir()}
    assert tables == {
        "summary.csv", "summary.tex", "leaders.csv", "leaders.tex", "metrics-flat.tex"
    }  # fmt: skip
    assert {"figures/", "tables/"} <= set(page.texts)


def test_a_report_stands_where_nothing_can_be_written_beside_it(alone, tmp_path, capsys):
    (tmp_path / "figures").write_text("in the way")
    assert write_report(alone, tmp_path).exists()
    assert "lacks figures or tables beside it" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "\u2013"),
        (0, "0"),
        (1.23456, "1.23"),
        (-12.3456, "\u221212.3"),
        (0.5, "0.50"),
        (0.04567, "0.046"),
        (-0.0042, "\u22120.0042"),
        (-3e-17, "0"),
        (0.999, "1.00"),
        (9.996, "10.0"),
        (1234.5, "1234"),
        (3.0, "3.00"),
    ],
)
def test_numbers_are_short(value, text):
    assert format_number(value) == text


def test_a_small_share_keeps_its_leading_digits():
    assert format_number(0.0321, 2) == "0.032"


@pytest.mark.parametrize(
    ("value", "text"), [(0.25, "+25.0"), (-0.25, "\u221225.0"), (0.0, "0"), (1e-17, "0")]
)
def test_only_what_is_above_zero_has_a_plus(value, text):
    assert signed(value, 100) == text


def test_what_was_varied_is_drawn_dose_by_dose():
    results = make_results(NAMES, episodes=6, vary={"friction": (0.5, 1.0, 2.0), "push": (0, 8)})
    text = format_report(results)
    page = Page(text)
    assert page.count("svg") == 4  # the control loop, success, and a figure per quantity
    assert "friction=0.5" in text
    # spoken of first is where nothing is changed
    assert "of 6 episodes on flat (friction=1) (" in text
    assert "Factor on the friction of the legs" in text
    assert "Force sideways after 1 s, µN" in text
    rows = [attributes for tag, attributes in page.tags if tag == "tr"]
    assert len(rows) >= 5 * len(NAMES)


def test_who_crashed_is_named(few):
    crash = {
        "controller": "mine",
        "terrain": "flat",
        "condition": "push=8",
        "error": "KeyError: '<nothing>'",
        "traceback": "",
    }
    text = format_report(replace(few, protocol={**few.protocol, "crashes": [crash]}))
    assert "mine on flat (push=8) raised <code>KeyError: &#39;&lt;nothing&gt;&#39;</code>" in text


def test_nobody_is_missing_where_nobody_crashed(text):
    assert "Who is missing" not in text


def test_a_difference_tells_how_sure_and_how_large_it_is(text):
    assert re.search(r"better in \d+ % of the episodes.*corrected 0\.\d+; d = ", text)


def test_a_published_study_stands_beside_ours():
    results = make_results(
        ("cpg", "rule_based", "hybrid"),
        terrains=("flat", "gapped"),
        episodes=8,
        study="controller_comparison",
    )
    text = format_report(results)
    Page(text)
    assert "hybrid walks further than rule_based on gapped" in text
    # nobody walked on mixed
    assert re.search(
        r"hybrid walks further than cpg on mixed</td><td[^>]*></td>.*>not tested<", text
    )
    assert "13.8, 4.20, 4.00, 2.90" in text


def test_close_ups_stand_in_their_places(few):
    drives = np.linspace(-0.5, 1.5, 3)
    left, right = np.meshgrid(drives, drives, indexing="ij")
    text = format_report(
        few,
        examples=[walked("cpg")],
        drive_map=DriveMap(drives, left + right, right - left),
    )
    page = Page(text)
    assert text.count("<h3>Gait</h3>") == 1  # on flat, where it was walked
    # curves without a video, and nothing to play
    assert [attrs.get("class") for _, attrs in page.tags].count("run-along") == 1
    assert page.count("input") == 0
    assert "From drive to behaviour" in text


def test_trainings_with_several_seeds_are_told_over_seeds(few):
    training = {"algo": "ppo", "settings": {}}
    entrants = [
        {**entrant, "kind": "learned", "training": training, "policy": "learned with ppo"}
        for entrant in few.protocol["entrants"]
    ]
    text = format_report(replace(few, protocol={**few.protocol, "entrants": entrants}))
    Page(text)
    assert "<h2>Over seeds</h2>" in text
    assert f'title="{", ".join(NAMES[:3])}">learned with ppo</td><td>3</td>' in text


def test_a_single_policy_has_no_seeds_to_tell_of(text):
    assert "Over seeds" not in text


def learned(results, **changes):
    """Results whose first two entrants are learned."""
    training = {"algo": "ppo", "settings": {}}
    entrants = [
        {**entrant, "kind": "learned", "training": training, "policy": "learned"}
        if entrant["name"] in NAMES[:2]
        else entrant
        for entrant in results.protocol["entrants"]
    ]
    entrants[0] |= changes
    return replace(results, protocol={**results.protocol, "entrants": entrants})


def test_learning_curves_are_drawn_where_there_are_any(few):
    evaluations = [{"decisions": 100.0, "success_rate": 0.5, "mean_return": 1.0}]
    text = format_report(learned(few), curves={"cpg": evaluations})
    Page(text)
    assert "<h2>Learning curves</h2>" in text
    assert "learned, n = 1" in text  # the other one of this training has none


@pytest.mark.parametrize("curves", [{}, {"hybrid": [{"decisions": 1.0}]}])
def test_without_learning_curves_there_is_no_section_of_them(few, curves):
    assert "Learning curves" not in format_report(learned(few), curves=curves)


def test_the_matrix_tells_where_a_policy_was_trained(results):
    trained = learned(results, trained_in={"terrain": {"name": "gapped"}})
    page = Page(format_report(trained))
    cells = [attrs for tag, attrs in page.tags if "--share" in attrs.get("style", "")]
    rates = [
        row["success_rate"]["value"]
        for terrain in ("flat", "gapped")
        for row in results.summaries
        if (row["terrain"], row["controller"]) == (terrain, "target-ppo")
    ]
    # alone in its training: the other one was trained elsewhere
    assert [cell["style"] for cell in cells] == [f"--share: {rate}" for rate in rates]
    assert [cell["class"] for cell in cells] == ["shade", "shade home"]


def test_rough_ground_is_drawn_below_the_paths(text):
    _, flat, gapped = text.split("<h3>Paths</h3>")
    assert "<symbol" not in flat
    assert "moved to start at the origin" in flat
    assert "<symbol" in gapped
    assert "gaps are bare" in gapped


@pytest.mark.parametrize("left", [0, 3])
def test_the_report_says_what_leaving_the_arena_means(results, left):
    rows = results.episodes.copy()
    rows["outcome"] = "timeout"
    chosen = rows.index[rows["terrain"] == rows["terrain"].iloc[0]][:left]
    rows.loc[chosen, "outcome"] = "left_arena"
    section = terrain_section(replace(results, episodes=rows), rows["terrain"].iloc[0], [], [])
    assert section["edge"].startswith(f"{left} of ") == (left > 0)
    assert ("walked off the ground" in section["edge"]) == (left > 0)
