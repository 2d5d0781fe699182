"""flyrl runs and flyrl sweep: list run folders, compare them over their seeds."""

from __future__ import annotations

import argparse
import datetime
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flyrl.cli.terminal import Subparsers, path_argument

if TYPE_CHECKING:
    from flyrl.training.runs import RunSummary

COLUMNS: Final = (
    "name",
    "task",
    "terrain",
    "algo",
    "seed",
    "decisions",
    "state",
    "best",
    "last",
    "time",
    "commit",
)
_FILTERS: Final = ("task", "terrain", "algo", "seed", "state")

Row = dict[str, Any]


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommands."""
    parser = subparsers.add_parser(
        "runs",
        help="list run folders",
        description="List the runs in a folder, with those of its sweeps; flyrl sweep compares.",
        epilog="best and last: success on the held-out episodes. A commit with + had changes. "
        "Example: flyrl runs --task target --sort best --reverse",
    )
    parser.add_argument(
        "paths",
        nargs="*",
        type=path_argument,
        default=[Path("runs")],
        metavar="FOLDER",
        help="folders of runs, or run folders (default: runs)",
    )
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
    sweep.add_argument(
        "folders",
        nargs="+",
        type=path_argument,
        metavar="FOLDER",
        help="of a sweep, as in runs/sweeps; two or more may be of single runs too",
    )
    sweep.add_argument(
        "--output",
        type=path_argument,
        metavar="FOLDER",
        help="where comparison.csv and learning_curves go (default: the folder of the one sweep)",
    )
    sweep.set_defaults(run=run_sweep)


def run(options: argparse.Namespace) -> int:
    """List the runs."""
    from flyrl.cli.terminal import print_table  # noqa: PLC0415
    from flyrl.text import csv_text  # noqa: PLC0415
    from flyrl.training.runs import find_runs, read_run  # noqa: PLC0415

    missing = [str(path) for path in options.paths if not path.is_dir()]
    if missing:
        raise ValueError(f"there is no folder {missing[0]}")
    found = {run: folder for folder in options.paths for run in find_runs(folder)}
    rows = [{**row(read_run(path)), "name": name} for name, path in _named(found).items()]
    for key in _FILTERS:
        wanted = getattr(options, key)
        rows = [entry for entry in rows if wanted is None or str(entry[key]) in wanted]
    rows = sort(rows, options.sort, is_reversed=options.reverse)
    has_problems = any(entry["problems"] for entry in rows)
    columns = (*COLUMNS, "problems") if has_problems else COLUMNS
    if options.csv:
        sys.stdout.write(csv_text(columns, rows))
    elif rows:
        print_table(columns, [_readable(entry) for entry in rows])
    else:
        print("no such runs")
    return 0


def _named(runs: Mapping[Path, Path]) -> dict[str, Path]:
    """Runs, given with the folders that they were found in, by a name as short as is unique."""
    short = {
        run: run.name if run == folder else str(run.relative_to(folder))
        for run, folder in runs.items()
    }
    taken = Counter(short.values())
    return {name if taken[name] == 1 else str(run): run for run, name in short.items()}


def row(run: RunSummary) -> Row:
    """What the list says of a run, keyed by `COLUMNS`; and `problems`."""
    from flyrl.training.runs import names_of  # noqa: PLC0415

    best, last = run.best, run.last
    return {
        "name": run.path.name,
        **names_of(run),
        "seed": run.setting("seed"),
        "decisions": run.decisions,
        "state": run.state,
        "best": best and best["success_rate"],
        "last": last and last["success_rate"],
        "time": run.wall_time_s,
        "commit": commit(run),
        "problems": "; ".join(run.problems),
    }


def commit(run: RunSummary) -> str | None:
    """Short commit of the code, with a plus if that had changes."""
    git = run.provenance.get("git")
    if not isinstance(git, dict) or not isinstance(git.get("commit"), str):
        return None
    return str(git["commit"])[:7] + "+" * bool(git.get("is_dirty"))


def sort(rows: Sequence[Row], column: str, *, is_reversed: bool = False) -> list[Row]:
    """Rows in order of a column; those without a value come last, either way."""
    known = [entry for entry in rows if entry[column] is not None]
    unknown = [entry for entry in rows if entry[column] is None]
    return sorted(known, key=lambda entry: entry[column], reverse=is_reversed) + unknown


def _readable(entry: Row) -> Row:
    """The row with success in per cent and time in hours, minutes and seconds."""
    shown = dict(entry)
    for key in ("best", "last"):
        if shown[key] is not None:
            shown[key] = f"{shown[key]:.1%}"
    if shown["time"] is not None:
        shown["time"] = str(datetime.timedelta(seconds=round(shown["time"])))
    return shown


def run_sweep(options: argparse.Namespace) -> int:
    """Print and write what the folders hold."""
    if len(options.folders) > 1 and options.output is None:
        raise ValueError("several folders need --output, the folder to write to")
    compare_folders(options.folders, options.output or options.folders[0])
    return 0


def compare_folders(folders: Sequence[Path], output: Path) -> None:
    """Compare the runs in some folders: print the table, write it and the learning curves."""
    from flyrl.cli.terminal import print_table  # noqa: PLC0415
    from flyrl.front.comparison import compare_folders  # noqa: PLC0415

    compared = compare_folders(folders, output)
    print_table(list(compared.rows[0]), compared.rows)
    print(*compared.notes, sep="\n")
