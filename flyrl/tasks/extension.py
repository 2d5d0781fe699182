"""A task with terms of the user's own added, replaced, removed and weighed; tasks as records."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, get_args

from flyrl.entry_points import is_entry_point, look_up
from flyrl.files import file_digest
from flyrl.tasks.task import (
    SUCCESS,
    UNSTABLE,
    ErrorTerm,
    MeanTerm,
    ObservationTerm,
    RewardTerm,
    Task,
    Term,
    Termination,
)
from flyrl.validation import distinct, number, one_of, plain

TABLES: Final[Mapping[str, type[Term]]] = {
    "observation": ObservationTerm,
    "reward": RewardTerm,
    "means": MeanTerm,
    "terminations": Termination,
    "errors": ErrorTerm,
}
"""Tables of a task, and what their rows are."""


def extended(
    task: Task,
    terms: Mapping[str, Term],
    weights: Mapping[str, float],
    without: Sequence[str] = (),
) -> Task:
    """Take rows out of a task's tables, add others, and change the weights of its rewards.

    Parameters
    ----------
    task
        Task to start from; it stays as it is.
    terms
        Terms to add, by the `module:attribute` that each comes from, for records. An
        observation term goes to the end of the observation, a reward term to that of the reward,
        and so on; but a term that has the name of one that is taken out goes to its place.
    weights
        Weights of reward terms by name, the task's own and the added ones.
    without
        Names of the terms to take out, of terminations their outcomes. Where several tables have
        one of that name, `reward.success` says which.

    Raises
    ------
    ValueError
        A term that is of no such type or whose name is taken in its table, a name to take out that
        is in no table or in several, no observation that is left, or a weight that is no finite
        number or of no reward term.
    """
    for source, term in terms.items():
        if not isinstance(term, get_args(Term)):
            names = ", ".join(kind.__name__ for kind in TABLES.values())
            raise ValueError(f"term {source!r} must be one of {names}, got {term!r}")
    own = [row for table in TABLES for row in getattr(task, table)]
    removed = [_found([_place(row) for row in own], name) for name in without]
    kept = [row for row in own if _place(row) not in removed]
    distinct("a task (task.without takes terms out)", map(_place, (*kept, *terms.values())))
    rows: dict[str, Any] = {_place(row): row for row in own}
    # a term that has the name of one that is taken out goes to its place
    rows |= dict.fromkeys(removed) | {_place(term): term for term in terms.values()}
    rewards = [place.removeprefix("reward.") for place in rows if place.startswith("reward.")]
    for name, given in weights.items():
        place = f"reward.{one_of('task.weights', name, rewards)}"
        weight = number(f"task.weights.{name}", given)
        rows[place] = rows[place] and replace(rows[place], weight=weight)
    tables: dict[str, Any] = {
        table: tuple(row for row in rows.values() if isinstance(row, kind))
        for table, kind in TABLES.items()
    }
    if not tables["observation"]:
        raise ValueError("task.without must leave a term of the observation")
    added = {source: term for source, term in task.added.items() if _place(term) not in removed}
    known = [_place(term) for term in task.added.values()]
    return replace(
        task,
        **tables,
        added={**added, **terms},
        removed=(*task.removed, *(place for place in removed if place not in known)),
    )


def _place(term: Term) -> str:
    """Table and name of a term, as in "reward.success"."""
    table = next(table for table, kind in TABLES.items() if isinstance(term, kind))
    return f"{table}.{term.outcome if isinstance(term, Termination) else term.name}"


def _found(places: Sequence[str], name: str) -> str:
    """Place of the term that a name to take out means."""
    found = [place for place in places if name in (place, place.partition(".")[2])]
    if not found:
        names = dict.fromkeys(place.partition(".")[2] for place in places)
        one_of("task.without", name, names)
    if len(found) > 1:
        raise ValueError(
            f"task.without must say which {name!r}, {' or '.join(found)}, got {name!r}"
        )
    return found[0]


def load_terms(names: Sequence[str]) -> dict[str, Term]:
    """Import terms by name, `module:attribute` each; importing a module runs its code.

    Returns
    -------
    The terms by these names, in this order.

    Raises
    ------
    ValueError
        A name that is given twice, or there is no such term (see `flyrl.entry_points.look_up`).
    """
    terms: dict[str, Term] = {}
    for i, name in enumerate(names):
        key = f"task.terms[{i}]"
        if name in terms:
            raise ValueError(f"{key} is {name!r}, which is there already")
        terms[name] = look_up(
            key, name, {}, lambda value: isinstance(value, get_args(Term)), "term"
        )
    return terms


def task_record(task: Task) -> dict[str, Any]:
    """A task as plain JSON values: what `flyrl.tasks.task_from` makes it from."""
    return {
        "name": task.name,
        **plain(task.parameters),
        "terms": list(task.added),
        "without": list(task.removed),
        "weights": {term.name: term.weight for term in task.reward},
        "time_limit": task.time_limit_s,
        "drive_time_constant": task.drive_time_constant_s,
    }


def task_table(task: Task) -> dict[str, Any]:
    """A task as its reader sees it, as plain JSON values: terms with descriptions, limits."""
    props = [prop for prop in task.props if not prop.at_goal]
    return {
        "success": task.success,
        "failures": [
            *(end.outcome for end in task.terminations if end.outcome != SUCCESS),
            UNSTABLE,
        ],
        "time_limit_s": task.time_limit_s,
        "decision_interval_s": task.decision_interval_s,
        "actions": type(task.actions).__name__.lower(),
        "props": _columns(props, "name", "shape", "size", "rgba"),
        "observation": _columns(task.observation, "name", "size", "description"),
        "reward": _columns(task.reward, "name", "weight", "description"),
        "errors": _columns(task.errors, "name", "description"),
    }


def _columns(rows: Iterable[Any], *names: str) -> list[dict[str, Any]]:
    return [{name: plain(getattr(row, name)) for name in names} for row in rows]


def code_of(task: Task) -> list[str]:
    """Names, `module:attribute`, of the user's own code that a task is made of."""
    return [name for name in (task.name, *task.added) if is_entry_point(name)]


def code_digests(names: Iterable[str]) -> dict[str, str | None]:
    """SHA-256 of the modules of a user's own code, by module; None where there is no file.

    Parameters
    ----------
    names
        `module:attribute` each, of what is loaded.
    """
    modules = dict.fromkeys(name.partition(":")[0] for name in names)
    files = {name: getattr(sys.modules.get(name), "__file__", None) for name in modules}
    return {name: file and file_digest(Path(file)) for name, file in files.items()}
