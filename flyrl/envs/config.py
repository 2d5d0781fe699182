"""Settings of an environment, checked and resolved, and as a record."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from flyrl.bodies.fly import FLIES, FlyConfig
from flyrl.bodies.worm import WORMS, WormConfig
from flyrl.controllers.controller import Controller, controller_from
from flyrl.controllers.gait_log import SAMPLING_S
from flyrl.simulation.physics import PHYSICS_PRESETS, PhysicsConfig
from flyrl.simulation.randomisation import RANDOMISATIONS, RandomisationConfig
from flyrl.simulation.scene import SceneConfig, batch_class
from flyrl.tasks import Drives, Episode, JointTargets, Task, TaskSettings, task_from, task_record
from flyrl.tasks.function import ALWAYS, task_function
from flyrl.terrains import Terrain, terrain_from
from flyrl.validation import did_you_mean, from_keys, one_of, plain, within

BodyConfig = FlyConfig | WormConfig
BODIES: Final[Mapping[str, BodyConfig]] = {**FLIES, **WORMS}
"""Bodies by name."""

Config = TypeVar("Config")

Fields = Mapping[str, Any]
"""Fields of a config, from which it is made."""

LONGEST_DECISION_S: Final = 10.0
"""The engine cannot be interrupted within a decision."""

Observation = NDArray[np.float32] | dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class EnvConfig:
    """Everything that makes an environment.

    Parameters
    ----------
    task
        A name in `flyrl.tasks.TASKS` or of a task function of your own, module:attribute; a
        mapping with the name and settings, as `flyrl.tasks.task_from` takes it; a task function; or
        a table, a `Task`.
    body, terrain, controller
        Configs, their fields as a mapping, or the name that picks one: a body in `BODIES`, a
        terrain in `flyrl.terrains.TERRAINS`, a controller in `flyrl.controllers.CONTROLLERS`, or a
        terrain or controller of your own, module:attribute, with default settings. With None, the
        body is the usual one of the task, and the controller the hybrid one. A worm has no
        controller: a task for worms recruits its muscles itself.
    physics
        Settings, or the name of a preset; None takes "balanced" for a fly and "worm" for a worm.
    decision_interval
        s for which a decision is held, at most 10; None takes the task's. A multiple of the
        physics step.
    randomisation
        Ranges that the fly of every episode is drawn from, or the name of some.
    log_gait
        Whether the engine logs how the flies walk (see `flyrl.controllers.gait_log`); they walk
        the same with and without.
    as_vectors
        Whether an observation that is a dict, and has no goals, comes as one vector (see
        `flyrl.tasks.Task.flattened`).
    """

    task: TaskSettings | Task = "target"
    body: str | BodyConfig | Fields | None = None
    terrain: str | Terrain | Fields = "flat"
    controller: str | Controller | Fields | None = None
    physics: str | PhysicsConfig | Fields | None = None
    decision_interval: float | None = None
    randomisation: str | RandomisationConfig | Fields = "none"
    log_gait: bool = False
    as_vectors: bool = False

    resolved_task: Task = field(init=False, repr=False)
    resolved_randomisation: RandomisationConfig = field(init=False, repr=False)
    scene: SceneConfig = field(init=False, repr=False)
    steps_per_decision: int = field(init=False, repr=False)
    decision_interval_s: float = field(init=False, repr=False)
    """Time for which a decision is held, s."""

    def __post_init__(self) -> None:
        for name in ("log_gait", "as_vectors"):
            one_of(name, getattr(self, name), (False, True))
        task, interval = self.task, self.decision_interval
        if interval is None and isinstance(task, Mapping):
            interval = task.get("decision_interval")
        if interval is not None:
            within("decision_interval", interval, 0, LONGEST_DECISION_S)
        body = usual_body(task) if self.body is None else _named("body", self.body, BODIES)
        if not isinstance(task, Task):
            task = task_from(task, body if isinstance(body, WormConfig) else None)
        if self.as_vectors:
            task = task.flattened()
        _check_body(task, body)
        kind = batch_class(body)
        drawn_from = _named("randomisation", self.randomisation, RANDOMISATIONS)
        controller: Any = self.controller
        if kind.has_legs:
            usual = "joints" if isinstance(task.actions, JointTargets) else "hybrid"
            controller = controller_from(usual if self.controller is None else self.controller)
            task = _fit_task(task, controller)
        elif replace(drawn_from, sensor_noise=0.0) != RandomisationConfig():
            raise ValueError(
                f"randomisation of a {kind.creature} must be of sensor_noise alone, got "
                f"{drawn_from}"
            )
        terrain = terrain_from(self.terrain).sized(task.extent_mm)
        presets = {name: PHYSICS_PRESETS[name] for name in kind.presets}
        physics = kind.usual_physics if self.physics is None else self.physics
        physics = _named("physics", physics, presets)
        if interval is None:
            interval = task.decision_interval_s or physics.timestep
        steps = _physics_steps(task, interval, physics)
        is_sensed = any(term.spreads().any() for term in task.observation)
        if drawn_from.sensor_noise and not is_sensed:
            raise ValueError(
                f"randomisation.sensor_noise is {drawn_from.sensor_noise}; it must be 0 in the "
                f"task {task.name!r}, none of whose observation terms has a spread"
            )
        # worst case: ceil(latency / decision interval) commands are in flight
        queue = math.ceil(round(drawn_from.longest_latency / physics.timestep) / steps)
        gait = 0
        if self.log_gait and kind.has_legs:  # all samples of a decision are kept until its end
            # at any step they are more than two thirds of SAMPLING_S apart: as many places in all
            gait = 1 + math.ceil(1.5 * steps * physics.timestep / SAMPLING_S)
        scene = SceneConfig(body, terrain, controller, physics, queue, gait, task.props)
        object.__setattr__(self, "resolved_task", task)
        object.__setattr__(self, "resolved_randomisation", drawn_from)
        object.__setattr__(self, "scene", scene)
        object.__setattr__(self, "steps_per_decision", steps)
        object.__setattr__(self, "decision_interval_s", steps * physics.timestep)

    def __reduce__(self) -> tuple[Any, ...]:
        # the rest follows from these, and terms of a task may be functions that cannot be pickled
        return type(self), tuple(getattr(self, name) for name in _settings(self))

    @property
    def creature(self) -> str:
        """Word for the body: "fly" or "worm"."""
        creature: str = self.scene.batch_class.creature
        return creature

    @property
    def fly_scene(self) -> SceneConfig:
        """The scene, of flies.

        Raises
        ------
        ValueError
            If it is one of worms.
        """
        if self.creature != "fly":
            raise ValueError(f"task must be one for flies, got {self.resolved_task.name!r}")
        return self.scene

    def sample_episode(self, seed: int, difficulty: float = 1.0) -> Episode:
        """Draw the episode with a seed: the task's, of a fly from the ranges."""
        episode = self.resolved_task.sample_episode(self.scene.terrain, seed, difficulty)
        return replace(episode, randomisation=self.resolved_randomisation.draw(seed))


