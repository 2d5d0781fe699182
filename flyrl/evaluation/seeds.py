"""Policies that differ in their seed alone: what their training reaches, not one lucky run of it.

Agarwal et al. 2021, https://arxiv.org/abs/2108.13264.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.evaluation.rows import Json
from flyrl.evaluation.statistics import Interval, interquartile_mean, performance_profile

PROFILE_AT: Final = tuple(np.round(np.linspace(0.0, 1.0, 21), 2).tolist())
"""Success rates that performance profiles are taken at."""


@dataclass(frozen=True, eq=False)
class SeedGroup:
    """Policies of one training with several seeds.

    Attributes
    ----------
    label
        How they were trained.
    names
        Of the entrants.
    terrains
        Where they were evaluated.
    scores
        Success rates, shape (runs, terrains).
    """

    label: str
    names: tuple[str, ...]
    terrains: tuple[str, ...]
    scores: NDArray[np.float64]

    def on_each(self, rng: np.random.Generator) -> list[Interval]:
        """Interquartile mean over the runs, terrain by terrain."""
        return [interquartile_mean(self.scores[:, [i]], rng) for i in range(len(self.terrains))]

    def overall(self, rng: np.random.Generator) -> Interval:
        """Interquartile mean over runs and terrains."""
        return interquartile_mean(self.scores, rng)

    def profile(self, rng: np.random.Generator) -> list[Interval]:
        """Share of runs and terrains with at least each success rate of `PROFILE_AT`."""
        return performance_profile(self.scores, PROFILE_AT, rng)


def seed_groups(entrants: Sequence[Json], summary: Sequence[Json]) -> list[SeedGroup]:
    """Learned entrants by their training, in order of appearance.

    Parameters
    ----------
    entrants
        Of a protocol.
    summary
        Rows of one condition. An entrant that is missing on a terrain is left out.
    """
    rates = {(row["terrain"], row["controller"]): row["success_rate"]["value"] for row in summary}
    terrains = tuple(dict.fromkeys(row["terrain"] for row in summary))
    groups = []
    for label, members in trainings(entrants).items():
        names = tuple(
            name for name in members if all((terrain, name) in rates for terrain in terrains)
        )
        if names:
            scores = np.array([[rates[terrain, name] for terrain in terrains] for name in names])
            groups.append(SeedGroup(label, names, terrains, scores))
    return groups


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
    """All that decides what a training leads to, but for its seed."""
    training: dict[str, Any] = entrant.get("training") or {}
    settings = training.get("settings")
    if settings is None:  # of unknown training: alone
        return str(entrant["name"])
    return json.dumps([training.get("algo"), settings, entrant.get("trained_in")], sort_keys=True)
