"""Contents of a report's sections, for its template: figures, rows of tables, videos, origin."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.colors import to_hex

from flyrl.evaluation.conditions import QUANTITIES, compared_conditions
from flyrl.evaluation.contrast import crossing, parted, success_by_kind
from flyrl.evaluation.episodes import Json
from flyrl.evaluation.metrics import metric_label
from flyrl.evaluation.results import Results, paired
from flyrl.evaluation.studies import STUDIES, judge
from flyrl.evaluation.summary import Leader, find_leaders
from flyrl.report.figures import MAX_DOTS
from flyrl.report.paths import Walk, Walks, walk_of
from flyrl.report.video import FLY_PACE, FPS, Video
from flyrl.report.wording import contrast_text, interval_text, outcome_name
from flyrl.rollouts import EpisodeRecord
from flyrl.simulation.marks import LEG_COLOURS
from flyrl.tasks.task import LEFT_ARENA
from flyrl.terrains import terrain_on_record

DIGITS: Final = 5
"""Significant digits of a number in the table of all episodes; episodes.csv has them all."""

_LONGEST: Final = 400
"""Characters of a text from a policy file that are shown."""

_LEGEND: Final = {
    "grips": "tarsi while the leg grips",
    "retracts": "tibia while the retraction reflex corrects it",
    "stumbles": "femur while the stumbling reflex does",
}


def spread_metrics(protocol: Json) -> list[str]:
    """Metrics with more than two values that the task is compared by."""
    return [metric for metric in protocol["compared"] if metric != "success"]


def usual_rows(results: Results) -> list[Json]:
    """Summary under the usual condition."""
    label = compared_conditions(results.protocol["vary"])[0].label
    return [row for row in results.summaries if row["condition"] == label]


def all_leaders(results: Results) -> list[Leader]:
    """The best on each terrain under each condition, the usual one first."""
    protocol, rows = results.protocol, results.episodes
    labels = [condition.label for condition in compared_conditions(protocol["vary"])]
    rng = np.random.default_rng(protocol["seed"])
    found = find_leaders(rows[rows["condition"].isin(labels)], protocol, rng)
    return sorted(found, key=lambda leader: labels.index(leader.condition))


def table_row(row: Json) -> Json:
    """A row of the summary, with its failures counted and named."""
    failures = {
        outcome_name(name): count
        for name, count in row["outcomes"].items()
        if count and name not in ("success", "timeout")
    }
    return {
        **row,
        "failures": sum(failures.values()),
        "failure_text": ", ".join(f"{count} {name}" for name, count in failures.items()),
        "rate_text": interval_text(row["success_rate"]) if row["episodes"] else "",
    }


def lead_videos(protocol: Json, videos: Sequence[Video]) -> list[Video]:
    """Both of a contrast, the learned one first, that a report leads with; empty without any.

    It is the first in which the learned entrant succeeds and the reference does not, else the first
    in which they differ.
    """
    contrasts = parted(protocol.get("film", {}))
    # values of success where the learned one alone succeeds
    ranked = sorted(contrasts, key=lambda terrain: contrasts[terrain]["values"] != [1.0, 0.0])
    for terrain in ranked:
        of = contrasts[terrain]
        place = terrain, of["episode"]
        filmed = {each.controller: each for each in videos if (each.terrain, each.episode) == place}
        if filmed.keys() >= {of["controller"], of["reference"]}:
            return [filmed[of["controller"]], filmed[of["reference"]]]
    return []


def terrain_section(
    results: Results,
    terrain: Json,
    videos: Sequence[Video],
    examples: Sequence[EpisodeRecord],
    leading: Sequence[Video] = (),
) -> Json:
    """Tables and videos of a terrain; where quantities were varied, what their doses are.

    Parameters
    ----------
    terrain
        Entry of the protocol.
    videos, examples, leading
        Of all terrains; the `lead_videos` are left to the summary.
    """
    name, protocol = terrain["name"], results.protocol
    usual = compared_conditions(protocol["vary"])[0].label
    summary = [row for row in results.summaries if row["terrain"] == name]
    walked = results.episodes[results.episodes["terrain"] == name]
    of_usual = walked[walked["condition"] == usual]
    filmed = [video for video in videos if video.terrain == name]
    records = [record for record in examples if record.terrain == name]
    gaits = [(record, record.gait) for record in records if record.gait]
    gaits = [each for each in gaits if each[0].index == gaits[0][0].index]
    return {
        "name": name,
        "doses": {quantity: QUANTITIES[quantity].text for quantity in protocol["vary"]},
        "rows": [table_row(row) for row in summary],
        "interactions": [row for row in summary if (row["paired"] or {}).get("interactions")],
        "edge": _edge(walked, terrain),
        "is_outlined": walked["controller"].value_counts().max() > MAX_DOTS,
        "walks": [record for record, _ in gaits],
        "has_reflexes": any((gait.retraction | gait.stumbling).any() for _, gait in gaits),
        "compared": [row for row in summary if row["paired"]],
        "reasons": _reasons(summary),
        "crossing": crossing(of_usual, protocol, np.random.default_rng(protocol["seed"])),
        "kinds": success_by_kind(of_usual, terrain["config"]),
        "chosen": contrast_text(protocol, name),
        "players": [
            player(
                [video for video in filmed if video.episode == episode],
                [record for record in records if record.index == episode],
                leading,
            )
            for episode in sorted(
                {video.episode for video in filmed} | {record.index for record in records}
            )
        ],
    }


def present_metrics(results: Results) -> set[str]:
    """Metrics that somebody has a value of."""
    return {
        metric
        for row in results.summaries
        for metric, spread in row["metrics"].items()
        if spread["n"]
    }


def _edge(rows: pd.DataFrame, terrain: Json) -> str:
    """Explanation of flies that left the arena; empty where none did."""
    left = int((rows["outcome"] == LEFT_ARENA).sum())
    if not left:
        return ""
    extent = ""
    if (known := terrain_on_record(terrain["config"])) is not None:
        at = known.bounds
        extent = f", x {at.x_min:g} to {at.x_max:g} and y {at.y_min:g} to {at.y_max:g} mm"
    return (
        f"{left} of {len(rows)} episodes ended because the fly walked off the ground{extent}: "
        "it “left the arena”, which counts as a failure. It says how far and where flies walked, "
        "not that they fell; on larger ground they would have walked on"
    )


def walks_on(results: Results, terrain: str) -> Walks:
    """Paths on a terrain by controller, where they were kept."""
    drawn, rows = results.drawn.get(terrain, ()), results.episodes
    walks: dict[str, list[Walk]] = {name: [] for name in rows["controller"].unique()}
    for row, path in results.trajectories.items():
        walked = rows.iloc[row]
        if walked["terrain"] == terrain:
            index = int(walked["episode"])
            episode = drawn[index] if index < len(drawn) else {}
            walk = walk_of(index, path, episode, walked["outcome"], results.protocol)
            walks[walked["controller"]].append(walk)
    return walks


def study_section(results: Results) -> Json | None:
    """A published study's claims and figures beside ours; None where none was asked for."""
    if results.protocol["study"] is None:
        return None
    study = STUDIES[results.protocol["study"]]
    ours = {(row["terrain"], row["controller"]): row["metrics"] for row in usual_rows(results)}
    return {
        "published": study,
        "body": results.protocol.get("body", {}).get("name", "unknown"),
        "judgements": judge(study, results.summaries),
        "figures": [
            (
                each,
                [
                    (*at, values, ours[at][each.metric])
                    for at, values in each.values.items()
                    if at in ours
                ],
            )
            for each in study.figures
        ],
    }