class UnexpectedArgumentError(TypeError, ValueError):
    """A keyword that no environment has: a TypeError, by which TorchRL knows it, as in Python.

    Attributes
    ----------
    name
        The keyword; empty where Gymnasium raised the error again, with its own words added.
    """

    def __init__(self, message: str, name: str = "") -> None:
        super().__init__(message)
        self.name = name


def config_for(
    given: Mapping[str, Any], config: EnvConfig | None = None, others: Iterable[str] = ()
) -> EnvConfig:
    """Change the settings, by default the usual ones, as keywords of an environment say.

    Parameters
    ----------
    given
        Fields of `EnvConfig`, parameters and other settings of the task.
    config
        Settings to change.
    others
        Keywords that the environment takes besides, for messages.

    Raises
    ------
    UnexpectedArgumentError
        A keyword that does not exist.
    ValueError
        A value that is not allowed.
    """
    config = config or EnvConfig()
    known = [*_settings(EnvConfig), *others]
    message = "the environment got an unexpected keyword argument"
    return replace(config, **with_task({"task": config.task, **given}, known, message))


def with_task(given: Mapping[str, Any], known: Sequence[str], message: str) -> dict[str, Any]:
    """Keywords with the settings of the task moved into "task".

    Parameters
    ----------
    given
        Holds "task", and its settings unless it is a table.
    known
        Keywords that are no settings of the task.
    message
        Beginning of the error, before the keyword.

    Raises
    ------
    UnexpectedArgumentError
        A keyword that does not exist.
    """
    given, task = dict(given), given["task"]
    allowed = tuple(known)
    if not isinstance(task, Task):
        settings = task if isinstance(task, Mapping) else {"name": task}
        allowed = tuple(dict.fromkeys([*known, *task_function(settings).parameters, *ALWAYS[2:]]))
        more = {name: given.pop(name) for name in allowed if name in given and name not in known}
        given["task"] = {**settings, **more} if more else task
    for name in given:
        if name not in allowed:
            raise UnexpectedArgumentError(
                f"{message} {name!r}{did_you_mean(name, allowed)} (allowed: {', '.join(allowed)})",
                name,
            )
    return given


