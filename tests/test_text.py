import csv
import io

import pandas as pd
import pytest

from flyrl.text import csv_cell, csv_table, csv_text, plain_name, printable

FORMULAS = ["=1+1", "+1+1", "-1+1", "@SUM(A1)", " =1+1", "\t=1+1", "\r=1+1", "\n=1+1", "\uff1d1+1"]


@pytest.mark.parametrize("text", FORMULAS)
def test_no_text_is_a_formula(text):
    cell = csv_cell(text)
    assert cell[0] == "'"
    assert cell.endswith(text.lstrip("\t\r\n"))


@pytest.mark.parametrize("value", [-1.5, -2, True, None, "-1.5", "+3e-4", "cpg", "a=b", ""])
def test_numbers_and_plain_text_stay(value):
    assert csv_cell(value) == value


def test_rows_and_tables_become_the_same_csv():
    rows = [{"name": "=1", "-a": -0.5, "both": "@b"}, {"name": None, "-a": 2.0, "both": "-2"}]
    text = csv_text(list(rows[0]), rows)
    assert text == "name,'-a,both\n'=1,-0.5,'@b\n,2.0,-2\n"
    assert csv_table(pd.DataFrame(rows)) == text
    assert csv_table(pd.DataFrame(rows).astype({"name": "category"})) == text


def test_quotes_and_commas_stay_within_their_cell():
    rows = [{"name": '=HYPERLINK("a,b")\n@c', "value": 1}]
    (row,) = csv.DictReader(io.StringIO(csv_text(["name", "value"], rows)))
    assert row == {"name": '\'=HYPERLINK("a,b") @c', "value": "1"}


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("random_blocks", "random_blocks"),
        ("../../a b", ".._.._a_b"),
        ('"><img src=x>', "___img_src_x_"),
        ("é" * 5000, "_" * 100),
    ],
)
def test_plain_names(text, name):
    assert plain_name(text) == name


def test_a_cell_is_one_line_without_control_characters():
    assert csv_cell("a\nb\x1b[31m\u202e\udc80") == "a b?[31m??"
    assert printable("flat, 0.35 mm \u2212 ü") == "flat, 0.35 mm \u2212 ü"
