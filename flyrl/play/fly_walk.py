"""One fly that walks from decision to decision, and what there is to tell of it."""

from collections import deque
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.controllers.gait_log import SAMPLING_S
from flyrl.envs.core import BatchedEnv, Observation
from flyrl.play.fly_setting import DISTANCE, ENDLESS, INTERVAL_S, PlayedFlyConfig
from flyrl.simulation.flies import SHOWN, FlyState
from flyrl.tasks import RUNNING, RewardTerm
from flyrl.tasks.target import draw_target
from flyrl.tasks.terms import goal_distance
from flyrl.terrains import Bounds, Flat

GAIT_SPAN_S: Final = 1.0
"""For how long the gait is remembered, s."""

SPEED_SPAN_S: Final = 0.2
"""Over how long the speed is averaged: it sways with every step that the fly takes."""

_GOALS: Final = 20_261_123
"""Sets the generator of later targets apart from the episode's, which has the same seed."""

_OSCILLATORS: Final = ("phases", "magnitudes", "freqs", "amps", "scratch")
"""What a controller with oscillators takes over from another, that it goes on in its stride."""


class FlyWalk:
    """A fly in the task to be played.

    Parameters
    ----------
    config
        Of the fly and its ground.

    Attributes
    ----------
    config
        The same.
    env
        What simulates the fly, the only one in it.
    outcome
        "running", or how the episode has ended: "fall", "left_arena" or "unstable". Then the fly
        stays as it is until it is reset.
    rewards
        What each term of the reward gave for the last decision, weighted, by name.
    """

    def __init__(self, config: PlayedFlyConfig) -> None:
        self.config = config
        self.env = BatchedEnv(config.env(), num_envs=1, num_threads=1)
        self._samples: deque[int] = deque(maxlen=round(GAIT_SPAN_S / SAMPLING_S))
        self._num_samples = 0
        self._trail: deque[tuple[float, float]] = deque(maxlen=1 + round(SPEED_SPAN_S / INTERVAL_S))
        self.reset(config.seed)

    @property
    def state(self) -> FlyState:
        """The fly as it is now; n is 1."""
        state = self.env.state
        assert isinstance(state, FlyState)  # the task is one for flies
        return state

    @property
    def goal(self) -> tuple[float, float]:
        """Where the target is, mm."""
        x, y = self.env.task_state().goal[0]
        return float(x), float(y)

    @property
    def bounds(self) -> Bounds:
        """Extent of the ground, mm."""
        terrain = self.env.config.scene.terrain
        return ENDLESS if isinstance(terrain, Flat) else terrain.bounds

    @property
    def distance_mm(self) -> float:
        """Horizontal distance from the thorax to the target, mm."""
        return float(goal_distance(self.state.position_w, np.array([self.goal]))[0])

    @property
    def speed_mm_s(self) -> float:
        """Horizontal way over `SPEED_SPAN_S`, or since the reset, over the time it took, mm/s."""
        ways = np.linalg.norm(np.diff(self._trail, axis=0), axis=1) if len(self._trail) > 1 else []
        return float(np.sum(ways)) / (max(len(ways), 1) * INTERVAL_S)

    @property
    def returns(self) -> dict[str, float]:
        """What each term of the reward has added up to since the reset, weighted, by name."""
        totals = self.env.task_state().totals
        return {term.name: term.weight * float(totals[term.name][0]) for term in self._terms}

    @property
    def gait(self) -> NDArray[np.uint32]:
        """Samples of `flyrl.controllers.gait_log` over the latest `GAIT_SPAN_S`, oldest first.

        They are `SAMPLING_S` apart, (T,).
        """
        return np.array(self._samples, dtype=np.uint32)

    @property
    def _terms(self) -> tuple[RewardTerm, ...]:
        return self.env.task.reward

    def reset(self, seed: int) -> None:
        """Start the episode of a seed."""
        self.env.reset(seeds=[seed])
        self._goals = np.random.default_rng([_GOALS, seed])
        self.outcome = RUNNING
        self.rewards = {term.name: 0.0 for term in self._terms}
        self._samples.clear()
        self._num_samples = 0
        self._trail.clear()
        self._note()

    def decide(self, drive: ArrayLike) -> None:
        """Walk for a decision's time with a drive (left, right); after the end, do nothing."""
        if self.outcome != RUNNING:
            return
        action = self.env.task.actions.of(np.reshape(drive, (1, 2)))
        transition = self.env.step(action)
        self.outcome = str(transition.outcome[0])
        state = self.env.task_state()
        self.rewards = {
            term.name: term.weight * float(term.compute(state)[0]) for term in self._terms
        }
        self._note()

    def observe(self) -> Observation:
        """What a policy sees, (1, size)."""
        return self.env.observe()

    def draw_goal(self) -> None:
        """Put the target somewhere else: the next one of the episode."""
        x, y, _ = self.state.position_w[0]
        self.move_target(*draw_target(self._goals, (float(x), float(y)), self.bounds, DISTANCE))

    def move_target(self, x_w: float, y_w: float) -> None:
        """Move the target, mm."""
        self.env.set_goals(np.array([[x_w, y_w]]))

    def changed(self, config: PlayedFlyConfig, seed: int) -> "FlyWalk":
        """Make a walk of the same fly with other settings; the present one stays as it is.

        With another leg controller, physics, reflexes or adhesion it goes on from where it is. With
        another body or terrain, or once it has ended, it starts the episode of the seed.
        """
        other = FlyWalk(replace(config, seed=seed))
        before, after = self.config, config
        is_same_place = (before.body, before.terrain) == (after.body, after.terrain)
        if is_same_place and self.outcome == RUNNING:
            other._go_on_from(self, seed)
        return other

    def _go_on_from(self, walk: "FlyWalk", seed: int) -> None:
        """Take over everything from a walk of the same body on the same ground."""
        snapshot = walk.env.snapshot()
        before, after = walk.env.config.fly_scene.controller, self.env.config.fly_scene.controller
        if before != after:
            fresh = after.initial_state(seed)
            kept = () if "rule_based" in (before.name, after.name) else _OSCILLATORS
            rows = self.env.flies.rows_after(walk.env.flies, fresh, kept)
            snapshot["simulation"]["physics"] = rows
        self.env.restore(snapshot)
        self.rewards = walk.rewards
        self._goals = walk._goals
        self._samples.extend(walk._samples)
        self._num_samples = walk._num_samples
        self._trail.clear()
        self._trail.extend(walk._trail)
        now = self.env.flies.state()
        self.env.state = replace(self.state, **{name: getattr(now, name) for name in SHOWN})

    def _note(self) -> None:
        """Remember how the legs moved, and where the fly is."""
        flies = self.env.flies
        fresh = flies.gait_samples(0, self._num_samples)
        self._num_samples += len(fresh)
        # the log's are not exactly so far apart
        count = round(len(fresh) * self.env.config.fly_scene.gait_sampling_s / SAMPLING_S)
        nearest = ((np.arange(count) + 0.5) * len(fresh) / count).astype(np.intp)
        self._samples.extend(fresh[nearest].tolist())
        x, y, _ = self.state.position_w[0]
        self._trail.append((float(x), float(y)))
