"""Run flygym-gymnasium 1.3.2 and keep what it did, to set flyrl beside it.

For an interpreter of its own, in which flyrl is not installed, from the root of the repository:

    python3.11 -m venv /tmp/flygym
    /tmp/flygym/bin/pip install flygym-gymnasium==1.3.2 numpy==2.0.2 scipy==1.17.1 \
        gymnasium==1.4.0 networkx==3.6.1
    /tmp/flygym/bin/python -m benchmarks.fidelity.reference runs/flygym --seeds 0 1 2 3

One file per run, `TERRAIN-CONTROLLER-SEED.npz`, of half a minute to some minutes; what is there is
not run again. `python -m benchmarks.fidelity walking --collect runs/flygym` then adds them
to `reference.json`. With `--drives smooth abrupt turn` the hybrid controller is steered by the
sequences of `drives.py` (`TERRAIN-DRIVES-SEED.npz`), and `python -m benchmarks.fidelity steering
--collect` adds a folder of those alone to `reference_steering.json`.
"""

import time
from typing import Any, Final

import numpy as np
from dm_control.rl.control import PhysicsError
from flygym_gymnasium import Fly, SingleFlySimulation
from flygym_gymnasium.arena import (
    BaseArena,
    BlocksTerrain,
    FlatTerrain,
    GappedTerrain,
    MixedTerrain,
)
from flygym_gymnasium.examples.locomotion import (
    CPGNetwork,
    HybridTurningController,
    PreprogrammedSteps,
    RuleBasedController,
)
from flygym_gymnasium.examples.locomotion.rule_based_controller import construct_rules_graph
from numpy.typing import NDArray

from benchmarks.fidelity.drives import HOLD_S, KINDS, sequence
from benchmarks.fidelity.peers import (
    SAMPLING_S,
    SENSED,
    TIMESTEP_S,
    TRIPOD,
    in_contact,
    keep,
    parser,
    phases,
    spawn,
)

TERRAINS: Final[dict[str, type[BaseArena]]] = {
    "flat": FlatTerrain,
    "gapped": GappedTerrain,
    "blocks": BlocksTerrain,
    "mixed": MixedTerrain,
}
CONTROLLERS: Final = ("cpg", "rule_based", "hybrid")
PACKAGES: Final = ("flygym-gymnasium", "mujoco", "dm_control", "numpy", "scipy", "gymnasium")

STRAIGHT: Final = np.ones((1, 2))
"""Drives (left, right) straight ahead, one pair that is held on."""

RULE_BASED_STEP_DURATION_S: Final = 1.0 / 12.0
RULE_WEIGHTS: Final = {
    "rule1": -10.0,
    "rule2_ipsi": 2.5,
    "rule2_contra": 1.0,
    "rule3_ipsi": 3.0,
    "rule3_contra": 2.0,
}


class Cpg:
    """The tripod CPG alone, on the recorded steps."""

    def __init__(self, phases: NDArray[np.float64]) -> None:
        self.steps = PreprogrammedSteps()
        self.network = CPGNetwork(**TRIPOD, init_phases=phases)

    def action(self) -> dict[str, NDArray[Any]]:
        """Advance by one time step; target angles and adhesion."""
        self.network.step()
        return _leg_action(self.steps, self.network.curr_phases, self.network.curr_magnitudes)


class RuleBased:
    """The rule-based controller, with steps as long as the CPG's cycle."""

    def __init__(self, seed: int) -> None:
        self.steps = PreprogrammedSteps()
        self.steps.duration = RULE_BASED_STEP_DURATION_S
        self.rules = RuleBasedController(
            timestep=TIMESTEP_S,
            rules_graph=construct_rules_graph(),
            weights=RULE_WEIGHTS,
            preprogrammed_steps=self.steps,
            seed=seed,
        )

    def action(self) -> dict[str, NDArray[Any]]:
        """Advance by one time step; target angles and adhesion."""
        self.rules.step()
        return _leg_action(self.steps, self.rules.leg_phases, np.ones(6))


class Driven:
    """A sequence of drives, for the controller that is its own simulation.

    Parameters
    ----------
    drives
        Pairs (left, right), each held for `HOLD_S`, (k, 2); the last one is held on.
    """

    def __init__(self, drives: NDArray[np.float64]) -> None:
        self.drives = drives
        self.steps_taken = 0

    def action(self) -> NDArray[np.float64]:
        """Drive (left, right)."""
        index = self.steps_taken // round(HOLD_S / TIMESTEP_S)
        self.steps_taken += 1
        drive: NDArray[np.float64] = self.drives[min(index, len(self.drives) - 1)]
        return drive


