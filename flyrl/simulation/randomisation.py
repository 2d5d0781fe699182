"""Domain randomisation: how the fly of an episode differs from the fly of the scene.

A policy that is to hold on another fly than the one it was trained on is trained on many (Peng et
al. 2018, arXiv:1710.06537). Ranges are settings; what was drawn from them belongs to an episode.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from flyrl.anatomy import JOINTS, LEGS, Leg
from flyrl.bodies.fly import GHOST, is_of_legs
from flyrl.bodies.surface import HIDDEN_GROUP, VISUAL_GROUP
from flyrl.simulation.engine import ENGINE, ENGINE_SIZE
from flyrl.validation import Within, check_fields, distinct, ordered

MAX_LATENCY: Final = 0.05
"""s; longest delay between a decision and its arrival at the legs."""

Range = tuple[float, float]

_STREAM: Final = 171_006_537
"""Sets the generator of the draws apart from the task's, which has the same seed."""

_FACTOR: Final = Within(0, 100)
_FACTOR_ABOVE_0: Final = Within(0.01, 100)
_NOISE: Final = Within(0, 100)
_LATENCY: Final = Within(0, MAX_LATENCY)

_RANGES: Final = ("friction", "mass", "actuator_gain", "adhesion", "drive_latency")
_DRAWN: Final = (*_RANGES, "missing_leg")
"""In the order of the draws: a new quantity goes to the end, so that the others keep theirs."""


@dataclass(frozen=True)
class Randomisation:
    """How the fly of one episode differs from the scene's; by default, not at all.

    Attributes
    ----------
    friction
        Factor on the friction of legs on the ground.
    mass
        Factor on the mass and inertia of every part of the body.
    actuator_gain
        Factor on the stiffness of the 42 position servos.
    adhesion
        Factor on the force of gripping legs.
    sensor_noise
        Standard deviation of the noise on what the fly senses, as a share of each sense's spread;
        see `flyrl.tasks.ObservationTerm`.
    drive_latency
        s from a decision until its drive is at the leg controller, rounded to physics steps.
    missing_leg
        Leg that is cut off, beside those that the scene's fly lacks (`FlyConfig.missing_legs`).

    Raises
    ------
    ValueError
        A number that is not allowed.
    """

    friction: Annotated[float, _FACTOR] = 1.0
    mass: Annotated[float, _FACTOR_ABOVE_0] = 1.0
    actuator_gain: Annotated[float, _FACTOR_ABOVE_0] = 1.0
    adhesion: Annotated[float, _FACTOR] = 1.0
    sensor_noise: Annotated[float, _NOISE] = 0.0
    drive_latency: Annotated[float, _LATENCY] = 0.0
    missing_leg: Leg | None = None

    def __post_init__(self) -> None:
        check_fields(self, "randomisation")

    def numbers(self) -> dict[str, float]:
        """Its values by name; the missing leg's is its place in anatomy.LEGS, -1 without one."""
        leg = -1 if self.missing_leg is None else LEGS.index(self.missing_leg)
        return {**vars(self), "missing_leg": leg}


UNVARIED: Final = Randomisation()
"""The scene's own fly."""


@dataclass(frozen=True)
class RandomisationConfig:
    """Ranges that the fly of every episode is drawn from; by default, it is always the scene's.

    Attributes
    ----------
    friction, mass, actuator_gain, adhesion
        Least and greatest factor, drawn uniformly; None leaves the quantity as it is. What each
        means stands in `Randomisation`.
    sensor_noise
        The same in every episode.
    drive_latency
        Least and greatest, s, drawn uniformly, from 0 to `MAX_LATENCY`; None is 0.
    missing_leg
        Legs of which one is cut off in every episode, each as likely; None, or (), cuts off none.

    Raises
    ------
    ValueError
        A range, number or leg that is not allowed.
    """

    friction: Annotated[Range | None, _FACTOR] = None
    mass: Annotated[Range | None, _FACTOR_ABOVE_0] = None
    actuator_gain: Annotated[Range | None, _FACTOR_ABOVE_0] = None
    adhesion: Annotated[Range | None, _FACTOR] = None
    sensor_noise: Annotated[float, _NOISE] = 0.0
    drive_latency: Annotated[Range | None, _LATENCY] = None
    missing_leg: tuple[Leg, ...] | None = None

    def __post_init__(self) -> None:
        check_fields(self, "randomisation")
        distinct("randomisation.missing_leg", self.missing_leg or ())
        for name in _RANGES:
            given = getattr(self, name)
            if given is not None:
                ordered(f"randomisation.{name}", given)

    @property
    def longest_latency(self) -> float:
        """Greatest latency that can be drawn, s."""
        return 0.0 if self.drive_latency is None else self.drive_latency[1]

    def draw(self, seed: int) -> Randomisation:
        """Draw the fly of the episode with a seed; a range changes no draw but its own."""
        if not any(getattr(self, name) for name in _DRAWN):
            return Randomisation(sensor_noise=self.sensor_noise)
        shares = np.random.default_rng([seed, _STREAM]).random(len(_DRAWN)).tolist()
        drawn: dict[str, Any] = {}
        for name, share in zip(_DRAWN, shares, strict=True):
            if not (given := getattr(self, name)):
                continue
            if name == "missing_leg":
                drawn[name] = given[int(share * len(given))]
            else:
                low, high = given
                drawn[name] = min(low + share * (high - low), high)
        return Randomisation(sensor_noise=self.sensor_noise, **drawn)


