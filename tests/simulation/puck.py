"""A body of a user's own: a puck that two motors push over the ground, along x and y."""

from dataclasses import dataclass, make_dataclass
from typing import ClassVar

import mujoco
import numpy as np

from flyrl.controllers.controller import Command
from flyrl.simulation.batch import Batch
from flyrl.simulation.physics import apply_physics
from flyrl.simulation.rendering import BodyRenderer
from flyrl.simulation.scene import Scene
from flyrl.tasks import Drives, ObservationTerm, RewardTerm, Task
from flyrl.tasks.episode import Episode
from flyrl.terrains import add_terrain


@dataclass(frozen=True)
class Puck:
    radius: float = 1.0

    simulated_by: ClassVar[str] = "tests.simulation.puck:PuckBatch"


PuckState = make_dataclass(
    "PuckState", ["time", "position_w", "velocity_w", "yaw", "actuation", "is_unstable"]
)


class PuckRenderer(BodyRenderer):
    cameras = ("top",)

    def _look(self, goal):
        middle = self._data.body("Puck").xpos
        self._camera.lookat[:] = middle
        self._camera.elevation, self._camera.distance = -89.0, 20.0
        return middle


class PuckBatch(Batch):
    creature = "puck"
    presets = ("balanced",)
    usual_physics = "balanced"
    renderer = PuckRenderer
    needless = ("init_phases", "init_magnitudes", "joint_angles", "pushes")

    @classmethod
    def fit(cls, config):
        return None

    @classmethod
    def build(cls, config, visual):
        spec = mujoco.MjSpec()
        puck = spec.worldbody.add_body(name="Puck", pos=(0, 0, config.body.radius))
        puck.add_geom(size=(config.body.radius, 0, 0), density=1e-3, contype=0, conaffinity=0)
        for name, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0))):
            joint = puck.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
            joint.damping[0] = 0.1
            motor = spec.add_actuator(name=name, target=name)
            motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        add_terrain(spec, config.terrain)
        apply_physics(spec, config.physics, config.terrain)
        model = spec.compile()
        return Scene(config, model, np.arange(2), np.arange(2), np.dtype(np.float64))

    def start(self, ids, episodes):
        self._clear(ids)
        self._qpos[ids] = [episode.spawn_position_w[:2] for episode in episodes]
        self._forward(ids)

    def set_command(self, command, ids=slice(None)):
        self._batch.bind("ctrl")[ids] = command

    def state(self):
        n = self.num_sims
        return PuckState(
            time=self._time.copy(),
            position_w=np.hstack([self._qpos, np.zeros((n, 1))]),
            velocity_w=np.hstack([self._qvel, np.zeros((n, 1))]),
            yaw=np.zeros(n),
            actuation=self._batch.bind("ctrl").copy(),
            is_unstable=self._is_unstable.copy(),
        )


class Pushes(Drives):
    creature = "puck"


def ahead(state):
    return state.body.position_w[:, 0] - state.previous.position_w[:, 0]


def glide() -> Task:
    """Get ahead along x."""
    return Task(
        observation=(
            ObservationTerm("place", (3,), -9, 9, lambda state: state.body.position_w, "mm"),
        ),
        reward=(RewardTerm("ahead", 1.0, ahead, "mm"),),
        terminations=(),
        sample_episode=lambda terrain, seed, difficulty=1.0: Episode(
            seed, (0.1 * (seed % 5), 0.0, 0.0), 0.0, ()
        ),
        time_limit_s=0.2,
        actions=Pushes(command=Command(("x", "y"), (-5.0, -5.0), (5.0, 5.0))),
        name="glide",
    )
