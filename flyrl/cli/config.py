"""From the composed config to the dataclasses that the rest of flyrl takes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from flyrl.bodies.fly import FlyConfig
from flyrl.cli.arguments import closest
from flyrl.cli.conversion import from_mapping, whole_number
from flyrl.controllers.leg_controller import ControllerConfig
from flyrl.envs.core import EnvConfig
from flyrl.simulation.physics import PhysicsConfig
from flyrl.simulation.scene import STEPS_OF_BODY
from flyrl.terrains import TerrainConfig
from flyrl.training.algorithms import ALGORITHMS, AlgorithmConfig
from flyrl.training.config import ScheduleConfig, TrainingConfig


@dataclass(frozen=True, kw_only=True)
class _TaskSettings:
    name: str
    decision_interval: float | None = None


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
        algo=algorithm_config(config["algo"]),
        training=from_mapping(ScheduleConfig, config["training"], "training"),
        seed=whole_number("seed", config["seed"]),
    )


def env_config(config: Mapping[str, Any]) -> EnvConfig:
    """Settings of an environment, from the groups task, body, terrain, controller and physics."""
    body = from_mapping(FlyConfig, config["body"], "body")
    controller = dict(config["controller"])
    if controller.get("steps") is None:
        controller["steps"] = STEPS_OF_BODY[body.name]
    if controller.get("reflexes") is None:
        controller["reflexes"] = body.name
    task = from_mapping(_TaskSettings, config["task"], "task")
    return EnvConfig(
        task=task.name,
        body=body,
        terrain=from_mapping(TerrainConfig, config["terrain"], "terrain"),
        controller=from_mapping(ControllerConfig, controller, "controller"),
        physics=from_mapping(PhysicsConfig, config["physics"], "physics"),
        decision_interval=task.decision_interval,
    )


def algorithm_config(config: Mapping[str, Any]) -> AlgorithmConfig:
    """Settings of a learning algorithm; `name` picks which."""
    settings = dict(config)
    name = settings.pop("name", None)
    if name not in ALGORITHMS:
        raise ValueError(
            f"algo.name: {name}; allowed: {', '.join(ALGORITHMS)}; "
            f"closest: {closest(str(name), ALGORITHMS)}"
        )
    return from_mapping(ALGORITHMS[name], settings, "algo")
