"""flyrl beside flygym-gymnasium: medians of all statistics, and paired differences of speed."""

from collections.abc import Sequence
from typing import Final

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


def by_seed(runs: Sequence[Row], terrain: str, statistic: str = "speed") -> pd.DataFrame:
    """A statistic by seed, in rows, and controller, in columns; NaN where a run blew up."""
    found = frame(runs)
    found = found[(found["terrain"] == terrain) & (found["outcome"] != UNSTABLE)]
    return found.pivot(index="seed", columns="controller", values=statistic).astype(float)


def reference_speed(reference: Sequence[Row], terrain: str, controller: str) -> float:
    """Median speed of the reference's runs, the earlier ones included, mm/s."""
    earlier = EARLIER_SPEEDS.get((terrain, controller), ())
    return float(np.median([*earlier, *by_seed(reference, terrain)[controller].dropna()]))


def hybrid_over(speeds: pd.DataFrame, other: str) -> Interval:
    """Mean difference hybrid - other over the seeds that both have walked, mm/s."""
    difference = (speeds["hybrid"] - speeds[other]).dropna()
    return paired_difference(difference, np.random.default_rng(0))


def interval_text(found: Interval) -> str:
    """The value and, where there is one, its interval."""
    bounds = "" if found.low is None else f" [{found.low:.2f}, {found.high:.2f}]"
    return f"{found.value:.2f}{bounds}"


def verdict(reference: Sequence[Row], runs: Sequence[Row]) -> str:
    """A line per physics and terrain, as text: medians, ratios to the reference, paired intervals.

    Only terrains that all three controllers have walked, with `MIN_RUNS` runs or more, have a line.
    """
    lines = ["median speed (mm/s), over the reference's; hybrid - other: mean and 95 % interval"]
    for physics in dict.fromkeys(run["physics"] for run in runs):
        of_physics = [run for run in runs if run["physics"] == physics]
        for terrain in dict.fromkeys(run["terrain"] for run in of_physics):
            speeds = by_seed(of_physics, terrain).reindex(columns=CONTROLLERS)
            if speeds.count().min() < MIN_RUNS:
                continue
            medians = speeds.median()
            ratios = [
                f"{name} {medians[name]:5.2f} "
                f"({medians[name] / reference_speed(reference, terrain, name):4.2f})"
                for name in CONTROLLERS
            ]
            differences = [
                f"hybrid-{other} {interval_text(hybrid_over(speeds, other))}"
                for other in ("cpg", "rule_based")
            ]
            cpg_over_hybrid = medians["cpg"] / medians["hybrid"]
            lines.append(
                f"{physics:9} {terrain:7} {'  '.join(ratios)}  cpg/hybrid {cpg_over_hybrid:4.2f}  "
                f"{'  '.join(differences)}"
            )
    return "\n".join(lines)
