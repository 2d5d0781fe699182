"""Who can enter an evaluation: fixed controllers by name, learned policies by file or name."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from flyrl.controllers import ControllerConfig
from flyrl.controllers.leg_controller import ControllerName
from flyrl.envs.core import EnvConfig
from flyrl.evaluation.config import EvaluationConfig
from flyrl.files import file_digest
from flyrl.policies import (
    ConstantDrive,
    LearnedPolicy,
    OpenLoop,
    PolicyFileError,
    Pursuit,
    PursuitOfGoal,
    load_policy,
)
from flyrl.policies.bundle import policy_file
from flyrl.policies.library import policy_name
from flyrl.rollouts import Policy
from flyrl.tasks import ACHIEVED_GOAL, DESIRED_GOAL, Task, term_digests
from flyrl.terrains import TerrainConfig, terrain_label
from flyrl.validation import one_of


@dataclass(frozen=True)
class Entrant:
    """A leg controller and the policy that steers it.

    Attributes
    ----------
    name
        Unique among the entrants of an evaluation.
    controller
        Of the legs.
    policy
        Of the descending drive.
    decision_interval
        s for which a decision is held; None takes the task's.
    record
        Where the entrant comes from, as plain JSON values.
    """

    name: str
    controller: ControllerConfig
    policy: Policy
    decision_interval: float | None
    record: Mapping[str, Any]

    def env(self, config: EvaluationConfig, terrain: TerrainConfig) -> EnvConfig:
        """Environment that the entrant walks in."""
        return dataclasses.replace(
            config.env(terrain),
            controller=self.controller,
            decision_interval=self.decision_interval,
        )


@dataclass(frozen=True)
class _Fixed:
    """A fixed entrant; with `sees`, it needs a task that shows these terms, or those."""

    legs: ControllerName
    text: str
    make: Callable[[Task], Policy]
    sees: tuple[tuple[str, ...], ...] = ()

    def goes_with(self, task: Task) -> bool:
        """Whether the task shows what it needs."""
        shown = task.slices()
        return not self.sees or any(shown.keys() >= set(terms) for terms in self.sees)


_QUICK_PURSUIT: Final = {"gain": 2.0, "forward": 1.5, "weakest": 0.0, "strongest": 1.5}
"""The quickest to a target of 16 settings (flat ground, 64 to 128 episodes that no evaluation has)
without a fall, at 0.81 s instead of 1.00; on a path the literature's turn keeps closer to it."""


_GOALS: Final = (ACHIEVED_GOAL, DESIRED_GOAL, "compass")


def _walk(task: Task) -> Policy:
    return ConstantDrive(1.0, 1.0, task.action)


def _stand(task: Task) -> Policy:
    return ConstantDrive(0.0, 0.0, task.action)


def _pursue(task: Task) -> Policy:
    tuned = _QUICK_PURSUIT if task.name in ("target", "target_goal", "heading") else {}
    shown = task.slices()
    if "target_direction" in shown:
        return Pursuit(shown["target_direction"], task.action, **tuned)
    achieved, desired, compass = (shown[name] for name in _GOALS)
    return PursuitOfGoal(achieved, desired, compass, task.action, **tuned)


def _follow_command(task: Task) -> Policy:
    return OpenLoop(task.slices()["command"], task.action)


FIXED: Final[Mapping[str, _Fixed]] = {
    "cpg": _Fixed("cpg", "constant drive (1, 1)", _walk),
    "rule_based": _Fixed("rule_based", "constant drive (1, 1)", _walk),
    "hybrid": _Fixed("hybrid", "constant drive (1, 1)", _walk),
    "pursuit": _Fixed(
        "hybrid",
        "proportional steering towards the target",
        _pursue,
        (("target_direction",), _GOALS),
    ),
    "open_loop": _Fixed(
        "hybrid", "drive that answers the command", _follow_command, (("command",),)
    ),
    "zero": _Fixed("hybrid", "constant drive (0, 0)", _stand),
}
"""Fixed entrants by name: the leg controller, and what steers it."""


def controller_names(config: EvaluationConfig) -> tuple[str, ...]:
    """Names of the fixed entrants: those that were asked for, or all that go with the task."""
    if config.controllers is not None:
        return config.controllers
    return tuple(name for name, fixed in FIXED.items() if fixed.goes_with(config.resolved_task))


def changed_terms(entrant: Entrant, task: Task) -> list[str]:
    """Modules of the user's own terms that are not what a learned policy was trained with."""
    training = entrant.record.get("training")
    before = training.get("terms") if isinstance(training, dict) else None
    if not isinstance(before, dict):  # fixed, or from before they were noted
        return []
    now = term_digests(task.added)
    return [module for module, digest in now.items() if before.get(module) != digest]


