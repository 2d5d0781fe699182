"""The episode of each terrain that tells the best learned entrant from the reference."""

from __future__ import annotations

import math

import pandas as pd

from flyrl.evaluation.episodes import Json
from flyrl.evaluation.summary import best_of, metric_values


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
