"""A fly on any ground, steered by hand or by a policy towards a target."""

from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import LEG_DOFS, LEGS
from flyrl.controllers import Controller, Hybrid
from flyrl.controllers.cpg_controller import OscillatorController
from flyrl.controllers.gait_log import unpack
from flyrl.envs.core import BatchedEnv
from flyrl.play.fly_setting import (
    BY_HAND,
    CHOICES,
    DISTANCE,
    ENDLESS,
    INTERVAL_S,
    REACH,
    SWITCHES,
    PlayedFlyConfig,
    pilots,
)
from flyrl.play.session import Playable
from flyrl.simulation.flies import SHOWN, FlyState
from flyrl.simulation.scene import build_scene
from flyrl.tasks import DRIVE_HIGH, DRIVE_LOW, RUNNING, UNSTABLE
from flyrl.tasks.episode import EDGE_MARGIN, is_inside
from flyrl.tasks.target import draw_target
from flyrl.tasks.terms import CORRECTION_CAP, goal_distance
from flyrl.terrains import Bounds, Flat
from flyrl.terrains.geoms import FLAT_GROUND
from flyrl.validation import FloatArray, one_of, random_seed, within

if TYPE_CHECKING:
    from flyrl.play.panel import Panel, Setting

KEY_STEP: Final = 0.1
"""Change of a drive by a press of an arrow key."""

GAIT_PLACES: Final = 100
"""Moments of the latest second for which the panel shows which legs stand: two per decision."""

_SPEED_DECISIONS: Final = 10
"""Decisions over which the speed is averaged: it sways with every step that the fly takes."""

_KEY_SIGNS: Final = {"up": (1, 1), "down": (-1, -1), "left": (-1, 1), "right": (1, -1), "s": (0, 0)}
"""Key -> signs with which it changes the drive, left and right; "s" stops."""

SIDES: Final = ("drive_left", "drive_right")
STEERING: Final = "steering"
"""Names of the controls that steer; those that make another scene are keys of `PlayedFlyConfig`."""

_GOALS: Final = 20_261_123
"""Sets the generator of later targets apart from the episode's, which has the same seed."""

_OSCILLATORS: Final = ("phases", "magnitudes", *OscillatorController.further_state)
"""State that a controller with oscillators takes over from another, to continue in its stride."""


