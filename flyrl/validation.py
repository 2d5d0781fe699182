"""Checks on arguments: a ValueError says what was given and what is allowed."""

import difflib
import math
from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
T = TypeVar("T")


def float_array(
    name: str, value: ArrayLike, shape: tuple[int, ...], *, minimum: float = -math.inf
) -> FloatArray:
    """Return a finite float64 copy of `value`.

    Raises
    ------
    ValueError
        If the shape differs, or an element is not a finite number of at least `minimum`.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be numbers of shape {shape}, got {value!r}") from None
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {array.tolist()}")
    if (array < minimum).any():
        raise ValueError(f"{name} must be at least {minimum:g}, got {array.tolist()}")
    return array


def number(name: str, value: float) -> float:
    """Return `value` as a float if it is a finite number, else raise ValueError."""
    if not _is_number(value) or not math.isfinite(value):
        raise ValueError(f"{name} must be a finite number, got {value!r}")
    return float(value)


def positive(name: str, value: float) -> float:
    """Return `value` as a float if it is a finite number above 0, else raise ValueError."""
    if not _is_number(value) or not 0 < value < math.inf:
        raise ValueError(f"{name} must be a finite number above 0, got {value!r}")
    return float(value)


def not_negative(name: str, value: float) -> float:
    """Return `value` as a float if it is a finite number of at least 0, else raise ValueError."""
    if not _is_number(value) or not 0 <= value < math.inf:
        raise ValueError(f"{name} must be a finite number of at least 0, got {value!r}")
    return float(value)


def at_least(name: str, value: float, minimum: float) -> float:
    """Return `value` if it is a finite number no smaller than `minimum`, else raise ValueError."""
    if not _is_number(value) or not minimum <= value < math.inf:
        raise ValueError(f"{name} must be at least {minimum}, got {value!r}")
    return value


def within(name: str, value: float, low: float, high: float) -> float:
    """Return `value` if it is a number from `low` to `high`, else raise ValueError."""
    if not _is_number(value) or not low <= value <= high:
        raise ValueError(f"{name} must lie within {low} and {high}, got {value!r}")
    return value


def one_of(name: str, value: T, allowed: Iterable[Any]) -> T:
    """Return `value` if it is among `allowed`, else raise ValueError with the closest match."""
    choices = tuple(allowed)
    if value in choices:
        return value
    close = difflib.get_close_matches(str(value), [str(choice) for choice in choices], n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, got {value!r}{hint}")


def random_seed(seed: int) -> int:
    """Return `seed` if MT19937 takes it (an integer of 0 … 2³² - 1), else raise ValueError."""
    if isinstance(seed, bool) or not isinstance(seed, Integral) or not 0 <= seed < 2**32:
        raise ValueError(f"seed must be an integer from 0 to 2**32 - 1, got {seed!r}")
    return int(seed)


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
