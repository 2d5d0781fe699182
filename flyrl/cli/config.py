"""From the composed config to the dataclasses that the rest of flyrl takes."""

from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields
from typing import Any, Final

from flyrl.envs.config import EnvConfig
from flyrl.evaluation import EvaluationConfig
from flyrl.evaluation.config import ENV_GROUPS, ReportConfig
from flyrl.training.algorithms import ALGORITHMS, AlgorithmConfig
from flyrl.training.config import LARGEST_SEED, ScheduleConfig, TrainingConfig
from flyrl.training.loggers import LOGGERS, LoggerConfig
from flyrl.training.runs import present_names
from flyrl.validation import (
    check_fields,
    file_path,
    from_keys,
    known_keys,
    number,
    one_of,
    tuples,
    whole_number,
)

_GROUPS: Final = ("body", "terrain", "controller", "physics", "randomisation")
"""Groups of an environment beside its task."""


def group(config: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Copy of the group of keys at `key` of a config; ValueError if there is none."""
    found = config.get(key)
    if not isinstance(found, Mapping):
        raise ValueError(f"{key} must be a group of keys, got {found!r:.60}")
    return dict(found)


def training_config(config: Mapping[str, Any]) -> TrainingConfig:
    """Settings of a training run.

    Parameters
    ----------
    config
        As `configs/train.yaml` composes it, or as a run folder's `config.yaml` holds it.

    Raises
    ------
    ValueError
        A key or value that is not allowed.
    """
    logger = _logger_config(config) if "logger" in config else None
    return TrainingConfig(
        env=env_config(config),
        training=from_keys("training", present_names(group(config, "training")), ScheduleConfig),
        seed=whole_number("seed", config.get("seed", 0), 0, LARGEST_SEED),
        logger=logger,
        algo=algorithm_config(config),
    )


def env_config(config: Mapping[str, Any]) -> EnvConfig:
    """Settings of an environment, from the groups that `env_record` has as keys.

    Without `randomisation`, as in the oldest records, there is none; with a worm, `controller` is
    null.
    """
    is_legless = config.get("controller", "") is None
    keys = [key for key in _GROUPS if key in config and not (key == "controller" and is_legless)]
    given: dict[str, Any] = {key: group(config, key) for key in keys}
    # an empty group is the usual one
    return EnvConfig(
        task=group(config, "task"), **{key: value for key, value in given.items() if value}
    )


def algorithm_config(config: Mapping[str, Any]) -> AlgorithmConfig:
    """Settings of a learning algorithm, from the group `algo`; `name` picks which."""
    settings = group(config, "algo")
    name = one_of("algo.name", settings.pop("name", None), ALGORITHMS)
    return AlgorithmConfig(name, **settings)


def _logger_config(config: Mapping[str, Any]) -> LoggerConfig | None:
    """Settings of a logger, from the group `logger`; `name` picks which."""
    settings = group(config, "logger")
    name = one_of("logger.name", settings.pop("name", None), ("none", *LOGGERS))
    if name == "none":
        return None
    logger = from_keys("logger", settings, LOGGERS[name])
    check_fields(logger, "logger")
    return logger


_OPTIONS: Final = {"progress_bar": True, "folder": None, **asdict(ReportConfig())}
"""Settings of an evaluation beside those of its EvaluationConfig: see docs/evaluation.md."""

_OF_EVALUATION: Final = tuple(
    each.name
    for each in fields(EvaluationConfig)
    if each.name not in (*ENV_GROUPS, "progress", "command", "settings")
)
_LISTS: Final = ("policies", "controllers", "terrains", "film")


def evaluation_defaults() -> dict[str, Any]:
    """Defaults of the group `evaluation`; null for mappings, as Hydra fills no empty ones."""
    defaults = {each.name: each.default for each in fields(EvaluationConfig)}
    given = {name: None if defaults[name] is MISSING else defaults[name] for name in _OF_EVALUATION}
    return {**given, **_OPTIONS}


def evaluation_settings(config: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of an evaluation with their defaults, where one value stands for a list of one.

    Parameters
    ----------
    config
        The group `evaluation`; or what holds its keys beside other groups, as
        `configs/evaluate.yaml` does.

    Raises
    ------
    ValueError
        A key that does not exist, or a value of `_OPTIONS` that is not allowed.
    """
    own = {key: value for key, value in config.items() if key not in ENV_GROUPS}
    if own.get("controller", "") is None:  # in a task for worms; entrants bring their own
        del own["controller"]
    known_keys("evaluation", own, (*_OF_EVALUATION, *_OPTIONS))
    for key in _LISTS:
        is_word = key == "film" and isinstance(own.get(key), str)
        if isinstance(own.get(key), str | int | float | Mapping) and not is_word:
            own[key] = [own[key]]
    options = {name: own.pop(name, default) for name, default in _OPTIONS.items()}
    one_of("progress_bar", options["progress_bar"], (False, True))
    report_config(options)
    if options["folder"] is not None:
        file_path("folder", options["folder"])
    return {**own, **options}


def report_config(settings: Mapping[str, Any]) -> ReportConfig:
    """Parts of a report, from settings as `evaluation_settings` returns them."""
    return ReportConfig(**{each.name: settings[each.name] for each in fields(ReportConfig)})


def _varied(given: Any) -> dict[str, tuple[Any, ...]]:
    """Values of each quantity, with tuples in place of lists; one value is a list of one."""
    return {
        name: tuples(values if isinstance(values, list | tuple) else [values])
        for name, values in group({"vary": given}, "vary").items()
    }


def evaluation_config(
    config: Mapping[str, Any], settings: Mapping[str, Any], command: str
) -> EvaluationConfig:
    """Settings of an evaluation.

    Parameters
    ----------
    config
        Holds the groups task, body, physics and randomisation.
    settings
        As `evaluation_settings` returns them.
    command
        What was typed.

    Raises
    ------
    ValueError
        A key or value that is not allowed.
    """
    groups = {key: group(config, key) for key in ENV_GROUPS if key in config}
    task = group(config, "task")
    asked = task.pop("decision_interval", None)
    env = env_config({**groups, "task": task})
    given = {name: settings[name] for name in _OF_EVALUATION if name in settings}
    given |= {name: given.get(name) or {} for name in ("vary", "smallest_effects")}
    found = EvaluationConfig(
        **{**given, "vary": _varied(given["vary"])},
        task=task,
        body=env.scene.body,
        physics=env.scene.physics,
        randomisation=env.resolved_randomisation,
        progress=settings["progress_bar"],
        settings={**groups, **settings},
        command=command,
    )
    own = found.env(found.terrains[0]).decision_interval_s
    if asked is not None and number("task.decision_interval", asked) != own:
        raise ValueError(
            "task.decision_interval must be null in an evaluation, where a learned policy brings "
            f"its own and a fixed one takes the task's, {own}, got {asked}"
        )
    return found
