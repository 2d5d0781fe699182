"""Speeds beside the reference's, and whether the controllers come in its order."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import stats

from benchmarks.fidelity.results import CONTROLLERS, TERRAINS, Row
from flyrl.evaluation.studies import STUDIES
from flyrl.tasks import UNSTABLE

EARLIER_SPEEDS: Final = STUDIES["controller_comparison"].figures[0].values
"""mm/s; runs of flygym-gymnasium 1.3.2 from before this benchmark, of which only the speed is left.
They count in the reference's median beside the runs in `reference.json`."""


@dataclass(frozen=True)
class Comparison:
    """The hybrid controller against another one, on the same initial conditions.

    Attributes
    ----------
    ratio : median speed of the other one over the hybrid's.
    low, high : 95 % bootstrap interval of the mean paired difference, hybrid - other, mm/s.
    """

    ratio: float
    low: float
    high: float


def reference_speed(reference: Sequence[Row], terrain: str, controller: str) -> float:
    """Median speed of the reference's runs, the earlier ones included, mm/s."""
    earlier = EARLIER_SPEEDS.get((terrain, controller), ())
    return float(np.median([*earlier, *speeds(reference, terrain, controller).values()]))


def speeds(runs: Sequence[Row], terrain: str, controller: str) -> dict[int, float]:
    """Speed by seed, mm/s; a run that blew up has none."""
    return {
        run["seed"]: run["statistics"]["speed"]
        for run in runs
        if (run["terrain"], run["controller"]) == (terrain, controller)
        and run["outcome"] != UNSTABLE
    }


def compare_hybrid(runs: Sequence[Row], terrain: str, other: str) -> Comparison:
    """Compare over the seeds that both have walked."""
    hybrid, rival = speeds(runs, terrain, "hybrid"), speeds(runs, terrain, other)
    shared = sorted(hybrid.keys() & rival.keys())
    first = np.array([hybrid[seed] for seed in shared])
    second = np.array([rival[seed] for seed in shared])
    interval = stats.bootstrap(
        (first - second,), np.mean, method="percentile", rng=np.random.default_rng(0)
    ).confidence_interval
    ratio = float(np.median(second) / np.median(first))
    return Comparison(ratio, float(interval.low), float(interval.high))


def verdict(reference: Sequence[Row], runs: Sequence[Row]) -> str:
    """A line per physics and terrain, as text: medians, ratios to the reference, paired intervals.

    Only terrains that all three controllers have walked, with five runs or more, have a line.
    """
    lines = ["median speed (mm/s), over the reference's; hybrid - other: 95 % interval of the mean"]
    for physics in dict.fromkeys(run["physics"] for run in runs):
        of_physics = [run for run in runs if run["physics"] == physics]
        for terrain in TERRAINS:
            found = {name: speeds(of_physics, terrain, name) for name in CONTROLLERS}
            if min(map(len, found.values())) < 5:
                continue
            medians = []
            for name, values in found.items():
                median = float(np.median(list(values.values())))
                ratio = median / reference_speed(reference, terrain, name)
                medians.append(f"{name} {median:5.2f} ({ratio:4.2f})")
            cpg = compare_hybrid(of_physics, terrain, "cpg")
            rules = compare_hybrid(of_physics, terrain, "rule_based")
            lines.append(
                f"{physics:9} {terrain:7} {'  '.join(medians)}  cpg/hybrid {cpg.ratio:4.2f}  "
                f"hybrid-cpg [{cpg.low:5.2f}, {cpg.high:5.2f}]  "
                f"hybrid-rules [{rules.low:5.2f}, {rules.high:5.2f}]"
            )
    return "\n".join(lines)
