"""Is it true? Walking beside flygym-gymnasium, steering and turning, and whether presets blow up.

From the root of the repository:
`python -m benchmarks.fidelity walking|classic|steering|turning|stability`.
"""

import argparse
import sys
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.fidelity import classic, results, stability, steering, steering_table, turning
from benchmarks.fidelity.calibration import CHOOSING_SEEDS
from benchmarks.fidelity.comparison import table, verdict
from benchmarks.fidelity.flyrl_runs import config, rows
from benchmarks.fidelity.statistics import STATISTICS
from benchmarks.machine import machine
from flyrl.simulation.physics import FLY_PRESETS

JUDGING_SEED = CHOOSING_SEEDS.stop
"""Presets are chosen with seeds below, and judged with those from here on."""


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.fidelity", description=(__doc__ or "").splitlines()[0]
    )
    studies = parser.add_subparsers(dest="study", required=True)

    def study(name: str, about: str) -> argparse.ArgumentParser:
        added = studies.add_parser(name, help=about)
        added.add_argument("--physics", nargs="+", choices=FLY_PRESETS, default=list(FLY_PRESETS))
        added.add_argument("--threads", type=int, default=0, help="0 takes one per CPU")
        return added

    def choice(added: argparse.ArgumentParser, option: str, allowed: tuple[str, ...]) -> None:
        added.add_argument(option, nargs="+", choices=allowed, default=allowed)

    def starts(added: argparse.ArgumentParser, conditions: int, meaning: str) -> None:
        added.add_argument("--conditions", type=int, default=conditions, help=meaning)
        added.add_argument(
            "--first-seed", type=int, default=JUDGING_SEED,
            help=f"seed of the first; the presets were chosen with seeds below {JUDGING_SEED}",
        )  # fmt: skip

    def stored(added: argparse.ArgumentParser, name: str) -> None:
        added.add_argument(
            "--output", type=Path, default=Path(f"runs/{name}.json"), help="where the runs go"
        )
        added.add_argument(
            "--collect", type=Path, metavar="FOLDER",
            help="run nothing, add the reference's runs in FOLDER to those that are stored",
        )  # fmt: skip

    walking = study("walking", "straight ahead, beside flygym-gymnasium")
    tutorials = study("classic", "the classic body, beside flygym 0.2.5")
    for added, name, controllers, seconds in (
        (walking, "fidelity", results.CONTROLLERS, 1.5),
        (tutorials, "classic", classic.CONTROLLERS, 1.0),
    ):
        choice(added, "--terrains", results.TERRAINS)
        choice(added, "--controllers", controllers)
        starts(added, 20, "starts, a seed each")
        added.add_argument("--seconds", type=float, default=seconds, help="simulated time of a run")
        stored(added, name)
        added.add_argument(
            "--show", action="store_true", help="run nothing, print what is in --output"
        )

    turn = study("turning", "yaw rate over a grid of drives; the first preset is 1")
    turn.add_argument("--size", type=int, default=9, help="levels of drive of each side")
    starts(turn, 8, "flies per pair of drives")
    turn.add_argument("--seconds", type=float, default=1.3, help="simulated time, 0.3 s to settle")

    steered = study("steering", "falls and tilt while steered")
    choice(steered, "--terrains", steering.TERRAINS)
    choice(steered, "--drives", steering.ALL_KINDS)
    starts(steered, 200, "starts, a seed each")
    stored(steered, "steering")
    steered.add_argument(
        "--show", type=Path, nargs="+", metavar="FILE", help="run nothing, print what these hold"
    )

    stable = study("stability", "random drives until a fall or time is up")
    choice(stable, "--terrains", results.TERRAINS)
    stable.add_argument("--episodes", type=int, default=500, help="per preset and terrain")
    stable.add_argument("--seconds", type=float, default=3.0, help="simulated time of an episode")
    return parser.parse_args()


def _walk(chosen: argparse.Namespace) -> None:
    is_classic = chosen.study == "classic"
    path = classic.REFERENCE if is_classic else results.REFERENCE
    settings = classic.classic_config if is_classic else config
    to_row = classic.row if is_classic else results.row
    reference = results.read(path)
    if chosen.collect is not None:
        results.write(path, results.collect(chosen.collect, reference, to_row))
        return
    seeds = range(chosen.first_seed, chosen.first_seed + chosen.conditions)
    found: list[results.Row] = []
    cells = product(chosen.physics, chosen.terrains, chosen.controllers)
    for physics, terrain, controller in () if chosen.show else cells:
        print(f"{physics} {terrain} {controller}", file=sys.stderr)
        about = {"terrain": terrain, "controller": controller, "physics": physics}
        walked = settings(controller, terrain, physics)
        found += rows(walked, seeds, chosen.seconds, chosen.threads, to_row, **about)
        results.write(chosen.output, {"machines": [machine()], "runs": found})
    found = results.read(chosen.output)["runs"]
    if is_classic:
        print(classic.tables(reference["runs"], found))
        return
    print(table(reference["runs"], found))
    for name, meaning in STATISTICS.items():
        print(f"  {name:16} {meaning}")
    print(verdict(reference["runs"], found))


def _turn(chosen: argparse.Namespace) -> None:
    first = None
    levels = turning.drives(chosen.size)
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
        print("        " + "".join(f"{level:8.2f}" for level in levels))
        for level, row in zip(levels, rates, strict=True):
            print(f"{level:8.2f}" + "".join(f"{rate:8.0f}" for rate in row))
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


def _steer(chosen: argparse.Namespace) -> None:
    reference = results.read(steering.REFERENCE)
    if chosen.collect is not None:
        collected = results.collect(
            chosen.collect, reference, steering.reference_row, steering.place
        )
        results.write(steering.REFERENCE, collected)
        return
    seeds = range(chosen.first_seed, chosen.first_seed + chosen.conditions)
    found: list[steering.Row] = []
    cells = product(chosen.terrains, chosen.drives, chosen.physics)
    for terrain, kind, physics in () if chosen.show else cells:
        found += steering.steer(physics, terrain, kind, seeds, chosen.threads)
        results.write(chosen.output, {"machines": [machine()], "runs": found})
    for path in chosen.show or ():
        found += results.read(path)["runs"]
    print(steering_table.table(found, reference["runs"]))


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
    studies = {
        "walking": _walk,
        "classic": _walk,
        "turning": _turn,
        "steering": _steer,
        "stability": _stay_stable,
    }
    studies[chosen.study](chosen)


if __name__ == "__main__":
    main()
