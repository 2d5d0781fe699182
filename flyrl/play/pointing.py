"""Where a click meets the ground."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray


class View(NamedTuple):
    """How the world is seen.

    Attributes
    ----------
    position_w
        Of the eye, mm, (3,).
    forward_w, up_w
        Directions of length 1, across each other, (3,).
    slope
        Half the height of what is seen at a distance of 1: the tangent of half the angle.
    """

    position_w: NDArray[np.float64]
    forward_w: NDArray[np.float64]
    up_w: NDArray[np.float64]
    slope: float


def camera_view(
    model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera
) -> View | None:
    """View of a camera; None if it has no perspective."""
    scene = mujoco.MjvScene(model, maxgeom=1)
    mujoco.mjv_updateCamera(model, data, camera, scene)
    left, right = scene.camera
    if left.orthographic:
        return None
    return View(
        (np.array(left.pos, np.float64) + right.pos) / 2,
        np.array(left.forward, np.float64),
        np.array(left.up, np.float64),
        left.frustum_top / left.frustum_near,
    )


def ground_point(view: View, x: float, y: float, aspect: float) -> tuple[float, float] | None:
    """Where the plane z = 0 is seen at a place of the picture, mm; None if it is not seen there.

    Parameters
    ----------
    view
        From where.
    x, y
        Place as shares of the picture's width and height, from its upper left corner.
    aspect
        Width of the picture, divided by its height.
    """
    right = np.cross(view.forward_w, view.up_w)
    across, upwards = (2 * x - 1) * aspect * view.slope, (1 - 2 * y) * view.slope
    ray = view.forward_w + across * right + upwards * view.up_w
    height = view.position_w[2]
    if ray[2] * height >= 0:
        return None
    x_w, y_w, _ = view.position_w - height / ray[2] * ray
    return float(x_w), float(y_w)