class PlayedFly(Playable):
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
        Settings at the start.

    Attributes
    ----------
    config
        Settings now; its `policy` and `seed` are those of the start.
    env
        The simulation; another one after a change of the scene.
    steering
        "by hand", or the name of the policy.
    outcome
        "running", or how the episode has ended: "fall", "left_arena" or "unstable".

    Raises
    ------
    ValueError
        If the policy cannot be had, or cannot steer here.
    """

    title = "fly"
    keys: Mapping[str, str] = {
        "up": "faster",
        "down": "slower",
        "left": "turn left",
        "right": "turn right",
        "s": "stop",
        "click": "move the target",
    }
    interval_s = INTERVAL_S
    outcome: str
    _memory: Any
    _goals: np.random.Generator

    def __init__(self, config: PlayedFlyConfig | None = None) -> None:
        self.config = config or PlayedFlyConfig()
        self._choices = {
            key: tuple(dict.fromkeys((*known, getattr(self.config, key))))
            for key, known in CHOICES.items()
        }
        self._pilots = pilots(self.config.policy)
        self._steer(self.config.policy or BY_HAND)
        self.env = BatchedEnv(self.config.env(), num_envs=1, num_threads=1)
        self._build_scenery()
        self.reset(self.config.seed)

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset, s."""
        return float(self.env.state.time[0])

    @property
    def hint(self) -> str:
        """Keys that matter now."""
        if self.outcome != RUNNING:
            return f"The walk has ended: {self.outcome}. Reset starts again."
        if not self._legs.follows_command:
            return f"The controller {self._legs.name} ignores the drive."
        if self._policy is None:
            return "arrow keys: steer     s: stop"
        return f"{self.steering} steers to the target     arrow keys: take over"

    def step(self) -> None:
        """Simulate a decision; nothing after the end."""
        env, flies = self.env, self.env.flies
        if self.outcome != RUNNING:
            return
        if self._policy is not None:
            action, self._memory = self._policy.predict(env.observe(), self._memory)
            self._drive = np.array(env.task.actions.commands(action[0]), dtype=np.float64)
        first = int(cast(NDArray[np.void], flies.gait_logs)["num_samples"][0])
        self.outcome = str(env.step(env.task.actions.of(self._drive[None])).outcome[0])
        stance = unpack(flies.gait_samples(0, first))["stance"]
        if len(stance):
            self._stands += [stance[len(stance) // 2], stance[-1]]
        self._trail.append(self._state.position_w[0, :2])
        if self._policy is not None and self._distance_mm < REACH:
            x, y = self._trail[-1].tolist()
            env.set_goals(np.array([draw_target(self._goals, (x, y), self._bounds, DISTANCE)]))
        self._pose()

    def reset(self, seed: int) -> None:
        """Start the episode of a seed, without drive; who steers stays.

        Raises
        ------
        ValueError
            If it is no seed.
        """
        self.seed = random_seed(seed)
        self._drive = np.zeros(2)
        self._start()

    def change(self, name: str, value: "Setting") -> None:
        """Set a control, press a key, or move the target to where a click is, x and y in mm.

        The target stays if that is beside the terrain, or too close to its edge.

        Raises
        ------
        ValueError
            If the value is not allowed; everything is as before then.
        """
        drive = self._drive.copy()
        if name == "s":
            self._drive_by_hand((0.0, 0.0))
        elif name in _KEY_SIGNS:
            self._drive_by_hand(drive + KEY_STEP * np.array(_KEY_SIGNS[name]))
        elif name in SIDES:
            drive[SIDES.index(name)] = within(name, cast(float, value), DRIVE_LOW, DRIVE_HIGH)
            self._drive_by_hand(drive)
        elif name == STEERING:
            self._steer(one_of(STEERING, str(value), (BY_HAND, *self._pilots)))
        elif name == "click":
            x_w, y_w = cast(tuple[float, float], value)
            if is_inside(x_w, y_w, self._bounds, EDGE_MARGIN):
                self.env.set_goals(np.array([[x_w, y_w]]))
                self._pose()
        else:
            self._remake(replace(self.config, **{name: value}))  # type: ignore[arg-type]

    def relax(self) -> None:
        """Let go of the drive, if a person has it; a policy steers on when the page is back."""
        if self._policy is None:
            self._drive_by_hand((0.0, 0.0))

    def draw(self, panel: "Panel") -> None:
        """Draw speed and distance, steering, legs, scene, reward, and muscles if it has any."""
        if panel.section("Fly"):
            moved = float(np.linalg.norm(self._trail[-1] - self._trail[0]))
            speed = moved / (max(len(self._trail) - 1, 1) * INTERVAL_S)
            panel.values({"speed, mm/s": speed, "to the target, mm": self._distance_mm})
        if panel.section("Steering"):
            panel.choice(STEERING, "who steers", (BY_HAND, *self._pilots), self.steering)
            for name, drive in zip(SIDES, self._drive.round(2).tolist(), strict=True):
                panel.slider(name, name.replace("_", ", "), DRIVE_LOW, DRIVE_HIGH, drive)
            panel.buttons({"s": "Stop"})
        if panel.section("Legs"):
            self._draw_legs(panel)
        if panel.section("Scene"):
            for key, options in self._choices.items():
                panel.choice(key, key, options, getattr(self.config, key))
            for key in SWITCHES:
                panel.switch(key, key, getattr(self.config, key))
        if panel.section("Reward"):
            state = self.env.task_state()
            for title, value_of in (
                ("of the last decision", lambda term: term.compute(state)),
                ("since the start", lambda term: state.totals[term.name]),
            ):
                rewards = {
                    term.name: term.weight * float(value_of(term)[0])
                    for term in self.env.task.reward
                }
                panel.text(title)
                panel.values({**rewards, "sum": sum(rewards.values())})
        if (tensions := self._state.muscle_tensions[0]).size:
            _draw_muscles(panel, tensions)

    def _draw_legs(self, panel: "Panel") -> None:
        """Draw phases, which legs stood in the latest second, and reflexes."""
        fly, legs = self._state, self._legs
        most = DRIVE_HIGH if legs.follows_command else 1.0
        panel.text(f"phases of the legs, magnitudes up to {most:g}")
        panel.dials(LEGS, fly.phases[0], fly.magnitudes[0] / most)
        panel.text("legs that stand")
        stands = np.array(self._stands, dtype=bool)
        panel.raster(LEGS, stands.reshape(-1, len(LEGS)).T, GAIT_PLACES, 1.0)
        if isinstance(legs, Hybrid):
            for name in ("retraction", "stumbling"):
                panel.text(f"{name}, up to {CORRECTION_CAP:g}")
                shares = getattr(fly, name)[0] / CORRECTION_CAP
                panel.bars(dict(zip(LEGS, shares.tolist(), strict=True)))

    def figures(self) -> dict[str, float | str | bool]:
        """Place to 0.1 mm, heading in deg to the left of +x, drives, target, and all settings."""
        names = ("x_mm", "y_mm", "target_x_mm", "target_y_mm", *SIDES)
        position_w, goal = self._state.position_w[0, :2], self.env.task_state().goal[0]
        # -0.0 becomes 0.0
        places = np.concatenate([position_w.round(1), goal.round(1), self._drive.round(2)]) + 0.0
        return {
            **dict(zip(names, places.tolist(), strict=True)),
            "heading_deg": round(float(np.degrees(self._state.yaw[0]))),
            "steering": self.steering,
            "outcome": self.outcome,
            **{key: getattr(self.config, key) for key in (*CHOICES, *SWITCHES)},
            "seed": self.seed,
        }

    @property
    def _state(self) -> FlyState:
        return cast(FlyState, self.env.state)

    @property
    def _legs(self) -> Controller:
        return cast(Controller, self.env.config.fly_scene.controller)

    @property
    def _distance_mm(self) -> float:
        """Horizontal distance from the thorax to the target, mm."""
        goals = self.env.task_state().goal
        return float(goal_distance(self._state.position_w, goals)[0])

    @property
    def _bounds(self) -> Bounds:
        """Extent of the ground, mm."""
        terrain = self.env.config.scene.terrain
        return ENDLESS if isinstance(terrain, Flat) else terrain.bounds

    def _start(self) -> None:
        """Start the episode of the seed."""
        self.env.reset(seeds=[self.seed])
        self.outcome, self._memory = RUNNING, None
        self._goals = np.random.default_rng([_GOALS, self.seed])
        self._stands: deque[NDArray[np.bool_]] = deque(maxlen=GAIT_PLACES)
        self._trail: deque[FloatArray] = deque(maxlen=1 + _SPEED_DECISIONS)
        self._trail.append(self._state.position_w[0, :2])
        self._pose()

    def _drive_by_hand(self, drive: Any) -> None:
        self._steer(BY_HAND)
        # -0.0 becomes 0.0
        self._drive = np.clip(drive, DRIVE_LOW, DRIVE_HIGH).round(2) + 0.0

    def _steer(self, name: str) -> None:
        """Let somebody steer, from the drive that is on."""
        self.steering, self._policy, self._memory = name, self._pilots.get(name), None

    def _remake(self, config: PlayedFlyConfig) -> None:
        """Build the scene anew, and only then take it."""
        if config == self.config:
            return
        env = BatchedEnv(config.env(), num_envs=1, num_threads=1)
        env.reset(seeds=[self.seed])
        is_same_place = (config.body, config.terrain) == (self.config.body, self.config.terrain)
        before, self.env, self.config = self.env, env, config
        if not is_same_place:
            self._build_scenery()
        if is_same_place and self.outcome == RUNNING:
            self._resume_from(before)
        else:
            self._start()

    def _resume_from(self, before: BatchedEnv) -> None:
        """Take over everything from an environment of the same body on the same ground."""
        snapshot = before.snapshot()
        old, new = before.config.fly_scene.controller, self._legs
        if old != new:
            fresh = new.initial_state(self.seed)
            have_both = all(isinstance(each, OscillatorController) for each in (old, new))
            kept = _OSCILLATORS if have_both else ()
            rows = self.env.flies.rows_after(before.flies, fresh, kept)
            snapshot["simulation"]["physics"] = rows
        self.env.restore(snapshot)
        now = self.env.flies.state()
        self.env.state = replace(self._state, **{name: getattr(now, name) for name in SHOWN})
        self._pose()

    def _build_scenery(self) -> None:
        """Compile the scene that is drawn, with the meshes, which have few triangles."""
        config = self.env.config.fly_scene
        self.model = build_scene(config, visual=True).model
        # without its mark the model is not taken for a fly that walks, whoever steps it
        self.model.numeric_data[0] = 0.0
        if isinstance(config.terrain, Flat):
            self.model.geom(FLAT_GROUND).size[:2] = 0.0  # drawn without an end
        self.data = mujoco.MjData(self.model)
        self.camera = mujoco.MjvCamera()
        self.camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        self.camera.trackbodyid = self.model.body("Thorax").id
        # from behind a fly that walks along +x, from its right and from above; degrees and mm
        self.camera.azimuth, self.camera.elevation, self.camera.distance = 25.0, -28.0, 9.0

    def _pose(self) -> None:
        """Pose the scenery; a fly that blew up is seen as it was before."""
        if self.outcome != UNSTABLE:
            self.env.flies.copy_into(0, self.model, self.data)
            self.camera.lookat[:] = self.data.qpos[:3]


def _draw_muscles(panel: "Panel", tensions: FloatArray) -> None:
    """Draw the mean tension (84,) of each leg, and a section per leg with all its muscles."""
    legs = tensions.reshape(len(LEGS), 2 * len(LEG_DOFS))
    if panel.section("Muscles"):
        panel.bars(dict(zip(LEGS, legs.mean(axis=1).tolist(), strict=True)))
    labels = [f"{dof} {way}" for dof in LEG_DOFS for way in "+-"]
    for leg, row in zip(LEGS, legs.tolist(), strict=True):
        if panel.section(f"Muscles of {leg}", is_open=False):
            panel.bars(dict(zip(labels, row, strict=True)))
