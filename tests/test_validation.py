"""Fields of dataclasses, checked against their annotations."""

import math
import re
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pytest

from flyrl.validation import (
    Within,
    check_fields,
    checked_arguments,
    float_array,
    known_keys,
    ordered,
)


@dataclass(frozen=True)
class Inner:
    size: float = 1.0


@dataclass(frozen=True)
class Settings:
    rate: Annotated[float, Within(0, 2)] = 1.0
    count: int = 1
    is_on: bool = False
    kind: Literal["fast", "slow"] = "fast"
    pair: Annotated[tuple[float, float] | None, Within(0, 1)] = None
    inner: Inner = Inner()

    def __post_init__(self) -> None:
        check_fields(self, "group")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rate": 2.1}, "group.rate must be a finite number from 0 to 2, got 2.1"),
        ({"rate": float("nan")}, "group.rate must be .* got nan"),
        ({"rate": True}, "group.rate must be .* got True"),
        ({"rate": 10**400}, "group.rate must be .* got 1000"),
        ({"count": 1.5}, "group.count must be a whole number, got 1.5"),
        ({"is_on": "no"}, "group.is_on must be True or False, got 'no'"),
        ({"kind": "slo"}, "group.kind must be one of .* got 'slo'; did you mean 'slow'"),
        ({"pair": 3}, "group.pair must be a list, got 3"),
        ({"pair": (0, 1, 1)}, "group.pair must be a list of 2, got"),
        ({"pair": (0, "1")}, r"group.pair\[1\] must be a finite number from 0 to 1, got '1'"),
        ({"inner": 3}, "group.inner must be a Inner, got 3"),
    ],
)
def test_a_field_that_is_not_allowed_is_named(settings, message):
    with pytest.raises(ValueError, match=message):
        Settings(**settings)


def test_values_become_pythons_own():
    settings = Settings(rate=1, pair=[0, 1])
    assert (settings.rate, settings.pair) == (1.0, (0.0, 1.0))
    assert type(settings.rate) is float
    assert hash(settings) == hash(Settings(pair=(0, 1)))


@pytest.mark.parametrize(("key", "hint"), [("terain", "; did you mean 'terrain'?"), ("colour", "")])
def test_an_unknown_key_is_named_with_a_close_one(key, hint):
    message = f"env has no {key!r}{hint} (allowed: task, terrain)"
    with pytest.raises(ValueError, match=re.escape(message) + "$"):
        known_keys("env", ["task", key], ["task", "terrain", "task"])


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (-1.0, "must be at least 0, got -1.0 at [0, 0]"),
        (2.0, "must be at most 1, got 2.0 at [0, 0]"),
        (math.nan, "must be finite, got nan at [0, 0]"),
    ],
)
def test_of_an_array_one_wrong_value_is_named(value, message):
    with pytest.raises(ValueError, match=re.escape(f"grips {message}") + "$"):
        float_array("grips", np.full((300, 6), value), (300, 6), minimum=0.0, maximum=1.0)


def test_arguments_of_a_function_are_checked_against_its_annotations():
    def function(size: Annotated[float, Within(0, 1)], pair: tuple[int, int] = (1, 2), free=None):
        """Nothing is done here."""

    checked = checked_arguments(function, {"size": 1, "free": [1, [2]]}, "group")
    assert checked == {"size": 1.0, "pair": (1, 2), "free": (1, (2,))}
    for given, message in (
        ({}, r"group\.size is missing"),
        ({"size": 2}, r"group\.size must be a finite number from 0 to 1, got 2"),
        ({"size": 1, "pair": [1]}, r"group\.pair must be a list of 2"),
        ({"size": 1, "piar": [1]}, r"group has no 'piar'; did you mean 'pair'"),
    ):
        with pytest.raises(ValueError, match=message):
            checked_arguments(function, given, "group")


def test_a_pair_rises():
    assert ordered("x", (1.0, 1.0)) == (1.0, 1.0)
    with pytest.raises(ValueError, match=r"x must be \(least, greatest\), got \(2, 1\)"):
        ordered("x", (2, 1))
