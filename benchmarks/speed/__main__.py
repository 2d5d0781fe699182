"""Measure how fast flyrl is on this machine, beside other simulators, and print it as tables.

Run `python -m benchmarks.speed` from the root of the repository, on an idle machine. It is
`flyrl bench` with one part more, `peers`.
"""

import argparse
import shutil
from pathlib import Path

from benchmarks.speed import peers
from flyrl.bench.results import PARTS
from flyrl.cli import bench


def _interpreter(text: str) -> str:
    found = shutil.which(text)
    if found is None:
        raise argparse.ArgumentTypeError(f"there is no interpreter {text!r}")
    return str(Path(found).absolute())


def main(arguments: list[str] | None = None) -> None:
    """Measure, or read, then print the tables."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.speed", description=(__doc__ or "").splitlines()[0]
    )
    bench.add_arguments(parser, PARTS)
    for key, (package, needed, _) in peers.PEERS.items():
        parser.add_argument(
            f"--{key}", type=_interpreter, metavar="PYTHON",
            help=f"interpreter that has {package}{needed}, for peers",
        )  # fmt: skip
    parser.add_argument(
        "--peer-seconds", type=float, default=0.2,
        help="simulated time for which flyrl and each peer are timed: two strides and more",
    )  # fmt: skip
    chosen = parser.parse_args(arguments)
    given = {key: vars(chosen).pop(key) for key in peers.PEERS}
    interpreters = {key: python for key, python in given.items() if python}
    try:
        bench.measure(
            chosen,
            {"peers": lambda: peers.measure(interpreters, chosen.terrains, chosen.peer_seconds)},
        )
    except ValueError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
