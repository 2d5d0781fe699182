"""Walk flyrl straight ahead and print how it walked beside flygym-gymnasium.

Run `python -m benchmarks.fidelity` from the root of the repository.
"""

import argparse
import sys
from pathlib import Path

from benchmarks.fidelity import results
from benchmarks.fidelity.compare import table
from benchmarks.fidelity.flyrl_runs import config, walk_straight
from benchmarks.fidelity.statistics import STATISTICS
from flyrl.simulation.physics import PHYSICS_PRESETS
from flyrl.tasks import TIMEOUT, UNSTABLE


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.fidelity", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--terrains", nargs="+", choices=results.TERRAINS, default=results.TERRAINS)
    parser.add_argument(
        "--controllers", nargs="+", choices=results.CONTROLLERS, default=results.CONTROLLERS
    )
    parser.add_argument(
        "--physics", nargs="+", choices=PHYSICS_PRESETS, default=list(PHYSICS_PRESETS)
    )
    parser.add_argument(
        "--conditions", type=int, default=20, help="initial conditions: seeds 0 to this - 1"
    )
    parser.add_argument("--seconds", type=float, default=1.5, help="simulated time of a run")
    parser.add_argument("--threads", type=int, default=0, help="0 takes one per CPU")
    parser.add_argument(
        "--output", type=Path, default=Path("runs/fidelity.json"), help="where the runs are written"
    )
    parser.add_argument(
        "--show", action="store_true", help="run nothing, print what is in --output"
    )
    parser.add_argument(
        "--collect", type=Path, metavar="FOLDER",
        help="run nothing, make reference.json from the runs of reference.py in FOLDER",
    )  # fmt: skip
    return parser.parse_args()


def _run(chosen: argparse.Namespace) -> list[results.Row]:
    rows = []
    seeds = list(range(chosen.conditions))
    for terrain in chosen.terrains:
        for controller in chosen.controllers:
            for physics in chosen.physics:
                print(f"{terrain} {controller} {physics}", file=sys.stderr)
                about = {"terrain": terrain, "controller": controller, "physics": physics}
                walks = walk_straight(
                    config(controller, terrain, physics), seeds, chosen.seconds, chosen.threads
                )
                for seed, walk in zip(seeds, walks, strict=True):
                    is_whole = walk.time[-1] > chosen.seconds - 1e-6
                    outcome = TIMEOUT if is_whole else UNSTABLE
                    rows.append(results.row(walk, **about, seed=seed, outcome=outcome))
                found = {"machines": [results.machine()], "statistics": STATISTICS, "runs": rows}
                results.write(chosen.output, found)
    return rows


def main() -> None:
    """Run, or read, then print the table."""
    chosen = _arguments()
    if chosen.collect is not None:
        results.write(results.REFERENCE, results.collect(chosen.collect))
        return
    rows = results.read(chosen.output)["runs"] if chosen.show else _run(chosen)
    reference = results.read(results.REFERENCE)["runs"]
    print(table(reference, rows))
    for name, meaning in STATISTICS.items():
        print(f"  {name:16} {meaning}")


if __name__ == "__main__":
    main()
