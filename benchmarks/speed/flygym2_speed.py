"""Time FlyGym 2: its hybrid turning controller, and its engine alone on the same actions.

Runs in the interpreter of `--flygym2`, in which flyrl is not installed:

    python3.12 -m venv /tmp/flygym2
    /tmp/flygym2/bin/pip install 'flygym>=2'
"""

import json
import sys
import time
from typing import Any, Final

import numpy as np
from flygym import Simulation
from flygym.compose import (
    BlocksTerrainWorld,
    FlatGroundWorld,
    GappedTerrainWorld,
    MixedTerrainWorld,
)
from flygym.utils.math import Rotation3D
from flygym_demo.complex_terrain import (
    HybridControllerObservation,
    HybridTurningController,
    LocomotionAction,
    apply_locomotion_action,
    make_locomotion_fly,
)

from benchmarks.machine import machine

WORLDS: Final = {
    "flat": FlatGroundWorld,
    "gapped": GappedTerrainWorld,
    "blocks": BlocksTerrainWorld,
    "mixed": MixedTerrainWorld,
}
SPAWN_HEIGHTS: Final = {"flat": 0.8, "gapped": 0.8, "blocks": 1.25, "mixed": 0.8}
"""mm; as high above the ground everywhere."""


def measure(terrain: str, warm_up: int, steps: int) -> list[dict[str, Any]]:
    """Steps per second with the controller, then with its recorded actions alone."""
    fly = make_locomotion_fly()
    world = WORLDS[terrain]()
    world.add_fly(fly, (0.0, 0.0, SPAWN_HEIGHTS[terrain]), Rotation3D("quat", (1, 0, 0, 0)))
    sim = Simulation(world)
    timestep = sim.mj_model.opt.timestep
    controller = HybridTurningController(
        timestep, output_dof_order=fly.get_actuated_jointdofs_order("position")
    )
    controller.reset(seed=0)
    actions: list[LocomotionAction] = []
    drive = np.ones(2)

    def walk(num_steps: int) -> None:
        for _ in range(num_steps):
            observed = HybridControllerObservation.from_sim(sim, fly.name)
            action = controller.step(drive, observed)
            apply_locomotion_action(sim, fly.name, action)
            sim.step()
            actions.append(action)

    def replay(some: list[LocomotionAction]) -> None:
        for action in some:
            apply_locomotion_action(sim, fly.name, action)
            sim.step()

    sim.reset()
    sim.forward()
    walk(warm_up)
    began = time.perf_counter()
    walk(steps)
    with_controller = steps / (time.perf_counter() - began)
    end = sim.mj_data.qpos.copy()

    sim.reset()
    sim.forward()
    replay(actions[:warm_up])
    began = time.perf_counter()
    replay(actions[warm_up:])
    alone = steps / (time.perf_counter() - began)
    if not np.allclose(sim.mj_data.qpos, end, rtol=0, atol=1e-6):
        raise RuntimeError("the replay left the recorded trajectory")
    return [
        {"what": what, "steps_per_s": speed, "real_time": speed * timestep}
        for what, speed in (("hybrid", with_controller), ("replay", alone))
    ]


if __name__ == "__main__":
    rows = measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    packages = ("flygym", "mujoco", "numpy", "numba")
    print(json.dumps({"versions": machine(packages)["versions"], "rows": rows}))
