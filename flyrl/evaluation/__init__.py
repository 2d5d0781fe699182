"""Every entrant on every terrain -> paired results: metrics, statistics, results files."""

import importlib
from typing import TYPE_CHECKING, Any, Final

from flyrl.evaluation.config import EvaluationConfig as EvaluationConfig

if TYPE_CHECKING:
    from flyrl.evaluation.drive_map import measure_drive_map as measure_drive_map
    from flyrl.evaluation.drive_map import measure_steering as measure_steering
    from flyrl.evaluation.entrants import Entrant as Entrant
    from flyrl.evaluation.entrants import make_entrants as make_entrants
    from flyrl.evaluation.results import Results as Results
    from flyrl.evaluation.results import ResultsError as ResultsError
    from flyrl.evaluation.results import load_results as load_results
    from flyrl.evaluation.results import write_results as write_results
    from flyrl.evaluation.run import evaluate as evaluate
    from flyrl.evaluation.run import walk_examples as walk_examples

# what needs pandas and SciPy's statistics is imported when it is first asked for
_ON_DEMAND: Final = {
    "drive_map": ("measure_drive_map", "measure_steering"),
    "entrants": ("Entrant", "make_entrants"),
    "results": ("Results", "ResultsError", "load_results", "write_results"),
    "run": ("evaluate", "walk_examples"),
}


def __getattr__(name: str) -> Any:
    for module, names in _ON_DEMAND.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