def make_entrants(config: EvaluationConfig) -> list[Entrant]:
    """All entrants of an evaluation: learned policies first, then the fixed controllers.

    Raises
    ------
    ValueError
        An unknown or repeated name, a policy file that cannot be used, a reference that is not
        among the entrants, or one whose decisions do not fit the physics.
    """
    names = controller_names(config)
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        raise ValueError(f"controllers must differ from one another, got {repeated[0]!r} twice")
    # Fixed first: a misspelt name shows before any file is read.
    fixed = [_fixed(name, config) for name in names]
    taken = {entrant.name for entrant in fixed}
    learned: list[Entrant] = []
    for path in config.policies:
        entrant = _learned(path, config, taken)
        taken.add(entrant.name)
        learned.append(entrant)
    entrants = [*learned, *fixed]
    reference_name(config, entrants)
    for entrant in entrants:
        for terrain in config.terrain_configs:
            try:
                entrant.env(config, terrain)
            except (ValueError, TypeError) as error:
                source = entrant.record["source"] or entrant.name
                raise ValueError(f"{source} cannot walk here: {error}") from error
    return entrants


def reference_name(config: EvaluationConfig, entrants: list[Entrant]) -> str:
    """Name of the entrant that the others are compared with; see `EvaluationConfig`."""
    names = [entrant.name for entrant in entrants]
    if config.reference is not None:
        return one_of("reference", config.reference, names)
    if "hybrid" in names:
        return "hybrid"
    return (*controller_names(config), *names)[0]


def _fixed(name: str, config: EvaluationConfig) -> Entrant:
    fixed = FIXED[one_of("controllers", name, FIXED)]
    task = config.resolved_task
    if not fixed.goes_with(task):
        needed = " or ".join(", ".join(terms) for terms in fixed.sees)
        raise ValueError(
            f"controllers: {name!r} needs a task that shows {needed}, got {task.name!r}"
        )
    legs = config.env(config.terrains[0]).scene.controller
    controller = dataclasses.replace(legs, name=fixed.legs)
    record = {
        "name": name,
        "kind": "fixed",
        "leg_controller": fixed.legs,
        "policy": fixed.text,
        "source": None,
        "sha256": None,
        "controller_config": dataclasses.asdict(controller),
    }
    return Entrant(name, controller, fixed.make(task), None, record)


def _learned(path: str, config: EvaluationConfig, taken: set[str]) -> Entrant:
    file = policy_file(path)
    policy = load_policy(file)
    env, training = policy.bundle.env, policy.bundle.training
    _check_observations(policy, config.resolved_task)
    legs = config.env(config.terrains[0]).scene.controller
    try:
        controller = ControllerConfig(**env["controller"]) if "controller" in env else legs
    except TypeError as error:
        raise PolicyFileError(f"{file}: its leg controller cannot be used here: {error}") from error
    interval = env["task"].get("decision_interval") if isinstance(env.get("task"), dict) else None
    name = _free_name(policy_name(file) or str(training.get("algo", file.stem)), taken)
    record = {
        "name": name,
        "kind": "learned",
        "leg_controller": controller.name,
        "policy": _how_learned(env, training),
        "source": str(file),
        "sha256": file_digest(file),
        "controller_config": dataclasses.asdict(controller),
        "trained_in": dict(env),
        "training": dict(training),
    }
    return Entrant(name, controller, policy, interval, record)


def _check_observations(policy: LearnedPolicy, task: Task) -> None:
    """Raise PolicyFileError unless the policy sees what the task shows; say what would help."""
    try:
        policy.check_task(task)
    except PolicyFileError as error:
        trained_in = policy.bundle.env.get("task")
        terms = trained_in.get("terms", []) if isinstance(trained_in, dict) else []
        if terms == list(task.added):
            raise
        raise PolicyFileError(
            f"{error}; it was trained with task.terms={_hydra_list(terms)}, "
            f"here they are {_hydra_list(task.added)}"
        ) from error


def _hydra_list(names: Sequence[str]) -> str:
    return f"[{','.join(map(str, names))}]"


def _how_learned(env: Mapping[str, Any], training: Mapping[str, Any]) -> str:
    text = "learned"
    if "algo" in training:
        text += f" with {training['algo']}"
    terrain = env.get("terrain")
    if isinstance(terrain, dict) and "name" in terrain:
        text += f" on {terrain_label(terrain['name'], terrain.get('random'))}"
    return text


def _free_name(name: str, taken: set[str]) -> str:
    """`name`, or `name-2`, `name-3`, … where that is taken."""
    if name not in taken:
        return name
    return next(f"{name}-{i}" for i in range(2, len(taken) + 3) if f"{name}-{i}" not in taken)
