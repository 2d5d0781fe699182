"""The report: one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from flyrl.envs.record import randomisation_text
from flyrl.evaluation.conditions import QUANTITIES, Condition
from flyrl.evaluation.drive_map import DriveMap
from flyrl.evaluation.metrics import METRICS, compared_metrics
from flyrl.evaluation.results import Json, Results, episodes_digest
from flyrl.evaluation.studies import STUDIES, judge
from flyrl.files import write_text
from flyrl.report.close_up import drive_map_figure, gait_figure
from flyrl.report.figures import (
    METRIC_LABELS,
    distributions_figure,
    doses_figure,
    paired_figure,
    success_figure,
    trajectories_figure,
)
from flyrl.report.palette import colours, stylesheet
from flyrl.report.video import Video
from flyrl.rollouts import EpisodeRecord

REPORT_FILE: Final = "report.html"
ORIGIN_SCHEMA: Final = "flyrl.report/1"
ORIGIN_ID: Final = "origin"
"""Of the element in a report that says how to repeat it."""


def _outcome_name(outcome: str) -> str:
    return "time out" if outcome == "timeout" else outcome.replace("_", " ")


def write_report(
    results: Results,
    folder: str | Path,
    *,
    videos: Sequence[Video] = (),
    examples: Sequence[EpisodeRecord] = (),
    drive_map: DriveMap | None = None,
    note: str | None = None,
) -> Path:
    """Write `report.html` to `folder`, whole or not at all, and return its path.

    Parameters
    ----------
    results
        What to report.
    videos
        Shown in the section of their terrain.
    examples
        Episodes with a log of the gait, whose diagrams are shown in the section of their terrain.
    drive_map
        Shown with the drives that the learned policies chose on top.
    note
        Said where videos would be, e.g. why there are none.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / REPORT_FILE
    text = format_report(results, videos=videos, examples=examples, drive_map=drive_map, note=note)
    write_text(path, text)
    return path


