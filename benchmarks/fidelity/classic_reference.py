"""Run flygym 0.2.5, which the classic body, step and reflexes are of, and keep what it did.

For an interpreter of its own, in which flyrl is not installed, from the root of the repository:

    python3.11 -m venv /tmp/flygym025
    /tmp/flygym025/bin/pip install flygym==0.2.5 mujoco==3.1.1 dm_control==1.0.16 \
        numpy==1.26.4 networkx==3.6.1 numba==0.68.1 opencv-python==4.10.0.84
    /tmp/flygym025/bin/python -m benchmarks.fidelity.classic_reference runs/flygym025

The controllers' loops are the package's own, on the model that it compiles. Only the fly's
observation is cut down to what those loops read: 20 starts on rough ground take an hour so, and
four otherwise. One file per run, as of `reference.py`; `python -m benchmarks.fidelity classic
--collect runs/flygym025` adds them to `reference_classic.json`. With `--tutorial` the flies start
as in the package's tutorial: at the origin, 0.2 mm up, phases and magnitudes drawn from a seed
(there 0, for 0.5 s).
"""

from typing import Any, Final

import mujoco
import numpy as np
from flygym.mujoco import NeuroMechFly, Parameters
from flygym.mujoco.arena import BaseArena, BlocksTerrain, FlatTerrain, GappedTerrain, MixedTerrain
from flygym.mujoco.examples import hybrid_controller
from flygym.mujoco.examples.common import PreprogrammedSteps
from flygym.mujoco.examples.cpg_controller import CPGNetwork, run_cpg_simulation
from flygym.mujoco.preprogrammed import all_leg_dofs
from numpy.typing import NDArray

from benchmarks.fidelity.peers import (
    SAMPLING_S,
    SENSED,
    TIMESTEP_S,
    TRIPOD,
    in_contact,
    keep,
    parser,
    phases,
    spawn,
)

TERRAINS: Final[dict[str, type[BaseArena]]] = {
    "flat": FlatTerrain,
    "gapped": GappedTerrain,
    "blocks": BlocksTerrain,
    "mixed": MixedTerrain,
}
CONTROLLERS: Final = ("cpg", "hybrid")
PACKAGES: Final = ("flygym", "mujoco", "dm_control", "numpy", "scipy", "gymnasium")

LEGS: Final = PreprogrammedSteps.legs
STEPS: Final = PreprogrammedSteps()

# of the package's tutorial on the hybrid controller
VECTORS: Final = {
    "F": np.array([0, 0, 0, -0.02, 0, 0.016, 0]),
    "M": np.array([-0.015, 0, 0, 0.004, 0, 0.01, -0.008]),
    "H": np.array([0, 0, 0, -0.01, 0, 0.005, 0]),
}
RATES: Final = {"retraction": (500, 1000 / 3), "stumbling": (2000, 500)}
STUMBLING_FORCE: Final = -1


class UnstableError(Exception):
    """The simulation has blown up."""


