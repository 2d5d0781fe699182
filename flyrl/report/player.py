"""The videos of a terrain with what goes with them, for the report's template."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Final

from markupsafe import Markup

from flyrl.evaluation.rows import Json
from flyrl.report.time_curves import time_figure
from flyrl.report.video import FLY_PACE, FPS, Video
from flyrl.report.wording import outcome_name
from flyrl.rollouts import EpisodeRecord
from flyrl.simulation.marks import LEG_COLOURS

_LEGEND: Final = {
    "grips": "tarsi while the leg grips",
    "retracts": "tibia while the retraction reflex corrects it",
    "stumbles": "femur while the stumbling reflex does",
}


def players(videos: Sequence[Video], examples: Sequence[EpisodeRecord], terrain: str) -> list[Json]:
    """What is seen of each episode on a terrain that was filmed, or walked again.

    Parameters
    ----------
    videos, examples
        Of all terrains.
    terrain
        Which.
    """
    shown = [video for video in videos if video.terrain == terrain]
    walked = [record for record in examples if record.terrain == terrain]
    episodes = sorted({video.episode for video in shown} | {record.index for record in walked})
    return [
        _player(
            [video for video in shown if video.episode == episode],
            [record for record in walked if record.index == episode],
            f"{terrain}-{episode}",
            episode,
        )
        for episode in episodes
    ]


def _player(
    shown: Sequence[Video], walked: Sequence[EpisodeRecord], name: str, episode: int
) -> Json:
    """Videos of an episode, their common clock, and the curves that run along.

    Without videos the curves show all of the episode.
    """
    end_s = max((video.shown_s for video in shown), default=None)
    frame_s = shown[0].frame_s if shown else FLY_PACE.frame_s
    curves = time_figure(walked, f"time-{name}", end_s) if walked else None
    return {
        "id": f"videos-{name}",
        "episode": episode,
        "videos": [
            {
                "controller": video.controller,
                "outcome": outcome_name(video.outcome),
                "frames": video.num_frames,
                "source": _data_url("video/mp4", video.mp4),
                "poster": _data_url("image/jpeg", video.poster),
            }
            for video in shown
        ],
        "legend": _legend(walked),
        "fps": FPS,
        "slowdown": 1 / (FPS * frame_s),
        "frame_s": frame_s,
        "frames": max((video.num_frames for video in shown), default=0),
        "end_s": end_s,
        "curves": curves
        and {
            "svg": Markup(curves.svg),
            "panels": curves.panels,
            "until_s": curves.until_s,
        },
    }


def _legend(walked: Sequence[EpisodeRecord]) -> list[tuple[str, str]]:
    """Colours of a fly's legs, and what they mean."""
    if any(record.creature != "fly" for record in walked):
        return []
    return [(_css_colour(LEG_COLOURS[name]), text) for name, text in _LEGEND.items()]


def _css_colour(rgb: tuple[float, float, float]) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def _data_url(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
