"""A study with Optuna: its trials are runs, one after the other, and it can be continued.

The folder of a study holds `study.db`, Optuna's storage (SQLite) with every trial, the settings,
the search space and the commands; `study.csv`, Optuna's table of the trials; and the runs.
"""

from __future__ import annotations

import json
import math
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.trial import FrozenTrial, TrialState
from sqlalchemy.exc import SQLAlchemyError

from flyrl.files import write_text
from flyrl.front.runs import illustrate
from flyrl.text import csv_table
from flyrl.training.callback import GoesOn, interruption
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.learn import Run, resume, train
from flyrl.training.runs import flat, held, read_run
from flyrl.validation import did_you_mean

TABLE_FILE: Final = "study.csv"

_FIXED: Final = (
    "seed",
    *(f"training.evaluation_{key}" for key in ("interval", "episodes", "seed")),
)
"""Settings that decide what a trial is measured on, or how lucky it is."""
_FIRST_PRUNED: Final = 2
"""The first evaluation of a trial never prunes it: early success is mostly luck."""
_REPEATS: Final = "repeats"
"""User attribute of a trial that repeats an interrupted one: the number of that."""

Values = Mapping[str, Any]
Space = Mapping[str, BaseDistribution]


@dataclass(frozen=True)
class Plan:
    """A study.

    Attributes
    ----------
    folder
        Where its storage, its table and the runs go.
    configure
        From the values of a trial, by dotted key, to what is trained; ValueError if they are not
        allowed.
    space
        What is searched, see `search_space`.
    trials
        How many the study is to have.
    seed
        Of the search.
    prune_after
        Trials that came to their end before others are ended early; None lets all come there.
    command
        From the values of a trial to the command that trains it alone, for its run folder.
    """

    folder: Path
    configure: Callable[[Values], TrainingConfig]
    space: Space
    trials: int = 50
    seed: int = 0
    prune_after: int | None = 5
    command: Callable[[Values], Sequence[str]] = lambda values: ()

    def values(self, params: Values) -> dict[str, Any]:
        """Values that a trial drew, by key, in the order of the search space."""
        drawn = {key: params[key] for key in self.space if key in params}
        is_list = {key: isinstance(v, str) and v.startswith("[") for key, v in drawn.items()}
        return {key: json.loads(v) if is_list[key] else v for key, v in drawn.items()}


def search_space(written: Mapping[str, Any], settings: Mapping[str, Any], name: str) -> Space:
    """Optuna's distributions of a search space.

    Parameters
    ----------
    written
        Dotted key -> `{low, high}`, with `log` or `step`, or `{choices}`: arguments of Optuna's
        FloatDistribution (IntDistribution for a whole setting) and CategoricalDistribution. A list
        among the choices is stored as JSON.
    settings
        Of a training, nested, as `training_record` has them.
    name
        Of the file, for messages.

    Raises
    ------
    ValueError
        A key that does not exist or cannot be searched, or a range without values.
    """
    known = flat(settings)
    space: dict[str, BaseDistribution] = {}
    for key, given in written.items():
        where = f"{name}: {key}"
        if key not in known:
            raise ValueError(f"{name}: there is no key {key!r}{did_you_mean(key, known)}")
        if key in _FIXED:
            raise ValueError(f"{where} cannot be searched: trials would not be comparable")
        if not isinstance(given, Mapping):
            raise ValueError(f"{where} must be {{low, high}} or {{choices}}, got {given!r}")
        is_whole = isinstance(known[key], int) and not isinstance(known[key], bool)
        try:
            if "choices" in given:
                choices = [json.dumps(v) if isinstance(v, list) else v for v in given["choices"]]
                space[key] = CategoricalDistribution(**{**given, "choices": choices})
            elif not is_whole:
                space[key] = FloatDistribution(**given)
            elif isinstance(given.get("low"), int) and isinstance(given.get("high"), int):
                space[key] = IntDistribution(**given)
            else:
                raise ValueError(f"low and high must be whole numbers, got {dict(given)}")
        except (TypeError, ValueError) as error:
            raise ValueError(f"{where}: {error}") from error
    return space


