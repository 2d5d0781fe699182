"""What a training run is made of."""

import dataclasses
import datetime
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final

from flyrl.envs.config import UnexpectedArgumentError, config_for, env_record
from flyrl.envs.core import EnvConfig
from flyrl.files import load_yaml
from flyrl.resources import configs_folder, tuned_name
from flyrl.simulation.batch import MOST_SIMS, MOST_THREADS
from flyrl.tasks import FAILURES, Task, TaskSettings, with_time_limit
from flyrl.text import plain_name
from flyrl.training.algorithms import (
    ALGORITHMS,
    MOST_SAMPLES,
    ON_POLICY,
    AlgorithmConfig,
    further_settings,
)
from flyrl.training.loggers import LOGGERS, LoggerConfig
from flyrl.training.runs import present_names
from flyrl.validation import Within, at_least, check_fields, did_you_mean, one_of, plain, within

LARGEST_SEED: Final = 2**31 - 1


@dataclass(frozen=True, kw_only=True)
class CurriculumConfig:
    """How the difficulty of the training episodes goes from low to 1, the usual one.

    Policies are always evaluated at difficulty 1.

    Attributes
    ----------
    enabled
        Whether there is a curriculum; else every episode has difficulty 1.
    start
        Difficulty of the first episodes, from 0 to 1.
    step
        By how much the difficulty rises or falls at a time.
    window
        Number of episodes, all drawn at the present difficulty, that a change is decided on: the
        latest ones. Some times `training.num_envs`, since successes end first.
    raise_at
        Share of successes from which on the difficulty rises.
    lower_at
        Share of successes down from which the difficulty falls, though not below `start`; with
        None it never does.
    """

    enabled: bool = False
    start: Annotated[float, Within(0, 1)] = 0.0
    step: Annotated[float, Within(1e-6, 1)] = 0.1
    window: Annotated[int, Within(1, 10**6)] = 100
    raise_at: Annotated[float, Within(0, 1)] = 0.7
    lower_at: Annotated[float, Within(0, 1)] | None = None

    def __post_init__(self) -> None:
        check_fields(self, "training.curriculum")
        if self.lower_at is not None and self.lower_at >= self.raise_at:
            raise ValueError(
                "training.curriculum.lower_at must be below training.curriculum.raise_at, "
                f"{self.raise_at}, got {self.lower_at}"
            )


