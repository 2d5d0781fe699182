"""The classic body with the tutorials' step and reflexes, beside flygym 0.2.5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from benchmarks.fidelity import results
from benchmarks.fidelity.comparison import MIN_RUNS, by_seed, hybrid_over, interval_text
from benchmarks.fidelity.flyrl_runs import config
from benchmarks.fidelity.results import Row
from benchmarks.fidelity.statistics import Trajectory
from flyrl.bodies.fly import FlyConfig
from flyrl.envs.core import EnvConfig
from flyrl.terrains import Blocks, Flat, Gapped, Mixed, Terrain

REFERENCE: Final = Path(__file__).with_name("reference_classic.json")
"""Runs of `classic_reference.py`; those that started as in the tutorial have `tutorial` set."""

CONTROLLERS: Final = ("cpg", "hybrid")

FINAL_S: Final = 0.5
"""s; the tutorial prints how far a fly has come by then."""

PATH_S: Final = 0.1
"""s between the points of a stored path."""

GROUNDS: Final[Mapping[str, Terrain]] = {
    "flat": Flat(),
    "gapped": Gapped(gap_range=(0.4, 0.4)),
    "blocks": Blocks(height_range=(0.45, 0.45)),
    "mixed": Mixed(gap_range=(0.5, 0.5), height_range=(0.45, 0.45)),
}
"""Ground of flygym 0.2.5: higher blocks and wider gaps than that of later versions, mm. Here the
slabs between gaps are narrower than there: 0.9 and 0.8 instead of 1 mm."""


def row(walk: Trajectory, **about: Any) -> Row:
    """What is stored of a run: as of others, and its way along x by `FINAL_S` and its path, mm."""
    place = walk.position_w - walk.position_w[0]
    final = int(np.searchsorted(walk.time, FINAL_S - 1e-9))
    kept = np.searchsorted(walk.time, np.arange(0.0, walk.time[-1] + 1e-9, PATH_S) - 1e-9)
    columns = {
        "x": place[kept, 0],
        "y": place[kept, 1],
        "yaw_deg": np.rad2deg(np.unwrap(walk.yaw)[kept]),
        "tilt_deg": np.rad2deg(np.arccos(np.clip(walk.upright[kept], -1.0, 1.0))),
    }
    return {
        **results.row(walk, **about),
        "final_x": round(float(place[final, 0]), 4) if final < len(place) else None,
        "path": {name: [round(float(v), 2) for v in values] for name, values in columns.items()},
    }


def classic_config(controller: str, terrain: str, physics: str) -> EnvConfig:
    """Environment of one cell of the comparison."""
    usual = config(controller, terrain, physics)
    return replace(usual, body=FlyConfig("classic"), terrain=GROUNDS[terrain])


def tables(reference: Sequence[Row], runs: Sequence[Row]) -> str:
    """Final x, then hybrid - CPG with falls, per source and ground, as text."""
    flygym = "flygym 0.2.5"
    found = results.frame(
        [
            *({**run, "source": f"{flygym}, tutorial"} for run in reference if run.get("tutorial")),
            *({**run, "source": flygym} for run in reference if not run.get("tutorial")),
            *({**run, "source": run["physics"]} for run in runs),
        ]
    )
    final = found.groupby(["source", "controller", "terrain"], sort=False)["final_x"]
    lines = []
    for (source, terrain), walked in found.groupby(["source", "terrain"], sort=False):
        speeds = by_seed(walked).reindex(columns=CONTROLLERS).dropna()
        if len(speeds) < MIN_RUNS:
            continue
        falls = by_seed(walked, "fall").loc[speeds.index, [*CONTROLLERS]].sum()
        lines.append(
            {
                "source": source,
                "ground": terrain,
                "starts": len(speeds),
                **{name: round(speeds[name].mean(), 1) for name in CONTROLLERS},
                "hybrid - cpg": interval_text(hybrid_over(speeds, "cpg")),
                "falls": ", ".join(f"{count:.0f}" for count in falls),
            }
        )
    parts = (
        f"x after {FINAL_S} s, mm: median (quartiles)",
        final.agg(_quartiles).unstack(fill_value="-").to_string(),
        "hybrid - CPG: mean and its 95 % interval over paired starts, mm/s",
        pd.DataFrame(lines).to_string(index=False),
    )
    return "\n\n".join(parts)


def _quartiles(values: pd.Series[float]) -> str:
    low, middle, high = values.quantile([0.25, 0.5, 0.75])
    return f"{middle:.2f} ({low:.2f}, {high:.2f})"
