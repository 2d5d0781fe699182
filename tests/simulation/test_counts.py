"""What speed rests on, by count rather than by clock."""

import sys
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
from test_callback import make_batch

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.simulation.physics import FLY_PRESETS, PHYSICS_PRESETS
from flyrl.tasks import Episode

TRIPOD = (0.0, np.pi, 0.0, np.pi, 0.0, np.pi)


@pytest.mark.parametrize("physics", FLY_PRESETS)
def test_a_decision_advances_time_and_controller_once_per_physics_step(physics: str) -> None:
    """20 ms at 12 Hz; magnitudes approach 1 by Euler steps, so they tell the number of steps."""
    env = BatchedEnv(EnvConfig("target_unfiltered", physics=physics), 2, num_threads=1)
    timestep = PHYSICS_PRESETS[physics].timestep
    steps = {"reference": 200, "balanced": 50, "fast": 20}[physics]
    assert env.config.steps_per_decision == steps
    episode = Episode(0, (0.0, 0.0, 0.5), 0.0, (5.0, 0.0), TRIPOD, (0.0,) * 6)
    env.reset(episodes=[episode] * 2)
    straight = env.task.actions.of(np.ones((2, 2)))
    for decision in (1, 2):
        env.step(straight)
        state = env.state
        np.testing.assert_allclose(state.time, decision * steps * timestep, rtol=0, atol=1e-12)
        magnitude = 1 - (1 - 20 * timestep) ** (decision * steps)
        np.testing.assert_allclose(state.magnitudes, magnitude, rtol=0, atol=1e-9)
        # in a tripod the couplings vanish
        advance = np.mod(state.phases - TRIPOD, 2 * np.pi)
        expected = 2 * np.pi * 12 * decision * 0.02
        np.testing.assert_allclose(advance, expected, rtol=0, atol=1e-9)


def test_models_are_compiled_in_construction_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six decisions for each of which a third of the episodes begin anew."""
    compiled, compile_spec = [], mujoco.MjSpec.compile

    def counting(spec: mujoco.MjSpec) -> mujoco.MjModel:
        compiled.append(spec)
        return compile_spec(spec)

    monkeypatch.setattr(mujoco.MjSpec, "compile", counting)
    env = FlyrlVecEnv(EnvConfig(terrain="mixed"), 6, num_threads=1, seed=0)
    in_construction = len(compiled)
    assert 1 <= in_construction <= 2
    env.reset()
    for k in range(6):
        env.step(np.ones((6, 2), dtype=np.float32))
        env.core.reset(ids=[k % 3, 3 + k % 3])
    assert len(compiled) == in_construction


def calls_during(run: Callable[[], None]) -> int:
    """Calls of Python and of native functions that Python made."""
    calls = 0

    def count(_frame: Any, event: str, _argument: Any) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        run()
    finally:
        sys.setprofile(None)
    return calls


def test_python_does_nothing_per_physics_step() -> None:
    batch = make_batch(num_sims=3)
    batch.step(10)
    assert calls_during(lambda: batch.step(1)) == calls_during(lambda: batch.step(100)) > 0
