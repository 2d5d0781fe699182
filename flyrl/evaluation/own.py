"""Entrants of a user's own: functions, objects, or either by its name, on the hybrid controller."""

from __future__ import annotations

import inspect
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flyrl.entry_points import is_entry_point, load_module
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant, free_name
from flyrl.files import file_digest
from flyrl.policies.function import FunctionPolicy, takes
from flyrl.rollouts import Policy
from flyrl.tasks import Task
from flyrl.validation import one_of


def is_own_name(name: str) -> bool:
    """Whether a name in `policies` is `module:attribute`, of something of the user's own."""
    return is_entry_point(name) and not Path(name).exists()


def make_own(given: object, config: EvaluationConfig, taken: Collection[str]) -> Entrant:
    """Entrant of a policy of the user's own.

    Parameters
    ----------
    given
        What `own_policy` takes, or its name, `module:attribute`.
    config
        Of the evaluation.
    taken
        Names that are not free any more.

    Raises
    ------
    ValueError
        The module cannot be used, or what is there is no policy.
    """
    source, file = None, None
    if isinstance(given, str):
        source = given
        found = load_module(given, "policies", "my_policies:steady")
        attribute = given.partition(":")[2]
        known = [key for key, value in found.items() if _is_something(value)]
        given = found[one_of(f"policies: policy in {found['__name__']}", attribute, known)]
        name, file = attribute, found.get("__file__")
    else:
        name = getattr(given, "__name__", type(given).__name__)
        module = inspect.getmodule(given if hasattr(given, "__name__") else type(given))
        file = getattr(module, "__file__", None)
    record = {
        "name": free_name(name.strip("<>"), taken),
        "kind": "own",
        "leg_controller": config.legs and config.legs.name,
        "policy": f"your own, {source or name}",
        "source": source,
        "sha256": file and file_digest(Path(file)),
        "controller_config": config.legs and asdict(config.legs),
    }
    policy = own_policy(given, source or name, config.resolved_task)
    return Entrant(str(record["name"]), config.legs, policy, None, record)


def own_policy(given: object, name: str, task: Task) -> Policy:
    """Policy of the user's own.

    Parameters
    ----------
    given
        One of three: an object with the `predict` of Stable-Baselines3; a function of one argument,
        the task, that returns such an object; or a function of two, the time and the observation,
        that returns a drive (see `FunctionPolicy`). A function is recognised by how many arguments
        it can be called with.
    name
        Of it, for messages.
    task
        What it is to act in.

    Raises
    ------
    ValueError
        It is none of these, or the function raises an error.
    """
    if isinstance(given, Policy) and not isinstance(given, type):
        return given
    if callable(given) and takes(given, 1):
        try:
            policy = given(task)
        except Exception as error:
            # the user's own code may raise anything
            raise ValueError(f"policies: {name} raised {type(error).__name__}: {error}") from error
        if not isinstance(policy, Policy):
            raise ValueError(
                f"policies: {name} must return a policy with predict(), got a "
                f"{type(policy).__name__}"
            )
        return policy
    if callable(given) and takes(given, 2):
        return FunctionPolicy(given, task)
    raise ValueError(
        f"policies: {name} must be an object with predict(), a function of (time_s, observation) "
        f"that returns a drive, or one of (task) that returns such an object, got a "
        f"{type(given).__name__}"
    )


def _is_something(value: Any) -> bool:
    return callable(value) or isinstance(value, Policy)
