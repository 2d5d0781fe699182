import csv
import io

import numpy as np
import pytest

from flyrl.evaluation.rows import (
    ROW_KEYS,
    csv_text,
    episode_row,
    episode_table,
    episodes_digest,
    joined,
    plain_rows,
)
from tests.synthetic import make_record

ROWS = [
    episode_row(make_record([(0, 0), (1, 0)], index=0, outcome="success"), "friction=2"),
    episode_row(make_record([(0, 0), (0, 0)], index=1, outcome="fall"), "friction=2"),
]


def test_rows_come_back_from_a_table_as_they_were():
    back = list(plain_rows(episode_table(ROWS)))
    assert back == ROWS
    assert [[type(value) for value in row.values()] for row in back] == [
        [type(value) for value in row.values()] for row in ROWS
    ]


def test_a_row_has_the_columns_of_the_table():
    assert list(ROWS[0]) == list(ROW_KEYS) == list(episode_table(ROWS))


def test_tables_one_below_the_other():
    other = [{**row, "controller": "hybrid"} for row in ROWS]
    both = joined([episode_table(ROWS), episode_table(other)])
    assert list(plain_rows(both)) == ROWS + other
    assert both["controller"].dtype == "category"


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_numbers_that_are_not_finite_are_refused(value):
    with pytest.raises(ValueError, match=r"return must be finite or None.*episode 0 of cpg"):
        episode_table([{**ROWS[0], "return": value}])


def test_a_table_takes_few_bytes_per_row():
    many = joined([episode_table(ROWS * 50)] * 100)
    assert len(many) == 10_000
    assert many.memory_usage(deep=True).sum() < 300 * len(many)


def test_csv_holds_every_digit_and_nothing_for_none():
    table = episode_table([{**ROWS[0], "return": 1 / 3}, ROWS[1]])
    first, second = csv.DictReader(io.StringIO("".join(csv_text(table))))
    assert float(first["return"]) == 1 / 3
    assert first["success"] == "True"
    assert second["time_to_goal_s"] == ""


def test_no_text_is_a_formula_in_a_spreadsheet():
    table = episode_table([{**ROWS[0], "controller": "=1+1", "return": -1.5}])
    (row,) = csv.DictReader(io.StringIO("".join(csv_text(table))))
    assert (row["controller"], row["return"]) == ("'=1+1", "-1.5")


def test_the_digest_changes_with_the_last_bit():
    changed = {**ROWS[0], "return": np.nextafter(ROWS[0]["return"], 1).item()}
    assert episodes_digest(episode_table(ROWS)) == episodes_digest(episode_table(ROWS))
    assert episodes_digest(episode_table([changed])) != episodes_digest(episode_table(ROWS[:1]))
