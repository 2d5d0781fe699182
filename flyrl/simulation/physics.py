"""Settings of the physics engine, and the presets that were measured."""

from dataclasses import dataclass
from typing import Annotated, Final, Literal

import mujoco

from flyrl.bodies.contact import ContactConfig, SurfaceContact
from flyrl.bodies.worm import TIMESTEP as WORM_TIMESTEP
from flyrl.validation import Within, check_fields

Integrator = Literal["euler", "implicitfast", "discrete"]
Cone = Literal["pyramidal", "elliptic"]
CollisionDetection = Literal["libccd", "native"]

_INTEGRATORS: Final = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "discrete": mujoco.mjtIntegrator.mjINT_DISCRETE,
}


_CONES: Final = {
    "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL,
    "elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC,
}


# Calibrated with benchmarks/fidelity. A box stops a foot within one step, as the literature's
# contact does, and takes 1/45 s to push it out again: pushed out at once, even the CPG alone glides
# over gaps; never, and a coarse step traps the hybrid and the rules too. A plane is slippery to a
# foot that has just touched down and grips it once it has sunk in, as the literature's integrator
# makes it: gripped at once, a fly turns a quarter too sharply and falls at the drive's corners.
# That it slips more easily along the foot than across it was fitted to how the reference turns. The
# tarsus segments above the foot would sink in with it; in the literature's model they bear next to
# nothing, so they are left out.
_BALANCED_CONTACT: Final = ContactConfig(
    plane=SurfaceContact(
        friction=(0.8, 0.005, 0.0001),
        solref=(-2e4, -4e3),
        solimp=(0.5, 0.99, 0.08, 0.5, 2.0),
    ),
    plane_segments=("Coxa", "Femur", "Tibia", "Tarsus5"),
    plane_friction_across=1.2,
    box=SurfaceContact(solref=(-9e4, -2e3)),
)
_FAST_CONTACT: Final = ContactConfig(
    plane=SurfaceContact(
        friction=(1.3, 0.005, 0.0001),
        solref=(-5e4, -5e3),
        solimp=(0.5, 0.985, 0.12, 0.5, 2.0),
    ),
    plane_segments=_BALANCED_CONTACT.plane_segments,
    # at this step even boxes have to let a foot slip at first, or the hybrid gets stuck too
    box=SurfaceContact(solref=(-6e4, -1e3), solimp=(0.7, 0.99, 0.03, 0.5, 2.0)),
)


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
    cone
        Shape of the friction cone; an "elliptic" one takes the solver half as long again.
    collision_detection
        How MuJoCo finds where a leg touches a box: "libccd", as the literature's versions, by
        Minkowski portal refinement; or "native", its exact successor. On the edge of a box the
        former's normals are slanted, so that a leg glides off, where the exact ones hold it: with
        these, the contact with boxes has to push it out.
    multiccd
        Whether to look for more than one point where a leg touches a box.
    contact
        How legs touch the ground; a worm's feet have a contact of their own (see `bodies.worm`).
    """

    timestep: Annotated[float, Within(1e-6, 2e-3)] = 5e-4
    integrator: Integrator = "discrete"
    solver_iterations: Annotated[int, Within(1, 10_000)] = 100
    solver_tolerance: Annotated[float, Within(0, 1)] = 1e-8
    noslip_iterations: Annotated[int, Within(0, 10_000)] = 0
    cone: Cone = "pyramidal"
    collision_detection: CollisionDetection = "native"
    multiccd: bool = False
    contact: ContactConfig = _BALANCED_CONTACT

    def __post_init__(self) -> None:
        check_fields(self, "physics")


PHYSICS_PRESETS: Final[dict[str, PhysicsConfig]] = {
    # step, integrator, contact and collision detection of the published models (flygym 1.2.1)
    "reference": PhysicsConfig(
        timestep=1e-4,
        integrator="euler",
        collision_detection="libccd",
        contact=ContactConfig(plane_shape="hull"),
    ),
    "balanced": PhysicsConfig(),
    "fast": PhysicsConfig(timestep=1e-3, contact=_FAST_CONTACT),
    # step and integrator at which no muscle explodes a worm
    "worm": PhysicsConfig(timestep=WORM_TIMESTEP, integrator="implicitfast"),
}

FLY_PRESETS: Final = ("reference", "balanced", "fast")
"""Those among `PHYSICS_PRESETS` that are for flies."""


def apply_physics(spec: mujoco.MjSpec, config: PhysicsConfig) -> None:
    """Write the settings into a model specification (gravity in mm/s²)."""
    option = spec.option
    option.timestep = config.timestep
    option.integrator = _INTEGRATORS[config.integrator]
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone = _CONES[config.cone]
    option.iterations = config.solver_iterations
    option.tolerance = config.solver_tolerance
    option.noslip_iterations = config.noslip_iterations
    option.gravity = [0.0, 0.0, -9810.0]
    # a fly on the ground is one island: looking for more costs up to a tenth
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    if config.collision_detection == "libccd":
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    if not config.multiccd:
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
