"""All who take part in an evaluation, from their names."""

from __future__ import annotations

from collections import Counter

from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant
from flyrl.evaluation.entry_point import is_policy_factory, make_from_factory
from flyrl.evaluation.fixed import controller_names, make_fixed
from flyrl.evaluation.learned import make_learned
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
    for path in config.policies:
        make = make_from_factory if is_policy_factory(path) else make_learned
        entrant = make(path, config, taken)
        taken.add(entrant.name)
        learned.append(entrant)
    entrants = [*learned, *fixed]
    reference_name(config, entrants)
    for entrant in entrants:
        for terrain in config.terrain_configs:
            try:
                entrant.env(config, terrain)
            except (ValueError, TypeError) as error:
                source = entrant.record["source"] or entrant.name
                raise ValueError(f"{source} cannot walk here: {error}") from error
    return entrants


def reference_name(config: EvaluationConfig, entrants: list[Entrant]) -> str:
    """Name of the entrant that the others are compared with; see `EvaluationConfig`."""
    names = [entrant.name for entrant in entrants]
    if config.reference is not None:
        return one_of("reference", config.reference, names)
    if "hybrid" in names:
        return "hybrid"
    return (*controller_names(config), *names)[0]
