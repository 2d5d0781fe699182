"""Walks of one fly: recorded, as a table, and filmed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final, cast

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid

from flyrl.anatomy import JOINTS, LEGS
from flyrl.controllers.controller import NUM_JOINTS, NUM_LEGS, Command
from flyrl.controllers.gait_log import STANCE_SPEED
from flyrl.envs.bodies import LARGEST_SIDE
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.files import write_bytes
from flyrl.front.recordings import TORQUES, save_table
from flyrl.report.close_up import SHOWN_JOINTS, WalkFigure, walk_figure
from flyrl.report.video import FLY_PACE, FPS, encode
from flyrl.simulation.flies import FlyState
from flyrl.simulation.marks import Overlay
from flyrl.simulation.rendering import Camera, FlyRenderer
from flyrl.tasks import RUNNING, TaskState
from flyrl.tasks.hybrid_turning import thorax
from flyrl.terrains import Ball
from flyrl.validation import (
    FloatArray,
    at_least,
    float_array,
    one_of,
    positive,
    whole_number,
    within,
)

Drive = ArrayLike | Callable[[float, Mapping[str, NDArray[np.float32]]], ArrayLike]
"""A pair (left, right), or a function of the time, s, and the observation that returns one."""

_BODY: Final = (
    *(f"{axis}_mm" for axis in "xyz"),
    *(f"v{axis}_mm_s" for axis in "xyz"),
    *(f"{angle}_rad" for angle in ("yaw", "pitch", "roll")),
)
"""Columns of the thorax."""


def walk(
    controller: Any = None,
    drive: Drive | None = None,
    *,
    terrain: Any = "flat",
    seconds: float | None = None,
    every: float = 1e-3,
    seed: int = 0,
    physics: Any = None,
    body: Any = None,
    joints: ArrayLike | None = None,
    adhesion: ArrayLike | None = None,
    rate_hz: float | None = None,
) -> Walk:
    """Let a fly walk, and record it.

    Parameters
    ----------
    controller, terrain, physics, body
        As in `EnvConfig`.
    drive
        A pair (left, right), held; or a function of the time, s, and the observation (that of
        `hybrid_turning`) that returns one, which is clipped to its range. None is (1, 1).
    seconds
        Simulated time, up to the first sample that reaches it; None is 1.
    every
        Time between two samples, and two calls of a function of the drive, s; as near as whole
        physics steps allow. From a physics step up to the time of the walk.
    seed
        Of the episode: where the fly starts, and in which phase.
    joints
        A recording to be replayed instead, with the controller `joints`: angles, rad, (T, 42),
        ordered as `flyrl.anatomy.JOINTS`, resampled linearly to the physics step. It goes without
        `controller`, `drive` and `seconds`.
    adhesion
        1 where a leg grips, (T, 6), with `joints`; None: all legs grip. Holds until the next one.
    rate_hz
        Samples per second of the recording.

    Returns
    -------
    The walk, as far as it came: a fall or leaving the ground ends it.

    Raises
    ------
    ValueError
        A value that is not allowed.
    """
    scene = {"terrain": terrain, "physics": physics, "body": body}
    if joints is None:
        if adhesion is not None or rate_hz is not None:
            raise ValueError("adhesion and rate_hz go with joints, a recording; got no joints")
        config = EnvConfig("hybrid_turning", controller=controller, **scene)
        timestep = config.scene.physics.timestep
        command = config.fly_scene.controller.command
        commands = _driven((1.0, 1.0) if drive is None else drive, command)
        seconds = at_least("seconds", 1.0 if seconds is None else seconds, timestep)
        num_steps = round(seconds / timestep)
    else:
        for name, given in (("controller", controller), ("drive", drive), ("seconds", seconds)):
            if given is not None:
                raise ValueError(f"{name} must not be given with joints, got {given!r:.60}")
        config = EnvConfig("joints_box", **scene)
        timestep = config.scene.physics.timestep
        commands, num_steps = _replay(joints, adhesion, rate_hz, timestep)
        seconds = num_steps * timestep
    within("every", every, timestep, seconds)
    return _record(config, commands, num_steps, every, seed)


Commands = Callable[[int, float, Any], FloatArray]
"""Command at a physics step, a time (s) and an observation, (k,)."""


def _driven(drive: Drive, command: Command) -> Commands:
    if callable(drive):
        return lambda step, time_s, seen: _checked(drive(time_s, seen), command, is_clipped=True)
    held = _checked(drive, command)
    return lambda step, time_s, seen: held


def _checked(given: Any, command: Command, *, is_clipped: bool = False) -> FloatArray:
    """Drive as an array; that of a function may leave its range, to which the task clips it."""
    low, high = np.array(command.low), np.array(command.high)
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.array(np.nan)
    is_drive = values.shape == low.shape and np.isfinite(values).all()
    if is_drive and (is_clipped or ((low <= values) & (values <= high)).all()):
        return values
    ranges = zip(*command, strict=True)
    allowed = ", ".join(f"{name} from {least:g} to {most:g}" for name, least, most in ranges)
    raise ValueError(f"drive must be {low.size} numbers ({allowed:.100}), got {given!r:.60}")


def _replay(
    joints: ArrayLike, adhesion: ArrayLike | None, rate_hz: float | None, timestep: float
) -> tuple[Commands, int]:
    """Commands of a recording, and how many physics steps it lasts."""
    if rate_hz is None:
        raise ValueError("rate_hz must say how many samples per second joints has, got None")
    rate = positive("rate_hz", rate_hz)
    count = len(np.atleast_2d(joints))
    if not count:
        raise ValueError(
            f"joints must hold at least one sample, (T, 42), got shape {np.shape(joints)}"
        )
    angles = float_array("joints", joints, (count, NUM_JOINTS))
    grips = np.ones((count, NUM_LEGS)) if adhesion is None else adhesion
    grips = float_array("adhesion", grips, (count, NUM_LEGS), minimum=0.0, maximum=1.0)

    def command(step: int, time_s: float, seen: Any) -> FloatArray:
        place = min(step * timestep * rate, count - 1.0)
        before = int(place)
        share = place - before
        after = min(before + 1, count - 1)
        pose = (1.0 - share) * angles[before] + share * angles[after]
        return np.concatenate([pose, grips[before]])

    return command, max(1, round((count - 1) / rate / timestep))


def _record(config: EnvConfig, commands: Commands, num_steps: int, every: float, seed: int) -> Walk:
    timestep = config.scene.physics.timestep
    per_sample = max(1, round(every / timestep))
    # a recording moves at every physics step, a drive at every sample
    per_decision = 1 if config.resolved_task.name == "joints_box" else per_sample
    env = BatchedEnv(replace(config, decision_interval=per_decision * timestep), 1, 1)
    observation = env.reset(seeds=[seed])
    states, rows, outcome = [env.flies.state()], [env.flies.integration_state()[0]], RUNNING
    for step in range(0, num_steps, per_decision):
        seen = {name: values[0] for name, values in dict(observation).items()}
        transition = env.step(commands(step, step * timestep, seen)[None])
        observation = transition.observation
        if (step + per_decision) % per_sample == 0:
            states.append(env.flies.state())
            rows.append(env.flies.integration_state()[0])
        if transition.done[0]:
            outcome = str(transition.outcome[0])
            break
    return Walk(env, states, np.array(rows), outcome)


@dataclass(frozen=True)
class Walk:
    """A recorded walk of one fly.

    Attributes
    ----------
    env
        What simulated it.
    states
        The fly at every sample, the first at its start.
    rows
        MuJoCo's integration state at every sample, (T, size).
    outcome
        "running", or how the walk ended early: "fall", "left_arena" or "unstable".
    """

    env: BatchedEnv
    states: list[FlyState]
    rows: FloatArray
    outcome: str

    def frame(self) -> pd.DataFrame:
        """The walk as a table, a row per sample.

        Columns: `time_s`; of the thorax `x_mm`, `y_mm`, `z_mm`, its velocity `vx_mm_s` and so on,
        `yaw_rad`, `pitch_rad`, `roll_rad`; the command by its names; of every joint its angle,
        rad, by its name, and `torque_…`, µN·mm; of every leg `phase_…`, `magnitude_…`,
        `adhesion_…`, `stance_…` (on the ground, and its tip at rest: hind legs brush the ground
        as they swing), `retracts_…` and `stumbles_…` (1 while a reflex corrects it), and the
        ground's force `fx_…`, `fy_…`, `fz_…`, µN, world frame. Of a tethered fly on a ball also its
        fictive way: `fictive_x_mm`, `fictive_y_mm`, `fictive_yaw_rad`, from 0 on.
        """
        fly = _stacked(self.states)
        body = thorax(cast(TaskState, SimpleNamespace(fly=fly)))[:, :3].reshape(-1, 9)
        forces = fly.contact_forces_w.reshape(len(body), NUM_LEGS, -1, 3).sum(axis=2)
        scene = self.env.config.fly_scene
        is_replayed = self.env.task.name == "joints_box"
        names = () if is_replayed else scene.controller.command.names
        legs = {
            "phase": fly.phases,
            "magnitude": fly.magnitudes,
            "adhesion": fly.adhesion,
            "stance": _stance(fly),
            "retracts": (fly.retraction > 0.0).astype(np.float64),
            "stumbles": (fly.stumbling > 0.0).astype(np.float64),
            **{f"f{axis}": forces[:, :, i] for i, axis in enumerate("xyz")},
        }
        columns: dict[str, FloatArray] = {
            "time_s": fly.time,
            **dict(zip(_BODY, body.T, strict=True)),
            **(_fictive_way(fly) if isinstance(scene.terrain, Ball) else {}),
            **{f"command_{name}": fly.command[:, i] for i, name in enumerate(names)},
            **dict(zip(JOINTS, fly.joint_angles.T, strict=True)),
            **dict(zip(TORQUES, fly.actuator_torques.T, strict=True)),
        }
        for i, leg in enumerate(LEGS):
            columns |= {f"{name}_{leg}": values[:, i] for name, values in legs.items()}
        return pd.DataFrame(columns)

    def plot(self, joints: Sequence[str] = SHOWN_JOINTS) -> WalkFigure:
        """Draw speed, angles of some joints, and which legs stand, over the time.

        Parameters
        ----------
        joints
            Names in `flyrl.anatomy.JOINTS`; none leaves their panel out.

        Returns
        -------
        A figure of matplotlib, for `savefig`; a notebook shows it.

        Raises
        ------
        ValueError
            There is no such joint.
        """
        return walk_figure(self.frame(), joints)

    def save(self, path: str | Path) -> Path:
        """Write the table to a file: ".csv", ".npz", ".parquet" or ".nwb", by its suffix.

        Parameters
        ----------
        path
            See `flyrl.front.recordings.save_table` for what each holds.

        Raises
        ------
        ValueError
            Another suffix; or a package that it takes is missing, the message says how to get it.
        OSError
            The file cannot be written.
        """
        scene = self.env.config.fly_scene
        about = f"{scene.controller.name} controller on {scene.terrain.label} ground"
        return save_table(path, self.frame(), about)

    def _repr_html_(self) -> str:
        return self.frame().head().to_html() + f"<p>{len(self.rows)} samples; {self.outcome}</p>"

    def video(
        self,
        path: str | Path,
        camera: Camera = "follow",
        size: tuple[int, int] = (640, 480),
        overlay: Overlay | None = None,
    ) -> Path:
        """Film the walk, a quarter as fast as life; return the path of the MP4.

        Parameters
        ----------
        path
            Of the file, which ends in .mp4.
        camera
            "follow", "top" or "goal".
        size
            Width and height, px, even.
        overlay
            What is drawn besides; by default the legs' grip and reflexes in colours.

        Raises
        ------
        ValueError
            A value that is not allowed.
        RenderingUnavailableError
            If no GL context can be made.
        OSError, RuntimeError
            If ffmpeg fails.
        """
        target = Path(path)
        one_of(f"suffix of {target.name!r}", target.suffix, (".mp4",))
        sides = np.atleast_1d(size).tolist()
        if len(sides) != 2 or any(whole_number("size", n, 2, LARGEST_SIDE) % 2 for n in sides):
            raise ValueError(f"size must be two even numbers, got {size}")
        flies, scene = self.env.flies, self.env.config.fly_scene
        time = np.array([state.time[0] for state in self.states])
        shown = np.searchsorted(time, np.arange(0.0, time[-1] + 1e-9, FLY_PACE.frame_s) - 1e-9)
        with closing(FlyRenderer(scene, *size, camera, overlay or Overlay())) as renderer:
            pictures = []
            for row in np.minimum(shown, len(time) - 1):
                flies.restore(self.rows[row][None])
                pictures.append(renderer.render(flies))
        write_bytes(target, encode(pictures, FPS))
        return target


def _stacked(states: list[FlyState]) -> FlyState:
    """The fly at every sample as one state, whose first axis is the sample."""
    names = [field.name for field in fields(FlyState)]
    return FlyState(
        **{name: np.concatenate([getattr(state, name) for state in states]) for name in names}
    )


def _stance(fly: FlyState) -> FloatArray:
    """1 for each leg that is on the ground with its tip at rest since the sample before, (T, 6)."""
    grounded = fly.is_grounded.copy()
    moved = np.linalg.norm(np.diff(fly.end_effectors_w[:, :, :2], axis=0), axis=2)
    grounded[1:] *= moved < STANCE_SPEED * np.diff(fly.time)[:, None]
    return grounded


def _fictive_way(fly: FlyState) -> dict[str, FloatArray]:
    """Way and yaw that the ball's turning amounts to, by the trapezoidal rule."""
    time, (forward, left, turning) = fly.time, fly.fictive_velocity_b.T
    yaw = cumulative_trapezoid(turning, time, initial=0)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return {
        "fictive_x_mm": cumulative_trapezoid(cos * forward - sin * left, time, initial=0),
        "fictive_y_mm": cumulative_trapezoid(sin * forward + cos * left, time, initial=0),
        "fictive_yaw_rad": yaw,
    }
