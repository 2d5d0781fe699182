"""Tasks for worms: their muscles are the action, one number of recruited neurons per muscle.

worm_crawl: crawl along +x as far as possible. worm_hang: bend as commanded, with as few motor
neurons as possible. Each has a variant with continuous actions, for algorithms that need these.
They are made for a worm, since a worm may have any number of muscles.
"""

from dataclasses import replace
from functools import partial
from operator import attrgetter
from typing import Annotated

import numpy as np

from flyrl.bodies.worm import CRAWLER, HANGER, WormConfig
from flyrl.muscles import MotorPool
from flyrl.tasks.actions import Neurons
from flyrl.tasks.episode import TIME, Episode
from flyrl.tasks.function import TaskFunction, variant_of
from flyrl.tasks.task import Mask, ObservationTerm, RewardTerm, Task, TaskState
from flyrl.tasks.terms import compass, error, forward_progress, velocity_b
from flyrl.terrains import Terrain
from flyrl.validation import FloatArray, Within, one_of

_ANGLE = Within(0, 3)


def joint_velocities(state: TaskState) -> FloatArray:
    """Velocities of the joints, 5 rad/s, (n, J)."""
    return state.worm.joint_velocities / 5.0


def has_crawled(state: TaskState, way: float) -> Mask:
    """Whether the worm has come `way` mm along +x in this episode, (n,)."""
    return np.asarray(state.totals["progress"] >= way)


def bend_error(state: TaskState) -> FloatArray:
    """Bend less what is asked for, rad, (n, 1)."""
    return state.worm.bend[:, None] - state.command


def absolute_bend_error(state: TaskState) -> FloatArray:
    """Absolute error of the bend, rad, (n,)."""
    return np.abs(bend_error(state)[:, 0])


def bend_error_deg(state: TaskState) -> FloatArray:
    """The same, deg, (n,)."""
    return np.degrees(absolute_bend_error(state))


def has_bent(state: TaskState, tolerance: float) -> Mask:
    """Whether the worm is bent as commanded, within `tolerance`, rad, (n,)."""
    return np.asarray(absolute_bend_error(state) < tolerance)


def recruited_share(state: TaskState, pools: tuple[int, ...]) -> FloatArray:
    """Share of a worm's motor neurons that are recruited, 0 to 1, (n,).

    The first neuron of a pool always is, so it does not count.
    """
    most = max(1, sum(pools) - len(pools))  # 1: of pools of one neuron each
    return np.asarray(state.worm.neurons.sum(axis=1) / most)


def _muscles(worm: WormConfig) -> Neurons:
    """Actions of a worm: two muscles at each joint."""
    pool = MotorPool.from_image(worm.profile_path)
    return Neurons((len(pool),) * (2 * worm.joints))


def with_box(task: Task) -> Task:
    """The same task with continuous actions."""
    assert isinstance(task.actions, Neurons)
    return replace(task, actions=replace(task.actions, is_integer=False))


def _senses(worm: WormConfig) -> tuple[ObservationTerm, ...]:
    joints = worm.joints
    return (
        ObservationTerm(
            "joint_angles", (joints,), -2.0, 2.0, attrgetter("worm.joint_angles"),
            "of the joints from head to tail, in rad", spread=0.3,
        ),
        ObservationTerm(
            "joint_velocities", (joints,), -5.0, 5.0, joint_velocities,
            "of the joints, in 5 rad/s", spread=0.4,
        ),
        ObservationTerm(
            "tensions", (2 * joints,), 0.0, 1.0, attrgetter("worm.tensions"),
            "share of its strength that each muscle exerts", spread=0.3,
        ),
    )  # fmt: skip


def sample_episode(
    terrain: Terrain,
    seed: int,
    difficulty: float = 1.0,
    *,
    joints: int,
    start_angle: float,
    bend: float | None = None,
) -> Episode:
    """Draw the bend that is asked for or, without one, the heading; then the joints' angles."""
    rng = np.random.default_rng(seed)
    widest = start_angle if bend is None else bend
    drawn = float(rng.uniform(-widest, widest))
    return Episode(
        seed=seed,
        spawn_position_w=(0.0, 0.0, 0.0),
        spawn_yaw=drawn if bend is None else 0.0,
        goal=(),
        command=() if bend is None else (drawn,),
        joint_angles=tuple(rng.uniform(-start_angle, start_angle, size=joints).tolist()),
        difficulty=difficulty,
    )


