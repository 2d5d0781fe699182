"""Settings of an evaluation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Final, Literal

from flyrl.controllers import Controller
from flyrl.controllers.controller import controller_from
from flyrl.envs.config import BodyConfig, EnvConfig
from flyrl.evaluation.conditions import UNCHANGED, Condition, all_conditions
from flyrl.evaluation.metrics import check_metrics, smallest_effects
from flyrl.evaluation.studies import STUDIES
from flyrl.simulation.batch import MOST_SIMS, MOST_THREADS
from flyrl.simulation.physics import PhysicsConfig
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.simulation.rendering import Camera
from flyrl.tasks import Episode, Task, TaskSettings, with_time_limit
from flyrl.terrains import Terrain, terrain_from
from flyrl.validation import Within, check_fields, distinct, not_negative, one_of, within

FIRST_SEED: Final = 3 * 2**30
"""Seeds of evaluation episodes start here.

Training draws its episodes from seeds below 2**31, and the ones it picks its best policy on from
below this. So no policy was trained or chosen on an episode that it is compared on.
"""

ENV_GROUPS: Final = ("task", "body", "physics", "randomisation")
"""Groups of an environment's record that an evaluation is composed of."""

MAX_EPISODES: Final = 2**16
MAX_SEED: Final = 2**14 - 1
"""Together they reach the largest seed there is, 2**32 - 1."""


