"""flyrl runs and flyrl sweep: list run folders, compare them over their seeds."""

from __future__ import annotations

import argparse
import datetime
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flyrl.cli.terminal import Subparsers, path_argument

if TYPE_CHECKING:
    from flyrl.training.runs import RunSummary

_FILTERS: Final = ("task", "terrain", "algo", "seed", "state")
COLUMNS: Final = ("name", *_FILTERS[:4], "decisions", "state", "best", "last", "time", "commit")


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommands."""
    parser = subparsers.add_parser(
        "runs",
        help="list run folders",
        description="List the runs in a folder, with those of its sweeps; flyrl sweep compares.",
        epilog="best and last: success on the held-out episodes. A commit with + had changes. "
        "Example: flyrl runs --task target --sort best --reverse",
    )
    folder: dict[str, Any] = {"type": path_argument, "metavar": "FOLDER"}
    default = [Path("runs")]
    about = "folders of runs, or run folders (default: runs)"
    parser.add_argument("paths", nargs="*", **folder, default=default, help=about)
    for name in _FILTERS:
        parser.add_argument(
            f"--{name}", action="append", metavar=name.upper(), help=f"only this {name}; repeatable"
        )
    parser.add_argument("--sort", choices=COLUMNS, default="name", help="(default: name)")
    parser.add_argument("--reverse", action="store_true", help="the largest first")
    parser.add_argument("--csv", action="store_true", help="print CSV, with exact figures")
    parser.set_defaults(run=run)
    sweep = subparsers.add_parser(
        "sweep",
        help="compare the runs of sweeps over their seeds",
        description="Print the table that a sweep ends with, and write it and the learning curves "
        "to its folder; also of one that is still going on, or was killed. Of several folders, of "
        "sweeps and of single runs, make one table and one figure.",
        epilog="Example: flyrl sweep runs/sweeps/2026-01-31_120000",
    )
    about = "of a sweep, as in runs/sweeps; two or more may be of single runs too"
    sweep.add_argument("folders", nargs="+", **folder, help=about)
    about = "where comparison.csv and learning_curves go (default: the folder of the one sweep)"
    sweep.add_argument("--output", **folder, help=about)
    sweep.set_defaults(run=run_sweep)


def run(options: argparse.Namespace) -> int:
    """List the runs."""
    import pandas as pd  # noqa: PLC0415

    from flyrl.cli.terminal import print_table  # noqa: PLC0415
    from flyrl.text import csv_table  # noqa: PLC0415
    from flyrl.training.runs import find_runs, read_run  # noqa: PLC0415

    missing = [str(path) for path in options.paths if not path.is_dir()]
    if missing:
        raise ValueError(f"there is no folder {missing[0]}")
    found = {run: folder for folder in options.paths for run in find_runs(folder)}
    rows = [{**row(read_run(path)), "name": name} for name, path in _named(found).items()]
    table = pd.DataFrame(rows, columns=[*COLUMNS, "problems"], dtype=object)
    for key in _FILTERS:
        if wanted := getattr(options, key):
            table = table[table[key].map(str).isin(wanted)]
    table = table.sort_values(options.sort, ascending=not options.reverse, kind="stable")
    if not table["problems"].any():
        del table["problems"]
    if options.csv:
        sys.stdout.write(csv_table(table))
    elif len(table):
        for column, text in _TEXTS.items():
            table[column] = table[column].map(text, na_action="ignore")
        print_table(table)
    else:
        print("no such runs")
    return 0


_TEXTS: Final[Mapping[str, Callable[[float], str]]] = {
    "best": "{:.1%}".format,
    "last": "{:.1%}".format,
    "time": lambda seconds: str(datetime.timedelta(seconds=round(seconds))),
}
"""Columns as people read them."""


def _named(runs: Mapping[Path, Path]) -> dict[str, Path]:
    """Runs, given with the folders that they were found in, by a name as short as is unique."""
    short = {
        run: run.name if run == folder else str(run.relative_to(folder))
        for run, folder in runs.items()
    }
    taken = Counter(short.values())
    return {name if taken[name] == 1 else str(run): run for run, name in short.items()}


def row(run: RunSummary) -> dict[str, Any]:
    """Values of `COLUMNS` of a run; and its `problems`."""
    from flyrl.training.runs import names_of  # noqa: PLC0415

    best, last = run.best, run.last
    git = run.provenance.get("git")
    commit = git.get("commit") if isinstance(git, dict) else None
    is_dirty = isinstance(git, dict) and bool(git.get("is_dirty"))
    return {
        "name": run.path.name,
        **names_of(run),
        "seed": run.setting("seed"),
        "decisions": run.decisions,
        "state": run.state,
        "best": best and best["success_rate"],
        "last": last and last["success_rate"],
        "time": run.wall_time_s,
        # short, with a plus if the code had changes
        "commit": commit[:7] + "+" * is_dirty if isinstance(commit, str) else None,
        "problems": "; ".join(run.problems),
    }


def run_sweep(options: argparse.Namespace) -> int:
    """Print and write what the folders hold."""
    if len(options.folders) > 1 and options.output is None:
        raise ValueError("several folders need --output, the folder to write to")
    compare_folders(options.folders, options.output or options.folders[0])
    return 0


def compare_folders(folders: Sequence[Path], output: Path) -> None:
    """Compare the runs in some folders: print the table, write it and the learning curves."""
    import pandas as pd  # noqa: PLC0415

    from flyrl.cli.terminal import print_table  # noqa: PLC0415
    from flyrl.front.comparison import compare_folders  # noqa: PLC0415

    rows, notes = compare_folders(folders, output)
    print_table(pd.DataFrame(rows, dtype=object))
    print(*notes, sep="\n")
