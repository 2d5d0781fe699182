import pytest

from flyrl.evaluation.config import LazySequence

SQUARES = LazySequence(4, lambda i: i * i)


def test_items_are_those_that_are_made():
    assert list(SQUARES) == [0, 1, 4, 9]
    assert SQUARES[-1] == 9
    assert SQUARES[1:3] == [1, 4]
    assert len(SQUARES) == 4


def test_nothing_beyond_the_end():
    with pytest.raises(IndexError):
        SQUARES[4]


def test_nothing_is_made_before_it_is_asked_for():
    made = []
    sequence = LazySequence(10**9, made.append)
    sequence[7]
    assert made == [7]
