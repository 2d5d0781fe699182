"""Left and right mean the same: what is mirrored at the start stays mirrored."""

import itertools

import numpy as np
import pytest

from flyrl.anatomy import RIGHT_LEG_MIRROR
from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.physics import PHYSICS_PRESETS
from tests.simulation.test_callback import make_batch, start

TIMESTEP = PHYSICS_PRESETS["balanced"].timestep


def two_flies(**settings) -> FlyBatch:
    return make_batch(num_sims=2, physics=PHYSICS_PRESETS["balanced"], **settings)


def other_side(values: np.ndarray) -> np.ndarray:
    """Swap left and right legs, (6, ...)."""
    return np.roll(values, 3, axis=0)


def mirror_error(batch: FlyBatch, drive: tuple[float, float], seed: int) -> tuple[float, float]:
    """Largest distance (mm) and angle (rad) between a walk of 0.1 s and its mirrored twin's."""
    rng = np.random.default_rng(seed)
    phases, magnitudes = rng.uniform(0, 2 * np.pi, 6), rng.uniform(0, 1, 6)
    start(
        batch,
        {"init_phases": phases, "init_magnitudes": magnitudes},
        {"init_phases": other_side(phases), "init_magnitudes": other_side(magnitudes)},
    )
    batch.set_command(np.array([drive, drive[::-1]]))
    sign = np.array([1.0, -1.0, 1.0])
    millimetres = radians = 0.0
    for _ in range(round(0.1 / TIMESTEP / 4)):
        batch.step(4)
        state = batch.state()
        (place, twin), (tips, twin_tips) = state.position_w, state.end_effectors_w
        millimetres = max(
            millimetres,
            np.abs(place * sign - twin).max(),
            np.abs(other_side(tips) * sign - twin_tips).max(),
        )
        angles, twin_angles = state.joint_angles.reshape(2, 6, 7)
        # Reflected at y = 0 a rotation keeps its pitch and changes the signs of yaw and roll.
        turned, twin_turned = state.rotation_w
        radians = max(
            radians,
            np.abs(other_side(angles) * RIGHT_LEG_MIRROR - twin_angles).max(),
            np.abs(turned * np.outer(sign, sign) - twin_turned).max(),
        )
    return millimetres, radians


@pytest.mark.parametrize("legs", ["cpg", "hybrid"])
@pytest.mark.parametrize("body", ["current", "classic"])
def test_mirrored_drives_and_phases_give_mirrored_walks(body, legs) -> None:
    batch = two_flies(name=body, controller=legs)
    for seed, drive in itertools.product(range(2), [(1.0, 1.0), (1.2, 0.2), (-0.5, 0.8)]):
        millimetres, radians = mirror_error(batch, drive, seed)
        assert millimetres < 1e-6, drive
        assert radians < 1e-6, drive


def test_the_published_body_walks_lopsidedly() -> None:
    millimetres, _ = mirror_error(two_flies(symmetric=False), (1.0, 1.0), seed=0)
    assert millimetres > 1e-3