@dataclass(frozen=True, kw_only=True)
class ScheduleConfig:
    """How long to train, on how many flies, and how often to look at the result.

    Attributes
    ----------
    total_timesteps
        Decisions to collect, over all environments; the last update may go a little beyond.
    num_envs
        Flies that walk at the same time.
    num_threads
        Native threads for the physics; 0 takes one per CPU. Does not change the result.
    torch_threads
        Threads of torch. Another number can change the result in its last digits.
    evaluation_interval
        Decisions between two evaluations on the held-out episodes.
    evaluation_episodes
        Number of held-out episodes; the same ones at every evaluation.
    evaluation_seed
        Picks the held-out episodes, which no training run ever draws.
    stop_at
        Success rate on the held-out episodes, from 0 to 1, at which the run ends before
        `total_timesteps`: reached twice in a row. None trains to the end.
    checkpoint_interval
        Decisions between two checkpoints, from which an interrupted run can be resumed.
    checkpoints_kept
        How many of the latest checkpoints stay.
    progress_bar
        Whether to draw one on stderr.
    curriculum
        Whether and how the episodes get harder on the way.
    teacher
        Whose decisions the training starts from: a fixed law, as "pursuit", or a policy; see
        `flyrl.training.imitation`. None starts from chance.
    demonstrations
        How many decisions of the teacher, beside `total_timesteps`; None is 5,000, if there is one.
    """

    total_timesteps: Annotated[int, Within(1, 10**12)] = 120_000
    num_envs: Annotated[int, Within(1, MOST_SIMS)] = 32
    num_threads: Annotated[int, Within(0, MOST_THREADS)] = 0
    torch_threads: Annotated[int, Within(1, MOST_THREADS)] = 1
    evaluation_interval: Annotated[int, Within(1, 10**12)] = 10_000
    evaluation_episodes: Annotated[int, Within(1, MOST_SIMS)] = 32
    evaluation_seed: Annotated[int, Within(0, 2**63 - 1)] = 0
    stop_at: Annotated[float | None, Within(0, 1)] = None
    checkpoint_interval: Annotated[int, Within(1, 10**12)] = 10_000
    checkpoints_kept: Annotated[int, Within(1, 10**6)] = 2
    progress_bar: bool = True
    curriculum: CurriculumConfig = field(default_factory=CurriculumConfig)
    teacher: str | None = None
    demonstrations: Annotated[int | None, Within(1, 10**7)] = None

    def __post_init__(self) -> None:
        check_fields(self, "training")
        if self.teacher is None and self.demonstrations is not None:
            raise ValueError(
                "training.demonstrations must be null without a training.teacher, "
                f"got {self.demonstrations}"
            )

    @property
    def num_demonstrations(self) -> int:
        """Decisions of the teacher; 0 without one."""
        return 0 if self.teacher is None else self.demonstrations or 5_000


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """A training run, in full: two runs of the same config end with the same policy.

    Attributes
    ----------
    env
        What to train in; without a time limit, 3 s. A Dict observation without goals comes as a
        vector.
    algo
        What to train with.
    training
        How long, and on how many flies.
    seed
        Of the network, the exploration and the episodes.
    logger
        Service that the metrics are sent to as well; None sends nothing.
    """

    env: EnvConfig = field(default_factory=EnvConfig)
    algo: AlgorithmConfig = field(default_factory=AlgorithmConfig)
    training: ScheduleConfig = field(default_factory=ScheduleConfig)
    seed: int = 0
    logger: LoggerConfig | None = None

    def __post_init__(self) -> None:
        within("seed", self.seed, 0, LARGEST_SEED)
        task = self.env.resolved_task
        legs = self.env.scene.controller
        if legs is not None and not legs.follows_command:
            raise ValueError(
                f"controller must be hybrid or cpg in a training, got {legs.name!r}, which ignores "
                "the drive, so that no policy can steer it"
            )
        if task.time_limit_s is None:
            env = replace(self.env, task=with_time_limit(self.env.task))
            object.__setattr__(self, "env", env)
        if not task.has_vectors:
            object.__setattr__(self, "env", replace(self.env, as_vectors=True))
        if task.has_goals and self.algo.name == "crossq":
            raise ValueError(
                f"algo must be one that takes the Dict of a task with goals, as {task.name!r}, "
                f"got {self.algo.name!r}"
            )
        if task.actions.is_integer and self.algo.name not in ON_POLICY:
            raise ValueError(
                f"algo must be one of {', '.join(ON_POLICY)} where actions are whole numbers, as "
                f"in {task.name!r}, got {self.algo.name!r}, which needs a task whose actions are "
                "a Box"
            )
        terrain = self.env.scene.terrain
        if self.training.curriculum.enabled and not (task.difficulty or terrain.random):
            raise ValueError(
                "training.curriculum.enabled must be false where all episodes are equally hard, "
                f"got true in {task.name!r} on {terrain.name!r} with terrain.random=false"
            )
        if self.training.teacher is not None and task.has_goals:
            raise ValueError(
                f"training.teacher must be null in a task with goals, as {task.name!r}, "
                f"got {self.training.teacher!r}"
            )
        is_normalised = self.algo.settings["normalize_observation"]
        if self.training.teacher and is_normalised and self.algo.name in ON_POLICY:
            raise ValueError(
                "algo.normalize_observation must be false with a training.teacher, whose actions "
                f"{self.algo.name} learns before the statistics are known, got true"
            )
        self._check_samples()
        if self.algo.settings.get("her"):
            self._check_hindsight()

    def _check_samples(self) -> None:
        """Raise ValueError if the algorithm's settings do not go with the number of flies."""
        settings, num_envs = self.algo.settings, self.training.num_envs
        if self.algo.name not in ON_POLICY:
            at_least("algo.buffer_size", settings["buffer_size"], num_envs)
            return
        n_steps, collected = settings["n_steps"], settings["n_steps"] * num_envs
        if collected > MOST_SAMPLES:
            raise ValueError(
                f"algo.n_steps x training.num_envs must be at most {MOST_SAMPLES}, got "
                f"{n_steps} x {num_envs}"
            )
        if collected % settings.get("batch_size", 1):
            raise ValueError(
                f"algo.batch_size must divide {collected}, the algo.n_steps ({n_steps}) x "
                f"training.num_envs ({num_envs}) of an update, got {settings['batch_size']}"
            )
        if settings.get("normalize_advantage") and collected < 2:
            raise ValueError(
                "algo.n_steps x training.num_envs must be at least 2 with "
                f"algo.normalize_advantage, got {n_steps} x {num_envs}"
            )

    def _check_hindsight(self) -> None:
        """Raise ValueError unless whole episodes are kept and can be replayed with other goals."""
        task = self.env.resolved_task
        if not task.has_goals:
            raise ValueError(
                f"algo.her must be false in a task without goals, got true in {task.name!r} "
                "(target_goal has goals)"
            )
        others = [term.name for term in task.reward if term.of_goals is None]
        ends = [end for end in task.terminations if end not in FAILURES]
        others += [end.outcome for end in ends if not end.is_success]
        if others:
            raise ValueError(
                "algo.her must be false unless goals and failures decide all rewards and "
                f"terminations, got true in {task.name!r} with {others[0]!r}"
            )
        assert task.time_limit_s is not None  # __post_init__ checked
        decisions = round(task.time_limit_s / self.env.decision_interval_s)
        settings, num_envs = self.algo.settings, self.training.num_envs
        needed = f"with algo.her ({num_envs} flies, {decisions} decisions an episode)"
        at_least(
            f"algo.learning_starts {needed}", settings["learning_starts"], num_envs * decisions
        )
        # one that goes on, and the one before
        at_least(f"algo.buffer_size {needed}", settings["buffer_size"], 2 * num_envs * decisions)

    def name(self, now: datetime.datetime, label: str = "") -> str:
        """Name of a run that starts now: date, time, task, terrain, algorithm, seed, label."""
        parts = (
            now.strftime("%Y-%m-%d_%H%M%S"),
            plain_name(self.env.resolved_task.name),
            self.env.scene.terrain.label,
            self.algo.name,
            str(self.seed),
            *filter(None, [label]),
        )
        return "_".join(parts)


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
        Settings of the algorithm, fields of `ScheduleConfig` and of `EnvConfig`, and parameters of
        the task. Those that are not given are the ones that were tuned for the task and the
        algorithm, else the usual ones.

    Raises
    ------
    UnexpectedArgumentError
        A keyword that neither the environment, the algorithm nor the schedule has. A TypeError and
        a ValueError.
    ValueError
        A value that is not allowed.
    """
    settings = present_names(settings)
    one_of("algo", algo, ALGORITHMS)
    of_algo = ALGORITHMS[algo].keys() | further_settings(algo)
    of_schedule = {item.name for item in dataclasses.fields(ScheduleConfig)}
    of_env = {name: settings[name] for name in settings.keys() - of_algo - of_schedule}
    try:
        env = config_for({"task": task, **of_env})
    except UnexpectedArgumentError as error:
        known = {item.name for item in dataclasses.fields(EnvConfig) if item.init}
        known = {*known, *ALGORITHMS[algo], *of_schedule} - {"task", "log_gait"}
        hint = f"{did_you_mean(error.name, known)} (allowed: {', '.join(sorted(known))})"
        if others := [name for name, known in ALGORITHMS.items() if error.name in known]:
            hint = f", which is one of {', '.join(others)}"
        message = f"a training of {algo} has no setting {error.name!r}{hint}"
        raise UnexpectedArgumentError(message, error.name) from None
    # what was tried for the task and the algorithm, if anything was
    file = configs_folder() / "tuned" / f"{tuned_name(env.resolved_task.name, algo)}.yaml"
    tuned = load_yaml(file) if file.is_file() else {}

    def chosen(group: str, names: Iterable[str]) -> dict[str, Any]:
        given = {name: settings[name] for name in names if name in settings}
        return {**tuned.get(group, {}), **given}

    return TrainingConfig(
        env=env,
        algo=AlgorithmConfig(algo, **chosen("algo", of_algo)),
        training=ScheduleConfig(**chosen("training", of_schedule)),
        seed=seed,
        logger=LOGGERS[one_of("logger", logger, LOGGERS)]() if isinstance(logger, str) else logger,
    )


WITHOUT_EFFECT: Final = (
    "logger",
    "training.checkpoint",
    "training.num_threads",
    "training.progress_bar",
)
"""How dotted settings begin that do not change what a run comes to."""


def lasting_settings(config: TrainingConfig) -> dict[str, Any]:
    """Algorithm and schedule as plain values, as far as they decide on what a run comes to."""
    record = training_record(config)
    schedule = {
        key: value
        for key, value in record["training"].items()
        if not f"training.{key}".startswith(WITHOUT_EFFECT)
    }
    return {"algo": record["algo"], "training": schedule}


def training_record(config: TrainingConfig) -> dict[str, Any]:
    """Everything about a run as plain JSON values, keyed like `configs/train.yaml`."""
    record = {
        **env_record(config.env),
        "algo": {"name": config.algo.name, **plain(config.algo.settings)},
        "training": plain(config.training),
        "seed": config.seed,
    }
    if config.logger is not None:
        record["logger"] = {"name": config.logger.name, **dataclasses.asdict(config.logger)}
    return record
