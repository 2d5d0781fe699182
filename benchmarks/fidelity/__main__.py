"""Is it true? Walking beside flygym-gymnasium, steering and turning, and whether presets blow up.

From the root of the repository:
`python -m benchmarks.fidelity walking|classic|steering|turning|stability`.
"""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from benchmarks.fidelity import classic, comparison, results, stability, steering, turning
from benchmarks.fidelity.calibration import CHOOSING_SEEDS
from benchmarks.fidelity.flyrl_runs import rows
from benchmarks.fidelity.results import Row
from benchmarks.fidelity.steering_table import table
from benchmarks.machine import machine
from flyrl.simulation.physics import FLY_PRESETS

JUDGING_SEED = CHOOSING_SEEDS.stop
"""Presets are chosen with seeds below, and judged with those from here on."""


class Study(NamedTuple):
    """A study beside stored runs of a published package.

    Attributes
    ----------
    about
        What is done.
    reference
        File of the package's runs.
    to_row, place
        As `results.collect` takes them.
    measure
        Rows of a physics, terrain and kind: of controllers, or of drives.
    text
        Tables of the reference's rows and flyrl's.
    terrains, option, kinds
        Which there are, and the option that chooses among the kinds.
    starts, seconds
        How many there are usually, and how long a run is.
    """

    about: str
    reference: Path
    to_row: Callable[..., Row]
    place: Callable[[Row], tuple[int, ...]]
    measure: Callable[..., list[Row]]
    text: Callable[[Sequence[Row], Sequence[Row]], str]
    terrains: Sequence[str]
    option: str
    kinds: Sequence[str]
    starts: int
    seconds: float


# fmt: off
STUDIES: Final = {
    "walking": Study(
        "straight ahead, beside flygym-gymnasium", results.REFERENCE, results.row, results.place,
        rows, comparison.text,
        results.TERRAINS, "--controllers", results.CONTROLLERS, 20, 1.5,
    ),
    "classic": Study(
        "the classic body, beside flygym 0.2.5", classic.REFERENCE, classic.row, results.place,
        partial(rows, settings=classic.classic_config, to_row=classic.row), classic.tables,
        results.TERRAINS, "--controllers", classic.CONTROLLERS, 20, 1.0,
    ),
    "steering": Study(
        "falls and tilt while steered", steering.REFERENCE, steering.reference_row, steering.place,
        steering.steer, table,
        steering.TERRAINS, "--drives", steering.ALL_KINDS, 200, steering.SECONDS,
    ),
}
# fmt: on


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.fidelity", description=(__doc__ or "").splitlines()[0]
    )
    studies = parser.add_subparsers(dest="study", required=True)

    def study(name: str, about: str, seconds: float, terrains: Sequence[str] = ()) -> Any:
        add = studies.add_parser(name, help=about).add_argument
        add("--physics", nargs="+", choices=FLY_PRESETS, default=list(FLY_PRESETS))
        add("--threads", type=int, default=0, help="0 takes one per CPU")
        add("--seconds", type=float, default=seconds, help="simulated time of a run")
        if terrains:
            add("--terrains", nargs="+", choices=terrains, default=terrains)
        return add

    def starts(add: Any, count: int, meaning: str) -> None:
        add("--conditions", type=int, default=count, help=meaning)
        add("--first-seed", type=int, default=JUDGING_SEED,
            help=f"seed of the first; the presets were chosen with seeds below {JUDGING_SEED}",
        )  # fmt: skip

    for name, each in STUDIES.items():
        add = study(name, each.about, each.seconds, each.terrains)
        add(each.option, dest="kinds", nargs="+", choices=each.kinds, default=each.kinds)
        starts(add, each.starts, "starts, a seed each")
        add("--output", type=Path, default=Path(f"runs/{name}.json"), help="where the runs go")
        add("--show", type=Path, nargs="*", metavar="FILE",
            help="run nothing, print what these hold, or what is in --output")  # fmt: skip
        add("--collect", type=Path, metavar="FOLDER",
            help="run nothing, add the reference's runs in FOLDER to those that are stored",
        )  # fmt: skip
    add = study("turning", "yaw rate over a grid of drives; the first preset is 1", 1.3)
    add("--size", type=int, default=9, help="levels of drive of each side")
    starts(add, 8, "flies per pair of drives")
    add = study("stability", "random drives until a fall or time is up", 3.0, results.TERRAINS)
    add("--episodes", type=int, default=500, help="per preset and terrain")
    return parser.parse_args()


def _compare(chosen: argparse.Namespace, study: Study) -> None:
    reference = results.read(study.reference)
    if chosen.collect is not None:
        collected = results.collect(chosen.collect, reference, study.to_row, study.place)
        results.write(study.reference, collected)
        return
    found: list[Row] = []
    if chosen.show is None:
        seeds = range(chosen.first_seed, chosen.first_seed + chosen.conditions)
        for cell in product(chosen.physics, chosen.terrains, chosen.kinds):
            found += study.measure(*cell, seeds, chosen.threads, chosen.seconds)
            results.write(chosen.output, {"machines": [machine()], "runs": found})
    else:
        for path in chosen.show or [chosen.output]:
            found += results.read(path)["runs"]
    print(study.text(reference["runs"], found))


def _turn(chosen: argparse.Namespace) -> None:
    first = None
    levels = turning.levels(chosen.size).round(2)
    for physics in chosen.physics:
        rates, falls = turning.yaw_rates(
            physics,
            chosen.size,
            chosen.conditions,
            chosen.seconds,
            chosen.threads,
            chosen.first_seed,
        )
        print(f"{physics}: yaw rate (deg/s); rows: left drive, columns: right drive")
        print(pd.DataFrame(rates.round(), levels, levels).to_string())
        print(f"  largest share of falls {falls.max():.2f}")
        if first is None:
            first = rates
            continue
        difference = turning.relative_difference(rates, first)
        worst = np.abs(rates - first).max()
        print(
            f"  against {chosen.physics[0]}: rms difference {difference:.3f} of its rms, slope "
            f"{turning.slope(rates, first):.3f}, largest difference {worst:.0f} deg/s"
        )


def _stay_stable(chosen: argparse.Namespace) -> None:
    for physics, terrain in product(chosen.physics, chosen.terrains):
        ended, warned = stability.outcomes(
            physics, terrain, chosen.episodes, chosen.seconds, chosen.threads
        )
        warnings = ", ".join(f"{name} {number}" for name, number in warned.items()) or "none"
        print(f"{physics} {terrain}: {dict(ended)}; MuJoCo's warnings: {warnings}", flush=True)


def main() -> None:
    """Run a study, or read it, and print it."""
    chosen = _arguments()
    if chosen.study in STUDIES:
        _compare(chosen, STUDIES[chosen.study])
    elif chosen.study == "turning":
        _turn(chosen)
    else:
        _stay_stable(chosen)


if __name__ == "__main__":
    main()
