"""The table: flygym beside flyrl, per terrain and controller."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Final

from benchmarks.fidelity.results import Row, cell, summary
from benchmarks.fidelity.statistics import STATISTICS
from flyrl.tasks import UNSTABLE

REFERENCE_NAME: Final = "flygym"

DIGITS: Final = {
    "speed": 2,
    "straightness": 3,
    "yaw_drift": 1,
    "stride_length": 3,
    "stride_frequency": 2,
    "duty_factor": 3,
    "tripod": 3,
    "slip": 3,
    "fall": 2,
    "energy": 0,
}
"""Decimals of each statistic in the table."""


def table(reference: Sequence[Row], runs: Sequence[Row]) -> str:
    """Medians of all statistics (of falls the share) and speed against the reference's, as text.

    Runs that blew up are named below the table and count for nothing in it.
    """
    lines = [_line("terrain", "controller", "source", "n", STATISTICS, "speed ratio")]
    found = [(cell(run), REFERENCE_NAME, run) for run in reference]
    found += [(cell(run), run["physics"], run) for run in runs]
    unstable = [(source, run) for _, source, run in found if run["outcome"] == UNSTABLE]
    found = [each for each in found if each[2]["outcome"] != UNSTABLE]
    sources = [REFERENCE_NAME, *dict.fromkeys(run["physics"] for run in runs)]
    found.sort(key=lambda each: (each[0], sources.index(each[1])))
    for _, in_cell in groupby(found, key=lambda each: each[0]):
        reference_speed: float | None = None
        for source, group in groupby(in_cell, key=lambda each: each[1]):
            rows = [run for _, _, run in group]
            figures = summary(rows)
            speed = figures["speed"]
            if source == REFERENCE_NAME:
                reference_speed = speed
            ratio = f"{speed / reference_speed:.2f}" if speed and reference_speed else "-"
            lines.append(
                _line(
                    rows[0]["terrain"],
                    rows[0]["controller"],
                    source,
                    str(len(rows)),
                    {name: _number(value, DIGITS[name]) for name, value in figures.items()},
                    ratio,
                )
            )
    lines += [
        f"blew up: {run['terrain']} {run['controller']} {source}, seed {run['seed']}, after "
        f"{run['seconds']} s"
        for source, run in unstable
    ]
    return "\n".join(lines)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _line(
    terrain: str, controller: str, source: str, n: str, figures: Mapping[str, str], ratio: str
) -> str:
    is_head = figures is STATISTICS
    columns = [
        f"{name if is_head else value:>{max(len(name), 7)}}" for name, value in figures.items()
    ]
    return f"{terrain:7} {controller:10} {source:9} {n:>3} {' '.join(columns)} {ratio:>11}"