def _reasons(summary: Sequence[Json]) -> list[str]:
    """Why intervals are missing, controller by controller."""
    missing: dict[str, list[str]] = {}
    for row, metric, interval in paired(summary, "differences"):
        if interval["reason"]:
            missing.setdefault(f"{row['controller']}: {interval['reason']}", []).append(metric)
    return [f"{text} ({', '.join(metrics)})" for text, metrics in missing.items()]


def trainings_section(entrants: Sequence[Json]) -> list[dict[str, str]]:
    """Algorithm, decisions, seed and settings of each learned entrant, as its file tells them."""
    rows = []
    for entrant in entrants:
        if entrant.get("kind") == "learned":
            training = _mapping(entrant.get("training"))
            settings = _mapping(training.get("settings"))
            num_envs = _mapping(settings.get("training")).get("num_envs")
            shown = {key: training.get(key) for key in ("algo", "decisions", "seed")}
            shown["settings"] = {**_mapping(settings.get("algo")), "num_envs": num_envs}
            rows.append(
                {"name": entrant["name"], **{key: _text(value) for key, value in shown.items()}}
            )
    return rows


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _text(value: Any) -> str:
    """A value of a policy file; "not recorded" without one, settings with commas in between."""
    if isinstance(value, Mapping):
        value = ", ".join(
            f"{key} {each}" for key, each in value.items() if key != "name" and each is not None
        )
    text = "not recorded" if value in (None, "") else str(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} …"


