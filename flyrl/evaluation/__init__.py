"""Every entrant on every terrain -> paired results: metrics, statistics, results files."""

from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrants import FIXED, Entrant, changed_terms, make_entrants
from flyrl.evaluation.results import Results, ResultsError, load_results, write_results
from flyrl.evaluation.run import evaluate

__all__ = [
    "FIXED",
    "Entrant",
    "EvaluationConfig",
    "Results",
    "ResultsError",
    "changed_terms",
    "evaluate",
    "load_results",
    "make_entrants",
    "write_results",
]
