import copy
import csv
import io
import re

import pytest

from flyrl.evaluation.statistics import Interval
from flyrl.evaluation.summary import Leader
from flyrl.report.exports import format_tables
from flyrl.report.sections import all_leaders
from tests.synthetic import make_results


def tables(results):
    return format_tables(results, all_leaders(results))


@pytest.fixture(scope="module")
def files(results):
    return tables(results)


@pytest.fixture(scope="module")
def varied():
    """Files of results under conditions."""
    vary = {"push": (0, 8), "mass": (1, 2)}
    return tables(make_results(("cpg", "hybrid"), episodes=6, vary=vary))


def rows(text):
    """Cells of the rows of a table in LaTeX, the heading first."""
    lines = [line for line in text.splitlines() if line.endswith(r"\\")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)&", line[:-2])] for line in lines]


def records(text):
    """Rows of a table in CSV."""
    return list(csv.DictReader(io.StringIO(text)))


def test_tables_are_csv_and_two_are_latex_of_what_there_is(files, varied):
    names = {f"{name}.{kind}" for name in ("summary", "differences") for kind in ("csv", "tex")}
    assert set(files) == names | {"leaders.csv"}
    assert set(varied) == set(files) | {"interactions.csv"}
    alone = {"summary.csv", "summary.tex", "leaders.csv"}
    assert set(tables(make_results(("hybrid",), episodes=1))) == alone


def test_the_summary_has_a_row_per_controller_and_terrain(results, files):
    found = records(files["summary.csv"])
    for row, expected in zip(found, results.summaries, strict=True):
        assert (row["terrain"], row["controller"]) == (expected["terrain"], expected["controller"])
        assert float(row["success_rate_low"]) == expected["success_rate"]["low"]
        speed = expected["metrics"]["speed_mm_s"]
        for key in ("median", "q1", "q3"):
            assert float(row[f"speed_mm_s_{key}"]) == speed[key]  # every digit
    standing = next(row for row in found if row["controller"] == "cpg")
    assert standing["time_to_goal_s_median"] == ""  # it never came there


def test_differences_tell_all_there_is_to_know(results):
    table = results.differences
    assert len(table) == 2 * 2 * 4  # terrains, controllers, metrics
    row = table[(table["controller"] == "target-ppo") & (table["metric"] == "return")].iloc[1]
    expected = results.summaries[3]["paired"]["differences"]["return"]
    assert (row["terrain"], row["reference"], row["pairs"]) == ("gapped", "hybrid", 8)
    assert row["low"] == expected["low"] < row["difference"] < row["high"]
    assert row["p_corrected"] == expected["p_adjusted"]
    assert row["improvement"] == expected["improvement"]["value"]
    assert row["effect_size"] == expected["effect_size"]


def test_leaders_are_told_as_in_the_report(results):
    ahead = Interval(0.25, 0.125, 0.5, 9)
    leaders = [
        Leader("flat", ("a", "b"), "success", 0.5, "c", 0.25, ahead),
        Leader("gapped", ("a", "b", "c"), "success", 0.5),
    ]
    flat, gapped = records(format_tables(results, leaders)["leaders.csv"])
    assert "|".join(flat.values()) == "flat||a, b|success|0.5|c|0.25|0.25|0.125|0.5|"
    assert gapped["next"] == gapped["difference"] == ""


@pytest.mark.parametrize("name", ["summary.tex", "differences.tex"])
def test_all_latex_is_whole(files, varied, name):
    caption, begin, *body, end = files[name].splitlines()
    assert caption.startswith("% ")
    assert begin.startswith(r"\begin{tabular}{l") and end == r"\end{tabular}"
    assert files[name].isascii()  # no minus sign or dash that LaTeX does not know
    assert {r"\toprule", r"\midrule", r"\bottomrule"} <= set(body)
    assert not re.search(r"(?<!\\)[%_#]", "\n".join(body))
    assert "\n".join(body).count("$") % 2 == 0
    assert {len(row) for row in rows(files[name])} == {len(begin.split("{")[2]) - 1}
    assert "condition" in rows(varied[name])[0] and "push=8" in varied[name]
    assert "condition" not in rows(files[name])[0]


@pytest.mark.parametrize("terrain", ["[1em]", "*"])
def test_no_name_is_latex_or_a_formula(terrain):
    results = make_results(("cpg", "hybrid"), episodes=2)
    name = "=\\input{a}\n\n$x^2$~50%_&<"
    for row in results.summaries:
        row["terrain"] = terrain
        row["controller"] = row["controller"].replace("cpg", name)
    files = tables(results)
    latex = files["summary.tex"]
    start = f"{{{terrain[0]}}}{terrain[1:]} &"
    assert [line.startswith(start) for line in latex.splitlines()].count(True) == 2
    assert (
        r"=\textbackslash input\{a\} \$x\textasciicircum 2\$\textasciitilde 50\%\_\&$<$ &" in latex
    )
    assert records(files["summary.csv"])[0]["controller"] == "'=\\input{a}  $x^2$~50%_&<"


def test_numbers_in_latex_are_short(results):
    results = copy.deepcopy(results)
    row = next(row for row in results.summaries if row["controller"] == "cpg")
    row["success_rate"] = {"value": 0.5, "low": 0.25, "high": 0.75}
    row["metrics"]["return"] = {"n": 2, "median": 0, "mean": -1.234, "q1": -2.0, "q3": 34.56}
    row["metrics"]["speed_mm_s"] = {"n": 1, "median": 2.0, "mean": 2.0, "q1": 2.0, "q3": 2.0}
    difference = row["paired"]["differences"]["return"]
    difference.update(value=-1.0, low=-2.0, high=0.5, p_value=0.0004, p_adjusted=0.02)
    difference.update(effect_size=None, improvement={"value": 0.25, "low": None, "high": None})
    files = tables(results)
    heading, *body = rows(files["summary.tex"])
    cells = dict(zip(heading, next(cells for cells in body if cells[1] == "cpg"), strict=True))
    assert cells[r"success (\%)"] == "50 [25, 75]"
    assert cells["return"] == "$-$1.23 [$-$2.00, 34.6]"
    assert (cells["time to goal (s)"], cells["speed (mm/s)"]) == ("--", "2.00")
    told = [each[3:] for each in rows(files["differences.tex"]) if each[1:3] == ["cpg", "return"]]
    assert told[0] == ["$-$1.00 [$-$2.00, 0.50]", "$<$0.001", "0.020", "25", "--"]


def test_interactions_are_those_of_the_conditions_that_change_something(varied):
    found = records(varied["interactions.csv"])
    assert [(row["condition"], row["controller"], row["metric"]) for row in found] == [
        (condition, "cpg", metric)
        for condition in ("push=8", "mass=2")
        for metric in ("success", "time_to_goal_s")
    ]
    assert {row["interaction"] for row in found} == {"0.0"}  # the walks are the same
