"""flyrl tune: search for the best settings with Optuna; the trials are ordinary runs.

The folder of a study holds

- `study.json`: what is searched, the settings of all trials, and the commands;
- `study.db`: Optuna's storage (SQLite): every trial, its values, evaluations and end;
- the run folders of the trials;
- `study.csv`, a line per trial, and the plots.
"""

from __future__ import annotations

import argparse
import datetime
import functools
import importlib.util
import json
import math
import shlex
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from flyrl.cli.sweep import by_key
from flyrl.cli.tables import csv_text, print_table
from flyrl.files import new_folder, write_text
from flyrl.validation import at_least

if TYPE_CHECKING:
    from optuna import Study, Trial
    from optuna.distributions import BaseDistribution
    from optuna.trial import FrozenTrial

    from flyrl.cli.search_space import Choices, Range, Space
    from flyrl.training.config import TrainingConfig
    from flyrl.training.interruption import Interruption
    from flyrl.training.runs import RunSummary

STUDY_FILE: Final = "study.json"
STORAGE_FILE: Final = "study.db"
TABLE_FILE: Final = "study.csv"

_SHOWN: Final = 10
_FIRST_PRUNED: Final = 2
"""The first evaluation of a trial never prunes it: early success is mostly luck."""
_COLUMNS: Final = ("trial", "state", "value", "success", "return", "decisions", "seconds")
_STATES: Final = {
    "COMPLETE": "complete",
    "PRUNED": "pruned",
    "FAIL": "failed",
    "RUNNING": "interrupted",
    "WAITING": "waiting",
}
_RUN, _ERROR = "run", "error"
"""What a trial carries in the storage: name of its run folder, and why it failed."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """What a study is about.

    Attributes
    ----------
    folder
        Of the study.
    overrides
        Given for all trials.
    settings
        Composed of these, nested.
    space
        What is searched.
    trials
        How many the study is to have.
    seed
        Of the search.
    """

    folder: Path
    overrides: tuple[str, ...]
    settings: Mapping[str, Any]
    space: Space
    trials: int
    seed: int

    def config(self, values: Mapping[str, Any]) -> TrainingConfig:
        """Settings of a trial with these values; ValueError if they are not allowed."""
        from flyrl.cli.config import training_config  # noqa: PLC0415
        from flyrl.cli.search_space import with_values  # noqa: PLC0415

        return training_config(with_values(self.settings, values))

    def values(self, trial: Trial | FrozenTrial) -> dict[str, Any]:
        """What a trial drew, by key, in the order of the search space."""
        return {
            key: dimension.value(trial.params[key])
            for key, dimension in self.space.items()
            if key in trial.params
        }

    def command(self, values: Mapping[str, Any]) -> list[str]:
        """The command that trains with these values, without the study."""
        from flyrl.cli.search_space import override_text  # noqa: PLC0415

        drawn = (f"{key}={override_text(value)}" for key, value in values.items())
        given = (item for item in self.overrides if not by_key((item,)).keys() & values.keys())
        return ["flyrl-train", *given, *drawn]


def add_to(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "tune",
        help="search for the best settings with Optuna",
        description="Train again and again with settings that Optuna draws from a search space, "
        "and end those early that fall behind. The same command with the same name goes on with "
        "a study; more trials make it longer.",
        epilog="What is maximised: the best success rate on the held-out episodes; of equal ones, "
        "that with the higher return. Exit status: 0, 1 if no trial came to its end, 2 for an "
        "error, 128 + the signal's number after an interruption.",
    )
    parser.add_argument(
        "overrides", nargs="*", metavar="KEY=VALUE", help="settings of all trials, as of train.py"
    )
    parser.add_argument("--name", help="of the study (default: date and time)")
    parser.add_argument("--trials", type=int, default=50, help="in all (default: 50)")
    parser.add_argument(
        "--search",
        metavar="SPACE",
        help="a file of configs/search, or a YAML file of your own (default: as the algorithm)",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the search (default: 0)")
    parser.add_argument(
        "--prune-after",
        type=int,
        default=5,
        metavar="TRIALS",
        help="that came to their end, before others are ended early (default: 5)",
    )
    parser.add_argument("--no-pruning", action="store_true", help="let every trial come to its end")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Go on with a study, or start it."""
    if importlib.util.find_spec("optuna") is None:
        raise ValueError("flyrl tune needs Optuna: pip install 'flyrl[optuna]'")
    at_least("--trials", options.trials, 1)
    at_least("--seed", options.seed, 0)
    at_least("--prune-after", options.prune_after, 1)
    plan, written = _plan(options)
    # a mistake has been reported by now, without Optuna and torch
    from flyrl.training.interruption import interruption  # noqa: PLC0415
    from flyrl.training.runs import held  # noqa: PLC0415

    if options.name is None:
        folder = new_folder(plan.folder.parent, plan.folder.name)
        plan = replace(plan, folder=folder)
    plan.folder.mkdir(parents=True, exist_ok=True)
    prune_after = None if options.no_pruning else options.prune_after
    with held(plan.folder), interruption() as interrupted:
        _note(plan, written)
        with _opened(plan, prune_after) as study:
            number = _search(study, plan, interrupted)
            has_best = _tell(study, plan, is_ended=number is None)
    if number is not None:
        print(f"interrupted; go on with the same command and --name {plan.folder.name}")
    print(f"study: {plan.folder}")
    return 128 + number if number is not None else int(not has_best)


