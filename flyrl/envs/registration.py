"""Gymnasium ids."""

from typing import Final

import gymnasium

ENV_IDS: Final = {"flyrl/Target-v0": "target", "flyrl/HybridTurning-v0": "hybrid_turning"}
"""Gymnasium id -> task."""


def register_envs() -> None:
    """Register every id; a second call changes nothing."""
    for env_id, task in ENV_IDS.items():
        if env_id not in gymnasium.registry:
            gymnasium.register(
                id=env_id,
                entry_point="flyrl.envs.single:FlyEnv",
                vector_entry_point="flyrl.envs.vector:FlyVectorEnv",
                kwargs={"task": task},
            )
