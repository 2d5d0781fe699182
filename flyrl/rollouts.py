"""Policy and environment -> episode records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from flyrl import tasks
from flyrl.controllers.gait_log import unpack
from flyrl.tasks import SUCCESS, TIMEOUT, UNSTABLE, Episode
from flyrl.validation import FloatArray, positive

if TYPE_CHECKING:  # reading records takes no physics engine
    from flyrl.envs.core import BatchedEnv

BoolArray = NDArray[np.bool_]

FAILURES: Final = (*(failure.outcome for failure in tasks.FAILURES), UNSTABLE)
"""Outcomes that end an episode by failing; they are scored over the full horizon."""

SAMPLING_S: Final = 0.02
"""Least spacing of a record's samples, s: a quarter of a stride."""


@dataclass(frozen=True, eq=False)
class Gait:
    """Gait of an episode: states of the legs, sample by sample, and costs.

    Attributes
    ----------
    interval_s
        Time from one sample to the next, s.
    stance, adhesion
        Whether a leg stands (see `gait_log.STANCE_SPEED`), and whether it is commanded to grip,
        (S, 6), ordered as `anatomy.LEGS`.
    retraction, stumbling
        Whether that reflex corrects a leg, shape (S, 6).
    work_nj
        Done by the servos, nJ; what is done on them is not taken off.
    slip_mm
        Way of each leg's tip along the ground while it is on it and grips, mm, shape (6,).
    """

    interval_s: float
    stance: BoolArray
    adhesion: BoolArray
    retraction: BoolArray
    stumbling: BoolArray
    work_nj: float
    slip_mm: FloatArray


@dataclass(frozen=True, eq=False)
class EpisodeRecord:
    """One episode of one controller: how it ended, and the path it took.

    The trajectory has a sample at the start, one every decision or `SAMPLING_S`, whichever is
    longer, and one at the end: T samples in all, every one finite. A fly whose physics diverged
    stays where it was before.

    Attributes
    ----------
    controller
        Name of the entrant that walked.
    task, terrain
        Names of the task and of the terrain.
    index
        Position of the episode in the list that every controller walks.
    episode
        Everything random about the episode: seed, spawn, goal, phases.
    outcome
        Name of an outcome (see `flyrl.tasks.OUTCOMES`), or of a termination added to the task.
    return_
        Undiscounted sum of rewards.
    duration_s
        Simulated time until the episode ended, s.
    horizon_s
        Time limit of the task, s.
    time_s
        Sample times since the start, s, shape (T,).
    position_w
        Position of the thorax, or of a worm's middle, mm, world frame, shape (T, 3).
    yaw
        Heading about the world's z axis, rad, unwrapped, shape (T,).
    drive
        Descending drive (left, right) held up to the sample, shape (T, 2); zero at the start. Of a
        worm, the tensions of its M muscles, shape (T, M).
    errors
        Mean over the horizon of what the task measures, by name (see `tasks.ERRORS`); the time that
        a failure cut off counts as the worst.
    totals
        Sum of each reward term, unweighted, by name.
    gait
        Gait until then, where the environment logs it. Of a fly whose physics diverged, until the
        decision before.
    creature
        What walked: "fly" or "worm".

    Raises
    ------
    ValueError
        If a sample is not finite: no score may come of it.
    """

    controller: str
    task: str
    terrain: str
    index: int
    episode: Episode
    outcome: str
    return_: float
    duration_s: float
    horizon_s: float
    time_s: FloatArray
    position_w: FloatArray
    yaw: FloatArray
    drive: FloatArray
    errors: Mapping[str, float] = field(default_factory=dict)
    totals: Mapping[str, float] = field(default_factory=dict)
    gait: Gait | None = None
    creature: str = "fly"

    def __post_init__(self) -> None:
        for name in ("time_s", "position_w", "yaw", "drive"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} of a record must be finite (episode {self.index})")

    @property
    def seed(self) -> int:
        """Seed that the episode was drawn from."""
        return self.episode.seed

    @property
    def success(self) -> bool:
        """Whether the task was solved."""
        return self.outcome == SUCCESS

    @property
    def failed(self) -> bool:
        """Whether the episode was cut short by a fall or whatever else is no success."""
        return self.outcome not in (SUCCESS, TIMEOUT)


@runtime_checkable
class Policy(Protocol):
    """Policy that acts; the signature is Stable-Baselines3's."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Actions (n, size) for a batch of n observations, and the policy's next state."""
        ...


def run_episodes(
    env: BatchedEnv,
    policy: Policy,
    episodes: Sequence[Episode],
    *,
    controller: str = "policy",
    first_index: int = 0,
    horizon_s: float | None = None,
    on_progress: Callable[[int], object] | None = None,
) -> list[EpisodeRecord]:
    """Walk `episodes`, `env.num_envs` at a time, and record them.

    An episode gives the same record in any batch. What ends early stands still until its batch is
    through.

    Parameters
    ----------
    env
        Left wherever the last batch ends.
    policy
        Asked for deterministic actions.
    episodes
        Records come back in their order.
    controller
        Name that the records carry.
    first_index
        Index of the first of the episodes, from which they count.
    horizon_s
        Longest duration of an episode, s; the task's time limit where that is shorter.
    on_progress
        Called with the number of decisions settled since the last call. They add up to
        `num_decisions(env, len(episodes), horizon_s)`: an early end settles what it leaves out.

    Raises
    ------
    ValueError
        If neither the task nor `horizon_s` limits an episode.
    """
    decisions = num_decisions(env, 1, horizon_s)
    records: list[EpisodeRecord] = []
    for start in range(0, len(episodes), env.num_envs):
        batch = episodes[start : start + env.num_envs]
        paths = _run_batch(env, policy, batch, decisions, on_progress)
        for episode, path in zip(batch, paths, strict=True):
            time_s, position_w, yaw, drive = map(np.array, zip(*path.samples, strict=True))
            record = EpisodeRecord(
                controller=controller,
                task=env.task.name,
                terrain=env.config.scene.terrain.label,
                index=first_index + len(records),
                episode=episode,
                outcome=path.outcome,
                return_=path.return_,
                duration_s=float(time_s[-1]),
                horizon_s=decisions * env.config.decision_interval_s,
                time_s=time_s,
                position_w=position_w,
                yaw=np.unwrap(yaw),
                drive=drive,
                errors=path.mean_errors(env, decisions),
                totals=path.totals,
                gait=path.gait(env),
                creature=env.config.creature,
            )
            records.append(record)
    return records


