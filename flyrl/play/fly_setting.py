"""Settings of a played fly, the task that it walks in, and who can steer it there."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, cast, get_args

from flyrl.bodies.fly import FLIES
from flyrl.controllers import DRIVE, Hybrid
from flyrl.controllers.controller import controller_named
from flyrl.controllers.cpg_controller import Gait, OscillatorController
from flyrl.entry_points import is_entry_point
from flyrl.envs.config import EnvConfig
from flyrl.policies import LearnedPolicy, PolicyFileError, load_bundle, named_policies
from flyrl.policies.bundle import policy_file, policy_name
from flyrl.policies.laws import FIXED
from flyrl.rollouts import Policy
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.tasks import FAILURES, TASKS, RewardTerm, Task, TaskState, terms
from flyrl.tasks.task import Mask
from flyrl.terrains import KINDS, Bounds, terrain_named
from flyrl.validation import one_of, random_seed

if TYPE_CHECKING:
    from flyrl.play.panel import Panel

CHOICES: Final[dict[str, tuple[str, ...]]] = {
    "controller": ("cpg", "hybrid", "rule_based", "rule_based_steered"),
    "gait": get_args(Gait),
    "terrain": tuple(KINDS),
    "physics": FLY_PRESETS,
    "body": tuple(FLIES),
}
"""Allowed values, by key of `PlayedFlyConfig`; a terrain and a controller of a user's own, too."""

_OWN: Final = ("controller", "terrain")

SWITCHES: Final = ("retraction", "stumbling", "adhesion")
"""Keys of `PlayedFlyConfig` that are on or off."""


@dataclass(frozen=True)
class PlayedFlyConfig:
    """Settings of a played fly.

    Attributes
    ----------
    terrain, controller, gait, physics, body
        Names; see `CHOICES`. A controller and a terrain of a user's own are module:attribute. The
        rules choose their gait themselves.
    retraction, stumbling
        Whether the legs have that reflex; only the hybrid controller uses them.
    adhesion
        Whether the legs' tips stick to the ground while they stand.
    policy
        What steers at the start: "pursuit", the name of a policy that comes with flyrl, a policy
        file, or a run folder. None: a person.
    seed
        Of the first reset.

    Raises
    ------
    ValueError
        If a name is unknown, a controller takes no drive, a switch is neither True nor False, or
        the seed is no seed.
    """

    terrain: str = "flat"
    controller: str = "hybrid"
    gait: str = "tripod"
    physics: str = "balanced"
    body: str = "current"
    retraction: bool = True
    stumbling: bool = True
    adhesion: bool = True
    policy: str | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        for key, allowed in CHOICES.items():
            name = getattr(self, key)
            if key not in _OWN or not is_entry_point(str(name)):
                one_of(key, name, allowed)
        if is_entry_point(self.terrain):
            terrain_named(self.terrain)
        if controller_named(self.controller).command.names != DRIVE.names:
            raise ValueError(f"controller must be one that takes a drive, got {self.controller!r}")
        for key in SWITCHES:
            one_of(key, getattr(self, key), (False, True))
        random_seed(self.seed)

    @property
    def choices(self) -> dict[str, tuple[str, ...]]:
        """`CHOICES`, and what the user has of their own."""
        return {
            key: tuple(dict.fromkeys((*known, getattr(self, key))))
            for key, known in CHOICES.items()
        }

    def env(self) -> EnvConfig:
        """The environment that the fly walks in."""
        body, controller = FLIES[self.body], controller_named(self.controller)
        if isinstance(controller, OscillatorController):
            controller = replace(controller, gait=cast(Gait, self.gait))
        if isinstance(controller, Hybrid):
            controller = replace(
                controller, retraction=float(self.retraction), stumbling=float(self.stumbling)
            )
        return EnvConfig(
            task=ENDLESS_TASK if self.terrain == "flat" else PLAY_TASK,
            body=body if self.adhesion else replace(body, adhesion_gain=0.0),
            terrain=self.terrain,
            controller=controller,
            physics=self.physics,
            log_gait=True,
        )


