"""Measure how fast flyrl is on this machine, and print it as tables.

Run `python -m benchmarks.speed` from the root of the repository, on an idle machine.
"""

import argparse
import shutil
from collections.abc import Callable
from pathlib import Path

from benchmarks.machine import machine
from benchmarks.speed import engine, layers, overhead, peers, rendering, results, scale, worms
from benchmarks.speed.results import PARTS, Row
from benchmarks.speed.table import table
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.terrains import TERRAIN_NAMES

PACKAGES = ("mujoco", "numpy", "numba", "torch", "stable-baselines3")


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return number


def _interpreter(text: str) -> str:
    found = shutil.which(text)
    if found is None:
        raise argparse.ArgumentTypeError(f"there is no interpreter {text!r}")
    return str(Path(found).absolute())


def _part(text: str) -> str:
    if text not in PARTS:
        raise argparse.ArgumentTypeError(f"unknown part {text!r}; choose from {list(PARTS)}")
    return text


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.speed", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument(
        "parts", nargs="*", type=_part, metavar="part",
        help=f"among {', '.join(PARTS)}; default all",
    )  # fmt: skip
    parser.add_argument(
        "--presets", nargs="+", choices=FLY_PRESETS, default=list(FLY_PRESETS),
        help="for engine, overhead, single",
    )  # fmt: skip
    parser.add_argument(
        "--terrains", nargs="+", choices=TERRAIN_NAMES, default=list(TERRAIN_NAMES),
        help="for engine, overhead, rendering, peers",
    )  # fmt: skip
    parser.add_argument(
        "--threads", nargs="+", type=_positive, default=[1, 2], help="for engine, environment"
    )
    parser.add_argument(
        "--batches", nargs="+", type=_positive, default=[1, 16, 64, 256, 1024],
        help="numbers of flies, for engine",
    )  # fmt: skip
    parser.add_argument(
        "--cell-seconds", type=float, default=1.5,
        help="wall time of a cell, for engine, threads, worm",
    )  # fmt: skip
    parser.add_argument(
        "--repeats", type=_positive, default=5, help="for overhead, threads: the median counts"
    )
    parser.add_argument(
        "--overhead-seconds", type=float, default=0.2, help="simulated time of a repeat"
    )
    parser.add_argument(
        "--decisions", type=_positive, default=150,
        help="for environment; an episode has up to 150, at whose end resets come",
    )  # fmt: skip
    parser.add_argument("--rollouts", type=_positive, default=3, help="for ppo")
    for key, (package, needed, _) in peers.PEERS.items():
        parser.add_argument(
            f"--{key}", type=_interpreter, metavar="PYTHON",
            help=f"interpreter that has {package}{needed}, for peers",
        )  # fmt: skip
    parser.add_argument(
        "--peer-seconds", type=float, default=0.2,
        help="simulated time for which flyrl and each peer are timed: two strides and more",
    )  # fmt: skip
    parser.add_argument(
        "--output", type=Path, default=Path("runs/speed.json"),
        help="where results are kept; parts that are not measured stay as they are",
    )  # fmt: skip
    parser.add_argument(
        "--show", action="store_true", help="measure nothing, print what is in --output"
    )
    return parser.parse_args(arguments)


def _measure(part: str, chosen: argparse.Namespace) -> list[Row]:
    interpreters = {key: vars(chosen)[key] for key in peers.PEERS if vars(chosen)[key]}
    measures: dict[str, Callable[[], list[Row]]] = {
        "engine": lambda: engine.measure(
            chosen.presets, chosen.terrains, chosen.threads, chosen.batches, chosen.cell_seconds
        ),
        "threads": lambda: engine.measure_threads(chosen.cell_seconds, chosen.repeats),
        "overhead": lambda: overhead.measure(
            chosen.presets, chosen.terrains, chosen.overhead_seconds, chosen.repeats
        ),
        "environment": lambda: layers.measure_environment(chosen.threads, chosen.decisions),
        "scale": scale.measure,
        "single": lambda: layers.measure_single(chosen.presets),
        "ppo": lambda: layers.measure_ppo(chosen.rollouts),
        "worm": lambda: worms.measure(chosen.cell_seconds),
        "rendering": lambda: rendering.measure(chosen.terrains),
        "peers": lambda: peers.measure(interpreters, chosen.terrains, chosen.peer_seconds),
    }
    return measures[part]()


def main(arguments: list[str] | None = None) -> None:
    """Measure, or read, then print the tables."""
    chosen = _arguments(arguments)
    if not chosen.show:
        settings = {
            name: value
            for name, value in vars(chosen).items()
            if name not in {"parts", "output", "show", *peers.PEERS}
        }
        # one part after the other is written, so that an interruption costs one part
        for part in chosen.parts or PARTS:
            measured = {
                "machine": machine(PACKAGES),
                "settings": settings,
                "rows": _measure(part, chosen),
            }
            stored = results.read(chosen.output)
            results.write(chosen.output, results.merged(stored, {part: measured}))
    print(table(results.read(chosen.output)))


if __name__ == "__main__":
    main()
