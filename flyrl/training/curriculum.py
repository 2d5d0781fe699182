"""A curriculum: episodes that get harder as the policy gets better."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from flyrl.validation import at_least, positive, within


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
    start: float = 0.0
    step: float = 0.1
    window: int = 100
    raise_at: float = 0.7
    lower_at: float | None = None

    def __post_init__(self) -> None:
        within("training.curriculum.start", self.start, 0, 1)
        within("training.curriculum.step", positive("training.curriculum.step", self.step), 0, 1)
        at_least("training.curriculum.window", self.window, 1)
        within("training.curriculum.raise_at", self.raise_at, 0, 1)
        if self.lower_at is not None:
            within("training.curriculum.lower_at", self.lower_at, 0, 1)
            if not self.lower_at < self.raise_at:
                raise ValueError(
                    "training.curriculum.lower_at must be below training.curriculum.raise_at, "
                    f"{self.raise_at}, got {self.lower_at}"
                )


class Curriculum:
    """The present difficulty, and the successes that decide on the next.

    Parameters
    ----------
    config
        When it rises and falls.
    """

    def __init__(self, config: CurriculumConfig) -> None:
        self._config = config
        self._level = 0
        self._successes: deque[bool] = deque(maxlen=config.window)

    @property
    def difficulty(self) -> float:
        """Of the episodes that are drawn now, from 0 to 1."""
        return min(1.0, self._config.start + self._level * self._config.step)

    @property
    def success_rate(self) -> float | None:
        """Share of successes among the latest episodes at this difficulty; None without any."""
        return sum(self._successes) / len(self._successes) if self._successes else None

    def count(self, is_success: bool, difficulty: float) -> None:
        """Take note of an episode that ended, and change the difficulty if it is time.

        Parameters
        ----------
        is_success
            Whether the task was solved.
        difficulty
            That the episode was drawn at; it counts only if this is still the present one.
        """
        if difficulty != self.difficulty:
            return
        self._successes.append(is_success)
        share = self.success_rate
        if share is None or len(self._successes) < self._config.window:
            return
        if share >= self._config.raise_at and self.difficulty < 1.0:
            self._change(+1)
        elif self._config.lower_at is not None and share <= self._config.lower_at and self._level:
            self._change(-1)

    def _change(self, levels: int) -> None:
        self._level += levels
        self._successes.clear()

    def state(self) -> dict[str, Any]:
        """Everything that the future depends on, as plain values, for `restore`."""
        return {"level": self._level, "successes": list(self._successes)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Put back what `state` returned."""
        self._level = state["level"]
        self._successes.clear()
        self._successes.extend(state["successes"])