def format_report(
    results: Results,
    *,
    videos: Sequence[Video] = (),
    examples: Sequence[EpisodeRecord] = (),
    drive_map: DriveMap | None = None,
    note: str | None = None,
) -> str:
    """Text of the report; see `write_report`."""
    environment = Environment(
        loader=PackageLoader("flyrl.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = format_number
    names = list(dict.fromkeys(row["controller"] for row in results.summary))
    usual = _usual(results)
    sentence, detail = headline(usual, results.protocol)
    return environment.get_template("report.html.j2").render(
        title=_title(results.protocol, results.summary),
        headline=sentence,
        detail=detail,
        protocol=results.protocol,
        stylesheet=Markup(stylesheet()),
        colours=colours(names),
        metrics=METRICS,
        shown=[*_spread_metrics(results.protocol), "path_efficiency"],
        compared=compared_metrics(results.protocol["task"]),
        labels=METRIC_LABELS,
        success_svg=Markup(success_figure(usual)),
        rows=[_table_row(row) for row in results.summary],
        terrains=[
            _terrain_section(results, terrain["name"], videos, examples)
            for terrain in results.protocol["terrains"]
        ],
        note=note,
        drive_map=Markup(_drive_map(results, drive_map)),
        is_varied=bool(results.protocol["vary"]),
        crashes=results.protocol["crashes"],
        study=_study(results),
        origin=Markup(_origin(results)),
        entrants=results.protocol["entrants"],
        physics=json.dumps(results.protocol["physics"], indent=1),
        randomisation=randomisation_text(results.protocol.get("randomisation")),
    )


def headline(summary: Sequence[Json], protocol: Json) -> tuple[str, str]:
    """Who reaches how much, in one sentence; and its intervals beside the best of the others.

    The one who is spoken of is the best learned policy, or the best controller without any.
    """
    names = list(dict.fromkeys(row["controller"] for row in summary))
    kinds = {entrant["name"]: entrant.get("kind") for entrant in protocol["entrants"]}
    learned = [name for name in names if kinds.get(name) == "learned"]
    first = max(learned or names, key=lambda name: _share(summary, name))
    others = [name for name in names if name != first and name not in learned]
    verb, noun = ("reaches", "targets") if protocol["task"] == "target" else ("solves", "episodes")
    rows = [row for row in summary if row["controller"] == first]
    parts = [f"{row['successes']} of {row['episodes']} {noun} on {_place(row)}" for row in rows]
    detail = f"{first}: {_rates(rows)}."
    if others:
        best = max(others, key=lambda name: _share(summary, name))
        detail += f" Best of the others, {best}: "
        detail += f"{_rates([row for row in summary if row['controller'] == best])}."
    return f"{first} {verb} {_listed(parts)}.", detail


def _spread_metrics(protocol: Json) -> list[str]:
    """Metrics with more than two values that the task is compared by."""
    return [metric for metric in compared_metrics(protocol["task"]) if metric != "success"]


def _share(summary: Sequence[Json], name: str) -> float:
    rows = [row for row in summary if row["controller"] == name]
    return float(sum(row["successes"] for row in rows) / sum(row["episodes"] for row in rows))


def _rates(rows: Sequence[Json]) -> str:
    return ", ".join(
        f"{100 * row['success_rate']['value']:.0f}\u00a0% on {_place(row)} "
        f"(95\u00a0% interval {interval_text(row['success_rate'], 100)}\u00a0%)"
        for row in rows
    )


def _usual(results: Results) -> list[Json]:
    """Summary under the one condition that is closest to none, where quantities were varied."""
    conditions = [
        Condition(name, value)
        for name, values in results.protocol["vary"].items()
        for value in values
    ]
    if not conditions:
        return results.summary
    unchanged = [each for each in conditions if each.is_usual]
    label = (unchanged or conditions)[0].label
    return [row for row in results.summary if row["condition"] == label]


def _place(row: Json) -> str:
    """Terrain and condition, where there is one."""
    return f"{row['terrain']} ({row['condition']})" if row["condition"] else str(row["terrain"])


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def interval_text(interval: Mapping[str, Any], scale: float = 1) -> str:
    """`low to high` of an interval, in whole numbers of 1 / `scale`."""
    return f"{scale * interval['low']:.0f} to {scale * interval['high']:.0f}"


def format_number(value: float | None, digits: int = 3) -> str:
    """`value` to `digits` significant digits, without an exponent; a dash for None."""
    if value is None:
        return "\u2013"
    if value == 0:
        return "0"
    whole = len(str(int(abs(value)))) if abs(value) >= 1 else 0
    return f"{value:.{max(0, digits - max(whole, 1))}f}".replace("-", "\u2212")


def _title(protocol: Json, summary: Sequence[Json]) -> str:
    terrains = ", ".join(dict.fromkeys(row["terrain"] for row in summary))
    return f"{protocol['task']} on {terrains}"


def _table_row(row: Json) -> Json:
    failures = {
        name: count
        for name, count in row["outcomes"].items()
        if count and name not in ("success", "timeout")
    }
    return {
        **row,
        "failures": sum(failures.values()),
        "failure_text": ", ".join(f"{n} {_outcome_name(name)}" for name, n in failures.items()),
        "rate_text": interval_text(row["success_rate"], 100) if row["episodes"] else "",
    }


def _drive_map(results: Results, drive_map: DriveMap | None) -> str:
    """Figure of a drive map, with the drives that learned policies chose; empty without one."""
    if drive_map is None:
        return ""
    learned = [entrant["name"] for entrant in results.protocol["entrants"] if _is_learned(entrant)]
    chosen: dict[str, list[NDArray[np.float32]]] = {name: [] for name in learned}
    for row, path in zip(results.episodes, results.trajectories, strict=False):
        if row["controller"] in chosen:
            chosen[row["controller"]].append(path.drive[1:])
    visited = {name: np.concatenate(drives) for name, drives in chosen.items() if drives}
    return drive_map_figure(drive_map, visited, "drive-map")


def _is_learned(entrant: Json) -> bool:
    return entrant.get("kind") in ("learned", "entry_point")


def _terrain_section(
    results: Results, terrain: str, videos: Sequence[Video], examples: Sequence[EpisodeRecord]
) -> Json:
    horizon_s = results.protocol["horizon_s"]
    summary = [row for row in results.summary if row["terrain"] == terrain]
    if results.protocol["vary"]:
        return {"name": terrain, "doses": _doses(results, terrain)}
    goals = {
        index: episode["goal"]
        for section in results.protocol["terrains"]
        if section["name"] == terrain
        for index, episode in enumerate(section.get("episodes", []))
    }
    trajectories = ""
    if results.trajectories:
        trajectories = trajectories_figure(
            results.episodes,
            results.trajectories,
            [goals.get(row["episode"], ()) for row in results.episodes],
            terrain,
        )
    return {
        "name": terrain,
        "doses": [],
        "distributions": Markup(
            distributions_figure(
                results.episodes, terrain, horizon_s, _spread_metrics(results.protocol)
            )
        ),
        "trajectories": Markup(trajectories),
        "gait": Markup(_gait(terrain, examples)),
        "paired": Markup(paired_figure(results.episodes, results.summary, terrain, horizon_s)),
        "differences": _differences(summary),
        "reasons": _reasons(summary),
        "videos": [
            {
                "controller": video.controller,
                "episode": video.episode,
                "outcome": _outcome_name(video.outcome),
                "source": _data_url("video/mp4", video.mp4),
                "poster": _data_url("image/jpeg", video.poster),
            }
            for video in videos
            if video.terrain == terrain
        ],
    }


def _origin(results: Results) -> str:
    """JSON from which the evaluation can be repeated and compared, to stand in a script element."""
    protocol = results.protocol
    origin = {
        "schema": ORIGIN_SCHEMA,
        "settings": protocol["settings"],
        "versions": protocol["versions"],
        "policies": {entrant["name"]: entrant["sha256"] for entrant in protocol["entrants"]},
        "episodes_sha256": episodes_digest(results.episodes),
    }
    return json.dumps(origin).replace("<", "\\u003c")


def read_origin(path: Path) -> Json:
    """What a report holds of where it comes from: settings, versions, hashes.

    Raises
    ------
    ValueError
        The file is no report, or of another version.
    OSError
        It cannot be read.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    found = re.search(rf'<script type="application/json" id="{ORIGIN_ID}">(.*?)</script>', text)
    try:
        origin: Json = json.loads(found.group(1)) if found else {}
    except json.JSONDecodeError:
        origin = {}
    if origin.get("schema") != ORIGIN_SCHEMA:
        raise ValueError(f"{path} is no report of this version of flyrl")
    return origin


def _study(results: Results) -> Json | None:
    """A published study's claims and figures beside ours; None where none was asked for."""
    if results.protocol["study"] is None:
        return None
    study = STUDIES[results.protocol["study"]]
    ours = {(row["terrain"], row["controller"]): row["metrics"] for row in _usual(results)}
    return {
        "title": study.title,
        "source": study.source,
        "metric": METRIC_LABELS[study.metric],
        "judgements": judge(study, results.summary),
        "figures": [
            {
                "source": figures.source,
                "metric": METRIC_LABELS[figures.metric],
                "rows": [
                    {
                        "terrain": terrain,
                        "controller": controller,
                        "theirs": values,
                        "ours": ours[terrain, controller][figures.metric],
                    }
                    for (terrain, controller), values in figures.values.items()
                    if (terrain, controller) in ours
                ],
            }
            for figures in study.figures
        ],
    }


def _doses(results: Results, terrain: str) -> list[Json]:
    """What each quantity that was varied does on a terrain."""
    metrics = ["success", *_spread_metrics(results.protocol)]
    return [
        {
            "name": name,
            "text": QUANTITIES[name].text,
            "figure": Markup(
                doses_figure(
                    results.summary,
                    terrain,
                    name,
                    [Condition(name, value).label for value in values],
                    metrics,
                )
            ),
        }
        for name, values in results.protocol["vary"].items()
    ]


def _gait(terrain: str, examples: Sequence[EpisodeRecord]) -> str:
    shown = [record for record in examples if record.terrain == terrain and record.gait]
    return gait_figure(shown, f"gait-{terrain}") if shown else ""


def _data_url(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _differences(summary: Sequence[Json]) -> list[Json]:
    return [
        {"controller": row["controller"], **row["paired"]["differences"]}
        for row in summary
        if row["paired"]
    ]


def _reasons(summary: Sequence[Json]) -> list[str]:
    """Why intervals are missing, controller by controller."""
    missing: dict[str, list[str]] = {}
    for row in summary:
        for metric, interval in (row["paired"] or {"differences": {}})["differences"].items():
            if interval["reason"]:
                missing.setdefault(f"{row['controller']}: {interval['reason']}", []).append(metric)
    return [f"{text} ({', '.join(metrics)})" for text, metrics in missing.items()]
