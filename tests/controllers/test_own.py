"""The door for controllers of one's own: found by name, compiled once, told apart from ours."""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import TypingError

import flyrl
from flyrl.controllers import CONTROLLERS, CPG
from flyrl.controllers.controller import controller_from
from flyrl.envs.core import BatchedEnv, EnvConfig
from tests.controllers.own import Height, Wave

NAME = "tests.controllers.own:Wave"


def walked(controller, action=(1.0, 1.0), decisions=5):
    env = BatchedEnv(EnvConfig("hybrid_turning", controller=controller, decision_interval=0.02), 1)
    env.reset(seeds=[0])
    for _ in range(decisions):
        env.step(np.array([action]))
    return env


def test_a_controller_of_ones_own_moves_the_legs() -> None:
    moving, still = walked(NAME), walked(NAME, (0.0, 0.0))
    tibiae = slice(5, None, 7)
    assert np.abs(moving.state.joint_angles - still.state.joint_angles)[0, tibiae].max() > 0.1
    # 10 Hz for 0.1 s is one turn
    np.testing.assert_allclose(moving.state.phases[0] - np.arange(6), 2 * np.pi)
    assert not moving.state.retraction.any()


def test_settings_are_those_of_the_users_dataclass() -> None:
    controller = controller_from({"name": NAME, "amplitude": 0.1})
    assert controller == Wave(amplitude=0.1)
    assert dataclasses.asdict(controller) == {"name": NAME, "amplitude": 0.1, "frequency_hz": 10.0}


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_record_leads_back_to_its_controller(name) -> None:
    controller = controller_from(name)
    assert controller_from(dataclasses.asdict(controller)) == controller
    assert controller.name == name


def test_settings_of_other_controllers_in_old_records_are_ignored() -> None:
    record = {"name": "cpg", "frequency_hz": 9.0, "reflexes": None, "step_duration_s": None}
    assert controller_from(record) == CPG(frequency_hz=9.0)


def test_the_action_space_follows_from_the_command() -> None:
    env = walked("tests.controllers.own:Height", (0.4,))
    np.testing.assert_array_equal(env.task.actions.bounds, [[0.0], [0.5]])
    bent = env.flies.output["angles"][0] - Height().parameters(1e-4)["rest"]
    np.testing.assert_allclose(bent[5::7], 0.4)


def test_a_scaled_action_spans_the_range_of_the_command() -> None:
    env = BatchedEnv(EnvConfig("target", controller="tests.controllers.own:Height"), 1)
    assert env.task.actions.commands([[-1.0], [0.0], [1.0]]).ravel().tolist() == [0.0, 0.25, 0.5]
    shown = {term.name: term for term in env.task.observation}["drive"]
    assert (shown.shape, shown.low, shown.high) == ((1,), 0.0, 0.5)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("hybird", "controller must be one of .*'hybrid'.*did you mean 'hybrid'"),
        ("tests.controllers.own:Wav", "must be one of .*did you mean 'Wave'"),
        ("tests.controllers.own:np", "must be a Controller, got a module"),
        ("tests.controllers.own:WAVE", "must be a Controller, got a Wave"),
        ("tests.controllers.no_such:Wave", "cannot be imported"),
        ({"name": NAME, "amplitud": 0.1}, "controller has no 'amplitud'; did you mean 'amplitude'"),
        ({"amplitude": 0.1}, "controller.name must be text, got None"),
        ("tests.controllers.own:Whole", "'count' must be float64, got int64"),
        ("tests.controllers.own:Short", r"must have a static method step\(parameters, state"),
        ("tests.controllers.own:Misspelt", "compiled: no .* field 'angels'; did you mean 'angles'"),
        ("tests.controllers.own:Untyped", "own:Untyped' cannot be compiled: Unknown attribute"),
        ("tests.controllers.own:Raising", "must raise nothing, got ValueError: too slow"),
    ],
)
def test_what_is_no_controller_is_refused_by_name(given, message) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        BatchedEnv(EnvConfig(controller=given), 1)
    if "Unknown attribute" in message:
        assert isinstance(caught.value.__cause__, TypingError)


COPY = """
from dataclasses import dataclass
from flyrl.controllers import CPG
from flyrl.controllers.cpg_controller import cpg_controller_step

@dataclass(frozen=True)
class Mine(CPG):
    @staticmethod
    def step(parameters, state, senses, command, output):
        cpg_controller_step(parameters, state, senses, command, output)
        output.angles[0] += {shift}
"""
RUN = (
    "import numpy as np, gymnasium, flyrl\n"
    "env = gymnasium.make('flyrl/HybridTurning-v0', controller='mine:Mine')\n"
    "env.reset(seed=0)\n"
    "env.step(np.ones(2, np.float32))\n"
    "print(env.unwrapped.core.flies.output['angles'][0, 0])\n"
)


def test_a_kernel_is_compiled_once_and_again_when_its_file_changes(tmp_path) -> None:
    def run(shift):
        (tmp_path / "mine.py").write_text(COPY.format(shift=shift))
        done = subprocess.run(
            [sys.executable, "-c", RUN],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(Path(flyrl.__file__).parents[1])},
            capture_output=True,
            text=True,
            check=True,
        )
        return float(done.stdout), "compiling" in done.stderr

    first, is_compiled = run(0.25)
    assert is_compiled
    assert run(0.25) == (first, False)
    changed, is_compiled = run(0.5)
    assert is_compiled
    assert changed == pytest.approx(first + 0.25)
