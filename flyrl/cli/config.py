"""From the composed config to the dataclasses that the rest of flyrl takes."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Final, get_args

from flyrl.bodies.fly import FLIES, FlyConfig
from flyrl.bodies.worm import WORMS, WormConfig
from flyrl.cli.conversion import from_mapping, group, whole_number
from flyrl.controllers import Controller
from flyrl.controllers.controller import controller_from
from flyrl.envs.config import BodyConfig, EnvConfig
from flyrl.evaluation import EvaluationConfig
from flyrl.simulation.physics import PhysicsConfig
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.simulation.rendering import Camera
from flyrl.tasks import named_function
from flyrl.terrains import terrain_from
from flyrl.training.algorithms import ALGORITHMS, AlgorithmConfig
from flyrl.training.config import ScheduleConfig, TrainingConfig
from flyrl.training.loggers import LOGGERS, LoggerConfig
from flyrl.validation import file_path, number, one_of


def _body(task: Mapping[str, Any], given: Mapping[str, Any]) -> BodyConfig:
    """The group `body`: of a worm in a task for worms, else of a fly."""
    function = named_function(task)
    if function.worm is not None:
        _check_creature(function.name, given, FlyConfig, "a worm", WORMS)
        return from_mapping(WormConfig, given, "body")
    _check_creature(function.name, given, WormConfig, "a fly", FLIES)
    return from_mapping(FlyConfig, given, "body")


def _check_creature(
    task: str, given: Mapping[str, Any], other: type[Any], creature: str, names: Iterable[str]
) -> None:
    """Raise ValueError if the group `body` is of the other creature."""
    if given and given.keys() <= {field.name for field in fields(other)}:
        raise ValueError(
            f"body must be {creature} in the task {task!r} ({', '.join(names)}), got one with "
            f"{', '.join(given)}"
        )


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
    return TrainingConfig(
        env=env_config(config),
        algo=algorithm_config(config.get("algo")),
        training=from_mapping(ScheduleConfig, group(config, "training"), "training"),
        seed=whole_number("seed", config.get("seed")),
        logger=_logger_config(config.get("logger", {"name": "none"})),
    )


def env_config(config: Mapping[str, Any]) -> EnvConfig:
    """Settings of an environment, from the groups that `env_record` has as keys."""
    task = group(config, "task")
    return EnvConfig(
        task=task,
        body=_body(task, group(config, "body")),
        terrain=terrain_from(group(config, "terrain")),
        controller=_controller(config.get("controller")),
        physics=from_mapping(PhysicsConfig, group(config, "physics"), "physics"),
        randomisation=_randomisation(config),
    )


def _controller(given: Mapping[str, Any] | None) -> Controller | None:
    """The group `controller`, which is null with a worm."""
    return None if given is None else controller_from(group({"controller": given}, "controller"))


@dataclass(frozen=True, kw_only=True)
class EvaluationSettings:
    """The group `evaluation`; see `EvaluationConfig` for what it does not say itself.

    Attributes
    ----------
    videos
        Whether to show videos, where a GL library can be used.
    camera
        From where they are filmed, see `flyrl.simulation.rendering.FlyRenderer`.
    close_ups
        Whether to show gait diagrams and curves over time, and what drives do.
    drive_map
        Whether these close-ups hold what drives do.
    folder
        Where results and report go; None makes a new folder in `reports/`.
    """

    policies: tuple[str, ...] = ()
    controllers: tuple[str, ...] | None = EvaluationConfig.controllers
    terrains: tuple[Any, ...] = EvaluationConfig.terrains
    episodes: int = EvaluationConfig.episodes
    seed: int = EvaluationConfig.seed
    vary: dict[str, Any] | None = None
    reference: str | None = EvaluationConfig.reference
    smallest_effects: dict[str, float] | None = None
    trust_pickles: bool = EvaluationConfig.trust_pickles
    study: str | None = EvaluationConfig.study
    paths: int = EvaluationConfig.paths
    film: tuple[int, ...] = EvaluationConfig.film
    num_envs: int = EvaluationConfig.num_envs
    num_threads: int = EvaluationConfig.num_threads
    progress_bar: bool = True
    videos: bool = True
    camera: Camera = "goal"
    close_ups: bool = True
    drive_map: bool = True
    folder: str | None = None

    def __post_init__(self) -> None:
        one_of("camera", self.camera, get_args(Camera))
        if self.folder is not None:
            file_path("folder", self.folder)


_EVALUATION_GROUPS: Final = ("task", "body", "physics", "randomisation")
"""Groups of an evaluation beside its own settings."""


def evaluation_settings(config: Mapping[str, Any], key: str) -> EvaluationSettings:
    """Settings of the group `evaluation`, which stands at `key` (empty: at the top)."""
    return from_mapping(EvaluationSettings, config, key)


def own_settings(record: Mapping[str, Any]) -> EvaluationSettings:
    """Settings of an evaluation that stand beside its groups, as in `configs/evaluate.yaml`."""
    own = {key: value for key, value in record.items() if key not in _EVALUATION_GROUPS}
    # entrants bring their own controllers; a task for worms says that there is none
    if own.get("controller", "") is None:
        del own["controller"]
    return evaluation_settings(own, "")


def _varied(given: Mapping[str, Any]) -> dict[str, tuple[Any, ...]]:
    """Values of each quantity, with tuples in place of lists; one value is a list of one."""
    lists = {
        name: values if isinstance(values, list | tuple) else [values]
        for name, values in given.items()
    }
    return {name: tuple(_tuples(value) for value in values) for name, values in lists.items()}


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list | tuple) else value


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
    task = group(config, "task")
    body = _body(task, group(config, "body"))
    asked = task.pop("decision_interval", None)
    found = EvaluationConfig(
        policies=settings.policies,
        controllers=settings.controllers,
        task=task,
        terrains=tuple(
            terrain_from(terrain, f"terrains[{i}]") if isinstance(terrain, Mapping) else terrain
            for i, terrain in enumerate(settings.terrains)
        ),
        episodes=settings.episodes,
        seed=settings.seed,
        body=body,
        physics=from_mapping(PhysicsConfig, group(config, "physics"), "physics"),
        randomisation=_randomisation(config),
        vary=_varied(settings.vary or {}),
        reference=settings.reference,
        smallest_effects=settings.smallest_effects or {},
        trust_pickles=settings.trust_pickles,
        study=settings.study,
        paths=settings.paths,
        film=settings.film,
        num_envs=settings.num_envs,
        num_threads=settings.num_threads,
        progress=settings.progress_bar,
        settings={
            **{key: config[key] for key in _EVALUATION_GROUPS if key in config},
            **asdict(settings),
        },
        command=command,
    )
    own = found.env(found.terrains[0]).decision_interval_s
    if asked is not None and number("task.decision_interval", asked) != own:
        raise ValueError(
            "task.decision_interval must be null in an evaluation, where a learned policy brings "
            f"its own and a fixed one takes the task's, {own}, got {asked}"
        )
    return found


def _randomisation(config: Mapping[str, Any]) -> RandomisationConfig:
    """Ranges of the group randomisation, without which (as in earlier records) there are none."""
    return from_mapping(RandomisationConfig, config.get("randomisation", {}), "randomisation")


def algorithm_config(config: Any) -> AlgorithmConfig:
    """Settings of a learning algorithm; `name` picks which."""
    settings = group({"algo": config}, "algo")
    name = one_of("algo.name", settings.pop("name", None), ALGORITHMS)
    return from_mapping(ALGORITHMS[name], settings, "algo")


def _logger_config(config: Any) -> LoggerConfig | None:
    """Settings of a logger; `name` picks which, without the group (as in records) none."""
    settings = group({"logger": config}, "logger")
    name = one_of("logger.name", settings.pop("name", None), ("none", *LOGGERS))
    return None if name == "none" else from_mapping(LOGGERS[name], settings, "logger")
