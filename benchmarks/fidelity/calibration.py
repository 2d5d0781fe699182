"""What a preset of the physics has to be true to, measured and summed up in one number.

Every figure has a range that it should lie in. The objective is the sum over the figures of the
squared distance from that range, each in units of its own tolerance: 0 where all lie within.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from benchmarks.fidelity import results, steering
from benchmarks.fidelity.comparison import reference_speed
from benchmarks.fidelity.drives import HOLD_S
from benchmarks.fidelity.steering_table import fall_ratio, paired_falls, tilt_ratio
from benchmarks.fidelity.turning import relative_difference, yaw_rates
from benchmarks.walking import speed, walk
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import PHYSICS_PRESETS, PhysicsConfig

CHOOSING_SEEDS: Final = range(1000)
"""Presets are chosen with these starts and drives, and judged with others."""

STEERED_ON: Final = ("gapped", "blocks", "mixed")
"""Grounds on which falls and tilt are aimed at."""

CREEP_S: Final = 0.5
_TURN_S: Final = 1.3


class Aim(NamedTuple):
    """Range that a figure should lie in, and the distance from it that counts as 1."""

    low: float
    high: float
    tolerance: float


AIMS: Final[dict[str, Aim]] = {
    "speed over flygym's": Aim(0.8, 1.2, 0.05),
    "CPG over hybrid": Aim(0.0, 0.65, 0.05),
    "hybrid - CPG, mm/s": Aim(0.5, np.inf, 0.5),
    "hybrid - rules, mm/s": Aim(0.5, np.inf, 0.5),
    "turning, rms": Aim(0.0, 0.1, 0.01),
    "pursuit, falls - reference": Aim(-0.05, 0.05, 0.02),
    "abrupt, falls / reference": Aim(1 / 1.5, 1.5, 0.2),
    "tilt 95 % / reference": Aim(0.85, 1.15, 0.05),
    "creep, mm": Aim(0.0, 0.1, 0.02),
    "asymmetry, mm": Aim(0.0, 1e-6, 1e-6),
}
"""By the first part of a figure's name; what follows a ": " says where it was measured."""

Figures = dict[str, float]


def distance(name: str, value: float) -> float:
    """How far a figure is from its range, in tolerances; one that is not finite is 10 off."""
    low, high, tolerance = AIMS[name.partition(":")[0]]
    if not np.isfinite(value):
        return 10.0
    return max(low - value, value - high, 0.0) / tolerance


def objective(figures: Mapping[str, float]) -> float:
    """Sum of the squared distances of all figures from their ranges."""
    return sum(distance(name, value) ** 2 for name, value in figures.items())


class Yardstick:
    """What `reference` does from the same starts, measured once for many candidates.

    Parameters
    ----------
    walks, steered, turns
        How many starts: straight ahead, steered, and per pair of drives.
    num_threads
        0 takes one per CPU.
    preset
        Another to be measured against.
    levels
        Of the drive on each side, whose pairs are the drives of turns.
    """

    def __init__(
        self,
        walks: int,
        steered: int,
        turns: int,
        num_threads: int = 0,
        preset: str = "reference",
        levels: int = 5,
    ) -> None:
        for name, count in (("walks", walks), ("steered", steered), ("turns", turns)):
            if count > len(CHOOSING_SEEDS):
                raise ValueError(f"{name} is {count}; allowed: up to {len(CHOOSING_SEEDS)}")
        self.walks, self.steered, self.turns = walks, steered, turns
        self.num_threads, self.levels = num_threads, levels
        self._rates = self._turn(preset) if turns else np.empty(0)
        kinds = (steering.PURSUIT, "abrupt") if steered else ()
        self._steered = {
            (terrain, kind): self._steer(preset, terrain, kind)
            for terrain in STEERED_ON
            for kind in kinds
        }
        self._published = results.read(results.REFERENCE)["runs"]

    def measure(self, physics: PhysicsConfig) -> tuple[Figures, float]:
        """All figures of a candidate, and simulated seconds per second of the CPU."""
        figures, pace = self._straight(physics)
        if self.turns:
            figures["turning, rms"] = relative_difference(self._turn(physics), self._rates)
        for (terrain, kind), reference in self._steered.items():
            rows = self._steer(physics, terrain, kind)
            name, compared = (
                ("pursuit, falls - reference", paired_falls)
                if kind == steering.PURSUIT
                else ("abrupt, falls / reference", fall_ratio)
            )
            figures[f"{name}: {terrain}"] = compared(rows, reference).value
            figures[f"tilt 95 % / reference: {terrain} {kind}"] = tilt_ratio(rows, reference).value
        return {**figures, "creep, mm": creep(physics), "asymmetry, mm": asymmetry(physics)}, pace

    def _straight(self, physics: PhysicsConfig) -> tuple[Figures, float]:
        figures: Figures = {}
        began = time.process_time()
        for terrain in results.TERRAINS:
            speeds = {}
            for name in results.CONTROLLERS:
                positions, _ = walk(
                    (1, 1),
                    steering.SECONDS,
                    self.walks,
                    magnitude=0.0,
                    num_threads=self.num_threads,
                    physics=physics,
                    terrain=terrain,
                    controller=name,
                )
                speeds[name] = float(np.median(speed(positions, steering.SECONDS)))
                ratio = speeds[name] / reference_speed(self._published, terrain, name)
                figures[f"speed over flygym's: {terrain} {name}"] = ratio
            if terrain != "flat":
                hybrid, cpg, rules = (speeds[name] for name in ("hybrid", "cpg", "rule_based"))
                figures[f"CPG over hybrid: {terrain}"] = cpg / hybrid
                figures[f"hybrid - CPG, mm/s: {terrain}"] = hybrid - cpg
                figures[f"hybrid - rules, mm/s: {terrain}"] = hybrid - rules
        spent = time.process_time() - began
        simulated = self.walks * steering.SECONDS * len(results.TERRAINS) * len(results.CONTROLLERS)
        return figures, simulated / spent

    def _turn(self, physics: str | PhysicsConfig) -> steering.Array:
        return yaw_rates(physics, self.levels, self.turns, _TURN_S, self.num_threads)[0]

    def _steer(
        self, physics: str | PhysicsConfig, terrain: str, kind: str
    ) -> Sequence[steering.Row]:
        seeds = CHOOSING_SEEDS[: self.steered]
        return steering.steer(physics, terrain, kind, seeds, self.num_threads)


