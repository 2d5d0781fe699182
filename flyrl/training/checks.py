"""Checks of settings; each raises ValueError with the key, the value given and what is allowed."""

import math
from collections.abc import Sequence


def at_least(key: str, value: float, minimum: float) -> None:
    """Check that `value` is finite and no smaller than `minimum`."""
    if not minimum <= value < math.inf:
        raise ValueError(f"{key}: {value!r}; allowed: at least {minimum}")


def inside(key: str, value: float, low: float, high: float, *, is_open: bool = False) -> None:
    """Check that `value` lies between `low` (itself not allowed where `is_open`) and `high`."""
    if not low <= value <= high or (is_open and value == low):
        bounds = f"above {low}, up to {high}" if is_open else f"{low} to {high}"
        raise ValueError(f"{key}: {value!r}; allowed: {bounds}")


def one_of(key: str, value: str, allowed: Sequence[str]) -> None:
    """Check that `value` is one of `allowed`."""
    if value not in allowed:
        raise ValueError(f"{key}: {value!r}; allowed: {', '.join(allowed)}")