@TaskFunction
def worm_crawl(
    worm: WormConfig = CRAWLER,
    lengths: Annotated[float, Within(0.01, 1000)] = 2.0,
    start_angle: Annotated[float, _ANGLE] = 0.2,
    time_limit: Annotated[float, TIME] = 5.0,
) -> Task:
    """Crawl along +x, as far as possible.

    Parameters
    ----------
    worm
        The worm.
    lengths
        Way along +x that is a success, in lengths of the worm.
    start_angle
        The joints of a worm that starts are bent by up to this, and so is its heading turned, rad.
    time_limit
        s until the episode is cut off.

    Raises
    ------
    ValueError
        If the worm cannot crawl, or there is no such profile of its muscles.
    """
    one_of("mount of a worm in the task 'worm_crawl'", worm.mount, ("crawling",))
    way = lengths * worm.segments * worm.segment_length
    actions = _muscles(worm)
    recruited = partial(recruited_share, pools=actions.pools)
    as_long = "twice" if lengths == 2.0 else f"{lengths:g} times"
    return Task(
        observation=(
            ObservationTerm(
                "heading", (2,), -1.0, 1.0, compass,
                "cosine and sine of the heading's angle from the world's x axis",
            ),
            ObservationTerm(
                "velocity", (2,), -5.0, 5.0, velocity_b,
                "forward and leftward velocity of the worm's middle, in 20 mm/s", spread=0.3,
            ),
            *_senses(worm),
        ),
        reward=(RewardTerm("progress", 0.2, forward_progress, "mm along +x"),),
        terminations=(),
        time_limit_s=time_limit,
        decision_interval_s=0.05,
        actions=actions,
        sample_episode=partial(
            sample_episode, joints=worm.joints, start_angle=start_angle
        ),
        succeeds_in_time=partial(has_crawled, way=way),
        success=f"{way:g} mm along +x, {as_long} the worm's length",
        errors=(error("recruited_share", 1.0, recruited),),
        decisive=("advance_mm",),
        compared=("advance_mm", "recruited_share"),
    )  # fmt: skip


worm_crawl_box = variant_of(worm_crawl)(with_box)


@TaskFunction
def worm_hang(
    worm: WormConfig = HANGER,
    bend: Annotated[float, Within(0, 2)] = 1.5,
    tolerance: Annotated[float, Within(1e-3, 3)] = 0.1,
    start_angle: Annotated[float, _ANGLE] = 0.2,
    time_limit: Annotated[float, TIME] = 2.0,
) -> Task:
    """Bend as commanded, with few neurons; a success is to be bent so at the end.

    Parameters
    ----------
    worm
        The worm.
    bend
        Greatest bend that is asked for, to either side, rad.
    tolerance
        Largest bend error of a success, rad.
    start_angle
        The joints of a worm that starts are bent by up to this, rad.
    time_limit
        s until the episode is cut off.

    Raises
    ------
    ValueError
        If there is no such profile of the worm's muscles.
    """
    actions = _muscles(worm)
    recruited = partial(recruited_share, pools=actions.pools)
    bent = partial(has_bent, tolerance=tolerance)
    return Task(
        observation=(
            ObservationTerm(
                "command", (1,), -2.0, 2.0, attrgetter("command"),
                "bend that is asked for, in rad",
            ),
            ObservationTerm(
                "bend_error", (1,), -4.0, 4.0, bend_error,
                "sum of the joints' angles less what is asked for, in rad", spread=0.3,
            ),
            *_senses(worm),
        ),
        reward=(
            RewardTerm("error", -1.0, absolute_bend_error, "rad off what is asked for"),
            RewardTerm(
                "bent", 0.5, bent, "1 while the worm is bent as commanded"
            ),
            RewardTerm("recruitment", -0.2, recruited, "share of all neurons that are recruited"),
        ),
        terminations=(),
        time_limit_s=time_limit,
        decision_interval_s=0.05,
        actions=actions,
        sample_episode=partial(
            sample_episode, joints=worm.joints, start_angle=start_angle, bend=bend
        ),
        succeeds_in_time=bent,
        success=f"within {tolerance:g} rad of the bend at the end",
        errors=(
            error("bend_error_deg", 180.0, bend_error_deg),
            error("recruited_share", 1.0, recruited),
        ),
        decisive=("success", "bend_error_deg"),
        compared=("bend_error_deg", "recruited_share"),
    )  # fmt: skip


worm_hang_box = variant_of(worm_hang)(with_box)
