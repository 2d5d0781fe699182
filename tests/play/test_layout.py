"""How widgets are laid out."""

import math

import pytest

from flyrl.play.layout import bricks, figure, hand, runs


@pytest.mark.parametrize(
    ("number", "columns", "height"), [(1, 1, 20), (6, 1, 10), (12, 1, 10), (14, 2, 8), (84, 3, 8)]
)
def test_many_bars_are_thin_and_stand_side_by_side(number, columns, height):
    assert bricks(number) == (columns, height)


def test_unbroken_runs_of_a_row():
    assert runs("0110 111", "1") == [(1, 3), (5, 8)]
    assert runs("0110 111", "0") == [(0, 1), (3, 4)]
    assert runs("", "1") == []


def test_a_hand_goes_clockwise_from_upright():
    assert hand(0, 1, 10) == pytest.approx((0, -10))
    assert hand(math.pi / 2, 0.5, 10) == pytest.approx((5, 0))
    assert hand(math.pi, 3.0, 10) == pytest.approx((0, 10))


@pytest.mark.parametrize(
    ("value", "text"),
    [(20, "20"), (0.12345, "0.123"), (-1e-9, "0.000"), (123.456, "123.5"), (math.nan, "-")],
)
def test_figures(value, text):
    assert figure(value) == text
