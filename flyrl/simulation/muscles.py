"""The muscles of a fly's legs, as its model carries them for the native callback."""

import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import JOINTS
from flyrl.bodies.fly import FlyConfig, servo_stiffness
from flyrl.muscles import MotorPool


def pack_leg_muscles(config: FlyConfig) -> NDArray[np.float64]:
    """What the callback is told of the muscles; of a fly without, nothing.

    Stiffness of the servos that they stand in for (42,), strengths (84,), two per joint, and the
    recruitment table of the pool that they share (N,).

    Raises
    ------
    FileNotFoundError, ValueError
        If the profile is not one.
    """
    muscles = config.muscles
    if muscles is None:
        return np.empty(0)
    pool = MotorPool.from_image(muscles.profile_path)
    if muscles.order == "reversed":
        pool = MotorPool(pool.forces[::-1])
    factors = {"L": muscles.left, "R": muscles.right}
    sides = np.array([factors[joint.removeprefix("joint_")[0]] for joint in JOINTS])
    strengths = np.repeat(muscles.strength * sides, 2)
    return np.concatenate([servo_stiffness(config), strengths, pool.recruitment])
