"""Tasks for worms: their muscles are the action, one number of recruited neurons per muscle.

worm_crawl: crawl along +x as far as possible in 5 s. worm_hang: bend as told, with as few motor
neurons as possible. Each has a variant with continuous actions, for algorithms that need these.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from flyrl.bodies.worm import WormConfig
from flyrl.muscles import MotorPool
from flyrl.simulation.randomisation import UNVARIED
from flyrl.tasks import worm_terms as terms
from flyrl.tasks.actions import Neurons
from flyrl.tasks.episode import Episode
from flyrl.tasks.task import ErrorTerm, ObservationTerm, RewardTerm, Task
from flyrl.terrains import Terrain
from flyrl.validation import one_of

START_ANGLE: Final = 0.2
"""rad; the joints of a worm that starts are bent by up to this, and so is its heading turned."""

GREATEST_BEND: Final = 1.5
"""rad; the bend that worm_hang asks for is within this, to either side."""


@dataclass(frozen=True)
class WormTask:
    """A task that is made to measure, since a worm may have any number of muscles.

    Attributes
    ----------
    body
        The usual worm: a name in `flyrl.bodies.worm.WORMS`.
    make
        Makes the task for a worm, from its name and its actions.
    is_integer
        Whether actions are whole numbers.
    """

    body: str
    make: Callable[[str, WormConfig, Neurons], Task]
    is_integer: bool

    def task(self, name: str, worm: WormConfig) -> Task:
        """The task of this name for a worm.

        Raises
        ------
        ValueError
            If there is no such profile of the worm's muscles, or the worm cannot do the task.
        """
        pool = MotorPool.from_image(worm.profile_path)
        actions = Neurons((len(pool),) * (2 * worm.joints), self.is_integer)
        return self.make(name, worm, actions)


def _senses(worm: WormConfig) -> tuple[ObservationTerm, ...]:
    joints = worm.joints
    return (
        ObservationTerm(
            "joint_angles", (joints,), -2.0, 2.0, terms.joint_angles,
            "of the joints from head to tail, in rad", spread=0.3,
        ),
        ObservationTerm(
            "joint_velocities", (joints,), -5.0, 5.0, terms.joint_velocities,
            "of the joints, in 5 rad/s", spread=0.4,
        ),
        ObservationTerm(
            "tensions", (2 * joints,), 0.0, 1.0, terms.tensions,
            "share of its strength that each muscle exerts", spread=0.3,
        ),
    )  # fmt: skip


def _start(worm: WormConfig, rng: np.random.Generator) -> tuple[float, ...]:
    return tuple(map(float, rng.uniform(-START_ANGLE, START_ANGLE, size=worm.joints)))


def _crawling_episode(
    worm: WormConfig, terrain: Terrain, seed: int, difficulty: float = 1.0
) -> Episode:
    rng = np.random.default_rng(seed)
    yaw = float(rng.uniform(-START_ANGLE, START_ANGLE))
    return Episode(
        seed=seed,
        spawn_position_w=(0.0, 0.0, 0.0),
        spawn_yaw=yaw,
        goal=(),
        joint_angles=_start(worm, rng),
        randomisation=UNVARIED,
        difficulty=difficulty,
    )


def _hanging_episode(
    worm: WormConfig, terrain: Terrain, seed: int, difficulty: float = 1.0
) -> Episode:
    rng = np.random.default_rng(seed)
    return Episode(
        seed=seed,
        spawn_position_w=(0.0, 0.0, 0.0),
        spawn_yaw=0.0,
        goal=(),
        command=(float(rng.uniform(-GREATEST_BEND, GREATEST_BEND)),),
        joint_angles=_start(worm, rng),
        randomisation=UNVARIED,
        difficulty=difficulty,
    )


def crawling(name: str, worm: WormConfig, actions: Neurons) -> Task:
    """Crawl along +x, as far as possible in 5 s; two lengths of the worm are a success.

    Raises
    ------
    ValueError
        If the worm cannot crawl.
    """
    one_of(f"mount of a worm in the task {name!r}", worm.mount, ("crawling",))
    way = 2.0 * worm.segments * worm.segment_length
    recruited = partial(terms.recruited_share, pools=actions.pools)
    return Task(
        name=name,
        observation=(
            ObservationTerm(
                "heading", (2,), -1.0, 1.0, terms.heading,
                "cosine and sine of the heading's angle from the world's x axis",
            ),
            ObservationTerm(
                "velocity", (2,), -5.0, 5.0, terms.velocity_b,
                "forward and leftward velocity of the worm's middle, in 20 mm/s", spread=0.3,
            ),
            *_senses(worm),
        ),
        is_flat=True,
        reward=(RewardTerm("progress", 0.2, terms.progress, "mm along +x"),),
        terminations=(),
        time_limit_s=5.0,
        decision_interval_s=0.05,
        actions=actions,
        sample_episode=partial(_crawling_episode, worm),
        succeeds_in_time=partial(terms.has_crawled, way=way),
        success=f"{way:g} mm along +x, twice the worm's length",
        errors=(ErrorTerm("recruited_share", 1.0, recruited),),
    )  # fmt: skip


def hanging(name: str, worm: WormConfig, actions: Neurons) -> Task:
    """Bend as told for 2 s, with few neurons; success is to be within 0.1 rad in the end."""
    recruited = partial(terms.recruited_share, pools=actions.pools)
    return Task(
        name=name,
        observation=(
            ObservationTerm(
                "command", (1,), -2.0, 2.0, terms.command, "bend that is asked for, in rad"
            ),
            ObservationTerm(
                "bend_error", (1,), -4.0, 4.0, terms.bend_error,
                "sum of the joints' angles less what is asked for, in rad", spread=0.3,
            ),
            *_senses(worm),
        ),
        is_flat=True,
        reward=(
            RewardTerm("error", -1.0, terms.absolute_bend_error, "rad off what is asked for"),
            RewardTerm("bent", 0.5, terms.bent, "1 while the worm is bent as told"),
            RewardTerm("recruitment", -0.2, recruited, "share of all neurons that are recruited"),
        ),
        terminations=(),
        time_limit_s=2.0,
        decision_interval_s=0.05,
        actions=actions,
        sample_episode=partial(_hanging_episode, worm),
        succeeds_in_time=terms.has_bent,
        success=f"within {terms.BENT_WITHIN:g} rad of the bend at the end",
        errors=(
            ErrorTerm("bend_error_deg", 180.0, terms.bend_error_deg),
            ErrorTerm("recruited_share", 1.0, recruited),
        ),
    )  # fmt: skip


WORM_TASKS: Final[Mapping[str, WormTask]] = {
    "worm_hang": WormTask("worm_hanger", hanging, is_integer=True),
    "worm_hang_box": WormTask("worm_hanger", hanging, is_integer=False),
    "worm_crawl": WormTask("worm_crawler", crawling, is_integer=True),
    "worm_crawl_box": WormTask("worm_crawler", crawling, is_integer=False),
}
"""Tasks for worms by name."""
