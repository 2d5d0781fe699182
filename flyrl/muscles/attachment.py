"""Muscles of a creature: where a model says they sit, what they do there, their recruitment.

In a creature's MJCF or MjSpec a muscle is a site of a body "muscles", a child of the world that
holds nothing else. Its profile and strength are custom data:

    <custom>
      <text name="Muscle1/profile" data="linear.png"/>
      <numeric name="Muscle1/strength" data="1500"/>
    </custom>
    <worldbody>
      <body name="muscles">
        <site name="Muscle1" pos="0 0 1"/>
      </body>
      ...

Without a strength it is 1. A muscle may also name the body that it pulls against, as a text
"Muscle1/anchor": that body then feels the opposite torque, as with the muscles of animals. Without,
nothing does, and the creature as a whole is turned as if by a hand.

Units are mm, g, s: torques come out in µN mm. After cortex, Simulated Muscles, R. McIntyre
(2012-14), where a muscle is a marker in the creature's model, too, and has no anchor.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from flyrl.muscles.muscle import MotorPool, Muscle, pack_muscles, whole_numbers
from flyrl.muscles.placement import Place, measuring_model, nearest_body, place_on
from flyrl.resources import assets_folder
from flyrl.validation import FloatArray, not_negative, one_of

MUSCLES_BODY: Final = "muscles"
"""Name of the body that muscles are sites of."""

_TORQUE_ABOUT_Y: Final = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
"""Gear of a muscle's actuator: forces along the site's axes, torques about them."""


class AttachedMuscle(NamedTuple):
    """A muscle of a creature.

    Attributes
    ----------
    name : of the muscle, its site and its actuator.
    muscle : its motor pool and strength.
    body : name of the body on which it acts.
    """

    name: str
    muscle: Muscle
    body: str


def attach_muscles(spec: mujoco.MjSpec, profiles: Path | None = None) -> list[AttachedMuscle]:
    """Attach the muscles of a specification to the bodies on which they act, in place.

    The site of each muscle moves to the body that is nearest to it, and keeps its place and
    orientation in the world. There an actuator of the muscle's name, whose control is the muscle's
    force, turns the body about the site's y axis: right-handed, µN mm. A muscle with an anchor has
    a twin of its site there, "{muscle}/anchor", and turns both bodies, in opposite directions,
    about the twin's y axis. The body "muscles" and the custom data about muscles are no longer
    needed, and removed.

    Nearest is the body from whose surface the site is the least way off in the model's initial
    pose; inside a geom this way is negative. All geoms of a body count, in MuJoCo's sense: meshes
    by their convex hulls, height fields not at all. The world does not count. Of bodies that are
    equally near, the first in the model's order is taken.

    Parameters
    ----------
    spec
        Of a creature as the head of this module describes it. After an error it is as it was.
    profiles
        Folder in which profiles lie, that of the assets by default. No profile may lie elsewhere.

    Returns
    -------
    The muscles, in the order of their sites.

    Raises
    ------
    FileNotFoundError
        If a profile is missing in that folder.
    ValueError
        If the model does not compile, has no muscles, or anything else than sites in the body
        "muscles"; if a muscle has no name or no profile, its profile is not one, its strength is
        negative, its anchor is no other body, or an actuator has its name already; or if there is
        no body for it.
    """
    folder = assets_folder() / "muscles" if profiles is None else Path(profiles)
    sites = _muscle_sites(spec)
    muscles = [_read_muscle(spec, site.name, folder) for site in sites]
    posed = measuring_model(spec)
    placed = [_places(*posed, site.name, _read_anchor(spec, site.name)) for site in sites]

    bodies = list(spec.bodies)
    attached = []
    for site, muscle, places in zip(sites, muscles, placed, strict=True):
        name, twin = site.name, _custom("anchor", site.name)
        # What refers to the site does so by name. Deleted under its name, it would take that along.
        site.name = ""
        for new_name, place in places.items():
            _add_site(bodies[place.body], new_name, place, site)
        actuator = spec.add_actuator(
            name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_SITE, gear=_TORQUE_ABOUT_Y
        )
        actuator.set_to_motor()
        actuator.ctrllimited = actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
        if twin in places:
            actuator.refsite = twin
        attached.append(AttachedMuscle(name, muscle, bodies[places[name].body].name))
        texts = spec.text(_custom("profile", name)), spec.text(twin)
        for data in (*texts, spec.numeric(_custom("strength", name))):
            if data is not None:
                spec.delete(data)
    spec.delete(spec.body(MUSCLES_BODY))
    return attached


def _places(
    model: mujoco.MjModel, data: mujoco.MjData, name: str, anchor: str | None
) -> dict[str, Place]:
    """Places of a muscle's site and of its twin on the body that it pulls against, by name."""
    site = model.site(name).id
    body = nearest_body(model, data, site)
    if body is None:
        raise ValueError(f"muscle {name!r} has no body to act on: none but the world has geoms")
    bodies = {name: body}
    if anchor is not None:
        bodies[_custom("anchor", name)] = against = model.body(anchor).id
        if against == body:
            raise ValueError(f"muscle {name!r} acts on body {anchor!r}, its anchor: take another")
    return {name: place_on(model, data, site, body) for name, body in bodies.items()}


def _add_site(body: mujoco.MjsBody, name: str, place: Place, like: mujoco.MjsSite) -> None:
    added = body.add_site(
        name=name,
        pos=place.pos,
        quat=place.quat,
        type=like.type,
        size=place.size,
        group=like.group,
        rgba=like.rgba,
        material=like.material,
        userdata=like.userdata,
    )
    # whatever the model's defaults say
    added.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    added.fromto = np.full(6, np.nan)


