"""A controller means the same at every time step: all steps follow one continuous solution."""

import functools

import numpy as np
import pytest

from flyrl.controllers import Hybrid
from flyrl.controllers.reflexes import REFLEXES, ReflexesName
from tests.controllers.kernels import Legs, Observation

TIMESTEPS = (1e-4, 2e-4, 5e-4)
FINE = 2e-5
SAMPLE_INTERVAL = 1e-3
"""s; a multiple of every time step."""
NUM_SAMPLES = 500
NUM_COURSES = 2
"""Courses of events, each 0.5 s, over which errors are averaged."""

FIELDS = ("phases", "magnitudes", "retraction", "stumbling", "net_correction", "angles")


def drive(t: np.ndarray) -> np.ndarray:
    """Both sides at times (n,), the left backwards at some: (n, 2)."""
    return np.stack([0.5 + np.sin(7.1 * t), 0.9 + 0.4 * np.cos(11.3 * t)], axis=1)


def observe(t: np.ndarray, course: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights of the legs' tips below a thorax at 0, contact forces, and heading, (n, ...) each."""
    legs, time = np.arange(6), t[:, None]
    heights = -1 - 0.2 * np.sin(2 * np.pi * (2.3 + 0.71 * legs) * time + 1.9 * legs + course)
    heading = np.stack([np.cos(3.3 * t), np.sin(3.3 * t), np.zeros(len(t))], axis=1)
    forces = np.zeros((len(t), 36, 3))
    pushes = np.sin(2 * np.pi * (4.7 + 0.83 * legs) * time + 0.7 * legs + 1.3 * course)
    forces[:, 6 * legs + legs % 3] = 2.0 * pushes[:, :, None] * heading[:, None]
    return heights, forces, heading


@functools.cache
def trajectory(timestep: float, reflexes: ReflexesName = "current") -> dict[str, np.ndarray]:
    steps_per_sample = round(SAMPLE_INTERVAL / timestep)
    samples: dict[str, list[np.ndarray]] = {name: [] for name in FIELDS}
    times = np.arange(NUM_SAMPLES * steps_per_sample) * timestep
    initial = {"init_phases": np.arange(6.0), "init_magnitudes": np.linspace(0, 0.5, 6)}
    for course in range(NUM_COURSES):
        legs = Legs(Hybrid(reflexes=reflexes), timestep, **initial)
        sensed = zip(drive(times), *observe(times, course), strict=True)
        for step, (drives, *observed) in enumerate(sensed, start=1):
            legs.step(drives, Observation(0.0, *observed))
            if step % steps_per_sample == 0:
                for name in FIELDS:
                    samples[name].append(legs[name].copy())
    return {name: np.array(values) for name, values in samples.items()}


def errors(name: str, reflexes: ReflexesName = "current") -> np.ndarray:
    """Mean distance from the fine solution at each of `TIMESTEPS`."""
    fine = trajectory(FINE, reflexes)[name]
    return np.array([np.abs(trajectory(step, reflexes)[name] - fine).mean() for step in TIMESTEPS])


@pytest.mark.parametrize("reflexes", REFLEXES)
def test_the_reflexes_are_at_work(reflexes):
    fine = trajectory(FINE, reflexes)
    for name in ("retraction", "stumbling"):
        assert np.all((fine[name] > 5).any(axis=0)), name
        assert np.all((fine[name] == 0).any(axis=0)), name


# The fine solution is off by what its own step brings, so an error of first order is proportional
# to the difference between the steps.
EXPECTED = (np.array(TIMESTEPS) - FINE) / (TIMESTEPS[0] - FINE)


@pytest.mark.parametrize("name", ["phases", "magnitudes"])
def test_oscillators_converge_with_the_time_step(name):
    found = errors(name)
    assert found[0] < 2e-3
    np.testing.assert_allclose(found / found[0], EXPECTED, rtol=0.03)


@pytest.mark.parametrize("reflexes", REFLEXES)
@pytest.mark.parametrize("name", ["retraction", "stumbling", "net_correction", "angles"])
def test_corrections_converge_with_the_time_step(name, reflexes):
    """Less evenly: a reflex switches at the first step after its condition turns."""
    found = errors(name, reflexes)
    np.testing.assert_allclose(found / found[0], EXPECTED, rtol=0.4)
    scale = np.abs(trajectory(FINE, reflexes)[name]).mean()
    assert found[0] < 0.02 * scale
