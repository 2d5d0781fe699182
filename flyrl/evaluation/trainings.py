"""Trainings behind the learned entrants: over their seeds, and from terrain to terrain.

Policies that differ in their seed alone count as one training.
Agarwal et al. 2021, https://arxiv.org/abs/2108.13264.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from flyrl.entry_points import is_entry_point
from flyrl.evaluation.episodes import Json
from flyrl.evaluation.statistics import (
    MIN_RUNS,
    interquartile_mean,
    performance_profile,
    success_rate,
)
from flyrl.policies.laws import split_legs
from flyrl.terrains import Terrain, terrain_label, terrain_on_record

PROFILE_AT: Final = tuple(np.round(np.linspace(0.0, 1.0, 21), 2).tolist())
"""Success rates that performance profiles are taken at."""


def over_seeds(
    entrants: Sequence[Json], summary: Sequence[Json], rng: np.random.Generator
) -> Json | None:
    """Success of trainings over their seeds; None without a training of several seeds.

    Parameters
    ----------
    entrants
        Of a protocol.
    summary
        Rows of one condition. An entrant that is missing on a terrain is left out.
    rng
        Source of the resampling.

    Returns
    -------
    `terrains` of the evaluation; `rows`, one per training, with its `label`, the `names` of its
    entrants, `cells`, the interquartile mean of their success rates on each terrain, and that
    `overall`; and `profiles`, label -> share of runs and terrains that reach each of `PROFILE_AT`.
    """
    rates = {(row["controller"], row["terrain"]): row["success_rate"]["value"] for row in summary}
    terrains = list(dict.fromkeys(row["terrain"] for row in summary))
    groups = {}
    for label, members in trainings(entrants).items():
        names = [name for name in members if all((name, place) in rates for place in terrains)]
        if names:
            scores = np.array([[rates[name, place] for place in terrains] for name in names])
            groups[label] = names, scores
    if not any(len(names) > 1 for names, _ in groups.values()):
        return None
    rows = [
        {
            "label": label,
            "names": names,
            "cells": [interquartile_mean(column[:, None], rng) for column in scores.T],
            "overall": interquartile_mean(scores, rng),
        }
        for label, (names, scores) in groups.items()
    ]
    profiles = {
        label: performance_profile(scores, PROFILE_AT, rng) for label, (_, scores) in groups.items()
    }
    return {"terrains": terrains, "rows": rows, "profiles": profiles}


def trainings(entrants: Sequence[Json]) -> dict[str, tuple[str, ...]]:
    """Names of the learned entrants by their training, in order of appearance.

    The label of a training is how its policies were learned, with the name of the first of them
    where that is true of another training, too.

    Parameters
    ----------
    entrants
        Of a protocol.
    """
    members: dict[str, list[Json]] = {}
    for entrant in entrants:
        if entrant["kind"] == "learned":
            members.setdefault(_training(entrant), []).append(entrant)
    labels = Counter(group[0]["policy"] for group in members.values())
    found = {}
    for group in members.values():
        names = tuple(str(entrant["name"]) for entrant in group)
        label = str(group[0]["policy"])
        found[f"{label} ({names[0]})" if labels[label] > 1 else label] = names
    return found


def _training(entrant: Json) -> str:
    """All that decides what a training leads to, but for its seed; and legs it was put on."""
    training: dict[str, Any] = entrant.get("training") or {}
    settings = training.get("settings")
    if settings is None:  # of unknown training: alone
        return str(entrant["name"])
    decides = [training.get("algo"), settings, entrant.get("trained_in")]
    return json.dumps([*decides, split_legs(entrant["name"])[1]], sort_keys=True)


SECOND_METRIC: Final = {
    # few cross all the ground, and few keep to every command
    "traverse": "advance_mm",
    "velocity": "speed_error_mm_s",
    "path": "path_error_mm",
}
"""Task -> what else tells how well a policy does, where success says little."""


def generalisation(
    protocol: Json, summary: Sequence[Json], rng: np.random.Generator
) -> Json | None:
    """Matrix of trainings and terrains: success of every training on every terrain.

    Parameters
    ----------
    protocol
        Of the results.
    summary
        Rows of one condition.
    rng
        Source of the resampling.

    Returns
    -------
    `terrains` of the evaluation; the `second` metric, or None; and `rows`, those of a terrain one
    after the other. A row has the `terrain` that was trained on, the `label` of the training, the
    `names` of its entrants, one per run, and `cells`, one per terrain of the evaluation:

    - `success`: interquartile mean over the runs if there are `MIN_RUNS` or more, else the rate
      over all their episodes with its Wilson interval; without a value where nobody walked;
    - `second`: mean of the second metric, over runs the mean of theirs; None without one;
    - `is_home`: whether this is the terrain of the training.

    None where trainings and evaluation know but one terrain, and where no policy says what it was
    trained on.
    """
    second = SECOND_METRIC.get(protocol["task"])
    grounds = {each["name"]: each["config"] for each in protocol["terrains"]}
    records = {entrant["name"]: entrant for entrant in protocol["entrants"]}
    found = {(row["terrain"], row["controller"]): row for row in summary}
    rows = []
    for label, names in trainings(protocol["entrants"]).items():
        trained_on = _trained_on(records[names[0]])
        if trained_on is None:
            continue
        cells = []
        for terrain, ground in grounds.items():
            own = [found[terrain, name] for name in names if (terrain, name) in found]
            cells.append({**_cell(own, second, rng), "is_home": _is_home(trained_on, ground)})
        place = terrain_label(trained_on["name"], trained_on.get("random"))
        rows.append({"terrain": place, "label": label, "names": names, "cells": cells})
    places = list(dict.fromkeys(row["terrain"] for row in rows))
    if not rows or max(len(places), len(grounds)) < 2:
        return None
    rows.sort(key=lambda row: places.index(row["terrain"]))
    return {"terrains": tuple(grounds), "second": second, "rows": rows}


def is_same_ground(one: Terrain, other: Terrain) -> bool:
    """Whether two terrains are the same to walk on: a seed of which nothing is drawn has no say."""
    if replace(one, seed=0) != replace(other, seed=0):
        return False
    if one.random:
        return True
    first, second = one.draw(one.seed), other.draw(other.seed)
    pairs = zip(vars(first.boxes).values(), vars(second.boxes).values(), strict=True)
    return (first.shift, first.down) == (second.shift, second.down) and all(
        np.array_equal(*pair) for pair in pairs
    )


def _is_home(trained_on: Json, ground: Json) -> bool:
    """Whether records are of the same ground."""
    one, other = terrain_on_record(trained_on), terrain_on_record(ground)
    return trained_on == ground if one is None or other is None else is_same_ground(one, other)


def _trained_on(entrant: Json) -> Json | None:
    """Terrain of a training, as the policy file says, which anybody may have written; or None."""
    terrain: Any = (entrant.get("trained_in") or {}).get("terrain")
    if not isinstance(terrain, dict) or not isinstance(terrain.get("name"), str):
        return None
    is_own = is_entry_point(terrain["name"])
    return terrain if is_own or terrain_on_record(terrain) is not None else None


def _cell(rows: Sequence[Json], second: str | None, rng: np.random.Generator) -> Json:
    """Success and second metric from the rows of the runs on a terrain."""
    if len(rows) >= MIN_RUNS:
        success = interquartile_mean([[row["success_rate"]["value"]] for row in rows], rng)
    else:
        successes = sum(row["successes"] for row in rows)
        success = success_rate(successes, sum(row["episodes"] for row in rows))
    means = [row["metrics"][second]["mean"] for row in rows] if second else []
    present = [mean for mean in means if mean is not None]
    return {"success": success, "second": float(np.mean(present)) if present else None}