# --------------------------------------------------------------------------- what the model says


def _custom(what: str, muscle: str) -> str:
    """Name of the custom data that says what a muscle's profile, strength or anchor is."""
    return f"{muscle}/{what}"


def _muscle_sites(spec: mujoco.MjSpec) -> list[mujoco.MjsSite]:
    body = spec.body(MUSCLES_BODY)
    if body is None or body.parent.name != "world":
        raise ValueError(
            f"a creature's muscles must be sites of a body {MUSCLES_BODY!r}, a child "
            "of the world; this model has no such body"
        )
    for what in ("bodies", "joints", "geoms", "cameras", "lights"):
        if getattr(body, what):
            raise ValueError(f"body {MUSCLES_BODY!r} must hold nothing but sites, it has {what}")
    sites = list(body.sites)
    if not sites:
        raise ValueError(f"body {MUSCLES_BODY!r} must hold a site per muscle, it has none")
    actuators = {actuator.name for actuator in spec.actuators}
    for i, site in enumerate(sites):
        if not site.name:
            raise ValueError(f"every muscle needs a name; site {i} of {MUSCLES_BODY!r} has none")
        if site.name in actuators:
            raise ValueError(f"muscle {site.name!r}: an actuator has that name already")
    return sites


def _read_muscle(spec: mujoco.MjSpec, name: str, folder: Path) -> Muscle:
    text, numeric = spec.text(_custom("profile", name)), spec.numeric(_custom("strength", name))
    if text is None:
        raise ValueError(
            f"muscle {name!r} has no profile: a custom text {_custom('profile', name)!r} must name "
            "its image"
        )
    file = str(text.data)
    # resolved, so that links lead nowhere else either
    path = (folder / file).resolve()
    if path == folder.resolve() or not path.is_relative_to(folder.resolve()):
        raise ValueError(f"muscle {name!r}: its profile must be a file in {folder}, got {file!r}")
    try:
        pool = MotorPool.from_image(path)
    except (FileNotFoundError, ValueError) as error:
        raise type(error)(f"muscle {name!r}: {error}") from error
    if numeric is None:
        return Muscle(pool)
    key = f"muscle {name!r}: {_custom('strength', name)}"
    if numeric.size != 1 or len(numeric.data) != 1:
        raise ValueError(f"{key} must be one number, got {list(numeric.data)}")
    return Muscle(pool, not_negative(key, float(numeric.data[0])))


def _read_anchor(spec: mujoco.MjSpec, name: str) -> str | None:
    text = spec.text(_custom("anchor", name))
    if text is None:
        return None
    bodies = [body.name for body in spec.bodies if body.name not in ("", MUSCLES_BODY)]
    return one_of(f"muscle {name!r}: {_custom('anchor', name)}", str(text.data), bodies)


@dataclass(frozen=True, eq=False)
class Creature:
    """A creature with muscles, compiled, and its state.

    Attributes
    ----------
    model, data
        Of MuJoCo.
    muscles
        In the order of the sites in the model that it was made from.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    muscles: tuple[AttachedMuscle, ...]


def load_creature(source: mujoco.MjSpec | Path | str, profiles: Path | None = None) -> Creature:
    """Compile a creature with its muscles attached.

    Parameters
    ----------
    source
        Its model: a specification, which stays as it is, or the path of an MJCF file.
    profiles
        See `attach_muscles`.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If its muscles are not as `attach_muscles` wants them, or the model does not compile.
    """
    if isinstance(source, mujoco.MjSpec):
        spec = source.copy()
    elif Path(source).is_file():
        spec = mujoco.MjSpec.from_file(str(source))
    else:
        raise FileNotFoundError(f"creature {source}: there is no such file")
    muscles = attach_muscles(spec, profiles)
    model = spec.compile()
    return Creature(model, mujoco.MjData(model), tuple(muscles))


def movement(creature: Creature) -> Callable[[ArrayLike], FloatArray]:
    """Return the function that moves a creature: whole numbers in, tensions out.

    From cortex, Simulated Muscles, R. McIntyre. The function takes one whole number per muscle,
    (M,), in the order of `creature.muscles`; recruits every motor neuron up to it, as `Muscle`
    does; sets the muscles' actuators in `creature.data`, which act from the next step of the
    physics on; and returns the tensions, (M,) within 0 and 1. It raises ValueError for anything
    else than M whole numbers.
    """
    muscles = pack_muscles([attached.muscle for attached in creature.muscles])
    actuators = [creature.model.actuator(attached.name).id for attached in creature.muscles]

    def move(n: ArrayLike) -> FloatArray:
        index, shape = whole_numbers("n", n), muscles.strengths.shape
        if index.shape != shape:
            raise ValueError(
                f"n must be one whole number per muscle, shape {shape}, got shape {index.shape}"
            )
        tensions = muscles.tensions(index)
        creature.data.ctrl[actuators] = muscles.strengths * tensions
        return tensions

    return move


STEP: Final = 20
"""Neurons that a step recruits, as in cortex, Simulated Muscles, R. McIntyre."""


def last_neuron(creature: Creature) -> int:
    """Index of the last neuron of a creature's longest motor pool."""
    return max(len(attached.muscle.pool) for attached in creature.muscles) - 1


def bend(creature: Creature) -> float:
    """Bend of a creature at the moment: sum of the angles of all hinge joints, rad."""
    hinges = creature.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    return float(creature.data.qpos[creature.model.jnt_qposadr[hinges]].sum())
