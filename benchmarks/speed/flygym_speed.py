"""Time the hybrid turning controller of flygym-gymnasium 1.3.2.

Runs in the interpreter of `--flygym`, in which flyrl is not installed; how to make one says
`benchmarks/fidelity/reference.py`.
"""

import json
import sys
import time

import numpy as np

from benchmarks.fidelity.peers import TIMESTEP_S
from benchmarks.fidelity.reference import PACKAGES, start
from benchmarks.machine import machine


def main(terrain: str, warm_up: int, steps: int) -> None:
    """Print a row for the terrain, as JSON."""
    sim, _, _ = start(terrain, "hybrid", seed=0)
    drive = np.ones(2)
    for _ in range(warm_up):
        sim.step(drive)
    began = time.perf_counter()
    for _ in range(steps):
        sim.step(drive)
    speed = steps / (time.perf_counter() - began)
    row = {"what": "hybrid", "steps_per_s": speed, "real_time": speed * TIMESTEP_S}
    print(json.dumps({"versions": machine(PACKAGES)["versions"], "rows": [row]}))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
