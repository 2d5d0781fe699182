from dataclasses import dataclass
from typing import Literal

import pytest

from flyrl.cli.conversion import from_mapping


@dataclass(frozen=True)
class Inner:
    ratio: float = 1.0


@dataclass(frozen=True)
class Outer:
    name: Literal["a", "b"] = "a"
    count: int = 1
    is_on: bool = False
    length: float | None = None
    pair: tuple[float, float] = (0.0, 0.0)
    sizes: tuple[int, ...] = ()
    inner: Inner = Inner()


def test_every_kind_of_value():
    mapping = {
        "name": "b",
        "count": 3,
        "is_on": True,
        "length": 2,
        "pair": [1, 2.5],
        "sizes": [4, 5, 6],
        "inner": {"ratio": 0.5},
    }
    assert from_mapping(Outer, mapping, "x") == Outer(
        "b", 3, True, 2.0, (1.0, 2.5), (4, 5, 6), Inner(0.5)
    )


@pytest.mark.parametrize("value", [4, [4]])
def test_one_value_is_a_list_of_one(value):
    assert from_mapping(Outer, {"sizes": value}, "x").sizes == (4,)


def test_missing_keys_take_defaults():
    assert from_mapping(Outer, {"length": None}, "x") == Outer()


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ({"cout": 1}, r"there is no key 'x\.cout'; did you mean 'x\.count'."),
        (
            {"inner": {"ration": 1}},
            r"there is no key 'x\.inner\.ration'; did you mean 'x\.inner\.ratio'.",
        ),
        ({"name": "c"}, r"x\.name must be one of 'a', 'b', got 'c'"),
        ({"count": 1.5}, r"x\.count must be a whole number, got 1\.5"),
        ({"count": True}, r"x\.count must be a whole number, got True"),
        ({"count": None}, r"x\.count must be a whole number, got None"),
        ({"is_on": 1}, r"x\.is_on must be true or false, got 1"),
        ({"length": "1e-3"}, r"x\.length must be a number, got '1e-3'"),
        ({"pair": [1]}, r"x\.pair must be a list of 2, got \[1\]"),
        ({"pair": 1}, r"x\.pair must be a list, got 1"),
        ({"sizes": None}, r"x\.sizes must be a list, got None"),
        ({"sizes": "b"}, r"x\.sizes\[0\] must be a whole number, got 'b'"),
        ({"sizes": [1, "b"]}, r"x\.sizes\[1\] must be a whole number, got 'b'"),
        ({"inner": 3}, r"x\.inner must be a group of keys, got 3"),
    ],
)
def test_what_does_not_fit(mapping, message):
    with pytest.raises(ValueError, match=message):
        from_mapping(Outer, mapping, "x")