class Walker:
    """The package's fly, for its controllers' loops, which it samples.

    Attributes
    ----------
    samples
        What is kept of each moment; as `statistics.Trajectory` has it.
    """

    def __init__(self, terrain: str, height: float) -> None:
        fly = NeuroMechFly(
            Parameters(timestep=TIMESTEP_S, render_mode="headless", enable_adhesion=True),
            contact_sensor_placements=[f"{leg}{segment}" for leg in LEGS for segment in SENSED],
            arena=TERRAINS[terrain](),
            spawn_pos=(0.0, 0.0, height),
        )
        self.fly, self.sim_params, self.timestep = fly, fly.sim_params, TIMESTEP_S
        self.contact_sensor_placements = fly.contact_sensor_placements
        self.model, self.data = fly.physics.model.ptr, fly.physics.data.ptr
        name = "Animat/{}".format
        self.thorax = self.model.body(name("Thorax")).id
        self.tips = [self.model.body(name(f"{leg}Tarsus5")).id for leg in LEGS]
        self.sensed = [self.model.body(place).id for place in fly.contact_sensor_placements]
        self.dofs = [self.model.joint(name(joint)).dofadr[0] for joint in all_leg_dofs]
        servos = [f"actuator_position_{joint}" for joint in all_leg_dofs]
        grips = [f"{leg}Tarsus5_adhesion" for leg in LEGS]
        self.servos, self.grips = (
            [self.model.actuator(name(each)).id for each in names] for names in (servos, grips)
        )
        self.spawn = (0.0, 0.0)

    def reset(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Put the fly down at `spawn`, mm."""
        self.fly.reset()
        root = self.model.jnt_qposadr[self.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE][0]
        self.data.qpos[root : root + 2] += self.spawn
        mujoco.mj_forward(self.model, self.data)
        self.steps_taken = 0
        self.samples = [self._sample()]
        return self._observation(), {}

    def step(
        self, action: dict[str, NDArray[Any]]
    ) -> tuple[dict[str, NDArray[Any]], float, bool, bool, dict[str, Any]]:
        """One physics step, as dm_control takes it."""
        self.data.ctrl[self.servos] = action["joints"]
        self.data.ctrl[self.grips] = action["adhesion"]
        mujoco.mj_step2(self.model, self.data)
        mujoco.mj_step1(self.model, self.data)
        self.steps_taken += 1
        if self.data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            raise UnstableError
        if self.steps_taken % round(SAMPLING_S / TIMESTEP_S) == 0:
            self.samples.append(self._sample())
        return self._observation(), 0.0, False, False, {}

    def render(self) -> None:
        """Nothing: nobody watches."""

    def change_segment_color(self, segment: str, color: tuple[float, ...]) -> None:
        """Nothing either."""

    def _observation(self) -> dict[str, NDArray[Any]]:
        """The four observations that the loops read, as the package takes them.

        Positions are of centres of mass, and the orientation is the z axis of the thorax's
        principal axes of inertia. The grip's force, which the package takes off those on
        Tarsus5, stays, as no reflex asks for them.
        """
        data = self.data
        return {
            "fly": data.xipos[[self.thorax]],
            "end_effectors": data.xipos[self.tips],
            "fly_orientation": data.ximat[self.thorax].reshape(3, 3)[:, 2],
            "contact_forces": data.cfrc_ext[self.sensed, 3:],
        }

    def _sample(self) -> dict[str, Any]:
        data = self.data
        rotation = data.xmat[self.thorax].reshape(3, 3)
        power = data.actuator_force[self.servos] * data.qvel[self.dofs]
        return {
            "position_w": data.xpos[self.thorax].copy(),
            "yaw": np.arctan2(rotation[1, 0], rotation[0, 0]),
            "upright": rotation[2, 2],
            "end_effectors_w": data.xpos[self.tips].copy(),
            "contact": in_contact(data.cfrc_ext[self.sensed, 3:]),
            "power": np.maximum(power, 0.0).sum(),
        }


def run(
    walker: Walker, controller: str, seed: int, seconds: float, *, as_in_tutorial: bool
) -> dict[str, Any]:
    """Walk for some seconds; how it went.

    The tutorial also draws the magnitudes of the oscillators; others start at 0.
    """
    start: dict[str, Any] = {}
    if not as_in_tutorial:
        start = {"init_phases": phases(seed), "init_magnitudes": np.zeros(6)}
        walker.spawn = tuple(spawn(seed))
    oscillators = CPGNetwork(**TRIPOD, seed=seed, **start)
    outcome = "timeout"
    try:
        if controller == "cpg":
            run_cpg_simulation(walker, oscillators, STEPS, seconds)
        else:
            # the loop asks its module for it, which has it only when run as a script
            hybrid_controller.preprogrammed_steps = STEPS
            hybrid_controller.run_hybrid_simulation(
                walker, oscillators, STEPS, VECTORS, RATES, STUMBLING_FORCE, seconds
            )
    except UnstableError:
        outcome = "unstable"
    tutorial = {"tutorial": True} if as_in_tutorial else {}
    return {"controller": controller, "outcome": outcome, **tutorial}


def main() -> None:
    """Run what is not there yet, seed by seed."""
    command = parser(__doc__, TERRAINS, CONTROLLERS, list(range(1000, 1020)), 1.0)
    command.add_argument("--tutorial", action="store_true", help="start as in the tutorial")
    chosen = command.parse_args()
    height = 0.2 if chosen.tutorial else 0.5
    walkers = {terrain: Walker(terrain, height) for terrain in chosen.terrains}

    def walk(terrain: str, controller: str, seed: int) -> Any:
        walker = walkers[terrain]
        about = run(walker, controller, seed, chosen.seconds, as_in_tutorial=chosen.tutorial)
        return walker.samples, about

    keep(chosen, chosen.controllers, PACKAGES, walk)


if __name__ == "__main__":
    main()