def _plan(options: argparse.Namespace) -> tuple[Plan, dict[str, Any]]:
    """Check what was asked for; return it, and the search space as it was written."""
    from flyrl.cli.config import training_config  # noqa: PLC0415
    from flyrl.cli.search_space import (  # noqa: PLC0415
        check_space,
        find_space,
        read_space,
        search_space,
    )
    from flyrl.training.config import training_record  # noqa: PLC0415

    settings = compose_training(options.overrides)
    for key in ("resume", "evaluate_after"):
        if settings[key]:
            raise ValueError(f"flyrl tune only trains; {key} cannot be given with it")
    record = training_record(training_config(settings))
    path = find_space(options.search, record["algo"]["name"])
    written = read_space(path)
    space = search_space(written, {key: settings[key] for key in record}, str(path))
    for key in by_key(options.overrides):
        if key in space:
            print(f"{key} is searched: what is given for it is not taken", file=sys.stderr)
    name = options.name
    if name is None:
        name = datetime.datetime.now().astimezone().strftime("%Y-%m-%d_%H%M%S")
    elif name in {"", ".", ".."} or Path(name).name != name:
        raise ValueError(f"--name must be the name of a folder, got {name!r}")
    folder = Path(settings["runs_folder"]) / "studies" / name
    plan = Plan(folder, tuple(options.overrides), settings, space, options.trials, options.seed)
    check_space(space, plan.config, str(path))
    return plan, written


def compose_training(overrides: Sequence[str]) -> dict[str, Any]:
    """Settings that `train.py` would take with these overrides, as plain values.

    Raises
    ------
    ValueError
        An override that `train.py` refuses, or that asks for more than one run.
    """
    from hydra import compose, initialize_config_dir  # noqa: PLC0415
    from hydra.core.override_parser.overrides_parser import OverridesParser  # noqa: PLC0415

    from flyrl.cli.arguments import (  # noqa: PLC0415
        HYDRA_VERSION,
        check_arguments,
        plain_values,
    )
    from flyrl.resources import configs_folder  # noqa: PLC0415

    is_sweep = check_arguments("train", overrides) is not None
    for override in OverridesParser.create().parse_overrides(list(overrides)):
        if is_sweep or override.is_sweep_override():
            raise ValueError(
                "flyrl tune trains one after the other, and searches what the search space "
                f"says; it takes no sweep, got {override.input_line if not is_sweep else overrides}"
            )
    folder = str(configs_folder().resolve())
    with initialize_config_dir(folder, job_name="train", version_base=HYDRA_VERSION):
        return plain_values(compose("train", list(overrides)))


def _note(plan: Plan, written: Mapping[str, Any]) -> None:
    """Write down what the study is; raise ValueError if the one in its folder is another."""
    from flyrl.training.config import training_record  # noqa: PLC0415
    from flyrl.training.runs import flat  # noqa: PLC0415

    path = plan.folder / STUDY_FILE
    record = {
        "seed": plan.seed,
        "search": dict(written),
        "settings": training_record(plan.config({})),
    }
    commands: list[str] = []
    if path.exists():
        try:
            earlier = json.loads(path.read_text())
            commands = [str(command) for command in earlier["commands"]]
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path} cannot be read: {error}") from error
        before = flat({key: earlier.get(key) for key in record})
        now = flat(json.loads(json.dumps(record)))
        for key in dict.fromkeys([*before, *now]):
            if before.get(key) != now.get(key):
                raise ValueError(
                    f"{plan.folder} is a study with other settings: {key} is {before.get(key)}, "
                    f"now {now.get(key)}; take another --name"
                )
    elif any(plan.folder.glob("[!.]*")):
        raise ValueError(f"{plan.folder} holds something else than a study; take another --name")
    commands.append(shlex.join(["flyrl", *sys.argv[1:]]))
    write_text(path, json.dumps({"commands": commands, **record}, indent=2) + "\n")


