"""What steered runs come to: a table per ground and kind of drives, presets beside `reference`."""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.fidelity.steering import ALL_KINDS, TERRAINS, Row
from flyrl.tasks import UNSTABLE
from flyrl.tasks.task import FALL

Array = NDArray[np.float64]

RESAMPLES: Final = 2000
PERCENTILES: Final = (5, 50, 95)

_MAX_TILT_DEG: Final = 180


class Estimate(NamedTuple):
    """A figure with its 95 % interval; NaN where there is none."""

    value: float
    low: float
    high: float


def falls(rows: Sequence[Row]) -> Array:
    """1 for a run that ended with a fall, else 0, (n,)."""
    return np.array([float(row["outcome"] == FALL) for row in rows])


def fall_rate(rows: Sequence[Row]) -> float:
    """Falls per second of walking."""
    seconds = sum(row["seconds"] for row in rows)
    return float(falls(rows).sum() / seconds) if seconds else float("nan")


def tilt_counts(rows: Sequence[Row]) -> Array:
    """Samples of a tilt of 0, 1, … degrees, (n, 181)."""
    return np.array([np.bincount(row["tilt_deg"], minlength=_MAX_TILT_DEG + 1) for row in rows])


def percentile(counts: Array, percent: float) -> Array:
    """Smallest tilt, deg, that `percent` of the samples do not exceed; (…,) of counts (…, 181)."""
    summed = np.cumsum(counts, axis=-1)
    return np.asarray(np.argmax(summed >= percent / 100 * summed[..., -1:], axis=-1), dtype=float)


def paired_falls(rows: Sequence[Row], others: Sequence[Row]) -> Estimate:
    """Share of falls less that of the others, from the same starts."""
    return _bootstrap(falls(rows), falls(others), lambda a, b: a - b)


def fall_ratio(rows: Sequence[Row], others: Sequence[Row]) -> Estimate:
    """Falls over those of the others, from the same starts."""
    return _bootstrap(falls(rows), falls(others), _ratio)


def tilt_ratio(rows: Sequence[Row], others: Sequence[Row], percent: float = 95) -> Estimate:
    """Percentile of the tilt over that of the others, from the same starts.

    Tilts are whole degrees, so the ratio moves in steps of a few percent.
    """
    return _bootstrap(
        tilt_counts(rows),
        tilt_counts(others),
        lambda a, b: _ratio(percentile(a, percent), percentile(b, percent)),
    )


def _ratio(a: Array, b: Array) -> Array:
    return np.divide(a, b, out=np.full_like(a, np.nan), where=b != 0)


def _bootstrap(a: Array, b: Array, statistic: Callable[[Array, Array], Array]) -> Estimate:
    """Statistic of the means over runs; runs are drawn anew, the same ones of both.

    Parameters
    ----------
    a, b
        One row per run, (n,) or (n, k).
    statistic
        Of means (…,) or (…, k).
    """
    rng = np.random.default_rng(0)
    weights = rng.multinomial(len(a), np.full(len(a), 1 / len(a)), size=RESAMPLES) / len(a)
    value = statistic(a.mean(axis=0), b.mean(axis=0))
    drawn = np.asarray(statistic(weights @ a, weights @ b))
    drawn = drawn[np.isfinite(drawn)]
    if not len(drawn):
        return Estimate(float(value), float("nan"), float("nan"))
    low, high = np.percentile(drawn, (2.5, 97.5))
    return Estimate(float(value), float(low), float(high))


def pairs(rows: Iterable[Row], others: Iterable[Row]) -> tuple[list[Row], list[Row]]:
    """Runs of both from the seeds that both have, in the order of the seeds."""
    first, second = ({row["seed"]: row for row in each} for each in (rows, others))
    seeds = sorted(first.keys() & second.keys())
    return [first[seed] for seed in seeds], [second[seed] for seed in seeds]


def table(rows: Sequence[Row], flygym: Sequence[Row] = ()) -> str:
    """Figures per ground, kind of drives and physics, as text.

    Parameters
    ----------
    rows
        Of `steer`.
    flygym
        Of `collect`; beside them `reference` stands once more, on the same seeds alone.
    """
    lines = [
        f"{'terrain':8}{'drives':9}{'physics':11}{'n':>5} {'falls':>6} {'falls/s':>8} "
        f"{'tilt 5, 50, 95 %':>17} {'mm/s':>6} {'|deg/s|':>8}   falls - reference      "
        "falls / reference     tilt 95 % / reference"
    ]
    for terrain in TERRAINS:
        for kind in ALL_KINDS:
            cells = _by_physics(rows, terrain, kind)
            reference = cells.get("reference", [])
            lines += [_line(name, own, reference) for name, own in cells.items()]
            published = _by_physics(flygym, terrain, kind).get("flygym", [])
            shared, same = pairs(reference, published)
            if shared:
                lines.append(_line("(reference)", shared, []))
                lines.append(_line("flygym", same, shared))
    unstable = [row for row in rows if row["outcome"] == UNSTABLE]
    lines += [
        f"blew up: {row['terrain']} {row['kind']} {row['physics']}, seed {row['seed']}"
        for row in unstable
    ]
    return "\n".join(lines)


def _by_physics(rows: Iterable[Row], terrain: str, kind: str) -> dict[str, list[Row]]:
    cells: dict[str, list[Row]] = {}
    for row in rows:
        if (row["terrain"], row["kind"]) == (terrain, kind):
            cells.setdefault(row["physics"], []).append(row)
    return cells


def _line(name: str, rows: Sequence[Row], reference: Sequence[Row]) -> str:
    counts = tilt_counts(rows).sum(axis=0)
    tilts = [float(percentile(counts, percent)) for percent in PERCENTILES]
    speeds = [row["speed"] for row in rows if row["speed"] is not None]
    rates = [abs(row["yaw_deg"]) / row["seconds"] for row in rows if row["seconds"]]
    text = (
        f"{rows[0]['terrain']:8}{rows[0]['kind']:9}{name:11}{len(rows):>5} "
        f"{falls(rows).mean():>6.1%} {fall_rate(rows):>8.3f} "
        f"{', '.join(f'{tilt:.0f}' for tilt in tilts):>17} {np.median(speeds):>6.1f} "
        f"{np.median(rates):>8.0f}"
    )
    own, same = pairs(rows, reference)
    if not own or name == "reference":
        return text
    difference, ratio, tilt = paired_falls(own, same), fall_ratio(own, same), tilt_ratio(own, same)
    return (
        f"{text}   {difference.value:+.1%} [{difference.low:+.1%}, {difference.high:+.1%}]"
        f"   {ratio.value:.2f} [{ratio.low:.2f}, {ratio.high:.2f}]"
        f"   {tilt.value:.2f} [{tilt.low:.2f}, {tilt.high:.2f}]"
    )
