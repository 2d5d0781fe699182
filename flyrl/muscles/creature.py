"""A creature with muscles: its compiled model, its state, and the function that moves it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from flyrl.muscles.attachment import AttachedMuscle, attach_muscles
from flyrl.muscles.kernels import activate
from flyrl.muscles.muscle import pack_muscles, whole_numbers
from flyrl.validation import FloatArray


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
