"""Episodes in a report: a table to sort and filter, and the videos of a terrain.

The table is drawn by DataTables (https://datatables.net, MIT licence), which the package itables
carries along. Rows and library are packed, and unpacked when a reader first asks for the table, so
that a page with 100,000 episodes opens at once.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Sequence
from importlib import resources
from typing import Final

import numpy as np
import pandas as pd
from markupsafe import Markup

from flyrl.evaluation.metrics import metric_label
from flyrl.evaluation.results import Json, Results
from flyrl.report.close_up import time_figure
from flyrl.report.video import FLY_PACE, FPS, Video
from flyrl.report.wording import outcome_name
from flyrl.rollouts import EpisodeRecord
from flyrl.simulation.marks import LEG_COLOURS

DIGITS: Final = 5
"""Significant digits of a number in the table; episodes.csv has them all."""

_LIBRARY: Final = {"script": "html/dt_bundle.js", "style": "html/dt_bundle.css"}
"""Files of the package itables."""


def episodes_section(results: Results, metrics: list[str]) -> Json:
    """What the template needs: packed columns, and the packed library.

    Parameters
    ----------
    metrics
        Columns of numbers to show.
    """
    package = resources.files("itables")
    return {
        "count": len(results.episodes),
        "data": packed(json.dumps(episode_columns(results, metrics), separators=(",", ":"))),
        **{
            key: packed(package.joinpath(file).read_text(encoding="utf-8"))
            for key, file in _LIBRARY.items()
        },
    }


def episode_columns(results: Results, metrics: list[str]) -> list[Json]:
    """Columns of the table: `key`, `label`, `values`; for text, `names` that the values index."""
    rows = results.episodes
    columns = [
        _named("terrain", rows["terrain"]),
        {"key": "episode", "label": "episode", "values": rows["episode"].tolist()},
        _named("controller", rows["controller"]),
        _named("outcome", rows["outcome"].map(outcome_name)),
        *(
            {"key": metric, "label": metric_label(metric), "values": _numbers(rows[metric])}
            for metric in metrics
        ),
        {"key": "seed", "label": "seed", "values": rows["seed"].tolist()},
    ]
    if results.protocol["vary"]:
        columns.insert(1, _named("condition", rows["condition"]))
    return columns


def packed(text: str) -> str:
    """Text as gzip in base64; the same text gives the same bits."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _named(key: str, values: pd.Series[str]) -> Json:
    codes, names = pd.factorize(values)
    return {"key": key, "label": key, "names": list(names), "values": codes.tolist()}


def _numbers(values: pd.Series[float]) -> list[float | None]:
    return [
        None if np.isnan(value) else float(f"{value:.{DIGITS}g}") for value in values.to_numpy()
    ]


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
