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

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from flyrl.muscles.muscle import MotorPool, Muscle, activate, pack_muscles, whole_numbers
from flyrl.muscles.placement import Place, measuring_model, nearest_body, place_on
from flyrl.resources import assets_folder
from flyrl.validation import FloatArray, at_least, not_negative, one_of, positive

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
    anchors = [_read_anchor(spec, site.name) for site in sites]
    posed = measuring_model(spec)
    placed = [_places(*posed, *pair) for pair in zip(sites, anchors, strict=True)]

    bodies = list(spec.bodies)
    attached = []
    for site, muscle, (place, anchor) in zip(sites, muscles, placed, strict=True):
        name = site.name
        # What refers to the site does so by name. Deleted under its name, it would take that along.
        site.name = ""
        _add_site(bodies[place.body], name, place, site)
        actuator = spec.add_actuator(
            name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_SITE, gear=_TORQUE_ABOUT_Y
        )
        actuator.set_to_motor()
        actuator.ctrllimited = actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
        if anchor is not None:
            _add_site(bodies[anchor.body], _custom("anchor", name), anchor, site)
            actuator.refsite = _custom("anchor", name)
        attached.append(AttachedMuscle(name, muscle, bodies[place.body].name))
    spec.delete(spec.body(MUSCLES_BODY))
    for name in (attachment.name for attachment in attached):
        texts = spec.text(_custom("profile", name)), spec.text(_custom("anchor", name))
        for data in (*texts, spec.numeric(_custom("strength", name))):
            if data is not None:
                spec.delete(data)
    return attached


def _places(
    model: mujoco.MjModel, data: mujoco.MjData, site: mujoco.MjsSite, anchor: str | None
) -> tuple[Place, Place | None]:
    """Place of a muscle's site, and of its twin on the body that it pulls against."""
    index = model.site(site.name).id
    body = nearest_body(model, data, index)
    if body is None:
        raise ValueError(
            f"muscle {site.name!r} has no body to act on: none but the world has geoms"
        )
    against = None if anchor is None else model.body(anchor).id
    if against == body:
        raise ValueError(f"muscle {site.name!r} acts on body {anchor!r}, its anchor: take another")
    twin = None if against is None else place_on(model, data, index, against)
    return place_on(model, data, index, body), twin


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
    strength = 1.0 if numeric is None else _one_number(name, numeric)
    return Muscle(pool, strength)


def _one_number(name: str, numeric: mujoco.MjsNumeric) -> float:
    data = np.array(numeric.data, dtype=np.float64)
    if numeric.size != 1 or data.size > 1:
        raise ValueError(
            f"muscle {name!r}: {_custom('strength', name)} must be one number, got {data.tolist()}"
        )
    return not_negative(f"muscle {name!r}: {_custom('strength', name)}", float(data[0]))


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
    muscles = [attached.muscle for attached in creature.muscles]
    packed = pack_muscles(muscles)
    actuators = [creature.model.actuator(attached.name).id for attached in creature.muscles]

    def move(n: ArrayLike) -> FloatArray:
        index = whole_numbers("n", n)
        if index.shape != (len(muscles),):
            raise ValueError(
                f"n must be one whole number per muscle, shape ({len(muscles)},), "
                f"got shape {index.shape}"
            )
        tension, force = np.empty(len(muscles)), np.empty(len(muscles))
        activate(*packed, index, tension, force)
        creature.data.ctrl[actuators] = force
        return tension

    return move


STEP: Final = 20
"""Neurons that a step recruits, as in cortex, Simulated Muscles, R. McIntyre."""


class Moment(NamedTuple):
    """A creature in the course of recruitment.

    Attributes
    ----------
    n : what all muscles are activated with.
    tension : of each of the M muscles, (M,) within 0 and 1.
    bend : sum of the angles of all hinge joints, rad.
    is_last : whether n changes next, or all ends.
    """

    n: int
    tension: FloatArray
    bend: float
    is_last: bool


def recruit_stepwise(
    creature: Creature, step: int = STEP, hold_s: float = 1.0, frame_s: float = 0.04
) -> Iterator[Moment]:
    """Activate all muscles with 0, `step`, 2 `step`, … up to the last neuron of the longest pool.

    Parameters
    ----------
    creature
        It starts in its initial pose; its data move along, and hold what is at the moment given.
    step
        Neurons that are recruited at a time, 1 or more.
    hold_s
        For how long every n is held, s.
    frame_s
        From one moment to the next, s.
    """
    at_least("step", step, 1)
    frames = max(1, round(positive("hold_s", hold_s) / positive("frame_s", frame_s)))
    model, data = creature.model, creature.data
    per_frame = max(1, round(frame_s / model.opt.timestep))
    move = movement(creature)
    last = last_neuron(creature)
    mujoco.mj_resetData(model, data)
    for n in [*range(0, last, step), last]:
        tension = move(np.full(len(creature.muscles), n))
        for frame in range(frames):
            for _ in range(per_frame):
                mujoco.mj_step(model, data)
            # a step leaves the places of bodies as they were before it
            mujoco.mj_kinematics(model, data)
            yield Moment(n, tension, bend(creature), frame == frames - 1)


def last_neuron(creature: Creature) -> int:
    """Index of the last neuron of a creature's longest motor pool."""
    return max(len(attached.muscle.pool) for attached in creature.muscles) - 1


def bend(creature: Creature) -> float:
    """Bend of a creature at the moment: sum of the angles of all hinge joints, rad."""
    hinges = creature.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    return float(creature.data.qpos[creature.model.jnt_qposadr[hinges]].sum())
