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


@pytest.fixture(scope="module")
def files(results):
    return tables(results)


def tables(results):
    return format_tables(results, all_leaders(results))


def rows(text):
    """Cells of the rows of a LaTeX table, the heading first."""
    lines = [line for line in text.splitlines() if line.endswith(r"\\")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)&", line[:-2])] for line in lines]


def test_tables_are_csv_and_two_are_latex(files):
    assert set(files) == {
        "summary.csv", "leaders.csv", "differences.csv", "summary.tex", "differences.tex"
    }  # fmt: skip


def test_the_summary_has_a_row_per_controller_and_terrain(results, files):
    found = list(csv.DictReader(io.StringIO(files["summary.csv"])))
    assert [(row["terrain"], row["controller"]) for row in found] == [
        (row["terrain"], row["controller"]) for row in results.summaries
    ]
    for row, expected in zip(found, results.summaries, strict=True):
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
    files = format_tables(results, leaders)
    flat, gapped = csv.DictReader(io.StringIO(files["leaders.csv"]))
    assert list(flat.values()) == [
        "flat", "", "a, b", "success", "0.5", "c", "0.25", "0.25", "0.125", "0.5", ""
    ]  # fmt: skip
    assert gapped["next"] == gapped["difference"] == ""


def test_all_latex_is_whole(files):
    for name, text in files.items():
        if name.endswith(".tex"):
            lines = text.splitlines()
            assert lines[0].startswith("% ")
            assert lines[1].startswith(r"\begin{tabular}{l")
            assert lines[-1] == r"\end{tabular}"
            assert text.isascii()  # no minus sign or dash that LaTeX does not know
            assert [r"\toprule" in text, r"\midrule" in text, r"\bottomrule" in text] == [True] * 3
            body = "\n".join(lines[1:])
            assert not re.search(r"(?<!\\)[%_#]", body)
            assert body.count("$") % 2 == 0
            assert {len(row) for row in rows(text)} == {len(lines[1].split("{")[2]) - 1}


@pytest.mark.parametrize("terrain", ["[1em]", "*"])
def test_no_name_is_latex_or_a_formula(terrain):
    results = make_results(("cpg", "hybrid"), episodes=2)
    name = "=\\input{a}\n\n$x^2$~50%_&<"
    for row in results.summaries:
        row["terrain"] = terrain
        row["controller"] = row["controller"].replace("cpg", name)
    files = format_tables(results, all_leaders(results))
    latex = files["summary.tex"]
    start = f"{{{terrain[0]}}}{terrain[1:]} &"
    assert [line.startswith(start) for line in latex.splitlines()].count(True) == 2
    assert (
        r"=\textbackslash input\{a\} \$x\textasciicircum 2\$\textasciitilde 50\%\_\&$<$ &" in latex
    )
    rows = list(csv.DictReader(io.StringIO(files["summary.csv"])))
    assert rows[0]["controller"] == "'=\\input{a}  $x^2$~50%_&<"


def test_numbers_in_latex_are_short(results):
    results = copy.deepcopy(results)
    (row,) = (
        row for row in results.summaries if row["controller"] == "cpg" and row["terrain"] == "flat"
    )
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
    assert cells["time to goal (s)"] == "--"
    assert cells["speed (mm/s)"] == "2.00"
    (told,) = (
        cells for cells in rows(files["differences.tex"]) if cells[:3] == ["flat", "cpg", "return"]
    )
    assert told[3:] == ["$-$1.00 [$-$2.00, 0.50]", "$<$0.001", "0.020", "25", "--"]


def test_conditions_have_their_column(files):
    told = tables(make_results(("cpg", "hybrid"), episodes=2, vary={"push": (0, 8)}))
    for name in ("summary.tex", "differences.tex"):
        assert "condition" in rows(told[name])[0]
        assert "push=8" in told[name]
        assert "condition" not in rows(files[name])[0]


def test_interactions_stand_beside_the_differences():
    varied = make_results(("cpg", "hybrid"), episodes=6, vary={"push": (0, 8), "mass": (1, 2)})
    told = tables(varied)
    found = list(csv.DictReader(io.StringIO(told["interactions.csv"])))
    # of the conditions that change nothing there are none
    assert [(row["condition"], row["controller"], row["metric"]) for row in found] == [
        (condition, "cpg", metric)
        for condition in ("push=8", "mass=2")
        for metric in ("success", "time_to_goal_s")
    ]
    assert {row["interaction"] for row in found} == {"0.0"}  # the walks are the same