def _settings(config: type[EnvConfig] | EnvConfig) -> list[str]:
    return [item.name for item in fields(config) if item.init]


def _named(key: str, given: Any, table: Mapping[str, Config]) -> Config:
    """Settings as they are given, those of a mapping, or those that a name picks."""
    if isinstance(given, str):
        return table[one_of(key, given, table)]
    kinds: dict[type[Any], None] = {type(config): None for config in table.values()}
    if given and isinstance(given, Mapping):  # as JSON gives them
        known = {kind: given.keys() & {item.name for item in fields(kind)} for kind in kinds}
        return cast(Config, from_keys(key, given, max(kinds, key=lambda kind: len(known[kind]))))
    if type(given) not in kinds and not (key == "body" and hasattr(given, "simulated_by")):
        names = " or ".join(sorted(kind.__name__ for kind in kinds))
        allowed = ", ".join(map(repr, table))
        raise ValueError(f"{key} must be a {names} or one of {allowed}, got {given!r}")
    return cast(Config, given)


def _fit_task(task: Task, controller: Controller) -> Task:
    """Let a task's actions command what the controller takes, and its observation show that.

    Raises
    ------
    ValueError
        If its actions are joint angles, and the controller takes something else.
    """
    actions, command = task.actions, controller.command
    assert isinstance(actions, Drives)  # a task for flies
    if actions.command == command:
        return task
    if isinstance(actions, JointTargets):
        raise ValueError(
            f"controller must be 'joints' in the task {task.name!r}, got {controller.name!r}"
        )
    shown = tuple(
        replace(term, shape=(len(command.names),), low=min(command.low), high=max(command.high))
        if term.name == "drive"
        else term
        for term in task.observation
    )
    return replace(task, actions=actions.of_command(command), observation=shown)


def _physics_steps(task: Task, interval: float, physics: PhysicsConfig) -> int:
    """Number of physics steps for which a decision is held.

    Raises
    ------
    ValueError
        If that is no whole number, or the task's time limit is shorter than a decision.
    """
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
    return steps


def usual_body(task: TaskSettings | Task) -> BodyConfig:
    """Body that a task is for, unless another is asked for."""
    worm = task.worm if isinstance(task, Task) else task_function(task).worm
    return worm or FLIES["current"]


def _check_body(task: Task, body: BodyConfig) -> None:
    """Raise ValueError unless the task is for bodies like this."""
    creature = task.actions.creature
    if creature != batch_class(body).creature:
        names = [name for name, each in BODIES.items() if batch_class(each).creature == creature]
        raise ValueError(
            f"body must be a {creature} in the task {task.name!r} ({', '.join(names)}), got {body}"
        )
    if isinstance(body, WormConfig) and task.actions.size != 2 * body.joints:
        raise ValueError(
            f"body must have {task.actions.size} muscles in the task {task.name!r}, got "
            f"{2 * body.joints}"
        )


def env_record(env: EnvConfig) -> dict[str, Any]:
    """Everything about an environment as plain JSON values, keyed like the groups of `configs/`."""
    parts = ("body", "terrain", "physics", "controller")
    return {
        "task": {**task_record(env.resolved_task), "decision_interval": env.decision_interval_s},
        **{part: plain(getattr(env.scene, part)) for part in parts},
        "randomisation": plain(env.resolved_randomisation),
    }


def randomisation_text(record: Any) -> str:
    """Randomisation as one would type it, from the "randomisation" of a record."""
    given = record.items() if isinstance(record, dict) else ()
    # without quotes: a shell would take them off
    return ", ".join(f"{name}={value}" for name, value in given if value).replace("'", "") or "none"
