"""Videos of the episodes that were evaluated, walked again to the same bits."""

from __future__ import annotations

import itertools
import os
import sys
import tempfile
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

import imageio_ffmpeg
import numpy as np

from flyrl.envs.bodies import Bodies, View, make_renderer
from flyrl.envs.core import BatchedEnv
from flyrl.evaluation import Entrant, EvaluationConfig
from flyrl.evaluation.contrast import parted
from flyrl.evaluation.episodes import Json
from flyrl.progress import progress_bar
from flyrl.report import captions
from flyrl.simulation.batch import Batch
from flyrl.simulation.marks import FORCE_PER_MM, Overlay
from flyrl.simulation.rendering import Picture, RenderingUnavailableError, can_draw_in_threads
from flyrl.tasks import RUNNING, Episode
from flyrl.terrains import Terrain

WIDTH: Final = 480
HEIGHT: Final = 360
FPS: Final = 25


class Pace(NamedTuple):
    """Pace of a film.

    Attributes
    ----------
    frame_s
        Simulated time between two frames, s.
    longest_s
        Simulated time that is filmed at most, s.
    """

    frame_s: float
    longest_s: float


FLY_PACE: Final = Pace(0.01, 2.0)
"""A quarter of real time, in which single steps can be seen."""

WORM_PACE: Final = Pace(1 / FPS, 5.0)
"""Real time."""


FILMED: Final = View("goal", Overlay(), WIDTH, HEIGHT)
"""Camera, overlay and size of videos."""

HOLD_FRAMES: Final = 20
"""Frames for which the end stands still, so that it can be read."""

BAR_WIDTH: Final = 120
BAR_HEIGHT: Final = 7
"""Size of a worm's tension bars, px."""

_KEYFRAME_EVERY: Final = 20
"""Pictures; a browser that jumps into a video has no more than these to decode."""

MAX_BYTES: Final = 2 * 10**6
"""Largest size of one video."""

ALL_BYTES: Final = 4 * 10**6
"""Largest size of all videos of a report; base64 adds a third, which leaves room below 8 MB."""

_MOST_AT_A_TIME: Final = 4
"""Entrants that are filmed at once: the pictures of a film take 100 MB until it is encoded."""

_CRFS: Final = (25, 31, 37, 43, 49)
"""x264's quality, finest first; a video that is too large is tried again with the next."""


@dataclass(frozen=True)
class Video:
    """A video of one episode, to stand in the report.

    Attributes
    ----------
    controller, terrain
        Who walked, and where.
    episode
        Index of the episode.
    outcome
        How it ended.
    num_frames
        How many pictures it has, with those in which the end stands still.
    frame_s
        Simulated time between two of the others, s.
    mp4
        The file: H.264, yuv420p.
    poster
        Its last picture, a JPEG file, to be shown until it plays.
    """

    controller: str
    terrain: str
    episode: int
    outcome: str
    num_frames: int
    frame_s: float
    mp4: bytes
    poster: bytes

    @property
    def shown_s(self) -> float:
        """Simulated time that it shows, s."""
        return (self.num_frames - 1 - HOLD_FRAMES) * self.frame_s


