"""Results as JSON: one row per run, with the walking statistics of its trajectory."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.fidelity.statistics import STATISTICS, Trajectory, trajectory, walking_statistics
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


def collect(
    folder: Path, known: Mapping[str, Any], to_row: Callable[..., Row] = row
) -> dict[str, Any]:
    """Add the runs that `reference.py` has finished in `folder` to those that are known.

    Parameters
    ----------
    to_row
        Takes a trajectory and what its run was, by keyword, and gives what is stored of it.

    Raises
    ------
    ValueError
        If there is no run.
    """
    found = {(*cell(run), run["seed"]): run for run in known["runs"]}
    machines = [*known["machines"]]
    for machine, about, samples in finished(folder, "runs"):
        walked = to_row(trajectory(samples), **about)
        found[(*cell(walked), walked["seed"])] = walked
        if machine not in machines:
            machines.append(machine)
    rows = [found[place] for place in sorted(found)]
    return {"machines": machines, "statistics": STATISTICS, "runs": rows}


def finished(folder: Path, what: str) -> Iterator[tuple[Row, Row, dict[str, Any]]]:
    """Machine, description and samples of every run that `reference.py` has finished in `folder`.

    Raises
    ------
    ValueError
        If there is none; the message calls them `what`.
    """
    paths = sorted(folder.glob("[!.]*.npz"))  # with a dot in front, one is being written
    if not paths:
        raise ValueError(f"folder is {str(folder)!r}; it must hold {what} of reference.py")
    for path in paths:
        with np.load(path, allow_pickle=False) as samples:
            about = json.loads(str(samples["about"]))
            yield about.pop("machine"), about, dict(samples)


def cell(run: Row) -> tuple[int, int]:
    """Place of a run's terrain and controller in a table."""
    return TERRAINS.index(run["terrain"]), CONTROLLERS.index(run["controller"])


def summary(runs: Iterable[Row]) -> dict[str, float | None]:
    """Medians of the statistics over those runs that have them; of falls the share."""
    figures = [run["statistics"] for run in runs]
    result: dict[str, float | None] = {}
    for name in STATISTICS:
        values = [each[name] for each in figures if each[name] is not None]
        middle = np.mean if name == "fall" else np.median
        result[name] = float(middle(values)) if values else None
    return result


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
