"""Measure how fast flyrl is on this machine, beside other simulators, and print it as tables.

Run `python -m benchmarks.speed` from the root of the repository, on an idle machine. Every part
takes some twenty minutes in all.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Final

from benchmarks.machine import machine
from benchmarks.speed import engine, overhead, peers, rendering, results
from benchmarks.speed.results import PARTS, Row
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.terrains import LITERATURE

_RECORDED: Final = ("presets", "terrains", "threads", "batches", "cell_seconds")
"""Options that change measured values."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.speed", description=(__doc__ or "").splitlines()[0]
    )
    add = parser.add_argument
    add("parts", nargs="*", choices=(*PARTS, "all"), default="all")
    add("--presets", nargs="+", choices=FLY_PRESETS, default=list(FLY_PRESETS),
        help="for engine, overhead")  # fmt: skip
    add("--terrains", nargs="+", choices=LITERATURE, default=list(LITERATURE),
        help="for engine, overhead, rendering, peers")  # fmt: skip
    add("--threads", nargs="+", type=int, default=[1, 2], help="for engine")
    add("--batches", nargs="+", type=int, default=[1, 16, 64, 256, 1024],
        help="numbers of flies, for engine")  # fmt: skip
    add("--cell-seconds", type=float, default=1.5, help="wall time of a cell, for engine, worm")
    for key, (package, needed, _) in peers.PEERS.items():
        add(f"--{key}", metavar="PYTHON",
            help=f"interpreter that has {package}{needed}, for peers")  # fmt: skip
    add("--output", type=Path, default=Path("runs/speed.json"), metavar="FILE",
        help="file of results; parts that are not measured stay as they are")  # fmt: skip
    add("--show", action="store_true", help="measure nothing, print what is in --output")
    return parser


def main(arguments: list[str] | None = None) -> None:
    """Measure, or read, then print the tables."""
    chosen = _parser().parse_args(arguments)
    parts = PARTS if "all" in chosen.parts else chosen.parts
    stored = results.read(chosen.output)
    settings = {key: vars(chosen)[key] for key in _RECORDED}
    for part in () if chosen.show else parts:  # written one by one: an interruption costs one part
        rows = _measures(chosen)[part]()
        stored[part] = {"machine": machine(), "settings": settings, "rows": rows}
        results.write(chosen.output, stored)
    print(results.table(stored))


def _measures(chosen: argparse.Namespace) -> dict[str, Callable[[], list[Row]]]:
    interpreters = {key: vars(chosen)[key] for key in peers.PEERS if vars(chosen)[key]}
    return {
        "engine": lambda: engine.measure(
            chosen.presets, chosen.terrains, chosen.threads, chosen.batches, chosen.cell_seconds
        ),
        "overhead": lambda: overhead.measure(chosen.presets, chosen.terrains),
        "worm": lambda: engine.measure_worms(chosen.cell_seconds),
        "rendering": lambda: rendering.measure(chosen.terrains),
        "peers": lambda: peers.measure(interpreters, chosen.terrains),
    }


if __name__ == "__main__":
    main()
