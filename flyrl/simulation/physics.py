"""Settings of the physics engine, and the presets that were measured."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Final, Literal, NamedTuple

import mujoco

from flyrl.bodies.surface import GRAVITY, ContactConfig, SurfaceContact
from flyrl.bodies.worm import TIMESTEP as WORM_TIMESTEP
from flyrl.terrains import Terrain
from flyrl.validation import Within, check_fields

Integrator = Literal["euler", "implicitfast", "discrete"]
Cone = Literal["pyramidal", "elliptic"]
CollisionDetection = Literal["libccd", "native"]

# Calibrated with benchmarks/fidelity. A box stops a foot within one step, as the literature's
# contact does, and takes 1/28 s to push it out again: pushed out at once, even the CPG alone
# glides over gaps; never, and a coarse step traps the hybrid and the rules too. It is felt from
# 20 µm away, grips less than in the literature, and only from 2 µm deep on, or it trips a fly
# that is steered. A plane is slippery to a foot that has just touched down and grips it once it
# has sunk in, as the literature's integrator makes it: gripped at once, a fly turns a quarter too
# sharply and falls at the drive's corners. That it slips more easily along the foot than across
# it was fitted to how the reference turns. The tarsus segments above the foot would sink in with
# it; in the literature's model they bear next to nothing, so they are left out.
_BALANCED_CONTACT: Final = ContactConfig(
    plane=SurfaceContact(
        friction=(0.8, 0.005, 0.0001),
        solref=(-2.5e4, -5e3),
        solimp=(0.5, 0.99, 0.08, 0.5, 2.0),
    ),
    plane_segments=("Coxa", "Femur", "Tibia", "Tarsus5"),
    plane_friction_across=1.2,
    box=SurfaceContact(
        friction=(0.65, 0.005, 0.0001),
        solref=(-7e4, -2.5e3),
        solimp=(0.5, 0.999, 0.002, 0.5, 2.0),
        margin=0.02,
    ),
)
_FAST_CONTACT: Final = replace(
    _BALANCED_CONTACT,
    plane=replace(_BALANCED_CONTACT.plane, friction=(0.9, 0.005, 0.0001), solref=(-1.05e4, -1.5e3)),
    plane_friction_across=1.25,
    # at this step even boxes have to let a foot slip at first, or the hybrid gets stuck too
    box=SurfaceContact(
        friction=(0.7, 0.005, 0.0001),
        solref=(-6e4, -1e3),
        solimp=(0.75, 0.99, 0.03, 0.5, 2.0),
        margin=0.01,
    ),
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
        these, the contact with boxes has to push it out. With height fields it is always libccd:
        the exact normals of their prisms catch the feet of a fly at coarse steps (with "native",
        `balanced` walks over hills at two thirds of the speed of `reference`, and falls).
    multiccd
        Whether to look for more than one point where a leg touches a box.
    contact
        How legs touch the ground; a worm's feet have a contact of their own (see `bodies.worm`).
    """

    timestep: Annotated[float, Within(1e-6, 2e-3)] = 4e-4
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


class PresetVersion(NamedTuple):
    """Name of a preset and its version: 1, 2 and so on."""

    name: str
    version: int


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

PRESET_VERSIONS: Final = {"reference": 1, "balanced": 3, "fast": 3, "worm": 1}
"""Version of each of `PHYSICS_PRESETS`: one more whenever its settings change."""


def _digest(settings: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


_BY_DIGEST: Final = {
    **{
        _digest(asdict(PHYSICS_PRESETS[name])): (name, version)
        for name, version in PRESET_VERSIONS.items()
    },
    "7593c9fee681372a49e0f9cfbaaa22952736564e2bb8316002b2988a2947fbd6": ("balanced", 1),
    "8929ba6ba4e362fa5b697cc26c7295a9248f30469762d4de5a1213c4bb67f428": ("balanced", 2),
    "ed80341a32838259038b9bf496577daba9b5eba6882dcac4286b0cca16213686": ("fast", 1),
    "dc4c7277b1152e29c582bd097f56bb51113de58e79ef4c120706e47ee7baac5e": ("fast", 2),
}
"""By the SHA-256 of their settings, presets as they are and as they were: records that name no
preset are known by it."""


def preset_version(settings: Mapping[str, Any]) -> PresetVersion | None:
    """Preset that has these settings, today's or an earlier version; None: they are nobody's.

    Parameters
    ----------
    settings
        Fields of a `PhysicsConfig`, as plain JSON values or as `dataclasses.asdict` gives them.
    """
    known = _BY_DIGEST.get(_digest(settings))
    return known and PresetVersion(*known)


def walks_alike_on_flat(settings: Mapping[str, Any]) -> bool:
    """Whether flies walk on flat ground with these settings as with today's preset of that name.

    That is so, to the bit, where nothing differs but the contact with boxes, of which flat ground
    has none.
    """
    preset = preset_version(settings)
    if preset is None:
        return False
    today = asdict(PHYSICS_PRESETS[preset.name])
    contact = {**settings["contact"], "box": today["contact"]["box"]}
    return _digest({**settings, "contact": contact}) == _digest(today)


def preset_record(physics: PhysicsConfig) -> dict[str, Any] | None:
    """Name and version of the preset that has these settings, as plain JSON values."""
    preset = preset_version(asdict(physics))
    return preset and preset._asdict()


def gravity_along(down: Sequence[float]) -> list[float]:
    """Gravity, mm/s², along a unit vector."""
    return [-GRAVITY[2] * each for each in down]


def apply_physics(spec: mujoco.MjSpec, config: PhysicsConfig, terrain: Terrain) -> None:
    """Write the settings into a model specification, and turn gravity as a terrain does."""
    option = spec.option
    option.timestep = config.timestep
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{config.integrator.upper()}")
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone = getattr(mujoco.mjtCone, f"mjCONE_{config.cone.upper()}")
    option.iterations = config.solver_iterations
    option.tolerance = config.solver_tolerance
    option.noslip_iterations = config.noslip_iterations
    option.gravity = gravity_along(terrain.compiled().down)
    # a fly on the ground is one island: looking for more costs up to a tenth
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    if config.collision_detection == "libccd" or terrain.heights() is not None:
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    if not config.multiccd:
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
