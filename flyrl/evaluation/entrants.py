"""All who take part in an evaluation, from their names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import pandas as pd

from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant, controller_names, make_fixed
from flyrl.evaluation.learned import is_own_name, make_learned, make_own
from flyrl.evaluation.metrics import decisive_metrics, lower_is_better
from flyrl.evaluation.rows import Json
from flyrl.evaluation.summary import metric_values
from flyrl.tasks import Task
from flyrl.validation import one_of


def make_entrants(config: EvaluationConfig) -> list[Entrant]:
    """All entrants of an evaluation: learned policies first, then the fixed controllers.

    Raises
    ------
    ValueError
        An unknown or repeated name, a policy file that cannot be used, a reference that is not
        among the entrants, or one whose decisions do not fit the physics.
    """
    names = controller_names(config)
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        raise ValueError(f"controllers must differ from one another, got {repeated[0]!r} twice")
    # Fixed first: a misspelt name shows before any file is read.
    fixed = [make_fixed(name, config) for name in names]
    taken = {entrant.name for entrant in fixed}
    learned: list[Entrant] = []
    for given in config.policies:
        if isinstance(given, str) and not is_own_name(given):
            entrant = make_learned(given, config, taken)
        else:
            entrant = make_own(given, config, taken)
        taken.add(entrant.name)
        learned.append(entrant)
    entrants = [*learned, *fixed]
    if config.reference is not None:
        one_of("reference", config.reference, [entrant.name for entrant in entrants])
    for entrant in entrants:
        for terrain in config.terrain_configs:
            try:
                entrant.env(config, terrain)
            except (ValueError, TypeError) as error:
                source = entrant.record["source"] or entrant.name
                raise ValueError(f"{source} cannot walk here: {error}") from error
    return entrants


def best_reference(
    rows: pd.DataFrame, entrants: Sequence[Json], horizon_s: float, task: Task | None = None
) -> str:
    """Entrant that the others are compared with, unless the config names one.

    The best fixed entrant that sees what the task asks, by the means of the task's decisive metrics
    over all episodes; without one, the best fixed entrant; without any, the best of all.

    Parameters
    ----------
    rows
        Episodes; see `flyrl.evaluation.rows`.
    entrants
        Records of a protocol.
    horizon_s
        Stands in for the time to goal of an episode without success, s.
    task
        Says what decides; None: the built-in task that the rows name.
    """
    walked = list(rows["controller"].unique())
    fixed = [each for each in entrants if each["kind"] == "fixed" and each["name"] in walked]
    names = [each["name"] for each in fixed if each.get("sees")]
    names = names or [each["name"] for each in fixed] or walked

    def worth(name: str) -> list[float]:
        own = rows[rows["controller"] == name]
        means = {
            metric: float(metric_values(own, metric, horizon_s).mean())
            for metric in decisive_metrics(task or own["task"].iloc[0])
        }
        return [-mean if lower_is_better(metric) else mean for metric, mean in means.items()]

    best: str = max(names, key=worth)
    return best
