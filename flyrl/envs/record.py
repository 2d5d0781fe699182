"""Configs as plain JSON values."""

from dataclasses import asdict
from typing import Any

from flyrl.envs.core import EnvConfig
from flyrl.tasks import task_record


def env_record(env: EnvConfig) -> dict[str, Any]:
    """Everything about an environment as plain JSON values, keyed like the groups of `configs/`."""
    scene = env.scene
    return {
        "task": {
            **task_record(env.resolved_task),
            "decision_interval": env.decision_interval_s,
        },
        **{part: plain(asdict(getattr(scene, part))) for part in ("body", "terrain", "physics")},
        "controller": None if scene.controller is None else plain(asdict(scene.controller)),
        "randomisation": plain(asdict(env.resolved_randomisation)),
    }


def randomisation_text(record: Any) -> str:
    """What is randomised, as one would type it, from the "randomisation" of a record."""
    given = record.items() if isinstance(record, dict) else ()
    return ", ".join(f"{name}={value}" for name, value in given if value) or "none"


def plain(value: Any) -> Any:
    """`value` with lists in place of tuples, as JSON and YAML know them."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value