def record_videos(
    config: EvaluationConfig,
    entrants: Sequence[Entrant],
    missing: Collection[tuple[str, str]] = (),
    view: View = FILMED,
    chosen: Json | None = None,
) -> tuple[list[Video], str | None]:
    """Film every entrant on every terrain, on the episodes that the evaluation names.

    Of a contrast only its two are filmed. All videos together have at most `ALL_BYTES`, as far as
    the coarsest quality allows.

    Parameters
    ----------
    config
        Of the evaluation.
    entrants
        Of the evaluation.
    missing
        Entrants that raised an error, and where: names of controller and terrain.
    view
        How the videos look.
    chosen
        As in `EvaluationConfig.filmed`.

    Returns
    -------
    The videos, and a note that says why there are none. Where pictures or videos cannot be made the
    note goes to stderr as well, in one line, and nothing is raised.
    """
    filmed = config.filmed(chosen)
    pairs = {
        terrain: (each["controller"], each["reference"])
        for terrain, each in parted(chosen or {}).items()
    }
    by_entrant = [
        [
            (entrant, terrain, index)
            for terrain in config.terrain_configs
            for index in filmed[terrain.label]
            if (entrant.name, terrain.label) not in missing
            and entrant.name in pairs.get(terrain.label, (entrant.name,))
        ]
        for entrant in entrants
    ]
    count = sum(map(len, by_entrant))
    videos: list[Video] = []
    max_bytes = min(MAX_BYTES, ALL_BYTES // max(count, 1))

    def film(walks: Sequence[tuple[Entrant, Terrain, int]]) -> list[Video]:
        return [record_video(config, *walk, view, max_bytes) for walk in walks]

    threads = min(config.num_threads or os.cpu_count() or 1, _MOST_AT_A_TIME)
    try:
        imageio_ffmpeg.get_ffmpeg_exe()
        with (
            progress_bar(
                count, is_shown=config.progress, unit=" videos", description="filming"
            ) as bar,
            # nobody's own code is called by two threads at once, unless it is in two entrants
            ThreadPoolExecutor(threads if can_draw_in_threads() else 1) as pool,
        ):
            for films in pool.map(film, by_entrant):
                videos += films
                bar.update(len(films))
    except (RenderingUnavailableError, RuntimeError, OSError) as error:
        note = f"Videos are left out: {' '.join(str(error).split())}"
        print(note, file=sys.stderr)
        return [], note
    return videos, None


def record_video(
    config: EvaluationConfig,
    entrant: Entrant,
    terrain: Terrain,
    index: int = 0,
    view: View = FILMED,
    max_bytes: int = MAX_BYTES,
) -> Video:
    """Film one entrant on one episode: its beginning (see `Pace`), and how it ends.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    """
    env = BatchedEnv(entrant.env(config, terrain), 1, num_threads=1)
    episode = config.draw_episodes(terrain)[index]
    is_fly = env.config.creature == "fly"
    pace = FLY_PACE if is_fly else WORM_PACE
    # a worm has no feet whose forces are drawn
    overlay = view.drawn if is_fly else replace(view.drawn, forces=False)
    pictures: list[Picture] = []
    with closing(make_renderer(env.config, view)) as renderer:
        for body, time_s, outcome in _walk(env, entrant, episode, pace.frame_s):
            text = captions.ending_text(outcome, time_s, pace.longest_s)
            if time_s <= pace.longest_s + 1e-9:
                picture = renderer.render(body, 0, episode.goal)
                picture = measured(picture, renderer.pixels_per_mm, overlay)
                if not body.has_legs:
                    tensions = body.state().actuation[0]
                    picture = captions.tension_bars(picture, tensions, BAR_WIDTH, BAR_HEIGHT)
                shown = captions.clock_text(time_s, pace.frame_s * FPS) if overlay.clock else ""
                pictures.append(captions.titled(picture, entrant.name, shown))
    pictures += [captions.titled(picture, entrant.name, text, is_end=True)] * HOLD_FRAMES
    return Video(
        entrant.name,
        terrain.label,
        index,
        outcome,
        len(pictures),
        pace.frame_s,
        encode(pictures, max_bytes=max_bytes),
        captions.jpeg(pictures[-1]),
    )


def measured(picture: Picture, pixels_per_mm: float, overlay: Overlay) -> Picture:
    """A picture of a fly with its scale bar, if it has one, and the scale of force arrows.

    Parameters
    ----------
    pixels_per_mm
        At the fly.
    """
    if not overlay.scale_bar:
        return picture
    note = f", force {FORCE_PER_MM:g} µN/mm" if overlay.forces else ""
    return captions.with_scale_bar(picture, pixels_per_mm, note)


def _walk(
    env: BatchedEnv, entrant: Entrant, episode: Episode, frame_s: float
) -> Iterator[tuple[Batch, float, str]]:
    """Walk an episode; every `frame_s` and at the end: the body, the time, how the episode stands.

    The environment walks as in the evaluation. Between two decisions it cannot be looked at: there
    a second body, set to the same state before the decision, stands in for it.
    """
    stand_in = Bodies(env.config, 1, num_threads=1)
    steps = env.config.steps_per_decision
    timestep = env.config.scene.physics.timestep
    per_frame = max(1, round(frame_s / timestep))
    observation = env.reset(episodes=[episode])
    stand_in.start(np.arange(1), [episode])
    yield env.batch, 0.0, RUNNING
    state, outcome, walked = None, RUNNING, 0
    while outcome == RUNNING:
        action, state = entrant.policy.predict(
            observation, state, np.array([walked == 0]), deterministic=True
        )
        inside = [step for step in range(1, steps) if (walked + step) % per_frame == 0]
        if inside:
            stand_in.batch.restore(env.batch.integration_state())
            env.command(stand_in, np.asarray(action, dtype=np.float64))
        for last, step in itertools.pairwise([0, *inside]):
            stand_in.batch.step(step - last)
            yield stand_in.batch, (walked + step) * timestep, RUNNING
        transition = env.step(action)
        observation, outcome = transition.observation, str(transition.outcome[0])
        walked += steps
        if walked % per_frame == 0 or outcome != RUNNING:
            yield env.batch, walked * timestep, outcome


def encode(pictures: list[Picture], fps: int = FPS, max_bytes: int = MAX_BYTES) -> bytes:
    """Encode pictures (height, width, 3), of even size, as an H.264 MP4 that browsers play.

    Raises
    ------
    OSError, RuntimeError
        If ffmpeg fails.
    """
    height, width = pictures[0].shape[:2]
    for crf in _CRFS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "video.mp4"
            writer = imageio_ffmpeg.write_frames(
                str(path),
                (width, height),
                fps=fps,
                codec="libx264",
                quality=None,
                macro_block_size=2,
                output_params=[
                    *("-crf", str(crf), "-preset", "veryfast", "-g", str(_KEYFRAME_EVERY)),
                    *("-movflags", "+faststart"),
                ],
                ffmpeg_log_level="error",
            )
            with closing(writer):
                writer.send(None)  # starts ffmpeg
                for picture in pictures:
                    writer.send(np.ascontiguousarray(picture))
            data = path.read_bytes()
        if len(data) <= max_bytes:
            break
    return data