def check_space(plan: Plan, name: str) -> None:
    """Raise ValueError if a search could draw what cannot be trained.

    Both ends of every range and every choice are tried, beside the first of all others.

    Parameters
    ----------
    plan
        The study.
    name
        Of the file, for messages.
    """
    ends = {
        key: each.choices if isinstance(each, CategoricalDistribution) else (each.low, each.high)  # type: ignore[attr-defined]
        for key, each in plan.space.items()
    }
    first = {key: values[0] for key, values in ends.items()}
    for key, value in ((key, value) for key, values in ends.items() for value in values):
        try:
            plan.configure(plan.values({**first, key: value}))
        except ValueError as error:
            raise ValueError(f"{name} allows {key}={value}, but {error}") from error


def tune(plan: Plan, command: str = "") -> tuple[list[FrozenTrial], int | None]:
    """Start or resume a study, until it has its trials or is interrupted.

    Parameters
    ----------
    plan
        The study.
    command
        What was typed, for the record.

    Returns
    -------
    Its trials, and the number of the signal that ended the search early, or None.

    Raises
    ------
    ValueError
        The folder holds a study with other settings.
    OSError
        The folder or the storage cannot be used, or another process is at it.
    """
    plan.folder.mkdir(parents=True, exist_ok=True)
    with held(plan.folder), interruption() as interrupted, _opened(plan) as study:
        _note(study, plan, command)
        number = _search(study, plan, interrupted)
        columns = ("number", "state", "value", "duration", "params", "user_attrs")
        write_text(plan.folder / TABLE_FILE, csv_table(study.trials_dataframe(columns)))
        return study.trials, number


