"""Settings of a played fly, the task that it walks in, and who can steer it there."""

from dataclasses import dataclass, replace
from typing import Annotated, Final, cast, get_args

from flyrl.bodies.fly import FLIES
from flyrl.controllers import DRIVE, Hybrid
from flyrl.controllers.controller import controller_from
from flyrl.controllers.cpg_controller import Gait, OscillatorController
from flyrl.envs.config import EnvConfig
from flyrl.policies import LearnedPolicy, load_bundle, load_policy, named_policies
from flyrl.rollouts import Policy
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.tasks import FAILURES, TASKS, RewardTerm, Task, TaskState, terms
from flyrl.tasks.task import Mask
from flyrl.terrains import KINDS, Bounds
from flyrl.validation import Within, check_fields, one_of

CHOICES: Final[dict[str, tuple[str, ...]]] = {
    "controller": ("cpg", "hybrid", "rule_based", "rule_based_steered"),
    "gait": get_args(Gait),
    "terrain": tuple(KINDS),
    "physics": FLY_PRESETS,
    "body": tuple(FLIES),
}
"""Values that the panel offers, by key of `PlayedFlyConfig`."""

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
    gait: Gait = "tripod"
    physics: str = "balanced"
    body: str = "current"
    retraction: bool = True
    stumbling: bool = True
    adhesion: bool = True
    policy: str | None = None
    seed: Annotated[int, Within(0, 2**32 - 1)] = 0

    def __post_init__(self) -> None:
        check_fields(self)
        one_of("body", self.body, FLIES)
        if controller_from(self.controller).command.names != DRIVE.names:
            raise ValueError(f"controller must be one that takes a drive, got {self.controller!r}")
        self.env()

    def env(self) -> EnvConfig:
        """The environment that the fly walks in."""
        body, controller = FLIES[self.body], controller_from(self.controller)
        if isinstance(controller, OscillatorController):
            controller = replace(controller, gait=self.gait)
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
    """The task without a time limit, which continues when the target is reached."""
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
"""`PLAY_TASK` on flat ground, which has no edge in play."""

ENDLESS: Final = Bounds(-1e6, 1e6, -1e6, 1e6)
"""Bounds of targets on flat ground, mm: 1 km is more than a fly walks in a day."""

INTERVAL_S: Final = cast(float, PLAY_TASK.decision_interval_s)
"""Decision interval, s."""

BY_HAND: Final = "by hand"


def pilots(given: str | None = None) -> dict[str, Policy]:
    """Make the policies that can steer to a target, by name.

    They are "pursuit", those that come with flyrl and learned that, and the one that is given.

    Parameters
    ----------
    given
        Name of one of these, a policy file, or a run folder.

    Raises
    ------
    ValueError
        What is given is missing, is no policy, or one that cannot steer here.
    """
    found: dict[str, Policy] = {"pursuit": load_policy("pursuit", PLAY_TASK)}
    for name in named_policies():
        bundle = load_bundle(name)
        if bundle.env["task"]["name"] == PLAY_TASK.name:
            found[name] = LearnedPolicy(bundle, PLAY_TASK)
    if given is not None and given not in found:
        names = ", ".join(found)
        try:
            found[given] = policy = LearnedPolicy(load_bundle(given), PLAY_TASK)
            interval = policy.bundle.env.get("task", {}).get("decision_interval", INTERVAL_S)
            if interval != INTERVAL_S:
                raise ValueError(f"it decides every {interval} s; it must be {INTERVAL_S} s")
        except ValueError as error:
            raise ValueError(
                f"policy must be a file, a run folder or one of {names} that can steer to a "
                f"target, got {given!r}: {error}"
            ) from error
    return found