@contextmanager
def _opened(plan: Plan, prune_after: int | None) -> Iterator[Study]:
    """The study in Optuna's storage; nothing is pruned without a number of trials."""
    import optuna  # noqa: PLC0415

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    pruner: optuna.pruners.BasePruner = optuna.pruners.NopPruner()
    if prune_after is not None:
        pruner = optuna.pruners.MedianPruner(prune_after, n_warmup_steps=_FIRST_PRUNED)
    path = (plan.folder / STORAGE_FILE).resolve()
    try:
        storage = optuna.storages.RDBStorage(f"sqlite:///{path}")
        try:
            yield optuna.create_study(
                storage=storage,
                study_name=plan.folder.name,
                direction="maximize",
                pruner=pruner,
                load_if_exists=True,
            )
        finally:
            storage.remove_session()
            storage.engine.dispose()
    except _storage_errors() as error:
        cause: BaseException = error
        while cause.__cause__ is not None:  # the last is SQLite's own, in one line
            cause = cause.__cause__
        raise OSError(f"{plan.folder / STORAGE_FILE} cannot be used: {cause}") from error


def _storage_errors() -> tuple[type[Exception], ...]:
    """What Optuna's storage raises, of a full disk say."""
    from optuna.exceptions import StorageInternalError  # noqa: PLC0415
    from sqlalchemy.exc import SQLAlchemyError  # noqa: PLC0415

    return StorageInternalError, SQLAlchemyError


def _search(study: Study, plan: Plan, interrupted: Interruption) -> int | None:
    """Run what is missing; return the number of the signal that ended it early, if one did."""
    from optuna.samplers import TPESampler  # noqa: PLC0415
    from optuna.trial import Trial, TrialState  # noqa: PLC0415

    number: int | None = None
    for left in study.get_trials(states=(TrialState.RUNNING,)):
        trial = Trial(study, left._trial_id)
        earlier = _left_run(study, left, plan)
        if earlier is None:
            _fail(study, trial, "killed")
        elif number is None:
            told = max(left.intermediate_values, default=0)
            number = _run_trial(study, trial, plan, earlier, told)
    distributions = {key: _distribution(dimension) for key, dimension in plan.space.items()}
    while number is None and (count := len(study.trials)) < plan.trials:
        if interrupted.signal is not None:
            return interrupted.signal
        # a generator of its own: what a trial draws depends on those before it, not on whether
        # the study was interrupted between them
        seed = np.random.SeedSequence([plan.seed, count]).generate_state(1)[0]
        study.sampler = TPESampler(seed=int(seed))
        number = _run_trial(study, study.ask(distributions), plan)
    return number


def _left_run(study: Study, trial: FrozenTrial, plan: Plan) -> RunSummary | None:
    """The run of a trial without an end, if there is something of it to go on with."""
    from flyrl.training.config import training_record  # noqa: PLC0415
    from flyrl.training.run_folder import RunFolder  # noqa: PLC0415
    from flyrl.training.runs import find_runs, read_run  # noqa: PLC0415

    others = [other for other in study.get_trials(deepcopy=False) if other.number != trial.number]
    taken = {other.user_attrs.get(_RUN) for other in others}
    try:
        settings = training_record(plan.config(plan.values(trial)))
    except ValueError:
        return None
    # by its settings: a trial that is killed knows nothing of its run
    for path in find_runs(plan.folder):
        run = read_run(path)
        can_go_on = run.state == "finished" or RunFolder(path).checkpoints()
        if path.name not in taken and run.settings == settings and can_go_on:
            return run
    return None


def _distribution(dimension: Range | Choices) -> BaseDistribution:
    from optuna.distributions import (  # noqa: PLC0415
        CategoricalDistribution,
        FloatDistribution,
        IntDistribution,
    )

    from flyrl.cli.search_space import Choices  # noqa: PLC0415

    if isinstance(dimension, Choices):
        return CategoricalDistribution(list(dimension.labels))
    low, high, step = dimension.low, dimension.high, dimension.step
    if dimension.is_whole:
        return IntDistribution(int(low), int(high), log=dimension.log, step=int(step or 1))
    return FloatDistribution(low, high, log=dimension.log, step=step)


