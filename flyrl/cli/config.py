"""From the composed config to the dataclasses that the rest of flyrl takes."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, Final

from flyrl.envs.config import EnvConfig
from flyrl.evaluation import EvaluationConfig
from flyrl.evaluation.config import ENV_GROUPS
from flyrl.simulation.rendering import Camera
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


@dataclass(frozen=True, kw_only=True)
class EvaluationSettings:
    """The group `evaluation`.

    Attributes
    ----------
    given
        Fields of the `EvaluationConfig`.
    progress_bar
        Whether to draw one on stderr.
    videos
        Whether to show videos, where a GL library can be used.
    camera
        View of the videos: goal (from the start towards the goal), follow (from ahead) or top.
    close_ups
        Whether to show gait diagrams and curves over time, and the walks under each drive.
    drive_map
        Whether these close-ups hold the walks under each drive.
    folder
        Folder of results and report; None makes a new one in `reports/`.
    """

    given: Mapping[str, Any]
    progress_bar: bool = True
    videos: bool = True
    camera: Camera = "goal"
    close_ups: bool = True
    drive_map: bool = True
    folder: str | None = None

    def __post_init__(self) -> None:
        check_fields(self, "evaluation")
        if self.folder is not None:
            file_path("folder", self.folder)

    @property
    def shown(self) -> dict[str, Any]:
        """Parts of the report, as in `flyrl.front.results.Shown`."""
        return {name: getattr(self, name) for name in _OPTIONS if name not in _NOT_SHOWN}

    def record(self) -> dict[str, Any]:
        """The group as it was composed, plain values."""
        return {**self.given, **{name: getattr(self, name) for name in _OPTIONS}}


_OPTIONS: Final = tuple(each.name for each in fields(EvaluationSettings))[1:]
_NOT_SHOWN: Final = ("progress_bar", "folder")
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
    return EvaluationSettings(given=given).record()


def evaluation_settings(config: Mapping[str, Any]) -> EvaluationSettings:
    """Settings of the group `evaluation`, where one value stands for a list of one."""
    known_keys("evaluation", config, (*_OF_EVALUATION, *_OPTIONS))
    given = {key: value for key, value in config.items() if key in _OF_EVALUATION}
    for key in _LISTS:
        is_word = key == "film" and isinstance(given.get(key), str)
        if isinstance(given.get(key), str | int | float | Mapping) and not is_word:
            given[key] = [given[key]]
    options = {key: value for key, value in config.items() if key in _OPTIONS}
    return EvaluationSettings(given=given, **options)


def own_settings(record: Mapping[str, Any]) -> EvaluationSettings:
    """Settings of an evaluation that stand beside its groups, as in `configs/evaluate.yaml`."""
    own = {key: value for key, value in record.items() if key not in ENV_GROUPS}
    # entrants bring their own controllers; a task for worms says that there is none
    if own.get("controller", "") is None:
        del own["controller"]
    return evaluation_settings(own)


def _varied(given: Any) -> dict[str, tuple[Any, ...]]:
    """Values of each quantity, with tuples in place of lists; one value is a list of one."""
    return {
        name: tuples(values if isinstance(values, list | tuple) else [values])
        for name, values in group({"vary": given or {}}, "vary").items()
    }


def evaluation_config(
    config: Mapping[str, Any], settings: EvaluationSettings, command: str
) -> EvaluationConfig:
    """Settings of an evaluation.

    Parameters
    ----------
    config
        Holds the groups task, body, physics and randomisation.
    settings
        The group evaluation.
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
    given = settings.given
    found = EvaluationConfig(
        **{
            **given,
            "vary": _varied(given.get("vary")),
            "smallest_effects": given.get("smallest_effects") or {},
        },
        task=task,
        body=env.scene.body,
        physics=env.scene.physics,
        randomisation=env.resolved_randomisation,
        progress=settings.progress_bar,
        settings={**groups, **settings.record()},
        command=command,
    )
    own = found.env(found.terrains[0]).decision_interval_s
    if asked is not None and number("task.decision_interval", asked) != own:
        raise ValueError(
            "task.decision_interval must be null in an evaluation, where a learned policy brings "
            f"its own and a fixed one takes the task's, {own}, got {asked}"
        )
    return found
