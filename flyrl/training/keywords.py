"""Keywords, as one writes them in Python, and tuned settings: to the config of a training."""

from dataclasses import fields
from typing import Any

from flyrl.envs.config import UnexpectedArgumentError, config_for
from flyrl.envs.core import EnvConfig
from flyrl.files import load_yaml
from flyrl.resources import configs_folder, tuned_name
from flyrl.tasks import Task, TaskSettings
from flyrl.training.algorithms import ALGORITHMS
from flyrl.training.config import ScheduleConfig, TrainingConfig
from flyrl.training.loggers import LOGGERS, LoggerConfig
from flyrl.training.runs import present_names
from flyrl.validation import did_you_mean, one_of


def config_from_keywords(
    task: TaskSettings | Task = "target",
    algo: str = "ppo",
    *,
    seed: int = 0,
    logger: str | LoggerConfig | None = None,
    **settings: Any,
) -> TrainingConfig:
    """Config of a training, the same that the command line composes of the same settings.

    Parameters
    ----------
    task
        Name of the task, or a task of your own.
    algo
        Name of the algorithm, see `flyrl.training.algorithms.ALGORITHMS`.
    seed
        Of the network, the exploration and the episodes.
    logger
        Service that the metrics are sent to as well: its settings, or its name for the usual ones.
    settings
        Fields of the algorithm's config, of `ScheduleConfig` and of `EnvConfig`, and parameters of
        the task. Those that are
        not given are the ones that were tuned for the task and the algorithm, else the usual ones.

    Raises
    ------
    UnexpectedArgumentError
        A keyword that neither the environment, the algorithm nor the schedule has. A TypeError and
        a ValueError.
    ValueError
        A value that is not allowed.
    """
    settings = present_names(settings)
    kind = ALGORITHMS[one_of("algo", algo, ALGORITHMS)]
    of_algo = {item.name for item in fields(kind)}
    of_schedule = {item.name for item in fields(ScheduleConfig)}
    of_env = {name: settings[name] for name in settings.keys() - of_algo - of_schedule}
    try:
        env = config_for(EnvConfig, {"task": task, **of_env})
    except UnexpectedArgumentError as error:
        known = [item.name for item in fields(EnvConfig) if item.init]
        known = sorted({*known, *of_algo, *of_schedule} - {"task", "log_gait"})
        raise UnexpectedArgumentError(
            f"a training of {algo} has no setting {error.name!r}{_hint(error.name, known)}",
            error.name,
        ) from None
    tuned = tuned_settings(env.resolved_task.name, algo)
    schedule = {**tuned["training"], **_only(settings, of_schedule)}
    if isinstance(logger, str):
        logger = LOGGERS[one_of("logger", logger, LOGGERS)]()
    return TrainingConfig(
        env=env,
        algo=kind(**{**tuned["algo"], **_only(settings, of_algo)}),
        training=ScheduleConfig(**schedule),
        seed=seed,
        logger=logger,
    )


def _only(settings: dict[str, Any], names: set[str]) -> dict[str, Any]:
    return {name: value for name, value in settings.items() if name in names}


def _hint(name: str, known: list[str]) -> str:
    """Algorithms that have such a setting, or the closest one that there is."""
    having = [
        algo for algo, kind in ALGORITHMS.items() if name in (item.name for item in fields(kind))
    ]
    if having:
        return f", which is one of {', '.join(having)}"
    return f"{did_you_mean(name, known)} (allowed: {', '.join(known)})"


def tuned_settings(task: str, algo: str) -> dict[str, dict[str, Any]]:
    """What was tried for a task and an algorithm: `algo` and `training`, each by field.

    Empty where nothing was.
    """
    file = configs_folder() / "tuned" / f"{tuned_name(task, algo)}.yaml"
    given = load_yaml(file) if file.is_file() else {}
    return {"algo": {}, "training": {}, **given}
