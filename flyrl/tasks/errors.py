"""Errors of the built-in tasks; every table of results has a column for each of them."""

from typing import Final

from flyrl.tasks.task import Compute, ErrorTerm

ERRORS: Final[dict[str, tuple[str, float]]] = {
    "heading_error_deg": ("angle between heading and where it should point, deg", 4.0),
    "path_error_mm": ("distance to the path, mm", 0.25),
    "speed_error_mm_s": ("difference from the commanded forward speed, mm/s", 0.5),
    "yaw_rate_error_deg_s": ("difference from the commanded yaw rate, deg/s", 15.0),
    "bend_error_deg": ("difference from the commanded bend of a worm, deg", 1.5),
    "recruited_share": ("share of a worm's motor neurons that are recruited", 0.05),
}
"""Description and smallest effect of interest by name.

The effects are about a quarter of what the tasks tolerate in a success, of a share 0.05.
"""


def error(name: str, worst: float, compute: Compute) -> ErrorTerm:
    """Error term of a name in `ERRORS`."""
    return ErrorTerm(name, worst, compute, *ERRORS[name])
