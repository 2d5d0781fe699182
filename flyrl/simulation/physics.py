"""Settings of the physics engine, and the presets that were measured."""

from dataclasses import dataclass, field
from typing import Final, Literal, get_args

import mujoco

from flyrl.bodies.fly import ContactConfig

Integrator = Literal["euler", "implicitfast", "discrete"]

_INTEGRATORS: Final = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "discrete": mujoco.mjtIntegrator.mjINT_DISCRETE,
}


@dataclass(frozen=True)
class PhysicsConfig:
    """Settings of MuJoCo for one scene.

    Parameters
    ----------
    timestep
        s. Controllers mean the same at every time step.
    integrator
        "discrete" is implicit in the servos' stiffness too, so it stays stable at coarse steps.
    solver_iterations, solver_tolerance
        Bounds on Newton's iterations per step.
    noslip_iterations
        Post-processing that suppresses slip of feet in contact.
    contact
        How legs touch the ground.
    """

    timestep: float = 2.5e-4
    integrator: Integrator = "discrete"
    solver_iterations: int = 100
    solver_tolerance: float = 1e-8
    noslip_iterations: int = 0
    contact: ContactConfig = field(default_factory=lambda: ContactConfig(solref=(-8e4, -4e3)))

    def __post_init__(self) -> None:
        if not 0 < self.timestep <= 2e-3:
            raise ValueError(f"timestep is {self.timestep} s; it must lie in (0, 0.002]")
        if self.integrator not in get_args(Integrator):
            raise ValueError(
                f"integrator is {self.integrator!r}; it must be one of {get_args(Integrator)}"
            )
        if self.solver_iterations < 1:
            raise ValueError(f"solver_iterations is {self.solver_iterations}; it must be >= 1")
        if self.noslip_iterations < 0:
            raise ValueError(f"noslip_iterations is {self.noslip_iterations}; it must be >= 0")
        if self.solver_tolerance < 0:
            raise ValueError(f"solver_tolerance is {self.solver_tolerance}; it must be >= 0")


PHYSICS_PRESETS: Final[dict[str, PhysicsConfig]] = {
    # the published models' step, integrator, no-slip pass and contact (flygym 0.2.5 and 1.2.1)
    "reference": PhysicsConfig(
        timestep=1e-4, integrator="euler", noslip_iterations=100, contact=ContactConfig()
    ),
    # The contact stops a foot within one step, as the literature's does, and takes 1/20 s to push
    # it back out: pushed out at once, even the CPG alone glides over gaps; never, and the coarser
    # step traps the hybrid controller too. Chosen with benchmarks/walking.py.
    "balanced": PhysicsConfig(),
}


def apply_physics(spec: mujoco.MjSpec, config: PhysicsConfig) -> None:
    """Write the settings into a model specification (gravity in mm/s²)."""
    option = spec.option
    option.timestep = config.timestep
    option.integrator = _INTEGRATORS[config.integrator]
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    option.iterations = config.solver_iterations
    option.tolerance = config.solver_tolerance
    option.noslip_iterations = config.noslip_iterations
    option.gravity = [0.0, 0.0, -9810.0]
