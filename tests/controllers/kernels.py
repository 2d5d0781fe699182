"""A controller's kernel, run by hand on made-up observations."""

from typing import NamedTuple

import numpy as np

from flyrl.controllers import Controller
from flyrl.controllers.controller import OUTPUT, SENSES


class Observation(NamedTuple):
    """What the reflexes sense, after the previous physics step; see `controller.SENSES`."""

    thorax_z: float
    end_effector_z: np.ndarray
    contact_forces_w: np.ndarray
    heading_w: np.ndarray


CALM = Observation(0.0, np.full(6, -1.0), np.zeros((36, 3)), np.array([1.0, 0.0, 0.0]))


class Legs:
    """A controller with its records, as the engine keeps them.

    Attributes
    ----------
    state, output
        Records of the controller's own type, and of type `OUTPUT`.
    """

    def __init__(self, controller: Controller, timestep: float, **initial) -> None:
        self.kernel = type(controller).step
        self.parameters = controller.parameters(timestep)
        self.state = controller.initial_state(**initial)
        self.senses = np.zeros(1, dtype=SENSES)[0]
        self.output = np.zeros(1, dtype=OUTPUT)[0]

    def step(self, command, observation: Observation = CALM) -> None:
        for name, values in observation._asdict().items():
            self.senses[name] = values
        command = np.array(command, dtype=np.float64)
        self.kernel(self.parameters, self.state, self.senses, command, self.output)

    def __getitem__(self, name: str):
        record = self.output if name in OUTPUT.names else self.state
        return record[name]
