"""How far what was learned on one terrain carries to the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from flyrl.entry_points import is_entry_point
from flyrl.evaluation.rows import Json
from flyrl.evaluation.seeds import trainings
from flyrl.evaluation.statistics import MIN_RUNS, Interval, interquartile_mean, success_rate
from flyrl.terrains import Terrain, terrain_label, terrain_on_record

SECOND_METRIC: Final = {
    # few cross all the ground, and few keep to every command
    "traverse": "advance_mm",
    "velocity": "speed_error_mm_s",
    "path": "path_error_mm",
}
"""Task -> what else tells how well a policy does, where success says little."""


@dataclass(frozen=True)
class Cell:
    """What a training comes to on a terrain.

    Attributes
    ----------
    success
        Interquartile mean over the runs if there are `MIN_RUNS` or more, else the rate over all
        their episodes with its Wilson interval; without a value where nobody walked.
    second
        Mean of the second metric, over runs the mean of theirs; None without one.
    is_home
        Whether this is the terrain of the training.
    """

    success: Interval
    second: float | None
    is_home: bool


@dataclass(frozen=True)
class Training:
    """A row of the matrix.

    Attributes
    ----------
    terrain
        Label of the ground that was trained on.
    label
        How it was trained.
    names
        Of the entrants, one per run.
    cells
        One per terrain of the evaluation.
    """

    terrain: str
    label: str
    names: tuple[str, ...]
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Generalisation:
    """A row per training, a column per terrain of the evaluation.

    Attributes
    ----------
    terrains
        Of the evaluation.
    second
        The second metric, or None.
    rows
        One per training, those of a terrain one after the other.
    """

    terrains: tuple[str, ...]
    second: str | None
    rows: tuple[Training, ...]


def generalisation(
    protocol: Json, summary: Sequence[Json], rng: np.random.Generator
) -> Generalisation | None:
    """What every training reaches on every terrain.

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
        cells = [
            _cell(
                [found[terrain, name] for name in names if (terrain, name) in found],
                second,
                _is_home(trained_on, ground),
                rng,
            )
            for terrain, ground in grounds.items()
        ]
        place = terrain_label(trained_on["name"], trained_on.get("random"))
        rows.append(Training(place, label, names, tuple(cells)))
    places = list(dict.fromkeys(row.terrain for row in rows))
    if not rows or max(len(places), len(grounds)) < 2:
        return None
    rows.sort(key=lambda row: places.index(row.terrain))
    return Generalisation(tuple(grounds), second, tuple(rows))


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


def _cell(
    rows: Sequence[Json], second: str | None, is_home: bool, rng: np.random.Generator
) -> Cell:
    """From the rows of the runs on a terrain."""
    if len(rows) >= MIN_RUNS:
        success = interquartile_mean([[row["success_rate"]["value"]] for row in rows], rng)
    else:
        successes = sum(row["successes"] for row in rows)
        success = success_rate(successes, sum(row["episodes"] for row in rows))
    means = [row["metrics"][second]["mean"] for row in rows] if second else []
    present = [mean for mean in means if mean is not None]
    return Cell(success, float(np.mean(present)) if present else None, is_home)
