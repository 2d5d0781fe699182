"""A CPG of one's own: a Python loop over oscillators that drives the 42 joints and six adhesions.

    python examples/cpg_loop.py

What the built-in controller `cpg` does inside the engine, written out.
"""

import gymnasium
import numpy as np

from flyrl import CPGNetwork, PreprogrammedSteps
from flyrl.controllers.cpg import gait_coupling_weights, gait_phase_biases


def walk(terrain: str = "flat", seconds: float = 0.5, seed: int = 0) -> np.ndarray:
    """Walk straight ahead.

    Parameters
    ----------
    terrain
        Name of the ground.
    seconds
        Simulated time, s.
    seed
        Of the episode, and of the oscillators' start.

    Returns
    -------
    The thorax's position after every physics step, mm, (T, 3), world frame.
    """
    env = gymnasium.make("flyrl/Joints-v0", terrain=terrain)
    timestep = env.unwrapped.config.scene.physics.timestep
    steps = PreprogrammedSteps()
    network = CPGNetwork(
        timestep=timestep,
        intrinsic_freqs=np.full(6, 12.0),
        intrinsic_amps=np.ones(6),
        coupling_weights=gait_coupling_weights(),
        phase_biases=gait_phase_biases(),
        convergence_coefs=np.full(6, 20.0),
        seed=seed,
    )
    env.reset(seed=seed)
    path = []
    for _ in range(round(seconds / timestep)):
        network.step()
        phases, magnitudes = network.curr_phases, network.curr_magnitudes
        joints = [
            steps.get_joint_angles(leg, phase, magnitude)
            for leg, phase, magnitude in zip(steps.legs, phases, magnitudes, strict=True)
        ]
        adhesion = [
            steps.get_adhesion_onoff(leg, phase)
            for leg, phase in zip(steps.legs, phases, strict=True)
        ]
        env.step({"joints": np.concatenate(joints), "adhesion": np.array(adhesion, dtype=np.int8)})
        path.append(env.unwrapped.core.state.position_w[0])
    env.close()
    return np.array(path)


if __name__ == "__main__":
    way = walk()
    print(f"{way[-1, 0] - way[0, 0]:.2f} mm along x in 0.5 s")
