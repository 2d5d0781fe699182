"""Trajectories and runs that nobody has walked."""

import json

import numpy as np

from benchmarks.fidelity.statistics import STATISTICS, trajectory


def series(samples, **changes):
    """A fly that stands at the origin, facing +y, all feet on the ground, at no power; 1 ms apart.

    `changes` replace samples by the name of an attribute of `Trajectory`.
    """
    still = {
        "time": 0.001 * np.arange(samples),
        "position_w": np.zeros((samples, 3)),
        "yaw": np.full(samples, np.pi / 2),
        "upright": np.ones(samples),
        "end_effectors_w": np.zeros((samples, 6, 3)),
        "contact": np.ones((samples, 6), dtype=bool),
        "power": np.zeros(samples),
    }
    return {**still, **changes}


def standing(samples, **changes):
    return trajectory(series(samples, **changes))


def keep(path, samples, **about):
    """Leave a run as `reference.py` does."""
    np.savez_compressed(path, **samples, about=json.dumps(about))


def run(speed, fall=0, controller="cpg", seed=7, **about):
    """A row of results; `about` replaces what it says of the run."""
    place = {"terrain": "flat", "physics": "balanced", "outcome": "timeout", "seconds": 1.5}
    statistics = {**dict.fromkeys(STATISTICS, 1.0), "speed": speed, "fall": fall}
    return {**place, "controller": controller, "seed": seed, **about, "statistics": statistics}
