"""A fly on any ground, steered by hand or by a policy towards a target."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import mujoco
import numpy as np

from flyrl.envs.core import BatchedEnv
from flyrl.play.fly_panel import LEFT, RIGHT, STEERING, STOP, FlyView, fly_sections
from flyrl.play.fly_scenery import Scenery
from flyrl.play.fly_setting import CHOICES, INTERVAL_S, REACH, SWITCHES, PlayedFlyConfig
from flyrl.play.fly_steering import BY_HAND, pilot_name, pilots
from flyrl.play.fly_walk import FlyWalk
from flyrl.play.panel import Section, Setting
from flyrl.rollouts import Policy
from flyrl.tasks import DRIVE_HIGH, DRIVE_LOW, RUNNING, UNSTABLE
from flyrl.tasks.target import is_inside
from flyrl.validation import one_of, random_seed, within

KEY_STEP: Final = 0.1
"""By how much a press of an arrow key changes a drive."""

_ARROWS: Final = {"up": (1, 1), "down": (-1, -1), "left": (-1, 1), "right": (1, -1)}
"""Key -> in which way it changes the drive, left and right."""

Drive = tuple[float, float]


class PlayedFly:
    """A fly that walks as it is driven: by two sliders and the arrow keys, or by a policy.

    It walks in `PLAY_TASK` on the engine that everything walks on, a decision per step, and the
    same settings, seed and actions give the same bits. A fly that fell over, left the arena or blew
    up stays as it is, with the reason on the panel, until it is reset.

    A slider or an arrow key takes the steering from a policy, at the drive that is on. Another leg
    controller, physics preset, reflex or adhesion leaves the fly where it is, in the middle of its
    episode; another body or terrain starts the episode of the same seed, as does any change after
    the end. Who steers, and the drive, stay. A policy that has reached the target gets another one.
    On flat ground there is no edge.

    Parameters
    ----------
    config
        What it is made of at the start.

    Attributes
    ----------
    config
        What it is made of now; its `policy` and `seed` are those of the start.
    steering
        "by hand", or the name of the policy.
    title, keys, interval_s, time_s, seed, model, data, camera
        See `Playable`. The model is another object after a change of body or terrain.

    Raises
    ------
    ValueError
        If the policy cannot be had, or cannot steer here.
    """

    def __init__(self, config: PlayedFlyConfig | None = None) -> None:
        config = config or PlayedFlyConfig()
        self.title = "fly"
        self.keys: Mapping[str, str] = {
            "up": "faster",
            "down": "slower",
            "left": "turn left",
            "right": "turn right",
            "s": "stop",
            "click": "move the target",
        }
        self.interval_s = INTERVAL_S
        self.config = config
        self.seed = config.seed
        self._pilots = pilots(config.policy)
        self._policy: Policy | None = None
        self._memory: Any = None
        self._drive: Drive = (0.0, 0.0)
        self._steer(BY_HAND if config.policy is None else pilot_name(config.policy))
        self._walk = FlyWalk(config)
        self._set(self._walk, Scenery(self._walk.env.config.fly_scene))

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset, s."""
        return float(self._walk.state.time[0])

    @property
    def env(self) -> BatchedEnv:
        """What simulates the fly; another one after a change of the scene."""
        return self._walk.env

    @property
    def outcome(self) -> str:
        """How the episode has ended: "fall", "left_arena" or "unstable"; before, "running"."""
        return self._walk.outcome

    def step(self, number: int) -> None:
        """Simulate a number of decisions, or as many as there are before the end."""
        for _ in range(number):
            if self.outcome != RUNNING:
                break
            if self._policy is not None:
                self._drive = self._decision(self._policy)
            self._walk.decide(self._drive)
            if self._policy is not None and self._walk.distance_mm < REACH:
                self._walk.draw_goal()
        self._show()

    def reset(self, seed: int) -> None:
        """Start the episode of a seed, without drive; who steers stays.

        Raises
        ------
        ValueError
            If it is no seed.
        """
        self.seed = random_seed(seed)
        self._drive, self._memory = (0.0, 0.0), None
        self._walk.reset(self.seed)
        self._show()

    def press(self, key: str) -> None:
        """Change the drive, by hand from now on: arrows by `KEY_STEP`, "s" to a halt."""
        if one_of("key", key, (*_ARROWS, "s")) == "s":
            self._stop()
            return
        left, right = _ARROWS[key]
        before_left, before_right = self._drive
        self._drive_by_hand(before_left + left * KEY_STEP, before_right + right * KEY_STEP)

    def change(self, name: str, value: Setting) -> None:
        """Set a widget.

        Raises
        ------
        ValueError
            If there is none of the name, or the value is not allowed; everything is as before then.
        """
        one_of("widget", name, (LEFT, RIGHT, STEERING, STOP, *CHOICES, *SWITCHES))
        if name == STOP:
            self._stop()
        elif name == STEERING:
            self._steer(str(value))
        elif name in (LEFT, RIGHT):
            drive = within(f"drive, {name}", value, DRIVE_LOW, DRIVE_HIGH)  # type: ignore[arg-type]
            left, right = self._drive
            self._drive_by_hand(*((drive, right) if name == LEFT else (left, drive)))
        else:
            self._remake(replace(self.config, **{name: value}))  # type: ignore[arg-type]

    def point(self, x_w: float, y_w: float) -> None:
        """Move the target, mm; nothing happens beside the terrain, or too close to its edge."""
        if is_inside(x_w, y_w, self._walk.bounds):
            self._walk.move_target(x_w, y_w)
            self._show()

    def relax(self) -> None:
        """Let go of the drive, if a person has it; a policy steers on when the page is back."""
        if self._policy is None:
            self._stop()

    def _stop(self) -> None:
        """Steer by hand, both drives at 0."""
        self._steer(BY_HAND)
        self._drive = (0.0, 0.0)

    @property
    def hint(self) -> str:
        """Keys that matter now."""
        if self.outcome != RUNNING:
            return "Reset starts again"
        if self.config.controller == "rule_based":
            return "rule-based legs walk straight ahead, whoever steers"
        if self._policy is None:
            return "arrow keys: steer     s: stop"
        return f"{self.steering} steers to the target     arrow keys: take over"

    def sections(self) -> tuple[Section, ...]:
        """How it fares, steering, legs, scene, reward, muscles."""
        walk, state = self._walk, self._walk.state
        return fly_sections(
            FlyView(
                config=self.config,
                steering=self.steering,
                pilots=(BY_HAND, *self._pilots),
                drive=_rounded(self._drive),
                speed_mm_s=walk.speed_mm_s,
                distance_mm=walk.distance_mm,
                outcome=walk.outcome,
                phases=state.phases[0],
                magnitudes=state.magnitudes[0],
                retraction=state.retraction[0],
                stumbling=state.stumbling[0],
                gait=walk.gait,
                rewards=walk.rewards,
                returns=walk.returns,
                tensions=state.muscle_tensions[0],
            )
        )

    def figures(self) -> dict[str, float | str | bool]:
        """Place to 0.1 mm, heading in deg to the left of +x, drives, target, and all settings."""
        state, config = self._walk.state, self.config
        x, y, _ = state.position_w[0]
        target_x, target_y = self._walk.goal
        left, right = _rounded(self._drive)
        return {
            "x_mm": _tenths(x),
            "y_mm": _tenths(y),
            "heading_deg": round(float(np.degrees(state.yaw[0]))),
            "drive_left": left,
            "drive_right": right,
            "steering": self.steering,
            "outcome": self.outcome,
            "target_x_mm": _tenths(target_x),
            "target_y_mm": _tenths(target_y),
            **{key: getattr(config, key) for key in (*CHOICES, *SWITCHES)},
            "seed": self.seed,
        }

    def _decision(self, policy: Policy) -> Drive:
        """Drive that a policy asks for."""
        action, self._memory = policy.predict(self._walk.observe(), self._memory)
        left, right = self.env.task.actions.commands(action[0])
        return float(left), float(right)

    def _drive_by_hand(self, left: float, right: float) -> None:
        self._steer(BY_HAND)
        self._drive = _rounded(np.clip((left, right), DRIVE_LOW, DRIVE_HIGH))

    def _steer(self, name: str) -> None:
        """Let somebody steer, from the drive that is on."""
        one_of(STEERING, name, (BY_HAND, *self._pilots))
        self._policy = None if name == BY_HAND else self._pilots[name]()
        self._memory = None
        self.steering = name

    def _remake(self, config: PlayedFlyConfig) -> None:
        """Build the scene anew, and only then take it."""
        if config == self.config:
            return
        walk = self._walk.changed(config, self.seed)
        looks = (config.body, config.terrain)
        is_alike = looks == (self.config.body, self.config.terrain)
        scenery = self._scenery if is_alike else Scenery(walk.env.config.fly_scene)
        self.config = config
        self._set(walk, scenery)
        if self.time_s == 0.0:
            self._memory = None

    def _set(self, walk: FlyWalk, scenery: Scenery) -> None:
        self._walk, self._scenery = walk, scenery
        self.model: mujoco.MjModel = scenery.model
        self.data: mujoco.MjData = scenery.data
        self.camera: mujoco.MjvCamera = scenery.camera
        self._show()

    def _show(self) -> None:
        # what blew up is seen as it was before
        if self.outcome != UNSTABLE:
            self._scenery.pose(self.env.flies)


def _rounded(drive: Any) -> Drive:
    """Hundredths; -0.0 becomes 0.0."""
    left, right = drive
    return round(float(left), 2) + 0.0, round(float(right), 2) + 0.0


def _tenths(value: float) -> float:
    return round(float(value), 1) + 0.0
