"""Is it true? Walking beside flygym-gymnasium, steering and turning, and whether presets blow up.

From the root of the repository:
`python -m benchmarks.fidelity walking|classic|steering|turning|stability`.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from benchmarks.fidelity import classic, results, stability, steering, steering_table, turning
from benchmarks.fidelity.calibration import CHOOSING_SEEDS
from benchmarks.fidelity.compare import table
from benchmarks.fidelity.flyrl_runs import config, walk_straight
from benchmarks.fidelity.statistics import STATISTICS
from benchmarks.fidelity.verdict import verdict
from benchmarks.machine import machine
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.tasks import TIMEOUT, UNSTABLE

JUDGING_SEED = CHOOSING_SEEDS.stop
"""Presets are chosen with seeds below, and judged with those from here on."""


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.fidelity", description=(__doc__ or "").splitlines()[0]
    )
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--physics", nargs="+", choices=FLY_PRESETS, default=list(FLY_PRESETS))
    common.add_argument("--threads", type=int, default=0, help="0 takes one per CPU")
    grounds = argparse.ArgumentParser(add_help=False)
    grounds.add_argument(
        "--terrains", nargs="+", choices=results.TERRAINS, default=results.TERRAINS
    )
    studies = parser.add_subparsers(dest="study", required=True)
    seed_help = f"seed of the first; the presets were chosen with seeds below {JUDGING_SEED}"

    walking = studies.add_parser(
        "walking", parents=[common, grounds], help="straight ahead, beside flygym-gymnasium"
    )
    walking.add_argument(
        "--controllers", nargs="+", choices=results.CONTROLLERS, default=results.CONTROLLERS
    )
    tutorials = studies.add_parser(
        "classic", parents=[common], help="the classic body, beside flygym 0.2.5"
    )
    compared = (
        (walking, 1.5, "fidelity", "reference.py"),
        (tutorials, 1.0, "classic", "classic_reference.py"),
    )
    for study, seconds, name, script in compared:
        study.add_argument("--conditions", type=int, default=20, help="starts, a seed each")
        study.add_argument("--first-seed", type=int, default=JUDGING_SEED, help=seed_help)
        study.add_argument("--seconds", type=float, default=seconds, help="simulated time of a run")
        study.add_argument(
            "--output", type=Path, default=Path(f"runs/{name}.json"), help="where the runs go"
        )
        study.add_argument(
            "--show", action="store_true", help="run nothing, print what is in --output"
        )
        study.add_argument(
            "--collect", type=Path, metavar="FOLDER",
            help=f"run nothing, add the runs of {script} in FOLDER to the reference",
        )  # fmt: skip

    turn = studies.add_parser(
        "turning", parents=[common], help="yaw rate over a grid of drives; the first preset is 1"
    )
    turn.add_argument("--size", type=int, default=9, help="levels of drive of each side")
    turn.add_argument("--conditions", type=int, default=8, help="flies per pair of drives")
    turn.add_argument("--first-seed", type=int, default=JUDGING_SEED, help=seed_help)
    turn.add_argument("--seconds", type=float, default=1.3, help="simulated time, 0.3 s to settle")

    steered = studies.add_parser("steering", parents=[common], help="falls and tilt while steered")
    steered.add_argument(
        "--terrains", nargs="+", choices=steering.TERRAINS, default=steering.TERRAINS
    )
    steered.add_argument(
        "--drives", nargs="+", choices=steering.ALL_KINDS, default=steering.ALL_KINDS
    )
    steered.add_argument("--conditions", type=int, default=200, help="starts, a seed each")
    steered.add_argument("--first-seed", type=int, default=JUDGING_SEED, help=seed_help)
    steered.add_argument(
        "--output", type=Path, default=Path("runs/steering.json"), help="where the runs are written"
    )
    steered.add_argument(
        "--show", type=Path, nargs="+", metavar="FILE", help="run nothing, print what these hold"
    )
    steered.add_argument(
        "--collect", type=Path, metavar="FOLDER",
        help="run nothing, add the runs of reference.py in FOLDER to reference_steering.json",
    )  # fmt: skip

    stable = studies.add_parser(
        "stability", parents=[common, grounds], help="random drives until a fall or time is up"
    )
    stable.add_argument("--episodes", type=int, default=500, help="per preset and terrain")
    stable.add_argument("--seconds", type=float, default=3.0, help="simulated time of an episode")
    return parser.parse_args()


def _walk(chosen: argparse.Namespace) -> None:
    if chosen.collect is not None:
        known = results.read(results.REFERENCE)
        results.write(results.REFERENCE, results.collect(chosen.collect, known))
        return
    rows = results.read(chosen.output)["runs"] if chosen.show else _run(chosen)
    reference = results.read(results.REFERENCE)["runs"]
    print(table(reference, rows))
    for name, meaning in STATISTICS.items():
        print(f"  {name:16} {meaning}")
    print(verdict(reference, rows))


def _run(chosen: argparse.Namespace) -> list[results.Row]:
    rows = []
    seeds = list(range(chosen.first_seed, chosen.first_seed + chosen.conditions))
    for physics in chosen.physics:
        for terrain in chosen.terrains:
            for controller in chosen.controllers:
                print(f"{physics} {terrain} {controller}", file=sys.stderr)
                about = {"terrain": terrain, "controller": controller, "physics": physics}
                walks = walk_straight(
                    config(controller, terrain, physics), seeds, chosen.seconds, chosen.threads
                )
                for seed, walk in zip(seeds, walks, strict=True):
                    is_whole = walk.time[-1] > chosen.seconds - 1e-6
                    outcome = TIMEOUT if is_whole else UNSTABLE
                    rows.append(results.row(walk, **about, seed=seed, outcome=outcome))
                found = {"machines": [machine()], "statistics": STATISTICS, "runs": rows}
                results.write(chosen.output, found)
    return rows


def _walk_classic(chosen: argparse.Namespace) -> None:
    if chosen.collect is not None:
        known = (
            results.read(classic.REFERENCE)
            if classic.REFERENCE.exists()
            else {"machines": [], "runs": []}
        )
        results.write(classic.REFERENCE, results.collect(chosen.collect, known, to_row=classic.row))
        return
    seeds = range(chosen.first_seed, chosen.first_seed + chosen.conditions)
    if not chosen.show:
        rows = []
        for physics in chosen.physics:
            for terrain in classic.GROUNDS:
                for controller in classic.CONTROLLERS:
                    print(f"{physics} {terrain} {controller}", file=sys.stderr)
                    rows += classic.walk_classic(
                        physics, terrain, controller, seeds, chosen.seconds, chosen.threads
                    )
        results.write(chosen.output, {"machines": [machine()], "runs": rows})
    published = results.read(classic.REFERENCE)["runs"]
    print(classic.tables(published, results.read(chosen.output)["runs"]))


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
    if chosen.collect is not None:
        published = results.read(steering.REFERENCE)
        results.write(steering.REFERENCE, steering.collect(chosen.collect, published))
        return
    if chosen.show:
        rows = [row for path in chosen.show for row in results.read(path)["runs"]]
    else:
        rows = []
        seeds = range(chosen.first_seed, chosen.first_seed + chosen.conditions)
        for terrain in chosen.terrains:
            for kind in chosen.drives:
                for physics in chosen.physics:
                    rows += steering.steer(physics, terrain, kind, seeds, chosen.threads)
                    results.write(chosen.output, {"machines": [machine()], "runs": rows})
    print(steering_table.table(rows, results.read(steering.REFERENCE)["runs"]))


def _stay_stable(chosen: argparse.Namespace) -> None:
    for physics in chosen.physics:
        for terrain in chosen.terrains:
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
        "classic": _walk_classic,
        "turning": _turn,
        "steering": _steer,
        "stability": _stay_stable,
    }
    studies[chosen.study](chosen)


if __name__ == "__main__":
    main()
