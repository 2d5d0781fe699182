"""A task of the table with a user's own terms, weights and time limit."""

import math
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from flyrl.files import file_digest
from flyrl.tasks.task import (
    SUCCESS,
    UNSTABLE,
    MeanTerm,
    ObservationTerm,
    RewardTerm,
    Task,
    Termination,
)
from flyrl.validation import number, one_of, positive

Term = ObservationTerm | RewardTerm | MeanTerm | Termination

TERM_TYPES: Final = (ObservationTerm, RewardTerm, MeanTerm, Termination)


def extended(
    task: Task,
    terms: Mapping[str, Term],
    weights: Mapping[str, float],
    time_limit_s: float | None = None,
) -> Task:
    """Append terms to a task's tables, weigh its rewards anew, and shorten its episodes.

    Parameters
    ----------
    task
        What to start from; it stays as it is.
    terms
        By the place that each comes from, `module:attribute`, which goes into records. An
        observation term is appended to the observation, a reward term to the reward, and so on.
    weights
        Of reward terms by name, the task's own and the appended ones.
    time_limit_s
        s until an episode is truncated, at most the task's own; None takes that.

    Raises
    ------
    ValueError
        A term that is of no such type or whose name is taken in its table, a weight that is no
        finite number or of no reward term, or a time limit that the task does not allow.
    """
    own = math.inf if task.time_limit_s is None else task.time_limit_s
    if time_limit_s is not None and positive("task.time_limit", time_limit_s) > own:
        raise ValueError(
            f"task.time_limit must be at most that of {task.name}, {own} s, got {time_limit_s}"
        )
    for source, term in terms.items():
        if not isinstance(term, TERM_TYPES):
            names = ", ".join(kind.__name__ for kind in TERM_TYPES)
            raise ValueError(f"term {source!r} must be one of {names}, got {term!r}")
    observation = (*task.observation, *_of(ObservationTerm, terms))
    reward = (*task.reward, *_of(RewardTerm, terms))
    means = (*task.means, *_of(MeanTerm, terms))
    terminations = (*task.terminations, *_of(Termination, terms))
    _check_unique("observation", [term.name for term in observation])
    _check_unique("reward", [term.name for term in reward])
    _check_unique("means", [term.name for term in means])
    _check_unique("terminations", [term.outcome for term in terminations])
    for name, weight in weights.items():
        one_of("task.weights", name, [term.name for term in reward])
        number(f"task.weights.{name}", weight)
    return replace(
        task,
        observation=observation,
        reward=tuple(replace(term, weight=weights.get(term.name, term.weight)) for term in reward),
        means=means,
        terminations=terminations,
        added=(*task.added, *terms),
        time_limit_s=task.time_limit_s if time_limit_s is None else time_limit_s,
    )


def task_record(task: Task) -> dict[str, Any]:
    """A task as plain JSON values: what `extended` makes it from."""
    return {
        "name": task.name,
        "terms": list(task.added),
        "weights": {term.name: term.weight for term in task.reward},
        "time_limit": task.time_limit_s,
    }


def task_table(task: Task) -> dict[str, Any]:
    """A task as its reader sees it, as plain JSON values: terms with descriptions, limits."""
    return {
        "success": task.success,
        "failures": [
            *(end.outcome for end in task.terminations if end.outcome != SUCCESS),
            UNSTABLE,
        ],
        "time_limit_s": task.time_limit_s,
        "decision_interval_s": task.decision_interval_s,
        "actions": type(task.actions).__name__.lower(),
        "props": [
            {"name": each.name, "shape": each.shape, "size": list(each.size), "rgba": each.rgba}
            for each in task.props
            if not each.at_goal
        ],
        "observation": [
            {"name": term.name, "size": term.size, "description": term.description}
            for term in task.observation
        ],
        "reward": [
            {"name": term.name, "weight": term.weight, "description": term.description}
            for term in task.reward
        ],
    }


def term_digests(names: Iterable[str]) -> dict[str, str | None]:
    """SHA-256 of the modules that terms come from, by module; None where there is no file.

    Parameters
    ----------
    names
        `module:attribute` each, of terms that are loaded.
    """
    modules = dict.fromkeys(name.partition(":")[0] for name in names)
    files = {name: getattr(sys.modules.get(name), "__file__", None) for name in modules}
    return {name: file and file_digest(Path(file)) for name, file in files.items()}


def _of(kind: type[Any], terms: Mapping[str, Term]) -> list[Any]:
    return [term for term in terms.values() if isinstance(term, kind)]


def _check_unique(table: str, names: list[str]) -> None:
    name, count = Counter(names).most_common(1)[0] if names else ("", 0)
    if count > 1:
        raise ValueError(f"the names in a task's {table} must differ, got {name!r} {count} times")
