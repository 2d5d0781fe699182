"""The classic body with the tutorials' step and reflexes, beside flygym 0.2.5."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.fidelity import results
from benchmarks.fidelity.flyrl_runs import config, walk_straight
from benchmarks.fidelity.results import Row
from benchmarks.fidelity.statistics import Trajectory
from benchmarks.fidelity.verdict import compare_hybrid, speeds
from flyrl.bodies.fly import FlyConfig
from flyrl.tasks import TIMEOUT, UNSTABLE
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


def walk_classic(
    physics: str, terrain: str, controller: str, seeds: Sequence[int], seconds: float, threads: int
) -> list[Row]:
    """Runs of flyrl, one per seed, started as the reference's."""
    settings = replace(
        config(controller, terrain, physics),
        body=FlyConfig("classic"),
        terrain=GROUNDS[terrain],
    )
    walks = walk_straight(settings, list(seeds), seconds, threads)
    about = {"terrain": terrain, "controller": controller, "physics": physics}
    return [
        row(
            walk,
            **about,
            seed=seed,
            outcome=TIMEOUT if walk.time[-1] > seconds - 1e-6 else UNSTABLE,
        )
        for seed, walk in zip(seeds, walks, strict=True)
    ]


def tables(reference: Sequence[Row], runs: Sequence[Row]) -> str:
    """Final x, then hybrid - CPG with falls, per source and ground, in Markdown."""
    started_alike = [run for run in reference if not run.get("tutorial")]
    sources = {"flygym 0.2.5, tutorial": [run for run in reference if run.get("tutorial")]}
    sources |= {"flygym 0.2.5": started_alike}
    for physics in dict.fromkeys(run["physics"] for run in runs):
        sources[physics] = [run for run in runs if run["physics"] == physics]
    lines = [f"x after {FINAL_S} s, mm: median (quartiles)", ""]
    lines += _head("source", "controller", *GROUNDS)
    for source, found in sources.items():
        for controller in CONTROLLERS:
            cells = [_final(found, terrain, controller) for terrain in GROUNDS]
            lines.append(f"| {source} | {controller} | {' | '.join(cells)} |")
    lines += ["", "hybrid - CPG: mean and its 95 % interval over paired starts, mm/s", ""]
    lines += _head("source", "ground", "starts", "CPG", "hybrid", "hybrid - CPG", "falls")
    for source, found in sources.items():
        compared = [_difference(source, found, terrain) for terrain in GROUNDS]
        lines += [line for line in compared if line is not None]
    return "\n".join(lines)


def _head(*names: str) -> list[str]:
    return [f"| {' | '.join(names)} |", "|" + "---|" * len(names)]


def _final(found: Sequence[Row], terrain: str, controller: str) -> str:
    values = [
        run["final_x"]
        for run in found
        if (run["terrain"], run["controller"]) == (terrain, controller)
        and run["final_x"] is not None
    ]
    if len(values) < 2:
        return f"{values[0]:.2f}" if values else "-"
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{middle:.2f} ({low:.2f}, {high:.2f})"


def _difference(source: str, found: Sequence[Row], terrain: str) -> str | None:
    """A row of the second table; None below five starts that both controllers have walked."""
    by_controller = {name: speeds(found, terrain, name) for name in CONTROLLERS}
    shared = by_controller["cpg"].keys() & by_controller["hybrid"].keys()
    if len(shared) < 5:
        return None
    falls, means = {}, {}
    for name, values in by_controller.items():
        means[name] = np.mean([values[seed] for seed in shared])
        falls[name] = sum(
            int(run["statistics"]["fall"])
            for run in found
            if (run["terrain"], run["controller"]) == (terrain, name) and run["seed"] in shared
        )
    compared = compare_hybrid(found, terrain, "cpg")
    difference = means["hybrid"] - means["cpg"]
    return (
        f"| {source} | {terrain} | {len(shared)} | {means['cpg']:.1f} | {means['hybrid']:.1f} "
        f"| {difference:.1f} [{compared.low:.1f}, {compared.high:.1f}] "
        f"| {falls['cpg']}, {falls['hybrid']} |"
    )
