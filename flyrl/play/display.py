"""What viewer and browser are given to draw: a model without forces, and the places of its parts.

Both run MuJoCo on it, to find where bodies are.
"""

import copy

import mujoco


def display_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """Copy a model for being drawn: no contacts, constraints, actuators, sensors."""
    display = copy.deepcopy(model)
    bits = mujoco.mjtDisableBit
    display.opt.disableflags |= (
        bits.mjDSBL_CONSTRAINT | bits.mjDSBL_CONTACT | bits.mjDSBL_ACTUATION | bits.mjDSBL_SENSOR
    )
    return display


def copy_state(source: mujoco.MjData, target: mujoco.MjData) -> None:
    """Copy what is drawn of a state, between copies of one model: joints and mocap bodies."""
    target.qpos[:] = source.qpos
    target.mocap_pos[:] = source.mocap_pos
    target.mocap_quat[:] = source.mocap_quat