RANDOMISATIONS: Final[dict[str, RandomisationConfig]] = {
    "none": RandomisationConfig(),
    "default": RandomisationConfig(
        friction=(0.7, 1.3),
        mass=(0.8, 1.2),
        actuator_gain=(0.8, 1.2),
        adhesion=(0.7, 1.3),
        sensor_noise=0.1,
        drive_latency=(0.0, 0.02),
    ),
    "lesion": RandomisationConfig(missing_leg=LEGS),
}
"""Ranges by name."""


_SERVOS: Final = slice(0, len(JOINTS))
_GRIPS: Final = slice(len(JOINTS), None)

_SCALED: Final[dict[str, tuple[tuple[str, tuple[Any, ...]], ...]]] = {
    # contacts with planes are pairs, those with boxes take the figures of the leg's shape
    "friction": (("pair_friction", ()), ("geom_friction", ())),
    "mass": (("body_mass", ()), ("body_inertia", ())),
    # a servo's force is gain x target - stiffness x angle, with the same figure twice
    "actuator_gain": (("actuator_gainprm", (_SERVOS, 0)), ("actuator_biasprm", (_SERVOS, 1))),
    "adhesion": (("actuator_gainprm", (_GRIPS, 0)),),
}
"""Factor of a `Randomisation` -> fields that it scales, and which of their values."""


_NEVER: Final = -1e3
"""mm; margin of a pair of shapes that never touch: they would have to be as deep in each other."""


def vary(
    model: mujoco.MjModel,
    batch: Batch,
    ids: NDArray[np.intp],
    randomisations: Sequence[Randomisation],
) -> None:
    """Give simulations `ids` of a batch their flies, always from the figures of its model's own.

    A field is shared by all simulations until the first one differs: flies that never do cost
    nothing.
    """
    is_cut = any(drawn.missing_leg for drawn in randomisations) or _has_cut(batch)
    for quantity, fields in _SCALED.items():
        factors = np.array([getattr(drawn, quantity) for drawn in randomisations])
        differs = (factors != 1.0).any() or (is_cut and quantity == "mass")
        for name, index in fields:
            if differs or batch.expanded(name) is not None:
                own = getattr(model, name)[index]
                values = batch.expand(name)[(slice(None), *index)]
                values[ids] = own * factors.reshape(-1, *(1,) * own.ndim)
    if is_cut:
        for sim, drawn in zip(ids, randomisations, strict=True):
            _cut(model, batch, sim, drawn)
    if batch.expanded("body_mass") is not None:
        # what MuJoCo derives from masses when it compiles a model
        batch.set_const(ids)


def _cut(model: mujoco.MjModel, batch: Batch, sim: np.intp, drawn: Randomisation) -> None:
    """Leave of the missing leg what `FlyConfig.missing_legs` leaves, and all of the others."""
    for name in ("numeric_data", "geom_conaffinity", "pair_margin"):
        batch.expand(name)[sim] = getattr(model, name)
    leg, is_missing = drawn.missing_leg, _is_missing(batch, sim)
    if leg is None or is_missing[LEGS.index(leg)]:
        return
    is_missing[LEGS.index(leg)] = 1.0
    bodies = _bodies(model, leg)
    geoms = np.isin(model.geom_bodyid, bodies)
    for name in ("body_mass", "body_inertia"):
        ghost = GHOST * getattr(model, name)[bodies]
        batch.expand(name)[sim, bodies] = ghost * drawn.mass
    batch.expand("geom_conaffinity")[sim, geoms] = 0
    pairs = geoms[model.pair_geom1] | geoms[model.pair_geom2]
    batch.expand("pair_margin")[sim, pairs] = _NEVER


def show_legs(batch: Batch, sim: int, model: mujoco.MjModel) -> None:
    """Hide the leg that a simulation lacks in a model that is drawn, and show the others."""
    if not _has_cut(batch):
        return
    for leg, is_missing in zip(LEGS, _is_missing(batch, sim), strict=True):
        is_drawn = np.isin(model.geom_group, (VISUAL_GROUP, HIDDEN_GROUP))
        geoms = np.isin(model.geom_bodyid, _bodies(model, leg)) & is_drawn
        model.geom_group[geoms] = HIDDEN_GROUP if is_missing else VISUAL_GROUP


def _has_cut(batch: Batch) -> bool:
    """Whether a simulation lacks a leg that the model has, or did."""
    return batch.expanded("numeric_data") is not None


def _is_missing(batch: Batch, sim: np.intp | int) -> NDArray[np.float64]:
    """Whether each leg is missing, as the callbacks read it: a live view, (6,)."""
    engine = batch.expand("numeric_data")[sim, :ENGINE_SIZE].view(ENGINE)[0]
    return np.asarray(engine["is_missing"])


def _bodies(model: mujoco.MjModel, leg: Leg) -> list[int]:
    """Bodies of a leg."""
    return [i for i in range(model.nbody) if is_of_legs(model.body(i).name, (leg,))]
