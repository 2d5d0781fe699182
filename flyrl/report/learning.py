"""What a report says about trainings: their learning curves, and where else they are of use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from flyrl.evaluation.generalisation import Generalisation, generalisation
from flyrl.evaluation.results import Results
from flyrl.evaluation.rows import Json
from flyrl.evaluation.seeds import trainings
from flyrl.report.curves import Evaluations, learning_curves_svg
from flyrl.report.sections import usual_rows


def generalisation_section(results: Results) -> Generalisation | None:
    """Every training on every terrain; None where there is but one terrain."""
    rng = np.random.default_rng(results.protocol["seed"])
    return generalisation(results.protocol, usual_rows(results), rng)


def curves_section(entrants: Sequence[Json], curves: Mapping[str, Evaluations]) -> str:
    """Figure of the learning curves, a line per training; empty without an evaluation.

    Parameters
    ----------
    entrants
        Of the protocol.
    curves
        As in `flyrl.report.html.Additions`.
    """
    groups = [
        (label, [curves[name] for name in names if curves.get(name)])
        for label, names in trainings(entrants).items()
    ]
    if not any(runs for _, runs in groups):
        return ""
    return Markup(learning_curves_svg(groups, "learning-curves"))
