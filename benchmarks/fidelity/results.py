"""Results as JSON: one row per run, with the walking statistics of its trajectory."""

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from benchmarks.fidelity.statistics import Trajectory, trajectory, walking_statistics
from flyrl.files import write_text

REFERENCE: Final = Path(__file__).with_name("reference.json")
"""What `collect` made of the runs of `reference.py`."""

TERRAINS: Final = ("flat", "gapped", "blocks", "mixed")
CONTROLLERS: Final = ("cpg", "rule_based", "hybrid")

Row = dict[str, Any]


def row(walk: Trajectory, **about: Any) -> Row:
    """What is stored of a run: which it was, then its statistics to four digits."""
    figures = {
        name: None if value is None else float(f"{value:.4g}")
        for name, value in walking_statistics(walk).items()
    }
    return {**about, "seconds": round(float(walk.time[-1]), 4), "statistics": figures}


def place(run: Row) -> tuple[int, ...]:
    """Place of a run among the others: terrain, controller, seed."""
    return TERRAINS.index(run["terrain"]), CONTROLLERS.index(run["controller"]), run["seed"]


def collect(
    folder: Path,
    known: Mapping[str, Any],
    to_row: Callable[..., Row] = row,
    place: Callable[[Row], tuple[int, ...]] = place,
) -> dict[str, Any]:
    """Add the runs that a reference has finished in `folder` to those that are known.

    Parameters
    ----------
    to_row
        From a trajectory and what its run was, by keyword, to what is stored of it.
    place
        Of a row among the others; a new run replaces the known one in its place.

    Raises
    ------
    ValueError
        If there is no run.
    """
    paths = sorted(folder.glob("[!.]*.npz"))  # with a dot in front, one is being written
    if not paths:
        raise ValueError(f"folder is {str(folder)!r}; it must hold runs of the reference")
    found, machines = {place(run): run for run in known["runs"]}, [*known["machines"]]
    for path in paths:
        with np.load(path, allow_pickle=False) as samples:
            about = json.loads(str(samples["about"]))
            machine = about.pop("machine")
            added = to_row(trajectory(dict(samples)), **about)
        found[place(added)] = added
        if machine not in machines:
            machines.append(machine)
    return {**known, "machines": machines, "runs": [found[key] for key in sorted(found)]}


def frame(runs: Iterable[Row]) -> pd.DataFrame:
    """A row per run, its statistics in columns beside those of what it was."""
    return pd.DataFrame([{**run, **run["statistics"]} for run in runs])


def write(path: Path, results: dict[str, Any]) -> None:
    """Write results as JSON, one run per line, whole or not at all."""
    head = {name: value for name, value in results.items() if name != "runs"}
    runs = ",\n".join("  " + json.dumps(run) for run in results["runs"])
    text = json.dumps(head, indent=1)[:-2] + f',\n "runs": [\n{runs}\n ]\n}}\n'
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)


def read(path: Path) -> dict[str, Any]:
    """Results that `write` wrote."""
    results: dict[str, Any] = json.loads(path.read_text())
    return results
