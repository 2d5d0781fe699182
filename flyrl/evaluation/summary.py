"""Summaries of each controller on each terrain, paired differences, and leaders."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.evaluation.conditions import compared_conditions
from flyrl.evaluation.episodes import Json, metric_columns
from flyrl.evaluation.metrics import metric_named
from flyrl.evaluation.statistics import (
    MIN_PAIRS,
    Interval,
    adjusted,
    distribution,
    effect_size,
    p_value,
    paired_difference,
    probability_of_improvement,
    success_rate,
)
from flyrl.tasks import OUTCOMES

_PLACE = ["terrain", "condition"]


def summarise(rows: pd.DataFrame, protocol: Json, rng: np.random.Generator) -> list[Json]:
    """One summary per terrain, condition and controller, in order of first appearance.

    "paired" holds the `differences` to the reference, by metric; where quantities were varied, also
    the `interactions` under each condition that changes something, by decisive metric: (own under
    the condition - own usually) - (the reference's under it - the reference's usually), over the
    episodes that both walked under both.

    Parameters
    ----------
    rows
        Episodes: see `flyrl.evaluation.results.Results`.
    protocol
        Its `reference`, `compared` and `decisive` metrics, `horizon_s` (the time to goal of an
        episode without success, in pairs only), and `vary`.
    rng
        Source of the resampling.

    Raises
    ------
    ValueError
        If the reference has no episodes, or a controller walked one episode twice.
    """
    twice = rows[rows.duplicated([*_PLACE, "controller", "episode"])]
    if len(twice):
        first = twice.iloc[0]
        raise ValueError(
            f"episodes must be walked once, got {first['episode']} twice by "
            f"{first['controller']} on {first['terrain']}"
        )
    names, reference = list(rows["controller"].unique()), protocol["reference"]
    if reference not in names:
        raise ValueError(f"reference must be one of {', '.join(names)}, got {reference!r}")
    horizon_s = protocol["horizon_s"]
    usual, *changed = (condition.label for condition in compared_conditions(protocol["vary"]))
    walked = {
        (*place, name): own
        for place, both in rows.groupby(_PLACE, sort=False, observed=True)
        for name in names
        if len(own := both[both["controller"] == name])
    }
    summary, none = [], rows.head(0)
    for (*place, name), own in walked.items():
        row = summarise_controller(own)
        if name != reference:
            others = walked.get((*place, reference), none)
            differences = paired_differences(own, others, protocol["compared"], horizon_s, rng)
            row["paired"] = {"reference": reference, "differences": differences}
        summary.append(row)
    for metric in protocol["compared"]:  # all comparisons by one metric are a family
        family = [row["paired"]["differences"][metric] for row in summary if row["paired"]]
        corrected = adjusted([entry["p_value"] for entry in family])
        for entry, value in zip(family, corrected, strict=True):
            entry["p_adjusted"] = value

    for (terrain, condition, name), row in zip(walked, summary, strict=True):
        if not row["paired"] or condition not in changed:
            continue
        interactions = row["paired"]["interactions"] = {}
        for metric in protocol["decisive"]:
            own_now, own_usual, other_now, other_usual = (
                metric_values(walked.get((terrain, label, who), none), metric, horizon_s)
                for who in (name, reference)
                for label in (condition, usual)
            )
            # by episode; NaN of one that was walked under one alone
            changes = ((own_now - own_usual) - (other_now - other_usual)).dropna()
            interactions[metric] = asdict(paired_difference(changes, rng))
    return summary


def summarise_controller(rows: pd.DataFrame) -> Json:
    """Summary of one controller on one terrain, from its `rows`; "paired" is None."""
    outcomes = Counter(rows["outcome"])
    kinds = dict.fromkeys((*OUTCOMES[1:], *sorted(outcomes)))
    first = rows.iloc[0]
    return {
        **{key: first[key] for key in ("controller", "task", "terrain", "condition")},
        "episodes": len(rows),
        "successes": outcomes["success"],
        "outcomes": {outcome: outcomes[outcome] for outcome in kinds},
        "success_rate": asdict(success_rate(outcomes["success"], len(rows))),
        "metrics": {key: asdict(distribution(rows[key])) for key in metric_columns(rows)},
        "paired": None,
    }


def paired_differences(
    own: pd.DataFrame,
    others: pd.DataFrame,
    compared: Sequence[str],
    horizon_s: float,
    rng: np.random.Generator,
) -> Json:
    """Mean differences own - other, one per metric in `compared`.

    Each with its interval, `p_value`, `effect_size`, and `improvement`: the share of episodes in
    which own is the better one.
    """
    found = {}
    for metric in compared:
        differences = paired_values(own, others, metric, horizon_s)
        found[metric] = {
            **asdict(paired_difference(differences, rng)),
            "p_value": p_value(differences, rng),
            "effect_size": effect_size(differences),
            "improvement": asdict(probability_of_improvement(_sign(metric) * differences, rng)),
        }
    return found


def paired_values(
    own: pd.DataFrame, others: pd.DataFrame, metric: str, horizon_s: float
) -> NDArray[np.float64]:
    """Differences own - other of `metric` over the episodes that both walked, in own's order.

    An episode without success counts its full horizon as time to goal, so that every pair counts.

    Parameters
    ----------
    own, others
        Rows of two controllers.
    horizon_s
        Stands in for the time to goal of an episode without success, s.
    """
    one, other = (metric_values(rows, metric, horizon_s) for rows in (own, others))
    one = one[one.index.isin(other.index)]
    return np.asarray(one - other.loc[one.index], dtype=np.float64)


def metric_values(rows: pd.DataFrame, metric: str, horizon_s: float) -> pd.Series[float]:
    """Values of a metric by episode, as `paired_values` compares them."""
    column = rows.set_index("episode")[metric].astype(np.float64)
    return column.fillna(horizon_s) if metric == "time_to_goal_s" else column


def _sign(metric: str) -> int:
    """1 of a metric that is better the higher it is, else -1."""
    return -1 if metric_named(metric).lower_is_better else 1


@dataclass(frozen=True)
class Leader:
    """Best controllers on a terrain under a condition.

    Attributes
    ----------
    terrain
        Where.
    names
        The best; more than one if nothing separates them, best mean first.
    metric
        The metric that separated the best from the next, or the task's first if none did.
    value
        The best's mean of it.
    next_name, next_value
        Who comes next, and its mean; None where all are the best.
    difference
        The best minus the next on the same episodes, with its interval; None without a next.
    condition
        Label of the condition; empty where nothing is varied.
    """

    terrain: str
    names: tuple[str, ...]
    metric: str
    value: float
    next_name: str | None = None
    next_value: float | None = None
    difference: Interval | None = None
    condition: str = ""


def find_leaders(rows: pd.DataFrame, protocol: Json, rng: np.random.Generator) -> list[Leader]:
    """The best on each terrain under each condition, in order of first appearance.

    They are ranked by the first of the protocol's `decisive` metrics. Those who are not worse than
    the best (the interval of the mean difference includes 0, the difference is smaller than the
    smallest effect of interest, or there are too few pairs) are ranked by the next metric.

    Parameters
    ----------
    rows
        Episodes: see `flyrl.evaluation.results.Results`.
    protocol
        Its `decisive` metrics, `smallest_effects` and `horizon_s`.
    rng
        Source of the resampling.
    """
    places = [
        {str(name): own for name, own in walked.groupby("controller", sort=False, observed=True)}
        for _, walked in rows.groupby(_PLACE, sort=False, observed=True)
    ]
    return [_leader(own, protocol["decisive"], protocol, rng) for own in places]


def _leader(
    own: Mapping[str, pd.DataFrame],
    metrics: Sequence[str],
    protocol: Json,
    rng: np.random.Generator,
) -> Leader:
    """The best of some controllers, by the first of some metrics that tells them apart."""
    metric, *finer = metrics
    horizon_s, effect = protocol["horizon_s"], protocol["smallest_effects"].get(metric, 0.0)
    means = {
        name: float(metric_values(rows, metric, horizon_s).mean()) for name, rows in own.items()
    }
    best, *others = sorted(own, key=lambda name: -_sign(metric) * means[name])
    differences = {
        name: paired_difference(paired_values(own[best], own[name], metric, horizon_s), rng)
        for name in others
    }
    behind = [name for name in others if _is_clear(differences[name], effect)]
    level = [best, *(name for name in others if name not in behind)]
    if finer and len(level) > 1:
        leader = _leader({name: own[name] for name in level}, finer, protocol, rng)
        if len(leader.names) < len(level):
            return leader
    row = own[best].iloc[0]
    leader = Leader(row["terrain"], tuple(level), metric, means[best], condition=row["condition"])
    if not behind:
        return leader
    following = behind[0]
    return replace(
        leader,
        next_name=following,
        next_value=means[following],
        difference=differences[following],
    )


def _is_clear(difference: Interval, effect: float) -> bool:
    """Whether a difference is at least `effect`, and its interval leaves out 0 or is a point."""
    if abs(difference.value or 0.0) < effect:
        return False
    if difference.low is None or difference.high is None:
        return difference.n >= MIN_PAIRS and bool(difference.value)
    return difference.low > 0 or difference.high < 0


def best_reference(rows: pd.DataFrame, protocol: Json) -> str:
    """Entrant that the others are compared with, unless the config names one.

    The best fixed entrant that sees what the task asks, by the means of the task's decisive metrics
    over all episodes; without one, the best fixed entrant; without any, the best of all.

    Parameters
    ----------
    rows
        Episodes: see `flyrl.evaluation.results.Results`.
    protocol
        Its `entrants`, `decisive` metrics and `horizon_s`.
    """
    walked = list(rows["controller"].unique())
    fixed = [
        each for each in protocol["entrants"] if each["kind"] == "fixed" and each["name"] in walked
    ]
    names = [each["name"] for each in fixed if each.get("sees")]
    return best_of(rows, protocol, names or [each["name"] for each in fixed] or walked)


def best_of(rows: pd.DataFrame, protocol: Json, names: Sequence[str]) -> str:
    """The best of some entrants, by the means of the decisive metrics over all episodes."""

    def worth(name: str) -> list[float]:
        own = rows[rows["controller"] == name]
        return [
            _sign(metric) * float(metric_values(own, metric, protocol["horizon_s"]).mean())
            for metric in protocol["decisive"]
        ]

    best: str = max(names, key=worth)
    return best