def creep(physics: PhysicsConfig) -> float:
    """Median way in `CREEP_S` of flies that should stand, after 0.2 s to settle, mm."""
    positions, _ = walk(
        (0, 0), CREEP_S, 8, magnitude=0.0, settle=0.2, num_threads=1, physics=physics
    )
    return float(np.median(speed(positions, CREEP_S)) * CREEP_S)


def asymmetry(physics: PhysicsConfig) -> float:
    """Largest distance between a turn to the left and its mirror image over 0.1 s, mm."""
    config = EnvConfig(task="hybrid_turning", physics=physics, decision_interval=HOLD_S)
    env = BatchedEnv(config, 2, 1)
    episode = replace(
        config.sample_episode(0),
        spawn_position_w=(0.0, 0.0, 0.5),
        spawn_yaw=0.0,
        init_magnitudes=(0.0,) * 6,
    )
    phases = episode.init_phases
    twins = [episode, replace(episode, init_phases=(*phases[3:], *phases[:3]))]
    env.reset(episodes=twins)
    for _ in range(round(0.1 / HOLD_S)):
        env.step(np.array([[0.4, 1.2], [1.2, 0.4]]))
    place, twin = env.state.position_w
    return float(np.abs(place * [1, -1, 1] - twin).max())


def candidate(base: str, changes: Mapping[str, float]) -> PhysicsConfig:
    """Preset `base` with changes of its step and contacts.

    Parameters
    ----------
    base
        Name of the preset.
    changes
        "timestep", s; and, each of "box" and "plane" before a dot: "friction", "push_out", 1/s,
        "damping", in units of 1 / step, "first" and "last", impedance at the surface and deep in,
        "width", mm, over which it grows, "margin", mm; "plane.across", friction across a foot.
    """
    physics = PHYSICS_PRESETS[base]
    contact = physics.contact
    timestep = changes.get("timestep", physics.timestep)
    for surface in ("box", "plane"):
        given = {
            name.partition(".")[2]: value
            for name, value in changes.items()
            if name.startswith(f"{surface}.")
        }
        before = getattr(contact, surface)
        stiffness, damping = (-value for value in before.solref)
        damping_per_step = given.get("damping", damping * physics.timestep)
        push_out = given.get("push_out", stiffness / damping)
        first, last, width, *rest = before.solimp
        after = replace(
            before,
            friction=(given.get("friction", before.friction[0]), *before.friction[1:]),
            solref=(-push_out * damping_per_step / timestep, -damping_per_step / timestep),
            solimp=(
                given.get("first", first),
                given.get("last", last),
                given.get("width", width),
                *rest,
            ),
            margin=given.get("margin", before.margin),
        )
        contact = replace(contact, **{surface: after})
        if "across" in given:
            contact = replace(contact, plane_friction_across=given["across"])
    return replace(physics, timestep=timestep, contact=contact)
