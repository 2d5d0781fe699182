"""What came of a study: a table of its trials, and plots."""

from __future__ import annotations

import functools
import shlex
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flyrl.cli.study import ERROR, RUN, Plan
from flyrl.cli.tables import print_table
from flyrl.files import write_text
from flyrl.text import csv_text

if TYPE_CHECKING:
    from optuna import Study
    from optuna.trial import FrozenTrial

TABLE_FILE: Final = "study.csv"

_SHOWN: Final = 10
_COLUMNS: Final = ("trial", "state", "value", "success", "return", "decisions", "seconds")
_STATES: Final = {
    "COMPLETE": "complete",
    "PRUNED": "pruned",
    "FAIL": "failed",
    "RUNNING": "interrupted",
    "WAITING": "waiting",
}

Row = dict[str, Any]


def tell(study: Study, plan: Plan, *, is_ended: bool) -> bool:
    """Write the table of all trials and print the best; at the end, draw plots as well.

    Returns
    -------
    Whether a trial came to its end.
    """
    from flyrl.cli.search_space import short_text  # noqa: PLC0415

    trials = study.get_trials(deepcopy=False)
    rows = [_row(trial, plan) for trial in trials]
    columns = [*_COLUMNS, *plan.space, "run", "error"]
    write_text(plan.folder / TABLE_FILE, csv_text(columns, rows))
    complete = [row for row in rows if row["state"] == "complete"]
    complete.sort(key=lambda row: row["value"], reverse=True)
    counts = Counter(row["state"] for row in rows)
    counted = ", ".join(f"{number} {state}" for state, number in counts.items())
    if not complete:
        print(f"no trial came to its end: {counted or 'no trials'}")
        return False
    shown = [{key: short_text(value) for key, value in row.items()} for row in complete[:_SHOWN]]
    print_table([*_COLUMNS[:1], *_COLUMNS[2:], *plan.space, "run"], shown)
    print(f"{len(rows)} trials: {counted}; all of them are in {plan.folder / TABLE_FILE}")
    if is_ended:
        _plot(study, plan.folder)
    best = plan.values(trials[complete[0]["trial"]])
    print(f"best: {shlex.join(plan.command(best))}")
    return True


def _row(trial: FrozenTrial, plan: Plan) -> Row:
    from flyrl.cli.search_space import override_text  # noqa: PLC0415

    duration = trial.duration
    return {
        "trial": trial.number,
        "state": _STATES[trial.state.name],
        "value": trial.value,
        "success": trial.user_attrs.get("success_rate"),
        "return": trial.user_attrs.get("mean_return"),
        "decisions": trial.user_attrs.get("decisions"),
        "seconds": None if duration is None else duration.total_seconds(),
        "run": trial.user_attrs.get(RUN),
        "error": trial.user_attrs.get(ERROR),
        **{
            key: override_text(value) if isinstance(value, list) else value
            for key, value in plan.values(trial).items()
        },
    }


def _plot(study: Study, folder: Path) -> None:
    """Draw the course of the study, and how the value depends on every setting."""
    from optuna.exceptions import ExperimentalWarning  # noqa: PLC0415
    from optuna.visualization import matplotlib as plots  # noqa: PLC0415

    from flyrl.report.plots import write_plots  # noqa: PLC0415

    drawings: dict[str, Callable[..., Any]] = {
        "history": plots.plot_optimization_history,
        "importances": plots.plot_param_importances,
        "slices": plots.plot_slice,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        # Optuna would draw bars of equal height
        warnings.filterwarnings("error", "The number of trials is too small", UserWarning)
        for name, draw in drawings.items():
            try:
                write_plots(folder, {name: functools.partial(draw, study, target_name="value")})
            except (ValueError, RuntimeError, UserWarning) as error:
                print(f"no plot of the {name}: {error}", file=sys.stderr)