def _leg_action(
    steps: Any, phases: NDArray[np.float64], magnitudes: NDArray[np.float64]
) -> dict[str, NDArray[Any]]:
    angles = [
        steps.get_joint_angles(leg, phase, magnitude)
        for leg, phase, magnitude in zip(steps.legs, phases, magnitudes, strict=True)
    ]
    adhesion = [
        steps.get_adhesion_onoff(leg, phase) for leg, phase in zip(steps.legs, phases, strict=True)
    ]
    return {"joints": np.concatenate(angles), "adhesion": np.array(adhesion, dtype=int)}


def start(
    terrain: str, controller: str, seed: int, drives: NDArray[np.float64] = STRAIGHT
) -> tuple[Any, Any, Any]:
    """Start a run from the spawn and phases that flyrl's `hybrid_turning` draws for a seed.

    The oscillators start at magnitude 0, as the package lets them.

    Returns
    -------
    Simulation, what gives its actions, and its first observation.
    """
    fly = Fly(
        spawn_pos=(*spawn(seed), 0.5),
        contact_sensor_placements=[
            f"{leg}{segment}" for leg in PreprogrammedSteps.legs for segment in SENSED
        ],
        enable_adhesion=True,
    )
    world = {"fly": fly, "cameras": [], "arena": TERRAINS[terrain](), "timestep": TIMESTEP_S}
    if controller == "hybrid":
        hybrid = HybridTurningController(**world)
        observation, _ = hybrid.reset(seed=seed, init_phases=phases(seed))
        return hybrid, Driven(drives), observation
    sim = SingleFlySimulation(**world)
    observation, _ = sim.reset(seed=seed)
    driver = Cpg(phases(seed)) if controller == "cpg" else RuleBased(seed)
    return sim, driver, observation


def sample(sim: Any, observation: dict[str, NDArray[np.float32]]) -> dict[str, Any]:
    """What is kept of one moment; as `statistics.Trajectory` has it."""
    # 3 torques, then 3 forces; by contact alone, the grip of adhesion included, as in flyrl
    forces = sim.physics.named.data.cfrc_ext[sim.fly.contact_sensor_placements][:, 3:]
    _, velocities, torques = observation["joints"].astype(float)
    heading = observation["fly_orientation"]
    return {
        "position_w": observation["fly"][0],
        "yaw": np.arctan2(heading[1], heading[0]),
        "upright": observation["cardinal_vectors"][2, 2],
        "end_effectors_w": observation["end_effectors"],
        "contact": in_contact(forces),
        # the package gives N·m for what it calls mm and g; in µN·mm, as ours
        "power": np.maximum(torques * 1e9 * velocities, 0.0).sum(),
    }


def run(
    terrain: str, controller: str, seed: int, seconds: float, drives: str | None = None
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Walk for some seconds, straight or with drives; samples, and how it went."""
    driven = STRAIGHT if drives is None else sequence(drives, seed, seconds)
    sim, driver, observation = start(terrain, controller, seed, driven)
    samples = [sample(sim, observation)]
    outcome = "timeout"
    every = round(SAMPLING_S / TIMESTEP_S)
    began = time.perf_counter()
    try:
        for k in range(1, round(seconds / TIMESTEP_S) + 1):
            observation = sim.step(driver.action())[0]
            if k % every == 0:
                samples.append(sample(sim, observation))
    except PhysicsError:
        outcome = "unstable"
    about = {"controller": controller, "outcome": outcome, **({"drives": drives} if drives else {})}
    return samples, {**about, "wall_s": round(time.perf_counter() - began, 1)}


def main() -> None:
    """Run what is not there yet, seed by seed."""
    command = parser(__doc__, TERRAINS, CONTROLLERS, [0, 1, 2, 3], 1.5)
    command.add_argument(
        "--drives", nargs="+", choices=KINDS, help="steer the hybrid controller, and no other"
    )
    chosen = command.parse_args()

    def steered(terrain: str, drives: str, seed: int) -> Any:
        return run(terrain, "hybrid", seed, chosen.seconds, drives)

    def straight(terrain: str, controller: str, seed: int) -> Any:
        return run(terrain, controller, seed, chosen.seconds)

    how = steered if chosen.drives else straight
    keep(chosen, chosen.drives or chosen.controllers, PACKAGES, how)


if __name__ == "__main__":
    main()
