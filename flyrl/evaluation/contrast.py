"""Differences between entrants: by episode, by steering and legs, by the kind of ground."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from flyrl.evaluation.episodes import Json
from flyrl.evaluation.statistics import Interval, paired_difference, success_rate
from flyrl.evaluation.summary import best_of, metric_values, paired_values
from flyrl.policies.laws import split_legs
from flyrl.tasks.episode import FIRST_GROUND_SEED
from flyrl.terrains import AnyGround, terrain_on_record


def contrasts(rows: pd.DataFrame, protocol: Json) -> Json:
    """Episode of each terrain that shows best where a learned entrant differs from the reference.

    That is the first in which the learned entrant succeeds and the reference does not; without any,
    the first in which they differ most in the first of the decisive metrics in which they differ at
    all. The learned entrant is the best over all terrains, the user's own included, the reference
    left out.

    Parameters
    ----------
    rows
        Episodes under one condition: see `flyrl.evaluation.results.Results`.
    protocol
        Its `reference`, `entrants`, `terrains`, `decisive` metrics and `horizon_s`.

    Returns
    -------
    Terrain -> `episode`, `controller`, `reference`, `metric` in which they differ, and `values` of
    both; `episode` 0 alone where there is no such pair, and where they differ in nothing.
    """
    kinds = {each["name"]: each["kind"] for each in protocol["entrants"]}
    walked = rows["controller"].unique()
    learned = [name for name in walked if kinds[name] != "fixed" and name != protocol["reference"]]
    best = best_of(rows, protocol, learned) if learned else ""
    grounds = [terrain["name"] for terrain in protocol["terrains"]]
    return {name: _contrast(rows[rows["terrain"] == name], best, protocol) for name in grounds}


def parted(chosen: Json) -> Json:
    """Contrasts, by terrain, of those that were chosen in which two entrants differ."""
    return {terrain: each for terrain, each in chosen.items() if "metric" in each}


def _contrast(rows: pd.DataFrame, learned: str, protocol: Json) -> Json:
    """The episode on one terrain."""
    names = learned, protocol["reference"]
    # of success alone a difference the other way round comes second
    ranked = [("success", 0.0), *((metric, -math.inf) for metric in protocol["decisive"])]
    for metric, least in ranked:
        own, other = (
            metric_values(rows[rows["controller"] == name], metric, protocol["horizon_s"])
            for name in names
        )
        # by episode; NaN where one has no value
        differences = (own - other).dropna().sort_index().clip(lower=least).abs()
        if differences.any():
            episode = int(differences.index[int(differences.argmax())])  # first of equal ones
            return {
                "episode": episode,
                "controller": learned,
                "reference": protocol["reference"],
                "metric": metric,
                "values": [float(own[episode]), float(other[episode])],
            }
    return {"episode": 0}


def success_by_kind(rows: pd.DataFrame, config: Json) -> dict[str, dict[str, Interval]]:
    """Success rate of each entrant on each kind of ground; empty where all are of one kind.

    Parameters
    ----------
    rows
        Episodes on one terrain under one condition.
    config
        Of the terrain, in the protocol.
    """
    ground = terrain_on_record(config)
    if not isinstance(ground, AnyGround):
        return {}
    kinds = {seed: ground.kind(FIRST_GROUND_SEED + int(seed)) for seed in rows["seed"].unique()}
    table: dict[str, dict[str, Interval]] = {}
    for name, walked in rows.groupby("controller", observed=True, sort=False):
        by_kind = walked["success"].groupby(walked["seed"].map(kinds))
        rates = {str(kind): success_rate(int(each.sum()), len(each)) for kind, each in by_kind}
        table[str(name)] = rates
    return table


def crossing(rows: pd.DataFrame, protocol: Json, rng: np.random.Generator) -> dict[str, Json]:
    """Entrants by steering and leg controller; empty where nobody was put on other legs with @.

    Parameters
    ----------
    rows
        Episodes on one terrain under one condition.
    protocol
        Of the evaluation.
    rng
        Source of the resampling.

    Returns
    -------
    Steering -> legs -> `success`, the entrant's rate; and mean differences, of the task's first
    decisive metric on the same episodes: `of_legs`, to the entrant with the same steering on the
    first legs, and `of_steering`, to that with the first steering on the same legs. None of the
    first itself, and where there is no such entrant.
    """
    walked = dict(iter(rows.groupby("controller", observed=True)))
    groups: dict[tuple[str, str | None], dict[str, str]] = {}
    for entrant in protocol["entrants"]:
        if (legs := entrant.get("leg_controller")) and entrant["name"] in walked:
            group = groups.setdefault((entrant["policy"], entrant["sha256"]), {})
            group.setdefault(legs, entrant["name"])
    names: dict[str, dict[str, str]] = {}
    for (text, _), group in groups.items():
        if len(group) > 1:
            called = {split_legs(name)[0] for name in group.values()}
            names[called.pop() if len(called) == 1 else text] = group
    if not any(split_legs(name)[1] for group in names.values() for name in group.values()):
        return {}
    first, first_legs = next(iter(names.values())), next(iter(next(iter(names.values()))))

    def difference(name: str, other: str | None) -> Interval | None:
        if other is None or other == name:
            return None
        metric, horizon_s = protocol["decisive"][0], protocol["horizon_s"]
        return paired_difference(paired_values(walked[name], walked[other], metric, horizon_s), rng)

    return {
        steering: {
            legs: {
                "success": success_rate(int(walked[name]["success"].sum()), len(walked[name])),
                "of_legs": difference(name, group.get(first_legs)),
                "of_steering": difference(name, first.get(legs)),
            }
            for legs, name in group.items()
        }
        for steering, group in names.items()
    }
