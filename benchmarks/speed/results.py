"""Results of the speed benchmark: JSON by part with the machine that ran it, and their tables."""

import json
from pathlib import Path
from typing import Any, Final

import pandas as pd

from flyrl.files import write_text

Row = dict[str, Any]
Part = dict[str, Any]
"""`machine`, `settings` and `rows`, the cells of the part's table."""

Results = dict[str, Part]

PARTS: Final[dict[str, str]] = {
    "engine": "physics steps/s of all flies together (simulated s per wall s), hybrid controller",
    "overhead": "speed with controller, and with environment too, over bare MuJoCo's; one thread",
    "worm": "physics steps/s of all worms together (simulated s per wall s), one thread",
    "rendering": "pictures/s of 640 x 480 of a fly, everything on",
    "peers": "simulated s per wall s on one core, beside other simulators of the fly",
}
"""Measurable parts in the order of the tables, and what each measures."""


def read(path: Path) -> Results:
    """Results that `write` wrote; none if there is no file."""
    results: Results = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return results


def write(path: Path, results: Results) -> None:
    """Write results as JSON in the order of `PARTS`, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    ordered = {name: results[name] for name in PARTS if name in results}
    write_text(path, json.dumps(ordered, indent=1) + "\n")


def significant(value: float) -> float:
    """A measured value, rounded to four digits."""
    return float(f"{value:.4g}")


def table(results: Results) -> str:
    """One table per part under a heading, and date, processor and versions where they change."""
    blocks, machine = [], None
    for name, part in results.items():
        if part["machine"] != machine:
            machine = part["machine"]
            versions = ", ".join(f"{key} {value}" for key, value in machine["versions"].items())
            about = f"{machine['date']}, {machine['cpu']}, cores: {machine['cores']}, {versions}"
            blocks.append(about)
        blocks.append(f"{name}: {PARTS[name]}\n{part_table(name, part['rows'])}")
    return "\n\n".join(blocks) or "nothing measured yet"


def part_table(name: str, rows: list[Row]) -> str:
    """Table of one part, then notes on what was not measured."""
    measured = pd.DataFrame(row for row in rows if "note" not in row)
    notes = [row for row in rows if "note" in row]
    lines = [f"  {row.get('simulator', name)}: {row['note']}" for row in notes]
    if len(measured):
        if "unstable" in measured:
            if measured["unstable"].any():
                lines.append("  ! an animal became unstable")
            measured["unstable"] = measured["unstable"].astype(bool).map({True: "!", False: ""})
        if name == "engine":
            measured = _engine_columns(measured)
        text = measured.to_string(index=False, na_rep="-", float_format=lambda x: f"{x:,.4g}")
        lines.insert(0, text)
    return "\n".join(lines)


def _engine_columns(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per preset, terrain and number of threads; a column per number of flies."""
    cells = [
        f"{speed:,.0f} ({real_time:.2f}){mark}"
        for speed, real_time, mark in zip(
            rows["steps_per_s"], rows["real_time"], rows["unstable"], strict=True
        )
    ]
    wide = rows.assign(cell=cells).pivot(
        index=["physics", "terrain", "threads"], columns="flies", values="cell"
    )
    return wide.rename(columns=lambda flies: f"{flies:,} flies").reset_index()
