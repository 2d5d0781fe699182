"""Walknet's rules in a Python loop that drives the 42 joints and six adhesions.

    python examples/rule_based_loop.py

What the built-in controller `rule_based` does inside the engine, written out.
"""

import gymnasium
import numpy as np

from flyrl import PreprogrammedSteps, RuleBasedSteppingCoordinator, construct_rules_graph
from flyrl.controllers.rule_based import RULE_WEIGHTS


def walk(terrain: str = "flat", seconds: float = 0.5, seed: int = 0) -> np.ndarray:
    """Walk straight ahead.

    Parameters
    ----------
    terrain
        Name of the ground.
    seconds
        Simulated time, s.
    seed
        Of the episode, and of the choices between legs.

    Returns
    -------
    The thorax's position after every physics step, mm, (T, 3), world frame.
    """
    env = gymnasium.make("flyrl/Joints-v0", terrain=terrain)
    timestep = env.unwrapped.config.scene.physics.timestep
    steps = PreprogrammedSteps(duration=1 / 12)
    rules = RuleBasedSteppingCoordinator(
        timestep, construct_rules_graph(), RULE_WEIGHTS, steps, seed=seed
    )
    env.reset(seed=seed)
    path = []
    for _ in range(round(seconds / timestep)):
        rules.step()
        joints = [
            steps.get_joint_angles(leg, phase)
            for leg, phase in zip(steps.legs, rules.leg_phases, strict=True)
        ]
        adhesion = [
            steps.get_adhesion_onoff(leg, phase)
            for leg, phase in zip(steps.legs, rules.leg_phases, strict=True)
        ]
        env.step({"joints": np.concatenate(joints), "adhesion": np.array(adhesion, dtype=np.int8)})
        path.append(env.unwrapped.core.state.position_w[0])
    env.close()
    return np.array(path)


if __name__ == "__main__":
    way = walk()
    print(f"{way[-1, 0] - way[0, 0]:.2f} mm along x in 0.5 s")
