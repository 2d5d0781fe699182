"""What an environment is made of, and what a decision in it leads to."""

import math
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from flyrl.bodies.fly import FLIES, FlyConfig
from flyrl.controllers.leg_controller import ControllerConfig, ControllerName
from flyrl.simulation.physics import PHYSICS_PRESETS, PhysicsConfig
from flyrl.simulation.randomisation import RANDOMISATIONS, RandomisationConfig
from flyrl.simulation.scene import STEPS_OF_BODY, SceneConfig
from flyrl.tasks import TASKS, Episode, Task
from flyrl.terrains import TERRAINS, TerrainConfig
from flyrl.validation import one_of

Observation = NDArray[np.float32] | dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class EnvConfig:
    """Everything that makes an environment.

    Parameters
    ----------
    task
        A name in `flyrl.tasks.TASKS`, or a task of your own.
    body, terrain, controller
        Configs, or the name that picks one: a body in `flyrl.bodies.fly.FLIES`, a terrain in
        `flyrl.terrains.TERRAINS`, a controller with default settings. With None, the controller is
        the hybrid one whose recorded step goes with the body.
    physics
        Settings, or the name of a preset.
    decision_interval
        s for which a decision is held; None takes the task's. A multiple of the physics step.
    randomisation
        Ranges that the fly of every episode is drawn from, or the name of some.
    log_gait
        Whether the engine logs how the flies walk (see `flyrl.controllers.gait_log`); they walk
        the same with and without.
    """

    task: str | Task = "target"
    body: str | FlyConfig = "current"
    terrain: str | TerrainConfig = "flat"
    controller: str | ControllerConfig | None = None
    physics: str | PhysicsConfig = "balanced"
    decision_interval: float | None = None
    randomisation: str | RandomisationConfig = "none"
    log_gait: bool = False

    resolved_task: Task = field(init=False, repr=False)
    resolved_randomisation: RandomisationConfig = field(init=False, repr=False)
    scene: SceneConfig = field(init=False, repr=False)
    steps_per_decision: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        task = self.task
        if isinstance(task, str):
            task = TASKS[one_of("task", task, TASKS)]
        body = self.body
        if isinstance(body, str):
            body = FLIES[one_of("body", body, FLIES)]
        terrain = self.terrain
        if isinstance(terrain, str):
            terrain = TERRAINS[one_of("terrain", terrain, TERRAINS)]
        controller = self.controller
        if controller is None or isinstance(controller, str):
            controller = ControllerConfig(
                name=cast(ControllerName, controller or "hybrid"),
                steps=STEPS_OF_BODY[body.name],
            )
        physics = self.physics
        if isinstance(physics, str):
            physics = PHYSICS_PRESETS[one_of("physics", physics, PHYSICS_PRESETS)]
        interval = self.decision_interval
        if interval is None:
            interval = task.decision_interval_s or physics.timestep
        steps = round(interval / physics.timestep)
        if steps < 1 or abs(steps * physics.timestep - interval) > 1e-9:
            raise ValueError(
                f"decision_interval is {interval} s; it must be a positive multiple of the physics "
                f"time step, {physics.timestep} s"
            )
        if task.time_limit_s is not None and round(task.time_limit_s / interval) < 1:
            raise ValueError(
                f"the time limit of {task.name} must be at least one decision, {interval} s, "
                f"got {task.time_limit_s}"
            )
        drawn_from = self.randomisation
        if isinstance(drawn_from, str):
            drawn_from = RANDOMISATIONS[one_of("randomisation", drawn_from, RANDOMISATIONS)]
        is_sensed = any(term.spreads().any() for term in task.observation)
        if drawn_from.sensor_noise and not is_sensed:
            raise ValueError(
                f"randomisation.sensor_noise is {drawn_from.sensor_noise}; it must be 0 in the "
                f"task {task.name!r}, none of whose observation terms has a spread"
            )
        # with every drive another, as many are on their way as are decided on meanwhile
        places = math.ceil(round(drawn_from.longest_latency / physics.timestep) / steps)
        scene = SceneConfig(body, terrain, controller, physics, places)
        if self.log_gait:  # all samples of a decision are kept until its end
            scene = replace(scene, gait_places=1 + steps // scene.steps_per_gait_sample)
        object.__setattr__(self, "resolved_task", task)
        object.__setattr__(self, "resolved_randomisation", drawn_from)
        object.__setattr__(self, "scene", scene)
        object.__setattr__(self, "steps_per_decision", steps)

    @property
    def decision_interval_s(self) -> float:
        """How long a decision is held, s."""
        return self.steps_per_decision * self.scene.physics.timestep

    def sample_episode(self, seed: int, difficulty: float = 1.0) -> Episode:
        """Draw the episode with a seed: the task's, of a fly from the ranges."""
        episode = self.resolved_task.sample_episode(self.scene.terrain, seed, difficulty)
        return replace(episode, randomisation=self.resolved_randomisation.draw(seed))


@dataclass(frozen=True)
class Transition:
    """What one decision led to, for every simulation of a batch.

    Attributes
    ----------
    observation
        float32, (n, size), or a dict of (n, ...) arrays; see `Task.is_flat`.
    reward
        (n,).
    terminated, truncated
        (n,); the outcome and success below are final where one of them holds.
    outcome
        "running", "timeout", "unstable" or the name of the task's termination, (n,).
    is_success
        (n,).
    """

    observation: Observation
    reward: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    outcome: NDArray[np.str_]
    is_success: NDArray[np.bool_]

    @property
    def done(self) -> NDArray[np.bool_]:
        """Whether the episode ended, (n,)."""
        return self.terminated | self.truncated
