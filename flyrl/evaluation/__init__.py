"""Every entrant on every terrain -> paired results: metrics, statistics, results files."""

import importlib
from typing import TYPE_CHECKING, Any, Final

from flyrl.evaluation.config import EvaluationConfig

if TYPE_CHECKING:
    from flyrl.evaluation.drive_map import measure_drive_map, measure_steering
    from flyrl.evaluation.entrants import Entrant, make_entrants
    from flyrl.evaluation.results import Results, ResultsError, load_results, write_results
    from flyrl.evaluation.run import evaluate, walk_examples

# what needs pandas and SciPy's statistics is imported when it is first asked for
_ON_DEMAND: Final = {
    "Entrant": "entrants",
    "Results": "results",
    "ResultsError": "results",
    "evaluate": "run",
    "load_results": "results",
    "make_entrants": "entrants",
    "measure_drive_map": "drive_map",
    "measure_steering": "drive_map",
    "walk_examples": "run",
    "write_results": "results",
}

__all__ = [
    "Entrant",
    "EvaluationConfig",
    "Results",
    "ResultsError",
    "evaluate",
    "load_results",
    "make_entrants",
    "measure_drive_map",
    "measure_steering",
    "walk_examples",
    "write_results",
]


def __getattr__(name: str) -> Any:
    if name in _ON_DEMAND:
        return getattr(importlib.import_module(f"{__name__}.{_ON_DEMAND[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
