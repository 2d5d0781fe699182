"""What stands in the sections of a report, for its template."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from flyrl.evaluation.conditions import QUANTITIES, Condition, compared_conditions
from flyrl.evaluation.drive_map import DriveMap
from flyrl.evaluation.metrics import metric_label
from flyrl.evaluation.results import Json, Results
from flyrl.evaluation.studies import STUDIES, judge
from flyrl.evaluation.summary import Leader, find_leaders
from flyrl.evaluation.trainings import PROFILE_AT, seed_groups
from flyrl.report.close_up import drive_map_figure, gait_figure
from flyrl.report.episodes import players
from flyrl.report.figures import (
    MAX_DOTS,
    distributions_figure,
    doses_figure,
    paired_figure,
    profiles_figure,
)
from flyrl.report.paths import Walk, Walks, paths_section, things_of
from flyrl.report.video import Video
from flyrl.report.wording import interval_text, outcome_name
from flyrl.rollouts import EpisodeRecord
from flyrl.tasks.task import LEFT_ARENA
from flyrl.terrains import terrain_on_record


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
    found = find_leaders(
        rows[rows["condition"].isin(labels)],
        protocol,
        np.random.default_rng(protocol["seed"]),
    )
    return sorted(found, key=lambda leader: labels.index(leader.condition))


def table_row(row: Json) -> Json:
    """A row of the summary, with its failures counted and named."""
    failures = {
        name: count
        for name, count in row["outcomes"].items()
        if count and name not in ("success", "timeout")
    }
    return {
        **row,
        "failures": sum(failures.values()),
        "failure_text": ", ".join(f"{n} {outcome_name(name)}" for name, n in failures.items()),
        "rate_text": interval_text(row["success_rate"]) if row["episodes"] else "",
    }


def drive_map_section(results: Results, drive_map: DriveMap | None) -> str:
    """Figure of a drive map, with the drives that learned policies chose; empty without one."""
    if drive_map is None:
        return ""
    learned = [entrant["name"] for entrant in results.protocol["entrants"] if _is_learned(entrant)]
    chosen: dict[str, list[NDArray[np.float32]]] = {name: [] for name in learned}
    names = results.episodes["controller"]
    for row, path in results.trajectories.items():
        if names[row] in chosen:
            chosen[names[row]].append(path.drive[1:])
    visited = {name: np.concatenate(drives) for name, drives in chosen.items() if drives}
    return drive_map_figure(drive_map, visited, "drive-map")


def _is_learned(entrant: Json) -> bool:
    return entrant.get("kind") in ("learned", "own")


def terrain_section(
    results: Results, terrain: str, videos: Sequence[Video], examples: Sequence[EpisodeRecord]
) -> Json:
    """Figures, tables and videos of a terrain; where quantities were varied, their doses."""
    horizon_s = results.protocol["horizon_s"]
    summary = [row for row in results.summaries if row["terrain"] == terrain]
    walked = results.episodes["controller"][results.episodes["terrain"] == terrain]
    if results.protocol["vary"]:
        return {
            "name": terrain,
            "doses": _doses(results, terrain),
            "rows": [table_row(row) for row in summary],
            "interactions": [row for row in summary if (row["paired"] or {}).get("interactions")],
        }
    return {
        "name": terrain,
        "doses": [],
        "rows": [table_row(row) for row in summary],
        "edge": _edge(results, terrain),
        "distributions": Markup(
            distributions_figure(
                results.episodes, terrain, horizon_s, spread_metrics(results.protocol)
            )
        ),
        "is_outlined": walked.value_counts().max() > MAX_DOTS,
        "paths": paths_section(
            _walks(results, terrain),
            next(each for each in results.protocol["terrains"] if each["name"] == terrain),
            results.drawn.get(terrain, ()),
        ),
        **_gait(terrain, examples),
        "paired": Markup(paired_figure(results.episodes, results.summaries, terrain, horizon_s)),
        "differences": _differences(summary),
        "reasons": _reasons(summary),
        "players": players(videos, examples, terrain),
    }


def _edge(results: Results, terrain: str) -> str:
    """What it means that flies left the arena; empty where none did."""
    rows = results.episodes[results.episodes["terrain"] == terrain]
    left = int((rows["outcome"] == LEFT_ARENA).sum())
    if not left:
        return ""
    record = next(each for each in results.protocol["terrains"] if each["name"] == terrain)
    extent = ""
    if (known := terrain_on_record(record["config"])) is not None:
        at = known.bounds
        extent = f", x {at.x_min:g} to {at.x_max:g} and y {at.y_min:g} to {at.y_max:g} mm"
    return (
        f"{left} of {len(rows)} episodes ended because the fly walked off the ground{extent}: "
        "it “left the arena”, which counts as a failure. It says how far and where flies walked, "
        "not that they fell; on larger ground they would have walked on"
    )


def _walks(results: Results, terrain: str) -> Walks:
    """Paths on a terrain by controller, where they were kept."""
    drawn = results.drawn.get(terrain, ())
    rows = results.episodes
    walks: dict[str, list[Walk]] = {name: [] for name in rows["controller"].unique()}
    for row, path in results.trajectories.items():
        walked = rows.iloc[row]
        if walked["terrain"] == terrain:
            index = int(walked["episode"])
            episode = drawn[index] if index < len(drawn) else {}
            goal = episode.get("goal", ())
            things = things_of(episode, results.protocol)
            walks[walked["controller"]].append(Walk(index, path, goal, walked["outcome"], things))
    return walks


def study_section(results: Results) -> Json | None:
    """A published study's claims and figures beside ours; None where none was asked for."""
    if results.protocol["study"] is None:
        return None
    study = STUDIES[results.protocol["study"]]
    ours = {(row["terrain"], row["controller"]): row["metrics"] for row in usual_rows(results)}
    return {
        "title": study.title,
        "source": study.source,
        "metric": metric_label(study.metric),
        "body": results.protocol.get("body", {}).get("name", "unknown"),
        "judgements": judge(study, results.summaries),
        "figures": [
            {
                "source": figures.source,
                "body": figures.body,
                "metric": metric_label(figures.metric),
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
    metrics = [
        metric
        for metric in spread_metrics(results.protocol)
        if any(row["metrics"][metric]["n"] for row in results.summaries)
    ]
    return [
        {
            "name": name,
            "text": f"{QUANTITIES[name].text[0].upper()}{QUANTITIES[name].text[1:]}",
            "figure": Markup(
                doses_figure(
                    results.summaries,
                    terrain,
                    name,
                    [Condition(name, value).label for value in values],
                    ["success", *metrics],
                )
            ),
        }
        for name, values in results.protocol["vary"].items()
    ]


def _gait(terrain: str, examples: Sequence[EpisodeRecord]) -> Json:
    """Gait diagram of the first episode, and whether reflexes are drawn in it."""
    walked = [record for record in examples if record.terrain == terrain and record.gait]
    first = [record for record in walked if record.index == walked[0].index]
    logs = [record.gait for record in first if record.gait]
    return {
        "gait": Markup(gait_figure(first, f"gait-{terrain}") if first else ""),
        "has_reflexes": any((log.retraction | log.stumbling).any() for log in logs),
    }


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


def seeds_section(results: Results) -> Json | None:
    """What trainings reach over their seeds; None without one that has several."""
    groups = seed_groups(results.protocol["entrants"], usual_rows(results))
    if not any(len(group.names) > 1 for group in groups):
        return None
    rng = np.random.default_rng(results.protocol["seed"])
    return {
        "terrains": groups[0].terrains,
        "rows": [
            {
                "label": group.label,
                "names": group.names,
                "cells": group.on_each(rng),
                "overall": group.overall(rng),
            }
            for group in groups
        ],
        "profiles": Markup(
            profiles_figure({group.label: group.profile(rng) for group in groups}, PROFILE_AT)
        ),
    }
