"""What the tables of the tasks for worms compute; the first axis is the simulation."""

import numpy as np

from flyrl.tasks.task import Array, Mask, TaskState


def joint_angles(state: TaskState) -> Array:
    """Angles of the joints, rad, (n, J)."""
    return state.worm.joint_angles


def joint_velocities(state: TaskState) -> Array:
    """Velocities of the joints, 5 rad/s, (n, J)."""
    return state.worm.joint_velocities / 5.0


def tensions(state: TaskState) -> Array:
    """Tensions of the muscles, 0 to 1, (n, M)."""
    return state.worm.tensions


def has_crawled(state: TaskState, way: float) -> Mask:
    """Whether the worm has come `way` mm along +x in this episode, (n,)."""
    return np.asarray(state.totals["progress"] >= way)


def bend_error(state: TaskState) -> Array:
    """Bend less what is asked for, rad, (n, 1)."""
    return state.worm.bend[:, None] - state.command


def absolute_bend_error(state: TaskState) -> Array:
    """How far the bend is off what is asked for, rad, (n,)."""
    return np.abs(bend_error(state)[:, 0])


def bend_error_deg(state: TaskState) -> Array:
    """The same, deg, (n,)."""
    return np.degrees(absolute_bend_error(state))


def has_bent(state: TaskState, tolerance: float) -> Mask:
    """Whether the worm is bent as told, within `tolerance`, rad, (n,)."""
    return np.asarray(absolute_bend_error(state) < tolerance)


def bent(state: TaskState, tolerance: float) -> Array:
    """1 where the worm is bent as told, else 0, (n,)."""
    return has_bent(state, tolerance).astype(np.float64)


def recruited_share(state: TaskState, pools: tuple[int, ...]) -> Array:
    """Share of a worm's motor neurons that are recruited, 0 to 1, (n,).

    The first neuron of a pool always is, so it does not count.
    """
    most = max(1, sum(pools) - len(pools))  # 1: of pools of one neuron each
    return np.asarray(state.worm.neurons.sum(axis=1) / most)
