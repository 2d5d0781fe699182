"""flyrl bench: how fast flyrl is on this machine."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from flyrl.bench.results import PARTS
from flyrl.cli.program import Subparsers, path_argument
from flyrl.text import printable

if TYPE_CHECKING:
    from flyrl.bench.results import Row

MEASURED: Final = tuple(part for part in PARTS if part != "peers")
"""What this measures; the peers need interpreters of their own, see benchmarks/README.md."""

_UNRECORDED: Final = {"parts", "output", "show", "run"}
"""Options that change no figure."""


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "bench",
        help="measure the speed of every part on this machine",
        description="Measure how fast flyrl is on this machine, which must be idle, and print it "
        "as tables. Every part takes some twenty minutes in all.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="parts:\n"
        + "\n".join(f"  {part:13}{PARTS[part]}" for part in MEASURED)
        + "\n\nexample:\n  flyrl bench engine --presets balanced --terrains flat",
    )
    add_arguments(parser, MEASURED)
    parser.set_defaults(run=run)


def add_arguments(parser: argparse.ArgumentParser, parts: Iterable[str]) -> None:
    """Add what is measured, how, and where it goes.

    Parameters
    ----------
    parser
        Takes them.
    parts
        That can be asked for.
    """
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"among {', '.join(parts)} (default: all)"
    )
    parser.add_argument(
        "--presets", nargs="+", metavar="NAME", help="for engine, overhead, single (default: all)"
    )
    parser.add_argument(
        "--terrains", nargs="+", metavar="NAME",
        help="for engine, overhead, rendering, peers (default: all)",
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
    parser.add_argument(
        "--output", type=path_argument, default=Path("runs/speed.json"), metavar="FILE",
        help="where results are kept (default: runs/speed.json); parts that are not measured stay "
        "as they are",
    )  # fmt: skip
    parser.add_argument(
        "--show", action="store_true", help="measure nothing, print what is in --output"
    )


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return number


def run(options: argparse.Namespace) -> int:
    """Measure, or read, then print the tables.

    Raises
    ------
    ValueError
        There is no such part, preset or terrain, or the file of results cannot be read.
    OSError
        The file of results cannot be written.
    """
    return measure(options, {})


def measure(options: argparse.Namespace, more: Mapping[str, Callable[[], list[Row]]]) -> int:
    """Measure flyrl, and what else can be measured here; see `run`.

    Parameters
    ----------
    options
        As `add_arguments` makes them.
    more
        Parts beside `MEASURED`, and what measures them.
    """
    from flyrl.bench import results  # noqa: PLC0415
    from flyrl.bench.table import table  # noqa: PLC0415
    from flyrl.simulation.physics import FLY_PRESETS  # noqa: PLC0415
    from flyrl.terrains import LITERATURE  # noqa: PLC0415
    from flyrl.validation import one_of  # noqa: PLC0415

    allowed = (*MEASURED, *more)
    parts = [one_of("part", part, allowed) for part in options.parts] or allowed
    for key, names in (("presets", FLY_PRESETS), ("terrains", LITERATURE)):
        given = getattr(options, key) or names
        setattr(options, key, [one_of(f"--{key}", name, names) for name in given])
    if not options.show:
        results.read(options.output)  # a file that cannot be read shows before the measuring
        from flyrl.bench.machine import machine  # noqa: PLC0415

        measures = {**_measures(options), **more}
        settings = {key: value for key, value in vars(options).items() if key not in _UNRECORDED}
        # one part after the other is written, so that an interruption costs one part
        for part in parts:
            measured = {"machine": machine(), "settings": settings, "rows": measures[part]()}
            stored = results.read(options.output)
            results.write(options.output, results.merged(stored, {part: measured}))
    print(printable(table(results.read(options.output)), keep="\n"))
    return 0


def _measures(chosen: argparse.Namespace) -> dict[str, Callable[[], list[Row]]]:
    """What measures each part."""
    from flyrl.bench import engine, layers, overhead, rendering, scale, worms  # noqa: PLC0415

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
        "worm": lambda: worms.measure(chosen.cell_seconds),
        "rendering": lambda: rendering.measure(chosen.terrains),
    }
