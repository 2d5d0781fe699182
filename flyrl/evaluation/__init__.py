"""Every entrant on every terrain -> paired results: metrics, statistics, results files."""

from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.drive_map import measure_drive_map, measure_steering
from flyrl.evaluation.entrant import Entrant
from flyrl.evaluation.entrants import make_entrants
from flyrl.evaluation.examples import walk_examples
from flyrl.evaluation.learned import changed_terms
from flyrl.evaluation.results import Results, ResultsError, load_results, write_results
from flyrl.evaluation.run import drop_parts, evaluate
from flyrl.policies.laws import FIXED

__all__ = [
    "FIXED",
    "Entrant",
    "EvaluationConfig",
    "Results",
    "ResultsError",
    "changed_terms",
    "drop_parts",
    "evaluate",
    "load_results",
    "make_entrants",
    "measure_drive_map",
    "measure_steering",
    "walk_examples",
    "write_results",
]
