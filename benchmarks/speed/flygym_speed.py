"""Time the hybrid turning controller of flygym-gymnasium 1.3.2.

Runs in the interpreter of `--flygym`, in which flyrl is not installed; how to make one says
`benchmarks/fidelity/reference.py`.
"""

import argparse
import json
import time

import numpy as np

from benchmarks.fidelity.reference import PACKAGES, TERRAINS, TIMESTEP_S, start
from benchmarks.machine import machine


def main() -> None:
    """Print one row per terrain, as JSON."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--terrains", nargs="+", choices=TERRAINS, default=list(TERRAINS))
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--warm-up", type=int, default=50)
    chosen = parser.parse_args()
    rows = []
    for terrain in chosen.terrains:
        sim, _, _ = start(terrain, "hybrid", seed=0)
        drive = np.ones(2)
        for _ in range(chosen.warm_up):
            sim.step(drive)
        began = time.perf_counter()
        for _ in range(chosen.steps):
            sim.step(drive)
        speed = chosen.steps / (time.perf_counter() - began)
        rows.append(
            {
                "terrain": terrain,
                "what": "hybrid",
                "steps_per_s": speed,
                "real_time": speed * TIMESTEP_S,
            }
        )
    print(json.dumps({"versions": machine(PACKAGES)["versions"], "rows": rows}))


if __name__ == "__main__":
    main()
