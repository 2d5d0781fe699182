"""Other simulators of the same fly on one core, each in an interpreter of its own."""

import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from tqdm import tqdm

from benchmarks.speed.engine import SETTLING_S, settled_scene, walking_time
from benchmarks.speed.results import Row, significant
from flyrl.simulation.flies import FlyBatch

FLYRL_PRESETS: Final = ("reference", "balanced")
"""Measured beside the peers: the preset with their time step, and the default one."""

FLIES: Final = 64

PEER_TIMESTEP_S: Final = 1e-4
"""Both peers'."""

PEERS: Final = {
    "flygym": ("flygym-gymnasium", "==1.3.2", "benchmarks.speed.flygym_speed"),
    "flygym2": ("flygym", ">=2", "benchmarks.speed.flygym2_speed"),
}
"""Option that gives the interpreter -> package, its version, and the module that runs there."""


def measure(
    interpreters: Mapping[str, str], terrains: Sequence[str], seconds: float = 0.2
) -> list[Row]:
    """Rows of flyrl and of every peer, terrain by terrain; a note for a peer that is not there.

    Parameters
    ----------
    interpreters
        Path of Python by key of `PEERS`.
    terrains
        On which to walk.
    seconds
        Simulated time that is measured, the same for all: what a step costs depends on how far
        the flies have walked and on what they touch there. It begins at `SETTLING_S`.
    """
    rows: list[Row] = []

    def add(simulator: str, terrain: str, found: Row) -> None:
        figures = {name: significant(found[name]) for name in found if name != "what"}
        rows.append({"simulator": simulator, "terrain": terrain, "what": found["what"], **figures})

    for terrain in tqdm(terrains, desc="peers"):
        for physics in FLYRL_PRESETS:
            scene, start = settled_scene(physics, terrain, FLIES)
            timestep = scene.config.physics.timestep
            steps = round(seconds / timestep)
            speed = FLIES * steps / walking_time(FlyBatch(scene, FLIES, 1), start, steps)
            own = speed * timestep
            measured = {"what": "hybrid", "steps_per_s": speed, "real_time": own}
            add(f"flyrl {physics}", terrain, measured)
        # `own` is now that of the default preset, the last
        for key, python in interpreters.items():
            package, _, module = PEERS[key]
            found = _run(python, module, terrain, seconds)
            for each in found["rows"]:
                measured = {**each, "ratio": own / each["real_time"]}
                add(f"{package} {found['versions'][package]}", terrain, measured)
    rows += [
        {"simulator": package + needed, "note": f"not measured: pass --{key} PYTHON"}
        for key, (package, needed, _) in PEERS.items()
        if key not in interpreters
    ]
    return rows


def _run(python: str, module: str, terrain: str, seconds: float) -> dict[str, Any]:
    """What the module prints, run by another interpreter on one thread."""
    warm_up, steps = round(SETTLING_S / PEER_TIMESTEP_S), round(seconds / PEER_TIMESTEP_S)
    command = [python, "-m", module, terrain, str(warm_up), str(steps)]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    root = Path(__file__).parents[2]
    done = subprocess.run(
        command, cwd=root, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result