def num_decisions(env: BatchedEnv, num_episodes: int, horizon_s: float | None = None) -> int:
    """Most decisions that `num_episodes` can take; see `run_episodes`."""
    limits = [limit for limit in (env.task.time_limit_s, horizon_s) if limit is not None]
    if not limits:
        raise ValueError(
            f"horizon_s must be a duration in s, since task {env.task.name!r} has no time limit"
        )
    if horizon_s is not None:
        positive("horizon_s", horizon_s)
    return num_episodes * max(1, round(min(limits) / env.config.decision_interval_s))


class _Path:
    """Samples of one simulation, collected while it walks."""

    def __init__(self) -> None:
        self.samples: list[tuple[float, NDArray[np.float64], float, NDArray[np.float64]]] = []
        self.gait_samples: list[NDArray[np.uint32]] = []
        self.num_gait_samples = 0
        self.work_nj = 0.0
        self.slip_mm = np.zeros(6)
        self.errors: NDArray[np.float64] | float = 0.0  # sums over decisions
        self.num_decisions = 0
        self.return_ = 0.0
        self.outcome = ""
        self.totals: dict[str, float] = {}

    def add(self, env: BatchedEnv, sim: int, time_s: float) -> None:
        """Sample simulation `sim` as it is now."""
        body, drive = env.state, env.state.actuation[sim].copy()
        self.samples.append((time_s, body.position_w[sim].copy(), float(body.yaw[sim]), drive))

    def add_gait(self, env: BatchedEnv, sim: int) -> None:
        """Take what simulation `sim` has logged of its gait since the last time."""
        logs = env.batch.gait_logs
        if logs is None or env.state.is_unstable[sim]:
            return
        samples = env.flies.gait_samples(sim, self.num_gait_samples)
        self.gait_samples.append(samples)
        self.num_gait_samples += len(samples)
        self.work_nj = float(logs["work"][sim])
        self.slip_mm = logs["slip"][sim].copy()

    def mean_errors(self, env: BatchedEnv, decisions: int) -> dict[str, float]:
        """Means over the episode; where it failed, over the horizon of so many decisions."""
        terms, taken = env.task.errors, self.num_decisions
        if self.outcome in (SUCCESS, TIMEOUT):
            decisions = taken
        lost = (decisions - taken) * np.array([term.worst for term in terms])
        means = (self.errors + lost) / decisions
        return {term.name: float(mean) for term, mean in zip(terms, means, strict=True)}

    def gait(self, env: BatchedEnv) -> Gait | None:
        """Gait until the end; None where the environment logs none."""
        if env.batch.gait_logs is None:
            return None
        return Gait(
            interval_s=env.config.fly_scene.gait_sampling_s,
            **unpack(np.concatenate([np.empty(0, np.uint32), *self.gait_samples])),
            work_nj=self.work_nj,
            slip_mm=self.slip_mm,
        )


def _run_batch(
    env: BatchedEnv,
    policy: Policy,
    episodes: Sequence[Episode],
    decisions: int,
    on_progress: Callable[[int], object] | None,
) -> list[_Path]:
    interval = env.config.decision_interval_s
    stride = max(1, round(SAMPLING_S / interval))
    active = np.arange(len(episodes))
    observation = env.reset(ids=active, episodes=episodes)
    paths = [_Path() for _ in episodes]
    for i in active:
        paths[i].add(env, int(i), 0.0)
    state = None
    starts = np.ones(env.num_envs, dtype=bool)
    for decision in range(1, decisions + 1):
        action, state = policy.predict(observation, state, starts, deterministic=True)
        starts = np.zeros(env.num_envs, dtype=bool)
        transition = env.step(action, ids=active)
        observation = transition.observation
        errors = _errors(env)
        done = transition.done if decision < decisions else np.ones(env.num_envs, dtype=bool)
        totals = env.task_state().totals if done[active].any() else {}
        for i in active:
            paths[i].return_ += float(transition.reward[i])
            paths[i].errors = paths[i].errors + errors[i]
            paths[i].num_decisions = decision
            paths[i].add_gait(env, int(i))
            if done[i] or decision % stride == 0:
                paths[i].add(env, int(i), decision * interval)
            if done[i]:
                paths[i].outcome = str(transition.outcome[i]) if transition.done[i] else TIMEOUT
                paths[i].totals = {name: float(total[i]) for name, total in totals.items()}
        if on_progress is not None:
            ended = int(done[active].sum())
            on_progress(len(active) + ended * (decisions - decision))
        active = active[~done[active]]
        if not active.size:
            break
    return paths


def _errors(env: BatchedEnv) -> NDArray[np.float64]:
    """Error terms of the task after this decision, shape (n, number of errors)."""
    if not env.task.errors:
        return np.zeros((env.num_envs, 0))
    state = env.task_state()
    return np.stack([term.compute(state) for term in env.task.errors], axis=1)
