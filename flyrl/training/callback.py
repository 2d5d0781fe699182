"""Callback of a training run: progress, evaluation, saving, stopping, interruption."""

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any, Final

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from flyrl.envs.config import env_record
from flyrl.envs.core import BatchedEnv
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.files import replacing, write_text
from flyrl.policies import LearnedPolicy, observation_layout
from flyrl.policies.bundle import PolicyBundle, save_bundle
from flyrl.policies.sb3 import bundle_from_sb3
from flyrl.progress import progress_bar
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.simulation.physics import preset_record
from flyrl.tasks import Episode, code_digests, code_of
from flyrl.text import csv_text
from flyrl.training.config import (
    CurriculumConfig,
    TrainingConfig,
    lasting_settings,
    training_record,
)
from flyrl.training.models import learner_state
from flyrl.training.run_folder import checkpoint_file, save_checkpoint, write_json
from flyrl.training.runs import STATUS_FILE, checkpoint_files, score

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def interruption() -> Iterator[list[signal.Signals]]:
    """Catch the signals inside the block; the first one stands in the list, a second one raises.

    Outside the main thread, nothing is caught.
    """
    asked: list[signal.Signals] = []

    def ask(number: int, frame: FrameType | None) -> None:
        if asked:
            raise KeyboardInterrupt  # asked twice: drop everything
        asked.append(signal.Signals(number))

    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    previous = {number: signal.signal(number, ask) for number in _SIGNALS}
    try:
        yield asked
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


STOPPING: Final = "the run stops after this rollout; a second Ctrl-C drops the rollout"

HELD_OUT_SEEDS: Final = range(2**31, 3 * 2**30)
"""Seeds of the held-out episodes: above those that training draws, below those of evaluations."""

GoesOn = Callable[[Sequence[Mapping[str, float]]], bool]
"""Takes the evaluations so far, the latest last, and returns whether the run continues."""


def held_out_episodes(config: TrainingConfig) -> list[Episode]:
    """Episodes of the evaluation during training; no run learns from them."""
    rng = np.random.default_rng(config.training.evaluation_seed)
    seeds = rng.integers(
        HELD_OUT_SEEDS.start, HELD_OUT_SEEDS.stop, size=config.training.evaluation_episodes
    )
    return [config.env.sample_episode(int(seed)) for seed in seeds]


def fly_env(model: BaseAlgorithm) -> FlyrlVecEnv:
    """The environment that a model learns in, without what normalises it."""
    assert model.env is not None
    env = model.env.unwrapped
    assert isinstance(env, FlyrlVecEnv)
    return env


def _means(records: Sequence[EpisodeRecord]) -> dict[str, float]:
    """Means over episodes, by column of `evaluations.csv`."""
    columns = [
        {
            "success_rate": record.success,
            "mean_return": record.return_,
            "mean_duration_s": record.duration_s,
            "advance_mm": record.position_w[-1, 0] - record.position_w[0, 0],
            **record.errors,
            **{f"unweighted_{name}": total for name, total in record.totals.items()},
        }
        for record in records
    ]
    return {name: float(np.mean([each[name] for each in columns])) for name in columns[0]}


@dataclass(frozen=True)
class Curriculum:
    """Present difficulty as a number of steps, and the successes that decide on the next.

    Attributes
    ----------
    level
        Steps that the difficulty is above `start`.
    successes
        Of the latest episodes at this difficulty, the last one last.
    """

    level: int = 0
    successes: tuple[bool, ...] = ()

    def difficulty(self, config: CurriculumConfig) -> float:
        """Difficulty of the episodes that are drawn now, from 0 to 1; 1 without a curriculum."""
        return min(1.0, config.start + self.level * config.step) if config.enabled else 1.0

    def after(self, config: CurriculumConfig, is_success: bool, difficulty: float) -> "Curriculum":
        """Return what follows an episode that ended.

        Parameters
        ----------
        config
            When the difficulty rises and falls.
        is_success
            Whether the task was solved.
        difficulty
            That the episode was drawn at; it counts only if this is still the present one.
        """
        if difficulty != self.difficulty(config):
            return self
        successes = (*self.successes, is_success)[-config.window :]
        share = sum(successes) / config.window
        if len(successes) == config.window:
            if share >= config.raise_at and difficulty < 1.0:
                return Curriculum(self.level + 1)
            if config.lower_at is not None and share <= config.lower_at and self.level:
                return Curriculum(self.level - 1)
        return Curriculum(self.level, successes)


