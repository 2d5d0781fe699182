"""Names of entrants."""

import pytest

from flyrl.evaluation.entrant import NAME_LENGTH, free_name


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("target-ppo", "target-ppo"),
        ("<b>x</b>", "b_x__b_"),
        ("=1+1", "1+1"),
        ("-a\x1b[2J\tb", "a__2J_b"),
        ("@\r", "unnamed"),
        ("x" * 1000, "x" * NAME_LENGTH),
    ],
)
def test_names_are_short_printable_text(name, kept):
    assert free_name(name, ()) == kept


def test_names_that_become_equal_are_told_apart():
    assert free_name("a<", ("a_",)) == "a_-2"