def _run_trial(
    study: Study, trial: Trial, plan: Plan, earlier: RunSummary | None = None, told: int = 0
) -> int | None:
    """Train as a trial says, or go on with its earlier run, and tell Optuna what came of it.

    Parameters
    ----------
    study, trial, plan
        What to train.
    earlier
        Its run.
    told
        How many evaluations of it Optuna knows; none of them ended it.

    Returns
    -------
    Number of the signal that ended the search. The trial is gone on with, unless it was over.
    """
    from optuna.trial import TrialState  # noqa: PLC0415

    from flyrl.cli.train import illustrate  # noqa: PLC0415
    from flyrl.training.learn import Run, resume, train  # noqa: PLC0415
    from flyrl.training.runs import read_run  # noqa: PLC0415

    values = plan.values(trial)
    drawn = " ".join(f"{key}={_short(value)}" for key, value in values.items())
    print(f"trial {trial.number} ({trial.number + 1} of {plan.trials}): {drawn}", file=sys.stderr)
    episodes = plan.config({}).training.evaluation_episodes

    def best(evaluations: Sequence[Mapping[str, float]]) -> float:
        return max(score(evaluation, episodes) for evaluation in evaluations)

    def goes_on(evaluations: Sequence[Mapping[str, float]]) -> bool:
        if len(evaluations) <= told:
            return True
        trial.report(best(evaluations), len(evaluations))
        return not trial.should_prune()

    command = plan.command(values)
    try:
        config = plan.config(values)
        show = functools.partial(illustrate, config, with_video=False)
        if earlier is None:
            finished = train(config, plan.folder, command, goes_on=goes_on, at_end=show)
        elif earlier.state == "finished":
            finished = Run(earlier.path, None)
        else:
            finished = resume(config, earlier.path, command, goes_on=goes_on, at_end=show)
        trial.set_user_attr(_RUN, finished.folder.name)
    except _storage_errors():
        raise
    except (OSError, KeyboardInterrupt) as error:
        _fail(study, trial, f"{type(error).__name__}: {error}")  # as would all that follow
        raise
    except Exception as error:
        if not isinstance(error, ValueError):
            traceback.print_exc()
        _fail(study, trial, f"{type(error).__name__}: {error}")
        return None
    if finished.interrupted_by is not None:
        return finished.interrupted_by
    summary = read_run(finished.folder)
    for key, value in (summary.best or {}).items():
        trial.set_user_attr(key, int(value) if key == "decisions" else value)
    if finished.is_pruned:
        study.tell(trial, state=TrialState.PRUNED)
        print(f"trial {trial.number} fell behind: it is pruned", file=sys.stderr)
    else:
        study.tell(trial, best(summary.evaluations))
    return finished.signal


def _fail(study: Study, trial: Trial, error: str) -> None:
    from optuna.trial import TrialState  # noqa: PLC0415

    trial.set_user_attr(_ERROR, error)
    study.tell(trial, state=TrialState.FAIL)
    print(f"trial {trial.number} failed: {error}", file=sys.stderr)


def score(evaluation: Mapping[str, float], episodes: int) -> float:
    """What a study maximises: success, and of equal success, the return.

    Parameters
    ----------
    evaluation
        With `success_rate` and `mean_return`.
    episodes
        That it was over. The return, which has no bounds, is squeezed into less than the success
        of one of them.
    """
    share = 0.5 + math.atan(evaluation["mean_return"]) / math.pi
    return evaluation["success_rate"] + share / episodes


def _tell(study: Study, plan: Plan, *, is_ended: bool) -> bool:
    """Write the table of all trials and print the best; at the end, draw plots as well.

    Returns
    -------
    Whether a trial came to its end.
    """
    trials = study.get_trials(deepcopy=False)
    rows = [_row(trial, plan) for trial in trials]
    columns = [*_COLUMNS, *plan.space, "run", "error"]
    write_text(plan.folder / TABLE_FILE, csv_text(columns, rows))
    complete = [row for row in rows if row["state"] == "complete"]
    complete.sort(key=lambda row: row["value"], reverse=True)
    counts = Counter(row["state"] for row in rows)
    told = ", ".join(f"{number} {state}" for state, number in counts.items())
    if not complete:
        print(f"no trial came to its end: {told or 'no trials'}")
        return False
    shown = [{key: _short(value) for key, value in row.items()} for row in complete[:_SHOWN]]
    print_table([*_COLUMNS[:1], *_COLUMNS[2:], *plan.space, "run"], shown)
    print(f"{len(rows)} trials: {told}; all of them are in {plan.folder / TABLE_FILE}")
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
        "run": trial.user_attrs.get(_RUN),
        "error": trial.user_attrs.get(_ERROR),
        **{
            key: override_text(value) if isinstance(value, list) else value
            for key, value in plan.values(trial).items()
        },
    }


def _short(value: Any) -> Any:
    """A value as it is shown: with four digits, lists as on the command line."""
    from flyrl.cli.search_space import override_text  # noqa: PLC0415

    if isinstance(value, float):
        return float(f"{value:.4g}")
    return override_text(value) if isinstance(value, list) else value


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