@contextmanager
def _opened(plan: Plan) -> Iterator[optuna.Study]:
    """The study in Optuna's storage."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    pruner: optuna.pruners.BasePruner = optuna.pruners.NopPruner()
    if plan.prune_after is not None:
        pruner = optuna.pruners.MedianPruner(plan.prune_after, n_warmup_steps=_FIRST_PRUNED)
    path = (plan.folder / "study.db").resolve()
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
    except (optuna.exceptions.StorageInternalError, SQLAlchemyError) as error:
        cause: BaseException = error
        while cause.__cause__ is not None:  # the last is SQLite's own, in one line
            cause = cause.__cause__
        raise OSError(f"{path} cannot be used: {cause}") from error


def _note(study: optuna.Study, plan: Plan, command: str) -> None:
    """Write down what the study is; raise ValueError if the stored one is another."""
    search = {
        key: json.loads(optuna.distributions.distribution_to_json(each))
        for key, each in plan.space.items()
    }
    record = {"seed": plan.seed, "search": search, "settings": training_record(plan.configure({}))}
    now = flat(json.loads(json.dumps(record)))
    before = flat(study.user_attrs["record"]) if "record" in study.user_attrs else now
    for key in {**before, **now}:
        if before.get(key) != now.get(key):
            raise ValueError(
                f"{plan.folder} is a study with other settings: {key} is {before.get(key)}, "
                f"now {now.get(key)}; take another name"
            )
    study.set_user_attr("record", record)
    study.set_user_attr("commands", [*study.user_attrs.get("commands", []), command])


def _search(study: optuna.Study, plan: Plan, interrupted: Sequence[int]) -> int | None:
    """Run what is missing; return the number of the signal that ended it early, if one did."""
    for killed in study.get_trials(states=(TrialState.RUNNING,)):
        _repeat_later(study, killed.number)
    while not interrupted:
        trials = study.get_trials(deepcopy=False)
        count = sum(_REPEATS not in trial.user_attrs for trial in trials)
        if count >= plan.trials and all(each.state != TrialState.WAITING for each in trials):
            return None
        # a generator of its own: what a trial draws depends on those before it, not on whether
        # the study was interrupted between them
        seed = np.random.SeedSequence([plan.seed, count]).generate_state(1)[0]
        study.sampler = optuna.samplers.TPESampler(seed=int(seed))
        number = _run_trial(study, plan, study.ask(dict(plan.space)))
        if number is not None:
            return number
    return interrupted[0] if interrupted else None


def _repeat_later(study: optuna.Study, number: int) -> None:
    """Let a trial with the same values take the place and the run of an interrupted one."""
    left = study.get_trials(deepcopy=False)[number]
    study.tell(number, state=TrialState.FAIL)
    first = left.user_attrs.get(_REPEATS, number)
    study.enqueue_trial(left.params, user_attrs={_REPEATS: first})


def _run_trial(study: optuna.Study, plan: Plan, trial: optuna.Trial) -> int | None:
    """Train as a trial says, or resume its earlier run, and tell Optuna what came of it.

    Returns
    -------
    Number of the signal that ended the search. The trial is repeated, unless it was over.
    """
    values = plan.values(trial.params)
    print(f"trial {trial.number}: {' '.join(command_words(values))}", file=sys.stderr)
    episodes = plan.configure({}).training.evaluation_episodes
    has_one_reward = not any(key.startswith("task.") for key in plan.space)

    def best(evaluations: Sequence[Mapping[str, float]]) -> float:
        return max(score(each, episodes, has_one_reward=has_one_reward) for each in evaluations)

    def goes_on(evaluations: Sequence[Mapping[str, float]]) -> bool:
        reported = study.get_trials(deepcopy=False)[trial.number].intermediate_values
        for count in range(len(reported) + 1, len(evaluations) + 1):
            trial.report(best(evaluations[:count]), count)
        return not trial.should_prune()

    try:
        run = _train(plan, trial, values, goes_on)
    except OSError:  # as would all that follow; the same command repeats the trial
        raise
    except Exception as error:
        if not isinstance(error, ValueError):
            traceback.print_exc()
        trial.set_user_attr("error", f"{type(error).__name__}: {error}")
        study.tell(trial, state=TrialState.FAIL)
        print(f"trial {trial.number} failed: {type(error).__name__}: {error}", file=sys.stderr)
        return None
    trial.set_user_attr("run", run.folder.name)
    if run.interrupted_by is not None:
        _repeat_later(study, trial.number)
        return run.interrupted_by
    summary = read_run(run.folder)
    for key, value in (summary.best or {}).items():
        trial.set_user_attr(key, value)
    if run.is_pruned:
        study.tell(trial, state=TrialState.PRUNED)
        print(f"trial {trial.number} fell behind: it is pruned", file=sys.stderr)
    else:
        study.tell(trial, best(summary.evaluations))
    return run.signal


def _train(plan: Plan, trial: optuna.Trial, values: Values, goes_on: GoesOn) -> Run:
    """Train, or resume the run of the trial that this one repeats."""
    config, command = plan.configure(values), plan.command(values)
    show = partial(illustrate, config, with_video=False)
    label = f"trial-{trial.user_attrs.get(_REPEATS, trial.number)}"
    for path in plan.folder.glob(f"*_{label}"):
        earlier = read_run(path)
        if earlier.state == "finished":
            return Run(path, None)
        if earlier.has_checkpoint:
            return resume(config, path, command, goes_on=goes_on, at_end=show)
    return train(config, plan.folder, command, label, goes_on=goes_on, at_end=show)


def command_words(values: Values) -> list[str]:
    """Values as on the command line."""
    return [f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in values.items()]


def score(evaluation: Mapping[str, float], episodes: int, *, has_one_reward: bool = True) -> float:
    """Value that a study maximises: success, and of equal success, the return.

    Parameters
    ----------
    evaluation
        With `success_rate` and `mean_return`.
    episodes
        That it was over. The return, which has no bounds, is squeezed into less than the success
        of one of them.
    has_one_reward
        Whether all trials have the same reward; if not, the return does not count.
    """
    if not has_one_reward:
        return evaluation["success_rate"]
    share = 0.5 + math.atan(evaluation["mean_return"]) / math.pi
    return evaluation["success_rate"] + share / episodes
