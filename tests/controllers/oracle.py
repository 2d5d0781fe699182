"""The controllers written out in plain NumPy, straight from the specification.

Slow and literal on purpose, and independent of `flyrl.controllers`: only the recorded angles and
SciPy's spline are shared with it.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from flyrl.resources import assets_folder

LEGS = ["LF", "LM", "LH", "RF", "RM", "RH"]
TWO_PI = 2 * np.pi

DURATION = {"tethered": 1278 * 1e-4, "untethered": 45 * 3e-3}
SWING_START_S = {
    "tethered": {"F": 0.0098, "M": 0.0012, "H": 0.0012},
    "untethered": {"F": 0.0, "M": 0.0, "H": 0.0},
}
STANCE_START_S = {
    "tethered": {"F": 0.0408, "M": 0.0318, "H": 0.0272},
    "untethered": {"F": 0.051, "M": 0.048, "H": 0.042},
}
NEUTRAL_PHASE = {"tethered": 0.0, "untethered": np.pi}

TRIPOD = {"LF": 0, "LH": 0, "RM": 0, "LM": 1, "RF": 1, "RH": 1}


class Steps:
    def __init__(self, name):
        with np.load(assets_folder() / "steps" / f"{name}.npz") as recording:
            angles = recording["angles"]
        grid = np.linspace(0, TWO_PI, angles.shape[2])
        self.splines = [CubicSpline(grid, leg, axis=1, bc_type="periodic") for leg in angles]
        self.neutral_phase = NEUTRAL_PHASE[name]
        self.swing_start = np.array(
            [SWING_START_S[name][leg[1]] / DURATION[name] * TWO_PI for leg in LEGS]
        )
        self.swing_end = np.array(
            [STANCE_START_S[name][leg[1]] / DURATION[name] * TWO_PI for leg in LEGS]
        )

    def angles(self, leg, phase, magnitude):
        neutral = self.splines[leg](self.neutral_phase)
        return neutral + magnitude * (self.splines[leg](phase % TWO_PI) - neutral)

    def adhesion(self, leg, phase, extension=0.0):
        theta = phase % TWO_PI
        swings = self.swing_start[leg] < theta < self.swing_end[leg] + extension
        return 0.0 if swings else 1.0


class Oscillators:
    """Spec section 4, for six legs and a drive (section 7)."""

    def __init__(self, timestep, seed, frequency=12.0, alpha=20.0, weight=10.0):
        self.dt, self.nu, self.alpha = timestep, frequency, alpha
        other = np.array([[TRIPOD[i] != TRIPOD[j] for j in LEGS] for i in LEGS])
        self.phi, self.w = np.pi * other, weight * other
        random = np.random.RandomState(seed)
        self.theta = random.uniform(0, TWO_PI, 6)
        self.r = random.uniform(0, 1, 6) * 1.0

    def step(self, drive):
        sides = np.repeat(drive, 3)
        nu = self.nu * np.where(sides >= 0, 1.0, -1.0)
        difference = self.theta[np.newaxis, :] - self.theta[:, np.newaxis] - self.phi
        dtheta = TWO_PI * nu + (self.r[np.newaxis, :] * self.w * np.sin(difference)).sum(axis=1)
        dr = self.alpha * (np.abs(sides) - self.r)
        self.theta = self.theta + dtheta * self.dt
        self.r = self.r + dr * self.dt


SETS = {
    "classic": {
        "v": {
            "F": (0, 0, 0, -0.02, 0, 0.016, 0),
            "M": (-0.015, 0, 0, 0.004, 0, 0.01, -0.008),
            "H": (0, 0, 0, -0.01, 0, 0.005, 0),
        },
        "right": (1, 1, 1, 1, 1, 1, 1),
        "retraction": (500, 1000 / 3),
        "stumbling": (2000, 500),
    },
    "current": {
        "v": {
            "F": (-0.03, 0, 0, -0.03, 0, 0.03, 0.03),
            "M": (-0.015, 0.001, 0.025, -0.02, 0, -0.02, 0),
            "H": (0, 0, 0, -0.02, 0, 0.01, -0.02),
        },
        "right": (1, -1, -1, 1, -1, 1, 1),
        "retraction": (800, 700),
        "stumbling": (2200, 1800),
    },
}


@dataclass
class Events:
    """How often something happened, so that a test can tell that it did."""

    retracted: int = 0
    persisted: int = 0
    capped: int = 0
    stumbled: int = 0
    stumbling_while_retracting: int = 0


@dataclass
class Hybrid:
    """Spec sections 6 and 7: the oscillators with both reflexes."""

    name: str
    steps: Steps
    oscillators: Oscillators
    retraction: np.ndarray = field(default_factory=lambda: np.zeros(6))
    stumbling: np.ndarray = field(default_factory=lambda: np.zeros(6))
    persisting_steps: np.ndarray = field(default_factory=lambda: np.zeros(6, dtype=int))
    events: Events = field(default_factory=Events)

    def step(self, drive, observation):
        figures, dt = SETS[self.name], self.oscillators.dt
        is_current = self.name == "current"

        depth = observation.thorax_z - observation.end_effector_z
        order = np.argsort(depth)
        in_hole = order[-1] if depth[order[-1]] - depth[order[-3]] > 0.05 else None
        if is_current and in_hole is not None and self.retraction[in_hole] > 20:
            self.persisting_steps[in_hole] = round(0.002 / dt)

        for leg in range(6):
            persists = self.persisting_steps[leg] > 0
            if persists:
                self.persisting_steps[leg] -= 1
            if leg == in_hole or persists:
                self.retraction[leg] += figures["retraction"][0] * dt
                self.events.retracted += 1
                self.events.persisted += leg != in_hole
            else:
                self.retraction[leg] = max(0, self.retraction[leg] - figures["retraction"][1] * dt)

            forces = observation.contact_forces_w[6 * leg : 6 * leg + 3]  # Tibia, Tarsus1, Tarsus2
            if (forces @ observation.heading_w < -1).any():
                self.stumbling[leg] += figures["stumbling"][0] * dt
                self.events.stumbled += 1
                self.events.stumbling_while_retracting += self.retraction[leg] > 0
            else:
                self.stumbling[leg] = max(0, self.stumbling[leg] - figures["stumbling"][1] * dt)
            if is_current and self.retraction[leg] > 0:
                self.stumbling[leg] = 0

        self.oscillators.step(drive)
        theta, r = self.oscillators.theta, self.oscillators.r

        self.net = np.zeros(6)
        targets, adhesion = [], []
        for leg, name in enumerate(LEGS):
            c = self.retraction[leg] if self.retraction[leg] > 0 else self.stumbling[leg]
            if is_current:
                self.events.capped += c > 80
                c = min(c, 80)
                end = self.steps.swing_end[leg]
                points = [0, end / 2, end + np.pi / 4, (end + TWO_PI) / 2, TWO_PI]
                c *= np.interp(theta[leg] % TWO_PI, points, [0, 0.8, 0, -0.1, 0])
            self.net[leg] = c
            v = np.array(figures["v"][name[1]])
            if name[0] == "R":
                v = v * np.array(figures["right"])
            targets.append(self.steps.angles(leg, theta[leg], r[leg]) + c * v)
            extension = np.pi / 4 if is_current else 0.0
            adhesion.append(self.steps.adhesion(leg, theta[leg], extension))
        self.targets = np.concatenate(targets)
        self.adhesion = np.array(adhesion)


RULE_WEIGHTS = {
    "rule1": -10,
    "rule2_ipsi": 2.5,
    "rule2_contra": 1,
    "rule3_ipsi": 3,
    "rule3_contra": 2,
}


class Walknet:
    """Spec section 5."""

    def __init__(self, timestep, duration, swing_end, seed, margin=0.001, weights=RULE_WEIGHTS):
        self.margin, self.weights = margin, weights
        self.increment = TWO_PI * timestep / duration
        self.swing_end = swing_end
        self.random = np.random.RandomState(seed)
        self.phases = np.zeros(6)
        self.stepping = np.zeros(6, dtype=bool)
        self.scores = np.zeros((3, 6))
        self.num_steps = 0
        self.num_random_choices = 0
        self.num_steps_started = 0

    def step(self):
        w = self.weights
        total = self.scores[0] + self.scores[1] + self.scores[2]
        if self.num_steps == 0:
            eligible = [LEGS.index(leg) for leg in ("LF", "LM", "RF", "RM")]
        else:
            best = total.max()
            threshold = max(0, best - self.margin * abs(best))
            eligible = [
                leg
                for leg in range(6)
                if not self.stepping[leg] and total[leg] > 0 and total[leg] >= threshold
            ]
        if eligible:
            self.num_steps_started += 1
            self.num_random_choices += len(eligible) > 1
            self.stepping[self.random.choice(eligible)] = True

        self.phases[self.stepping] += self.increment
        completed = self.phases >= TWO_PI
        self.phases[completed] = 0
        self.stepping[completed] = False

        self.scores[:] = 0
        for source in range(6):
            side, position = LEGS[source]
            other_side = "R" if side == "L" else "L"
            end = self.swing_end[source]
            progress = max(0, self.phases[source] - end) / (TWO_PI - end)
            if 0 < self.phases[source] < end and position in "MH":
                self.scores[0, LEGS.index(side + {"M": "F", "H": "M"}[position])] += w["rule1"]
            if progress > 0:
                if position in "MH":
                    ahead = LEGS.index(side + {"M": "F", "H": "M"}[position])
                    self.scores[1, ahead] += w["rule2_ipsi"] * (1 - progress)
                if position in "FM":
                    behind = LEGS.index(side + {"F": "M", "M": "H"}[position])
                    self.scores[2, behind] += w["rule3_ipsi"] * progress
                opposite = LEGS.index(other_side + position)
                self.scores[1, opposite] += w["rule2_contra"] * (1 - progress)
                self.scores[2, opposite] += w["rule3_contra"] * progress
        self.num_steps += 1