def draw_scene(
    panel: "Panel", config: PlayedFlyConfig, choices: Mapping[str, tuple[str, ...]]
) -> None:
    """Draw the controls of the scene, with their `choices` by key."""
    for key, options in choices.items():
        label = "leg controller" if key == "controller" else key
        panel.choice(key, label, options, getattr(config, key))
    of_hybrid = "" if config.controller == "hybrid" else " (hybrid alone)"
    for key in SWITCHES:
        label = key if key == "adhesion" else f"{key} reflex{of_hybrid}"
        panel.switch(key, label, getattr(config, key))


_TARGET: Final = TASKS["target"]()

REACH: Final[float] = _TARGET.parameters["reach"]
"""mm; so close to the target, a policy gets another one."""

DISTANCE: Final[tuple[float, float]] = _TARGET.parameters["distance"]
"""mm; least and greatest distance of a target when it is drawn."""


def _arrived(state: TaskState) -> Mask:
    """Whether the target was not reached before the decision and is now, (n,)."""
    before = terms.goal_distance(state.previous.position_w, state.goal)
    return terms.is_at_target(state, REACH) & (before >= REACH)


def _play_task(task: Task) -> Task:
    """The task without a time limit, which goes on when the target is reached."""
    ways = {term.name: term for term in task.reward if term.weight and term.name != "lost_time"}
    # the fly may stay: what a target is worth is paid once
    ways["success"] = RewardTerm(
        "success", ways["success"].weight, _arrived, "the target has just been reached"
    )
    return replace(task, reward=tuple(ways.values()), terminations=FAILURES, time_limit_s=None)


PLAY_TASK: Final = _play_task(_TARGET)
"""The task `target`, without an end but failure: what is observed, and what a decision does, is the
same, so that its policies fit."""

ENDLESS_TASK: Final = replace(
    PLAY_TASK, terminations=tuple(end for end in FAILURES if end.outcome != "left_arena")
)
"""The same on flat ground, which has no edge in play."""

ENDLESS: Final = Bounds(-1e6, 1e6, -1e6, 1e6)
"""Where targets may be on flat ground, mm: 1 km is more than a fly walks in a day."""

INTERVAL_S: Final = cast(float, PLAY_TASK.decision_interval_s)
"""How long a decision is held, s."""

BY_HAND: Final = "by hand"
PURSUIT: Final = "pursuit"


def pilots(given: str | None = None) -> dict[str, Policy]:
    """Make the policies that can steer to a target, by name.

    They are `PURSUIT`, those that come with flyrl and learned that, and the one that is given.

    Parameters
    ----------
    given
        Name of one of these, a policy file, or a run folder.

    Raises
    ------
    ValueError
        What is given is missing, is no policy, or one that cannot steer here.
    """
    found: dict[str, Policy] = {PURSUIT: FIXED[PURSUIT].make(PLAY_TASK)}
    for name, file in named_policies().items():
        policy = LearnedPolicy(load_bundle(file))
        if policy.bundle.env["task"]["name"] == PLAY_TASK.name and _misfit(policy) is None:
            found[name] = policy
    if given is not None and given not in found:
        names = ", ".join(found)
        try:
            policy = LearnedPolicy(load_bundle(given))
        except PolicyFileError as error:
            raise PolicyFileError(
                f"policy must be a file, a run folder or one of {names}; {error}"
            ) from error
        misfit = _misfit(policy)
        if misfit is not None:
            raise PolicyFileError(f"policy {given!r} cannot steer here ({names} can): {misfit}")
        found[pilot_name(given)] = policy
    return found


def pilot_name(given: str) -> str:
    """Name under which a policy that is given stands among the pilots."""
    return given if given == PURSUIT else policy_name(policy_file(given)) or given


def _misfit(policy: LearnedPolicy) -> str | None:
    """Reason why a policy does not fit; None if it does."""
    try:
        policy.check_task(PLAY_TASK)
    except PolicyFileError as error:
        return str(error)
    task = policy.bundle.env.get("task")
    interval = task.get("decision_interval") if isinstance(task, Mapping) else None
    if interval is not None and interval != INTERVAL_S:
        return f"it decides every {interval} s; it must be {INTERVAL_S} s"
    return None