class RunCallback(BaseCallback):
    """Progress bar, evaluation, saving, and stopping when asked to."""

    def __init__(
        self,
        config: TrainingConfig,
        folder: Path,
        interrupted: Sequence[signal.Signals],
        goes_on: GoesOn | None = None,
    ) -> None:
        super().__init__()
        schedule = config.training
        self._config = config
        self._folder = folder
        self._interrupted = interrupted
        self._goes_on = goes_on
        self.is_pruned = False
        self.interrupted_by: signal.Signals | None = None
        self._episodes = held_out_episodes(config)
        num_envs = min(schedule.num_envs, len(self._episodes))
        self._env = BatchedEnv(config.env, num_envs, schedule.num_threads)
        self._evaluations: list[dict[str, float]] = []
        self._curriculum = Curriculum()
        self._next_checkpoint = 0
        self._is_ending = False
        self._is_told = False
        self._start = time.monotonic()
        self._bar = progress_bar(
            schedule.total_timesteps,
            is_shown=schedule.progress_bar,
            unit=" decisions",
            description="training",
        )

    def restore(self, state: Mapping[str, Any]) -> None:
        """Resume from what a checkpoint says of the run."""
        self._evaluations = state["evaluations"]
        self._curriculum = Curriculum(**state["curriculum"])
        self._next_checkpoint = state["next_checkpoint"]
        self._start -= state["wall_time_s"]
        self._bar.initial = min(state["decisions"], self._config.training.total_timesteps)
        self._bar.reset()
        self._show()

    @property
    def difficulty(self) -> float:
        """Difficulty of the training episodes that are drawn now."""
        return self._curriculum.difficulty(self._config.training.curriculum)

    def close(self) -> None:
        """Leave the terminal in order."""
        self._bar.close()

    def _on_step(self) -> bool:
        # set, not added up: the last update may go beyond the total
        total = self._config.training.total_timesteps
        self._bar.update(min(self.num_timesteps, total) - self._bar.n)
        if self._config.training.curriculum.enabled:
            self._adapt()
        if self._interrupted and not (self._is_ending or self._is_told):
            self._is_told = True
            self._bar.write(STOPPING, file=sys.stderr)
        return not self._is_ending

    def _adapt(self) -> None:
        """Count the episodes that just ended, and set the difficulty of those drawn from now on."""
        before, config = self.difficulty, self._config.training.curriculum
        for i in np.flatnonzero(self.locals["dones"]):
            info = self.locals["infos"][i]
            ended = info["is_success"], info["difficulty"]
            self._curriculum = self._curriculum.after(config, *ended)
        fly_env(self.model).core.difficulty = self.difficulty
        self.logger.record("curriculum/difficulty", self.difficulty)
        if successes := self._curriculum.successes:
            self.logger.record("curriculum/success_rate", sum(successes) / len(successes))
        if self.difficulty != before:
            self._show()

    def _show(self) -> None:
        """Write the latest success rate and the difficulty beside the bar."""
        shown = {}
        if self._evaluations:
            shown["success"] = f"{self._evaluations[-1]['success_rate']:.0%}"
        if self._config.training.curriculum.enabled:
            shown["difficulty"] = f"{self.difficulty:.2f}"
        self._bar.set_postfix(shown)

    def _on_rollout_start(self) -> None:
        schedule = self._config.training
        last = self._evaluations[-1]["decisions"] if self._evaluations else 0
        if self.num_timesteps >= last + schedule.evaluation_interval:
            self.is_pruned = not self._evaluate()
        is_ending = bool(self._interrupted) or self.is_pruned or self._is_good_enough
        if self.num_timesteps >= self._next_checkpoint or is_ending:
            self._next_checkpoint = self.num_timesteps + schedule.checkpoint_interval
            self._save_checkpoint()
        # the decision that follows is the last one, and not in the checkpoint: nothing is lost
        self._is_ending = is_ending

    @property
    def _is_good_enough(self) -> bool:
        """Whether the last two evaluations reached `training.stop_at`."""
        stop_at, last = self._config.training.stop_at, self._evaluations[-2:]
        rates = [row["success_rate"] for row in last]
        return stop_at is not None and len(rates) == 2 and min(rates) >= stop_at

    def _on_training_end(self) -> None:
        # settled here: a signal during the last evaluation comes too late to interrupt the run
        self.interrupted_by = self._interrupted[0] if self._interrupted else None
        reason = self.interrupted_by and self.interrupted_by.name
        if self.interrupted_by is not None:
            if not self._is_ending:
                self._save_checkpoint()  # the signal came after the last rollout had begun
            self._save(self._bundle())
        elif self.is_pruned:
            reason = "pruning"  # right after an evaluation: it is saved
        else:
            if not self._is_good_enough:  # nor was it right before
                self._evaluate()
            self.logger.dump(self.num_timesteps)
        write_json(
            self._folder / STATUS_FILE,
            {
                "decisions": self.num_timesteps,
                "wall_time_s": round(time.monotonic() - self._start, 3),
                "interrupted_by": reason,
            },
        )

    def _save_checkpoint(self) -> None:
        state = {
            "learner": learner_state(self.model),
            "env": fly_env(self.model).snapshot(),
            "settings": training_record(self._config),
            "run": {
                "decisions": self.num_timesteps,
                "evaluations": self._evaluations,
                "next_checkpoint": self._next_checkpoint,
                "curriculum": vars(self._curriculum),
                "wall_time_s": time.monotonic() - self._start,
            },
        }
        save_checkpoint(checkpoint_file(self._folder, self.num_timesteps), state)
        for path in checkpoint_files(self._folder)[: -self._config.training.checkpoints_kept]:
            path.unlink()

    def _bundle(self) -> PolicyBundle:
        task = self._config.env.resolved_task
        return bundle_from_sb3(
            self.model,
            observation_layout(task),
            env_record(self._config.env),
            {
                "algo": self._config.algo.name,
                "seed": self._config.seed,
                "decisions": self.num_timesteps,
                "evaluation": None,
                "terms": code_digests(code_of(task)),
                "settings": lasting_settings(self._config),
                "physics_preset": preset_record(self._config.env.scene.physics),
            },
        )

    def _save(self, bundle: PolicyBundle) -> None:
        save_bundle(bundle, self._folder / "last.safetensors")
        with replacing(self._folder / "model.zip") as partial:
            self.model.save(partial)
        normaliser = self.model.get_vec_normalize_env()
        if normaliser is not None:
            with replacing(self._folder / "vecnormalize.pkl") as partial:
                normaliser.save(str(partial))

    def _evaluate(self) -> bool:
        """Evaluate the policy, as it would be saved, on the held-out episodes; keep it if best.

        Returns
        -------
        Whether the run continues.
        """
        bundle = self._bundle()
        records = run_episodes(self._env, LearnedPolicy(bundle), self._episodes)
        row = {"decisions": self.num_timesteps, **_means(records)}
        is_best = score(row) > max(map(score, self._evaluations), default=(-1.0, -np.inf))
        self._evaluations.append(row)
        table = csv_text(list(self._evaluations[0]), self._evaluations)
        write_text(self._folder / "evaluations.csv", table)
        logged = {key: row[key] for key in ("success_rate", "mean_return", "mean_duration_s")}
        for key, value in logged.items():
            self.logger.record(f"evaluation/{key}", value)
        evaluation = {"decisions": self.num_timesteps, **logged}
        bundle = replace(bundle, training={**bundle.training, "evaluation": evaluation})
        self._save(bundle)
        if is_best:
            save_bundle(bundle, self._folder / "best.safetensors")
        self._show()
        return self._goes_on is None or self._goes_on(self._evaluations)
