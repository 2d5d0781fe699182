"""What steered runs come to: a row per ground, kind of drives and preset, beside `reference`."""

from collections.abc import Callable, Iterable, Sequence
from itertools import product
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.fidelity.comparison import interval_text
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


def tilt_ratio(rows: Sequence[Row], others: Sequence[Row]) -> Estimate:
    """95th percentile of the tilt over that of the others, from the same starts.

    Tilts are whole degrees, so the ratio moves in steps of a few percent.
    """
    return _bootstrap(
        tilt_counts(rows),
        tilt_counts(others),
        lambda a, b: _ratio(percentile(a, 95), percentile(b, 95)),
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
        Of means (…,) or (…, k); NaN where there is none.
    """
    rng = np.random.default_rng(0)
    weights = rng.multinomial(len(a), np.full(len(a), 1 / len(a)), size=RESAMPLES) / len(a)
    value = float(statistic(a.mean(axis=0), b.mean(axis=0)))
    drawn = np.asarray(statistic(weights @ a, weights @ b))
    if not np.isfinite(drawn).any():
        return Estimate(value, np.nan, np.nan)
    low, high = np.nanpercentile(drawn, (2.5, 97.5))
    return Estimate(value, float(low), float(high))


def pairs(rows: Iterable[Row], others: Iterable[Row]) -> tuple[list[Row], list[Row]]:
    """Runs of both from the seeds that both have, in the order of the seeds."""
    first, second = ({row["seed"]: row for row in each} for each in (rows, others))
    seeds = sorted(first.keys() & second.keys())
    return [first[seed] for seed in seeds], [second[seed] for seed in seeds]


def table(flygym: Sequence[Row], rows: Sequence[Row]) -> str:
    """Figures per ground, kind of drives and physics, as text.

    Parameters
    ----------
    flygym
        Of `collect`; beside them `reference` stands once more, on the same seeds alone.
    rows
        Of `steer`.
    """
    lines = []
    for terrain, kind in product(TERRAINS, ALL_KINDS):
        own, published = (
            [row for row in each if (row["terrain"], row["kind"]) == (terrain, kind)]
            for each in (rows, flygym)
        )
        by_physics = {
            name: [row for row in own if row["physics"] == name]
            for name in dict.fromkeys(row["physics"] for row in own)
        }
        reference = by_physics.get("reference", [])
        for name, found in by_physics.items():
            lines.append(_line(name, found, [] if name == "reference" else reference))
        shared, same = pairs(reference, published)
        if shared:
            lines += [_line("(reference)", shared, []), _line("flygym", same, shared)]
    unstable = [
        f"blew up: {row['terrain']} {row['kind']} {row['physics']}, seed {row['seed']}"
        for row in rows
        if row["outcome"] == UNSTABLE
    ]
    return "\n".join([pd.DataFrame(lines).to_string(index=False, na_rep=""), *unstable])


def _line(name: str, rows: Sequence[Row], reference: Sequence[Row]) -> Row:
    counts = tilt_counts(rows).sum(axis=0)
    line = {
        "terrain": rows[0]["terrain"],
        "drives": rows[0]["kind"],
        "physics": name,
        "n": len(rows),
        "falls": f"{falls(rows).mean():.1%}",
        "falls/s": f"{fall_rate(rows):.3f}",
        "tilt 5, 50, 95 %": ", ".join(f"{percentile(counts, each):.0f}" for each in PERCENTILES),
        "mm/s": f"{np.median([row['speed'] for row in rows if row['speed'] is not None]):.1f}",
        "|deg/s|": "{:.0f}".format(
            np.median([abs(row["yaw_deg"]) / row["seconds"] for row in rows if row["seconds"]])
        ),
    }
    own, same = pairs(rows, reference)
    if own:
        line["falls - reference"] = interval_text(paired_falls(own, same), "+.1%")
        line["falls / reference"] = interval_text(fall_ratio(own, same))
        line["tilt 95 % / reference"] = interval_text(tilt_ratio(own, same))
    return line
