"""Conditions of an evaluation: a quantity that is changed for every entrant alike, and its values.

Robustness (another friction, mass, latency, a push) and experiments in silico (a leg cut off, a
joint fixed, a reflex weakened) are the same thing here: a quantity, and the values it takes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from flyrl.controllers import Hybrid
from flyrl.controllers.cpg_controller import OscillatorController
from flyrl.envs.core import EnvConfig
from flyrl.tasks import Episode
from flyrl.validation import not_negative, number, one_of, within

PUSH_TIME_S: Final = 1.0
"""Time of the push under the condition `push`, s after the start."""


@dataclass(frozen=True)
class Quantity:
    """Something that a condition changes.

    Attributes
    ----------
    text
        What it is, in words and units.
    usual
        Its value where nothing is changed.
    env
        The environment with another value of the quantity of a name.
    """

    text: str
    usual: Any
    env: Callable[[EnvConfig, str, Any], EnvConfig] = lambda env, name, value: env


def _randomised(env: EnvConfig, name: str, value: Any) -> EnvConfig:
    return replace(env, randomisation=replace(env.resolved_randomisation, **{name: value}))


def _factor(env: EnvConfig, name: str, value: Any) -> EnvConfig:
    return _randomised(env, name, (value, value))


def _coupled(env: EnvConfig, name: str, value: Any) -> EnvConfig:
    legs, factor = env.fly_scene.controller, not_negative("vary.coupling", value)
    if not isinstance(legs, OscillatorController):  # the rules have no couplings
        return env
    changes: dict[str, Any] = {"coupling_weight": factor * legs.coupling_weight}
    if legs.coupling_weights is not None:
        changes["coupling_weights"] = (factor * np.array(legs.coupling_weights)).tolist()
    return replace(env, controller=replace(legs, **changes))


def _reflex(env: EnvConfig, name: str, value: Any) -> EnvConfig:
    within(f"vary.{name}", value, 0, 100)
    legs = env.fly_scene.controller
    # no other controller has reflexes
    changed = replace(legs, **{name: value}) if isinstance(legs, Hybrid) else legs
    return replace(env, controller=changed)


def _body(env: EnvConfig, name: str, value: Any) -> EnvConfig:
    return replace(env, body=replace(env.fly_scene.body, **{name: value}))


def _muscles(env: EnvConfig, name: str, value: Any) -> EnvConfig:
    muscles = env.fly_scene.body.muscles
    if muscles is None:
        raise ValueError(
            f"vary.{name} is for a body with muscles (body=fly_muscles); this one has servos"
        )
    side = name.removesuffix("_muscles")
    return _body(env, "muscles", replace(muscles, **{side: value}))


QUANTITIES: Final[Mapping[str, Quantity]] = {
    "friction": Quantity("factor on the friction of the legs", 1.0, _factor),
    "mass": Quantity("factor on the fly's mass", 1.0, _factor),
    "actuator_gain": Quantity("factor on the servos' stiffness", 1.0, _factor),
    "adhesion": Quantity("factor on the grip of the legs", 1.0, _factor),
    "sensor_noise": Quantity("noise, in the spreads of the senses", 0.0, _randomised),
    "drive_latency": Quantity("time from a decision to the legs, s", 0.0, _factor),
    "push": Quantity("force sideways after 1 s, µN", 0.0),
    "coupling": Quantity("factor on the coupling of the oscillators", 1.0, _coupled),
    "retraction": Quantity("factor on the retraction reflex", 1.0, _reflex),
    "stumbling": Quantity("factor on the stumbling reflex", 1.0, _reflex),
    "missing_legs": Quantity("legs that are cut off", (), _body),
    "fixed_joints": Quantity("joints that cannot move, rad", (), _body),
    "left_muscles": Quantity("factor on the left legs' muscles", 1.0, _muscles),
    "right_muscles": Quantity("factor on the right legs' muscles", 1.0, _muscles),
    "senses_contact": Quantity("whether legs feel contact", True, _body),
}
"""Quantities that can be varied, by name."""


@dataclass(frozen=True)
class Condition:
    """A quantity at one value; without a name, nothing is changed.

    Raises
    ------
    ValueError
        There is no such quantity.
    """

    name: str = ""
    value: Any = None

    def __post_init__(self) -> None:
        if self.name:
            one_of("vary", self.name, QUANTITIES)

    @property
    def label(self) -> str:
        """Name and value, as in a table; empty where nothing is changed."""
        return f"{self.name}={value_text(self.value)}" if self.name else ""

    @property
    def is_usual(self) -> bool:
        """Whether nothing is changed."""
        return not self.name or value_text(self.value) == value_text(QUANTITIES[self.name].usual)

    def env(self, env: EnvConfig) -> EnvConfig:
        """The environment under this condition.

        Raises
        ------
        ValueError
            A value that is not allowed.
        """
        if not self.name:
            return env
        if env.creature != "fly" and self.name != "sensor_noise":
            raise ValueError(
                f"vary.{self.name} is for flies; of a worm, sensor_noise can be varied"
            )
        return QUANTITIES[self.name].env(env, self.name, self.value)

    def episode(self, episode: Episode) -> Episode:
        """The episode under this condition: with one push, to the left in every other episode."""
        if self.name != "push":
            return episode
        side = 1.0 if episode.seed % 2 else -1.0
        return replace(episode, pushes=(PUSH_TIME_S, side * number("vary.push", self.value)))


UNCHANGED: Final = Condition()
"""The condition that changes nothing."""


def all_conditions(vary: Mapping[str, Sequence[Any]]) -> tuple[Condition, ...]:
    """Conditions of quantities and their values; without quantities, one that changes nothing."""
    if not vary:
        return (UNCHANGED,)
    return tuple(Condition(name, value) for name, values in vary.items() for value in values)


def compared_conditions(vary: Mapping[str, Sequence[Any]]) -> tuple[Condition, ...]:
    """The usual condition, then every one that changes something.

    The usual condition is the first that changes nothing; without any, the first of all. Others
    that change nothing are left out: they are the same episodes again.
    """
    conditions = all_conditions(vary)
    usual = next((each for each in conditions if each.is_usual), conditions[0])
    return (usual, *(each for each in conditions if each != usual and not each.is_usual))


def value_text(value: Any) -> str:
    """A value as it stands in tables: a number without needless digits, names after one another."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float | int):
        return f"{value:g}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "+".join(value_text(item) for item in value) or "none"
    return str(value)
