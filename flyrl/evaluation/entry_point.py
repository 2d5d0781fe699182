"""Entrants of a user's own: a function, by its name, that makes a policy."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path

from flyrl.entry_points import is_entry_point, load_module
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant, free_name
from flyrl.files import file_digest
from flyrl.validation import one_of


def is_policy_factory(name: str) -> bool:
    """Whether one of `policies` is `module:factory`."""
    return is_entry_point(name) and not Path(name).exists()


def make_from_factory(name: str, config: EvaluationConfig, taken: Collection[str]) -> Entrant:
    """Entrant of a policy of the user's own, on the hybrid controller.

    Parameters
    ----------
    name
        `module:factory`; the factory is called with the task and returns an object whose `predict`
        is that of Stable-Baselines3 (see `rollouts.Policy`).
    config
        Of the evaluation.
    taken
        Names that are not free any more.

    Raises
    ------
    ValueError
        The module or the factory cannot be used, or what it returns has no `predict`.
    """
    found = load_module(name, "policies", "my_policies:steady")
    attribute = name.partition(":")[2]
    factories = [key for key, value in found.items() if callable(value)]
    factory = found[one_of(f"policies: factory in {found['__name__']}", attribute, factories)]
    try:
        policy = factory(config.resolved_task)
    except Exception as error:
        # the user's own code may raise anything
        raise ValueError(f"policies: {name} raised {type(error).__name__}: {error}") from error
    if not callable(getattr(policy, "predict", None)):
        raise ValueError(
            f"policies: {name} must return a policy with predict(), got a {type(policy).__name__}"
        )
    file = found.get("__file__")
    record = {
        "name": free_name(attribute, taken),
        "kind": "entry_point",
        "leg_controller": config.legs and config.legs.name,
        "policy": f"made by {name}",
        "source": name,
        "sha256": file and file_digest(Path(file)),
        "controller_config": config.legs and asdict(config.legs),
    }
    return Entrant(str(record["name"]), config.legs, policy, None, record)
