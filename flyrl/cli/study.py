"""A study with Optuna: its trials are runs, one after the other, and it can be continued."""

from __future__ import annotations

import functools
import math
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from flyrl.cli.sweep import by_key

if TYPE_CHECKING:
    from optuna import Study, Trial
    from optuna.distributions import BaseDistribution
    from optuna.trial import FrozenTrial

    from flyrl.cli.search_space import Choices, Range, Space
    from flyrl.training.config import TrainingConfig
    from flyrl.training.interruption import Interruption
    from flyrl.training.runs import RunSummary

STORAGE_FILE: Final = "study.db"

RUN, ERROR = "run", "error"
"""What a trial carries in the storage: name of its run folder, and why it failed."""

_FIRST_PRUNED: Final = 2
"""The first evaluation of a trial never prunes it: early success is mostly luck."""


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


@contextmanager
def opened(plan: Plan, prune_after: int | None) -> Iterator[Study]:
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


def search(study: Study, plan: Plan, interrupted: Interruption) -> int | None:
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
            reported = max(left.intermediate_values, default=0)
            number = _run_trial(study, trial, plan, earlier, reported)
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
    from flyrl.training.runs import find_runs, read_run  # noqa: PLC0415

    others = [other for other in study.get_trials(deepcopy=False) if other.number != trial.number]
    taken = {other.user_attrs.get(RUN) for other in others}
    try:
        settings = training_record(plan.config(plan.values(trial)))
    except ValueError:
        return None
    # by its settings: a trial that is killed knows nothing of its run
    for path in find_runs(plan.folder):
        run = read_run(path)
        can_go_on = run.state == "finished" or run.has_checkpoint
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
    study: Study, trial: Trial, plan: Plan, earlier: RunSummary | None = None, reported: int = 0
) -> int | None:
    """Train as a trial says, or go on with its earlier run, and tell Optuna what came of it.

    Parameters
    ----------
    study, trial, plan
        What to train.
    earlier
        Its run.
    reported
        How many evaluations of it Optuna knows; none of them ended it.

    Returns
    -------
    Number of the signal that ended the search. The trial is continued, unless it was over.
    """
    from optuna.trial import TrialState  # noqa: PLC0415

    from flyrl.cli.search_space import short_text  # noqa: PLC0415
    from flyrl.front.runs import illustrate  # noqa: PLC0415
    from flyrl.training.learn import Run, resume, train  # noqa: PLC0415
    from flyrl.training.runs import read_run  # noqa: PLC0415

    values = plan.values(trial)
    drawn = " ".join(f"{key}={short_text(value)}" for key, value in values.items())
    print(f"trial {trial.number} ({trial.number + 1} of {plan.trials}): {drawn}", file=sys.stderr)
    episodes = plan.config({}).training.evaluation_episodes
    has_one_reward = not any(key.startswith("task.") for key in plan.space)

    def best(evaluations: Sequence[Mapping[str, float]]) -> float:
        return max(score(each, episodes, has_one_reward=has_one_reward) for each in evaluations)

    def goes_on(evaluations: Sequence[Mapping[str, float]]) -> bool:
        if len(evaluations) <= reported:
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
        trial.set_user_attr(RUN, finished.folder.name)
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

    trial.set_user_attr(ERROR, error)
    study.tell(trial, state=TrialState.FAIL)
    print(f"trial {trial.number} failed: {error}", file=sys.stderr)


def score(evaluation: Mapping[str, float], episodes: int, *, has_one_reward: bool = True) -> float:
    """What a study maximises: success, and of equal success, the return.

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
