"""A leg controller as a user writes it: sines on the tibiae, as quick as the drive."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from flyrl import PreprogrammedSteps
from flyrl.controllers import Command, Controller


@dataclass(frozen=True)
class Wave(Controller):
    """Every leg's tibia follows a sine."""

    amplitude: float = 0.3
    frequency_hz: float = 10.0

    def parameters(self, timestep):
        record = np.zeros(1, dtype=[("rest", "f8", (42,)), ("amplitude", "f8"), ("rate", "f8")])[0]
        record["rest"] = PreprogrammedSteps().default_pose
        record["amplitude"] = self.amplitude
        record["rate"] = 2 * np.pi * self.frequency_hz * timestep
        return record

    def initial_state(self, seed=0, init_phases=None, init_magnitudes=None):
        record = np.zeros(1, dtype=[("phases", "f8", (6,))])[0]
        record["phases"] = np.arange(6.0)
        return record

    @staticmethod
    def step(parameters, state, senses, command, output):
        for joint in range(42):
            output.angles[joint] = parameters.rest[joint]
        for leg in range(6):
            state.phases[leg] += parameters.rate * command[leg // 3]
            output.angles[7 * leg + 5] += parameters.amplitude * np.sin(state.phases[leg])
            output.adhesion[leg] = 1.0


@dataclass(frozen=True)
class Height(Wave):
    """The tibiae bend as far as the only number of its command says."""

    command: ClassVar[Command] = Command(("bend",), (0.0,), (0.5,))

    @staticmethod
    def step(parameters, state, senses, command, output):
        for joint in range(42):
            output.angles[joint] = parameters.rest[joint]
        for leg in range(6):
            output.angles[7 * leg + 5] += command[0]
            output.adhesion[leg] = 1.0 if senses.thorax_z > 0.0 else 0.0


@dataclass(frozen=True)
class Whole(Wave):
    """Keeps whole numbers, which is refused."""

    def initial_state(self, seed=0, init_phases=None, init_magnitudes=None):
        return np.zeros(1, dtype=[("count", "i8")])[0]


@dataclass(frozen=True)
class Short(Controller):
    """Its kernel takes too little."""

    @staticmethod
    def step(parameters, state, senses, command):
        state.unused = 0.0


@dataclass(frozen=True)
class Misspelt(Controller):
    """Its kernel writes a field that the output does not have."""

    @staticmethod
    def step(parameters, state, senses, command, output):
        output.angels[0] = 0.0


@dataclass(frozen=True)
class Untyped(Controller):
    """Its kernel does what Numba cannot."""

    @staticmethod
    def step(parameters, state, senses, command, output):
        output.angles.clear()


@dataclass(frozen=True)
class Raising(Controller):
    """Its kernel raises an error."""

    @staticmethod
    def step(parameters, state, senses, command, output):
        if command[0] < 1.0:
            raise ValueError("too slow")


WAVE = Wave()
"""No class: settings are given where a controller is named."""