@dataclass(frozen=True, kw_only=True)
class EvaluationConfig:
    """Settings of an evaluation: entrants, episodes, comparison.

    Attributes
    ----------
    policies
        Learned policies: run folders, policy files or names, or algorithm:file.zip of a model that
        Stable-Baselines3 saved. And your own, see `evaluation.entrants.own_policy`: objects and
        functions, or either by its name, module:attribute, which is imported.
    controllers
        Names of fixed entrants; see `flyrl.policies.laws.FIXED`. Or leg controllers, or their
        settings with the name, to walk at the drive (1, 1). None takes the usual names that go with
        the task.
    task
        As `EnvConfig` takes it; without a time limit, 3 s. A Dict observation without goals comes
        as a vector.
    terrains
        Names (see `flyrl.terrains.TERRAINS`), configs, or their fields as mappings; their labels
        differ from one another.
    episodes
        Number of episodes per terrain; every entrant walks the same ones.
    seed
        Picks the episodes, and the resampling of the statistics.
    body, physics
        Names or configs, or None for the task's usual ones; the same for every entrant.
    randomisation
        Ranges that the fly of every episode is drawn from, or the name of some; every entrant
        walks as the same flies.
    vary
        Quantities (see `flyrl.evaluation.conditions.QUANTITIES`) and the values of each; everyone
        walks all episodes under every one of them. Empty changes nothing.
    reference
        Name of the entrant that the others are compared with. None takes the best fixed entrant
        that sees what the task asks; without one, the best fixed entrant, else the best of all.
    smallest_effects
        Smallest difference of interest by metric, in its unit, instead of the metric's own. Who
        differs by less is level.
    trust_pickles
        Whether zip files of Stable-Baselines3 may be read, which runs whatever code their author
        put there.
    study
        Name of a published study (see `flyrl.evaluation.studies.STUDIES`) whose claims are put to
        the test, or None.
    paths
        Of how many episodes the paths are kept: the first ones, of every entrant on every terrain
        under every condition.
    film
        Indices of the episodes that are filmed and looked at closely, beside the evaluation itself.
        "contrast" takes one on each terrain, where the best learned entrant and the reference
        differ; see `flyrl.evaluation.contrast`.
    num_envs
        Episodes that are walked at the same time. Does not change the result.
    num_threads
        Native threads; 0 takes one per CPU. Does not change the result.
    progress
        Whether to draw a progress bar on stderr.
    command
        What was typed, for the record.
    settings
        What that was composed to, plain values, from which the evaluation can be repeated.

    Raises
    ------
    ValueError
        A value that is not allowed.
    """

    policies: tuple[object, ...] = ()
    controllers: tuple[str | Controller | Mapping[str, Any], ...] | None = None
    task: TaskSettings | Task = "target"
    terrains: tuple[str | Terrain | Mapping[str, Any], ...] = ("flat",)
    episodes: Annotated[int, Within(1, MAX_EPISODES)] = 50
    seed: Annotated[int, Within(0, MAX_SEED)] = 0
    body: str | BodyConfig | None = None
    physics: str | PhysicsConfig | None = None
    randomisation: str | RandomisationConfig = "none"
    vary: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    reference: str | None = None
    smallest_effects: Mapping[str, float] = field(default_factory=dict)
    trust_pickles: bool = False
    study: str | None = None
    paths: Annotated[int, Within(0, MAX_EPISODES)] = 60
    film: tuple[int, ...] | Literal["contrast"] = (0,)
    num_envs: Annotated[int, Within(1, MOST_SIMS)] = 64
    num_threads: Annotated[int, Within(0, MOST_THREADS)] = 0
    progress: bool = False
    command: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.controllers is not None:
            given = (controller_from(c) if isinstance(c, Mapping) else c for c in self.controllers)
            object.__setattr__(self, "controllers", tuple(given))
        for i, policy in enumerate(self.policies):
            if not (isinstance(policy, str) or callable(policy) or hasattr(policy, "predict")):
                raise ValueError(
                    f"policies[{i}] must be text, a function, or an object with predict(), got "
                    f"{policy!r}"
                )
        if not self.policies and self.controllers == ():
            raise ValueError("policies or controllers must name at least one, got none")
        if not self.terrains:
            raise ValueError("terrains must name at least one, got none")
        terrains = tuple(
            terrain_from(terrain, f"terrains[{i}]") if isinstance(terrain, Mapping) else terrain
            for i, terrain in enumerate(self.terrains)
        )
        object.__setattr__(self, "terrains", terrains)
        one_of("study", self.study, (None, *STUDIES))
        if isinstance(self.film, tuple):
            for i, episode in enumerate(self.film):
                within(f"film[{i}]", episode, 0, self.episodes - 1)
            distinct("film", self.film)
        if self.resolved_task.time_limit_s is None:
            object.__setattr__(self, "task", with_time_limit(self.task))
        task = self.resolved_task
        check_metrics(task)
        for metric, effect in self.smallest_effects.items():
            one_of("smallest_effects", metric, smallest_effects(task))
            not_negative(f"smallest_effects.{metric}", effect)
        distinct("terrains", [terrain.label for terrain in self.terrain_configs])
        if not self.conditions:
            raise ValueError(f"vary must name values, got {dict(self.vary)}")
        distinct("vary", [condition.label for condition in self.conditions])
        for condition in self.conditions:
            condition.env(self.env(self.terrains[0]))

    def env(self, terrain: str | Terrain | Mapping[str, Any]) -> EnvConfig:
        """Environment with the controller that goes with the body."""
        return EnvConfig(
            task=self.task,
            body=self.body,
            terrain=terrain,
            physics=self.physics,
            randomisation=self.randomisation,
            log_gait=True,
            as_vectors=True,
        )

    @property
    def resolved_task(self) -> Task:
        """The task."""
        return self.env(self.terrains[0]).resolved_task

    @property
    def terrain_configs(self) -> tuple[Terrain, ...]:
        """The terrains."""
        return tuple(self.env(terrain).scene.terrain for terrain in self.terrains)

    @property
    def legs(self) -> Controller | None:
        """The hybrid controller that goes with the body; None of a worm, which has no legs."""
        legs: Controller | None = self.env(self.terrains[0]).scene.controller
        return legs

    @property
    def horizon_s(self) -> float:
        """Time limit of the task, s."""
        limit = self.resolved_task.time_limit_s
        assert limit is not None  # __post_init__ checked
        return limit

    def seeds(self) -> range:
        """Seeds of the episodes, the same on every terrain; no two values of `seed` share one."""
        first = FIRST_SEED + self.seed * MAX_EPISODES
        return range(first, first + self.episodes)

    def filmed(self, chosen: Mapping[str, Any] | None = None) -> dict[str, tuple[int, ...]]:
        """Indices of the episodes to film, by the label of their terrain.

        Parameters
        ----------
        chosen
            What `flyrl.evaluation.contrast.contrasts` chose; without it "contrast" is episode 0.
        """
        labels = [terrain.label for terrain in self.terrain_configs]
        if isinstance(self.film, tuple):
            return dict.fromkeys(labels, self.film)
        return {label: (chosen[label]["episode"] if chosen else 0,) for label in labels}

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions that every entrant walks under, one after the other."""
        return all_conditions(self.vary)

    def draw_episodes(self, terrain: Terrain, condition: Condition = UNCHANGED) -> list[Episode]:
        """Episodes on `terrain` under a condition, the same ones for every entrant."""
        env = condition.env(self.env(terrain))
        return [condition.episode(env.sample_episode(seed)) for seed in self.seeds()]


@dataclass(frozen=True, kw_only=True)
class ReportConfig:
    """Parts of a report beside its tables and figures; all of them, unless they are turned off.

    Attributes
    ----------
    videos
        Whether to film everyone, where a GL library can be used.
    camera
        From where they are filmed: "goal" (from the start towards it), "follow" or "top".
    close_ups
        Whether to show gait diagrams, curves over time, and what drives do.
    drive_map
        Whether these close-ups hold what each drive makes of a fly.

    Raises
    ------
    ValueError
        A value that is not allowed.
    """

    videos: bool = True
    camera: Camera = "goal"
    close_ups: bool = True
    drive_map: bool = True

    def __post_init__(self) -> None:
        check_fields(self)
