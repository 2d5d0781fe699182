"""flyrl-evaluate: let policies and controllers walk the same episodes, and report."""

from __future__ import annotations

import datetime
import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flyrl.cli.entry import Start, run_command
from flyrl.cli.terminal import LEFT_OUT
from flyrl.files import new_folder
from flyrl.text import plain_name

if TYPE_CHECKING:
    from flyrl.evaluation import Entrant, EvaluationConfig


def main(subcommand: Sequence[str] = ()) -> None:
    """Check the command line, then run; the last line printed is `report: <path>`.

    Parameters
    ----------
    subcommand
        What stands between the program and its arguments: `evaluate`, of `flyrl evaluate`.
    """
    run_command("evaluate", run, subcommand=subcommand)


def run(record: dict[str, Any], start: Start) -> None:
    """Evaluate as a composed `configs/evaluate.yaml` says.

    Parameters
    ----------
    record
        Plain values, resolved.
    start
        How the command was started.

    Raises
    ------
    SystemExit
        With status 1 if an entrant crashed, unless this is a job of a sweep.
    """
    from flyrl.cli.config import evaluation_settings, report_config  # noqa: PLC0415

    settings = evaluation_settings(record)
    config, entrants = comparison(record, settings, start.command)
    from flyrl.front.results import compare, results_folder  # noqa: PLC0415

    if settings["folder"] is None:
        now = datetime.datetime.now().astimezone().strftime("%Y-%m-%d_%H%M%S")
        parent = start.sweep or Path("reports")
        name = "_".join(filter(None, [now, plain_name(config.resolved_task.name), start.label]))
        folder = new_folder(parent, name)
    else:
        folder = results_folder(settings["folder"])
    try:
        results = compare(config, folder, entrants)
        report = results.write(folder, **asdict(report_config(settings)))
        print(f"report: {report}")
    except KeyboardInterrupt:
        print(f"resume with: folder={folder}", file=sys.stderr)
        raise
    if not results.is_complete and start.sweep is None:
        raise SystemExit(LEFT_OUT)


def comparison(
    record: dict[str, Any], settings: dict[str, Any], command: Sequence[str]
) -> tuple[EvaluationConfig, list[Entrant]]:
    """Settings of the evaluation, checked down to the policy files, and who takes part.

    Warns on stderr of terms that a policy was trained with in another version.

    Raises
    ------
    ValueError
        A setting, controller or policy file that cannot be used.
    """
    from flyrl.cli.config import evaluation_config  # noqa: PLC0415
    from flyrl.evaluation.entrants import changed_terms, make_entrants  # noqa: PLC0415

    config = evaluation_config(record, settings, shlex.join(command))
    entrants = make_entrants(config)
    for entrant in entrants:
        for module in changed_terms(entrant, config.resolved_task):
            print(
                f"warning: {entrant.name} was trained with another version of {module}",
                file=sys.stderr,
            )
    return config, entrants
