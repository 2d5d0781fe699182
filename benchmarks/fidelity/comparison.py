"""flyrl beside flygym-gymnasium: medians of all statistics, and paired differences of speed."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from benchmarks.fidelity.results import CONTROLLERS, TERRAINS, Row, frame
from benchmarks.fidelity.statistics import STATISTICS
from flyrl.evaluation.statistics import Interval, paired_difference
from flyrl.evaluation.studies import STUDIES
from flyrl.tasks import UNSTABLE

FLYGYM: Final = "flygym"

EARLIER_SPEEDS: Final = STUDIES["controller_comparison"].figures[0].values
"""mm/s; runs of flygym-gymnasium 1.3.2 from before this benchmark, of which only the speed is left.
They count in the reference's median beside the runs in `reference.json`."""

MIN_RUNS: Final = 5
"""Of each controller, from which on they are compared."""


def text(reference: Sequence[Row], runs: Sequence[Row]) -> str:
    """Table, what its columns mean, and the verdict."""
    meanings = [f"  {name:16} {meaning}" for name, meaning in STATISTICS.items()]
    return "\n".join([table(reference, runs), *meanings, verdict(reference, runs)])


def table(reference: Sequence[Row], runs: Sequence[Row]) -> str:
    """Medians of all statistics (of falls the share) and speed over the reference's, as text.

    Runs that blew up are named below the table and count for nothing in it.
    """
    found = frame([*({**run, "physics": FLYGYM} for run in reference), *runs])
    orders = {"terrain": TERRAINS, "controller": CONTROLLERS, "physics": found["physics"].unique()}
    for name, order in orders.items():
        found[name] = found[name].astype(pd.CategoricalDtype(list(order)))
    is_lost = found["outcome"] == UNSTABLE
    groups = found[~is_lost].groupby([*orders], observed=True)
    cells = groups[[*STATISTICS]].median()
    cells["fall"] = groups["fall"].mean()
    cells.insert(0, "n", groups.size())
    is_flygym = cells.index.get_level_values("physics") == FLYGYM
    cell = cells["speed"].where(is_flygym).groupby(["terrain", "controller"], observed=True)
    cells["speed_ratio"] = cells["speed"] / cell.transform("first")
    lines = [
        cells.reset_index().to_string(index=False, na_rep="-", float_format=lambda x: f"{x:.4g}")
    ]
    lines += [
        f"blew up: {run.terrain} {run.controller} {run.physics}, seed {run.seed}, after "
        f"{run.seconds} s"
        for run in found[is_lost].itertuples()
    ]
    return "\n".join(lines)


def by_seed(runs: pd.DataFrame, statistic: str = "speed") -> pd.DataFrame:
    """A statistic on one terrain by seed, in rows, and controller; of runs that did not blow up."""
    sound = runs[runs["outcome"] != UNSTABLE]
    return sound.pivot(index="seed", columns="controller", values=statistic).astype(float)


def reference_speed(reference: Sequence[Row], terrain: str, controller: str) -> float:
    """Median speed of the reference's runs, the earlier ones included, mm/s."""
    earlier = EARLIER_SPEEDS.get((terrain, controller), ())
    walked = frame(run for run in reference if run["terrain"] == terrain)
    return float(np.median([*earlier, *by_seed(walked)[controller].dropna()]))


def hybrid_over(speeds: pd.DataFrame, other: str) -> Interval:
    """Mean difference hybrid - other over the seeds that both have walked, mm/s."""
    difference = (speeds["hybrid"] - speeds[other]).dropna()
    return paired_difference(difference, np.random.default_rng(0))


def interval_text(found: Any, form: str = ".2f") -> str:
    """The `value` of an estimate and, where it has one, its interval from `low` to `high`."""
    bounds = "" if found.low is None else f" [{found.low:{form}}, {found.high:{form}}]"
    return f"{found.value:{form}}{bounds}"


def verdict(reference: Sequence[Row], runs: Sequence[Row]) -> str:
    """Medians of speed, mm/s (over the reference's), and hybrid - others with its 95 % interval.

    Only terrains that all three controllers have walked, with `MIN_RUNS` runs or more, have a line.
    """
    lines = []
    for (physics, terrain), walked in frame(runs).groupby(["physics", "terrain"], sort=False):
        speeds = by_seed(walked).reindex(columns=CONTROLLERS)
        if speeds.count().min() < MIN_RUNS:
            continue
        line = {"physics": physics, "terrain": terrain}
        medians = speeds.median()
        for name in CONTROLLERS:
            ratio = medians[name] / reference_speed(reference, str(terrain), name)
            line[name] = f"{medians[name]:.2f} ({ratio:.2f})"
        line["cpg/hybrid"] = f"{medians['cpg'] / medians['hybrid']:.2f}"
        for other in ("cpg", "rule_based"):
            line[f"hybrid - {other}"] = interval_text(hybrid_over(speeds, other))
        lines.append(line)
    return pd.DataFrame(lines).to_string(index=False)