def episodes_section(results: Results, metrics: Sequence[str]) -> Json:
    """Table of all episodes, and what draws it; both are unpacked when it is shown.

    A page with 100,000 episodes opens at once that way.

    Parameters
    ----------
    metrics
        Columns of numbers to show.
    """
    # DataTables, https://datatables.net, MIT licence
    library = resources.files("itables") / "html"
    return {
        "count": len(results.episodes),
        "data": packed(json.dumps(episode_rows(results, metrics), separators=(",", ":"))),
        "script": packed((library / "dt_bundle.js").read_text(encoding="utf-8")),
        "style": packed((library / "dt_bundle.css").read_text(encoding="utf-8")),
    }


def episode_rows(results: Results, metrics: Sequence[str]) -> Json:
    """`keys` and `labels` of the table's columns, and its `rows`; None where there is no value."""
    condition = ["condition"] if results.protocol["vary"] else []
    keys = ["terrain", *condition, "episode", "controller", "outcome", *metrics, "seed"]
    table = results.episodes[keys].astype(object)
    table["outcome"] = table["outcome"].map(outcome_name)
    table[[*metrics]] = table[[*metrics]].map(lambda value: float(f"{value:.{DIGITS}g}"))
    return {
        "keys": keys,
        "labels": [metric_label(key) if key in metrics else key for key in keys],
        "rows": table.astype(object).where(table.notna(), None).to_numpy().tolist(),
    }


def packed(text: str) -> str:
    """Text as gzip in base64; the same text gives the same bits."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def player(
    videos: Sequence[Video], walked: Sequence[EpisodeRecord], leading: Sequence[Video] = ()
) -> Json:
    """Videos of an episode, their common clock, and until when curves run along, s.

    Parameters
    ----------
    videos, walked
        Of the episode on a terrain, at least one of them.
    leading
        Videos that are shown elsewhere.
    """
    terrain = (videos or walked)[0].terrain
    episode = videos[0].episode if videos else walked[0].index
    shown = [video for video in videos if video not in leading]
    frame_s = videos[0].frame_s if videos else FLY_PACE.frame_s
    is_fly = all(record.creature == "fly" for record in walked)
    return {
        "name": f"{terrain}-{episode}",
        "terrain": terrain,
        "episode": episode,
        "videos": shown,
        "has_lead": len(shown) < len(videos),
        "legend": [(to_hex(LEG_COLOURS[name]), text) for name, text in _LEGEND.items() if is_fly],
        "fps": FPS,
        "slowdown": 1 / (FPS * frame_s),
        "frame_s": frame_s,
        "frames": max((video.num_frames for video in shown), default=0),
        "end_s": max((video.shown_s for video in shown), default=None),
        "walked": walked,
        # without videos, all of the walks
        "until_s": max([each.shown_s for each in videos] or [each.duration_s for each in walked]),
    }
