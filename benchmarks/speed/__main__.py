"""Measure how fast flyrl is on this machine, beside other simulators, and print it as tables.

Run `python -m benchmarks.speed` from the root of the repository, on an idle machine. Every part
takes some twenty minutes in all.
"""

import argparse
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

from benchmarks.machine import machine
from benchmarks.speed import engine, layers, overhead, peers, rendering, results, scale
from benchmarks.speed.results import PARTS, Row
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.terrains import LITERATURE
from flyrl.validation import one_of

_PACKAGES: Final = ("mujoco", "numpy", "numba", "torch", "stable-baselines3")
_UNRECORDED: Final = {"parts", "output", "show", *peers.PEERS}
"""Options that do not change a measured value."""


def _interpreter(text: str) -> str:
    found = shutil.which(text)
    if found is None:
        raise argparse.ArgumentTypeError(f"there is no interpreter {text!r}")
    return str(Path(found).absolute())


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return number


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.speed", description=(__doc__ or "").splitlines()[0]
    )
    add = parser.add_argument
    add("parts", nargs="*", metavar="PART", help=f"among {', '.join(PARTS)} (default: all)")
    add("--presets", nargs="+", metavar="NAME", help="for engine, overhead, single (default: all)")
    add("--terrains", nargs="+", metavar="NAME",
        help="for engine, overhead, rendering, peers (default: all)")  # fmt: skip
    add("--threads", nargs="+", type=_positive, default=[1, 2], help="for engine, environment")
    add("--batches", nargs="+", type=_positive, default=[1, 16, 64, 256, 1024],
        help="numbers of flies, for engine")  # fmt: skip
    add("--cell-seconds", type=float, default=1.5,
        help="wall time of a cell, for engine, threads, worm")  # fmt: skip
    add("--repeats", type=_positive, default=5, help="for overhead, threads: the median counts")
    add("--overhead-seconds", type=float, default=0.2, help="simulated time of a repeat")
    add("--decisions", type=_positive, default=150,
        help="for environment; an episode has up to 150, at whose end resets come")  # fmt: skip
    add("--rollouts", type=_positive, default=3, help="for ppo")
    for key, (package, needed, _) in peers.PEERS.items():
        add(f"--{key}", type=_interpreter, metavar="PYTHON",
            help=f"interpreter that has {package}{needed}, for peers")  # fmt: skip
    add("--peer-seconds", type=float, default=0.2,
        help="simulated time for which flyrl and each peer are timed")  # fmt: skip
    add("--output", type=Path, default=Path("runs/speed.json"), metavar="FILE",
        help="file of results (default: runs/speed.json); parts that are not measured stay as they "
        "are")  # fmt: skip
    add("--show", action="store_true", help="measure nothing, print what is in --output")
    return parser


def main(arguments: list[str] | None = None) -> None:
    """Measure, or read, then print the tables."""
    parser = _parser()
    chosen = parser.parse_args(arguments)
    try:
        parts = [one_of("part", part, PARTS) for part in chosen.parts] or list(PARTS)
        for key, names in (("presets", FLY_PRESETS), ("terrains", LITERATURE)):
            given = getattr(chosen, key) or names
            setattr(chosen, key, [one_of(f"--{key}", name, names) for name in given])
        stored = results.read(chosen.output)
    except ValueError as error:
        parser.error(str(error))
    settings = {key: value for key, value in vars(chosen).items() if key not in _UNRECORDED}
    for part in () if chosen.show else parts:  # written one by one: an interruption costs one part
        rows = _measures(chosen)[part]()
        stored[part] = {"machine": machine(_PACKAGES), "settings": settings, "rows": rows}
        results.write(chosen.output, stored)
    print(results.table(stored))


def _measures(chosen: argparse.Namespace) -> dict[str, Callable[[], list[Row]]]:
    interpreters = {key: vars(chosen)[key] for key in peers.PEERS if vars(chosen)[key]}
    return {
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
        "worm": lambda: engine.measure_worms(chosen.cell_seconds),
        "rendering": lambda: rendering.measure(chosen.terrains),
        "peers": lambda: peers.measure(interpreters, chosen.terrains, chosen.peer_seconds),
    }


if __name__ == "__main__":
    main()
