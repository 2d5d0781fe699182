"""A controller means the same at every time step: all steps follow one continuous solution."""

import functools

import numpy as np
import pytest

from flyrl.controllers import Hybrid
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
def trajectory(reflexes: str, timestep: float) -> dict[str, np.ndarray]:
    steps = {"current": "untethered", "classic": "tethered"}[reflexes]
    controller = Hybrid(steps)
    steps_per_sample = round(SAMPLE_INTERVAL / timestep)
    samples: dict[str, list[np.ndarray]] = {name: [] for name in FIELDS}
    times = np.arange(NUM_SAMPLES * steps_per_sample) * timestep
    drives = drive(times)
    for course in range(NUM_COURSES):
        initial = {"init_phases": np.arange(6.0), "init_magnitudes": np.linspace(0, 0.5, 6)}
        legs = Legs(controller, timestep, **initial)
        heights, forces, headings = observe(times, course)
        for step in range(len(times)):
            legs.step(drives[step], Observation(0.0, heights[step], forces[step], headings[step]))
            if (step + 1) % steps_per_sample == 0:
                for name in FIELDS:
                    samples[name].append(legs[name].copy())
    return {name: np.array(values) for name, values in samples.items()}


def errors(reflexes: str, name: str) -> np.ndarray:
    """Mean distance from the fine solution at each of `TIMESTEPS`."""
    fine = trajectory(reflexes, FINE)[name]
    return np.array([np.abs(trajectory(reflexes, step)[name] - fine).mean() for step in TIMESTEPS])


@pytest.mark.parametrize("reflexes", ["current", "classic"])
def test_the_reflexes_are_at_work(reflexes):
    fine = trajectory(reflexes, FINE)
    for name in ("retraction", "stumbling"):
        assert np.all((fine[name] > 5).any(axis=0)), name
        assert np.all((fine[name] == 0).any(axis=0)), name


# The fine solution is off by what its own step brings, so an error of first order is proportional
# to the difference between the steps.
EXPECTED = (np.array(TIMESTEPS) - FINE) / (TIMESTEPS[0] - FINE)


@pytest.mark.parametrize("reflexes", ["current", "classic"])
@pytest.mark.parametrize("name", ["phases", "magnitudes"])
def test_oscillators_converge_with_the_time_step(reflexes, name):
    found = errors(reflexes, name)
    assert found[0] < 2e-3
    np.testing.assert_allclose(found / found[0], EXPECTED, rtol=0.03)


@pytest.mark.parametrize("reflexes", ["current", "classic"])
@pytest.mark.parametrize("name", ["retraction", "stumbling", "net_correction", "angles"])
def test_corrections_converge_with_the_time_step(reflexes, name):
    """Less evenly: a reflex switches at the first step after its condition turns."""
    found = errors(reflexes, name)
    np.testing.assert_allclose(found / found[0], EXPECTED, rtol=0.4)
    scale = np.abs(trajectory(reflexes, FINE)[name]).mean()
    assert found[0] < 0.02 * scale
