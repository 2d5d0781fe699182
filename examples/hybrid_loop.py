"""CPG and reflexes in a Python loop that drives the 42 joints and six adhesions.

    python examples/hybrid_loop.py

What the built-in controller `hybrid` does inside the engine, written out: the CPG steps the legs;
a leg that hangs in a hole is pulled out, and one that stumbles is lifted.
"""

import gymnasium
import numpy as np

from flyrl import CPGNetwork, PreprogrammedSteps
from flyrl.controllers import Hybrid, Reflexes
from flyrl.controllers.cpg import gait_coupling_weights, gait_phase_biases, modulated
from flyrl.controllers.steps import adhesion_on


def walk(
    terrain: str = "mixed",
    seconds: float = 0.5,
    seed: int = 0,
    drive: tuple[float, float] = (1.0, 1.0),
) -> np.ndarray:
    """Walk under a steady descending drive.

    Parameters
    ----------
    terrain
        Name of the ground.
    seconds
        Simulated time, s.
    seed
        Of the episode, and of the oscillators' start.
    drive
        To the left and to the right legs.

    Returns
    -------
    The thorax's position after every physics step, mm, (T, 3), world frame.
    """
    env = gymnasium.make("flyrl/Joints-v0", terrain=terrain)
    timestep = env.unwrapped.config.scene.physics.timestep
    steps = PreprogrammedSteps()
    frequencies, amplitudes = modulated(drive, 12.0)
    network = CPGNetwork(
        timestep=timestep,
        intrinsic_freqs=np.full(6, 12.0),
        intrinsic_amps=np.ones(6),
        coupling_weights=gait_coupling_weights(),
        phase_biases=gait_phase_biases(),
        convergence_coefs=np.full(6, 20.0),
        seed=seed,
    )
    network.intrinsic_freqs, network.intrinsic_amps = frequencies, amplitudes
    reflexes = Reflexes(timestep, Hybrid())
    env.reset(seed=seed)
    path = []
    for _ in range(round(seconds / timestep)):
        # in double precision: the observation is rounded, and a reflex has thresholds
        fly = env.unwrapped.core.state
        reflexes.step(
            fly.position_w[0, 2],
            fly.end_effectors_w[0, :, 2],
            fly.contact_forces_w[0],
            fly.heading_w[0],
        )
        network.step()
        phases, magnitudes = network.curr_phases, network.curr_magnitudes
        joints = np.array(
            [
                steps.get_joint_angles(leg, phase, magnitude)
                for leg, phase, magnitude in zip(steps.legs, phases, magnitudes, strict=True)
            ]
        )
        joints += reflexes.net_corrections(phases)[:, np.newaxis] * reflexes.vectors
        adhesion = [
            adhesion_on(*timing)
            for timing in zip(phases, steps.swing_starts, reflexes.grip_starts, strict=True)
        ]
        env.step({"joints": joints.ravel(), "adhesion": np.array(adhesion, dtype=np.int8)})
        path.append(env.unwrapped.core.state.position_w[0])
    env.close()
    return np.array(path)


if __name__ == "__main__":
    way = walk()
    print(f"{way[-1, 0] - way[0, 0]:.2f} mm along x in 0.5 s")
