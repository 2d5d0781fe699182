"""Settings of the learning algorithms; the names are those of Stable-Baselines3's arguments."""

from typing import Final

from flyrl.training.algorithms.base import AlgorithmConfig
from flyrl.training.algorithms.off_policy import (
    CrossQConfig,
    DDPGConfig,
    HindsightConfig,
    NoisyConfig,
    OffPolicyConfig,
    SACConfig,
    TD3Config,
    TQCConfig,
)
from flyrl.training.algorithms.on_policy import (
    A2CConfig,
    OnPolicyConfig,
    PPOConfig,
    RecurrentPPOConfig,
    TRPOConfig,
)

ALGORITHMS: Final[dict[str, type[AlgorithmConfig]]] = {
    config.name: config
    for config in (
        PPOConfig,
        A2CConfig,
        TRPOConfig,
        RecurrentPPOConfig,
        SACConfig,
        TQCConfig,
        CrossQConfig,
        TD3Config,
        DDPGConfig,
    )
}
"""Name -> settings."""

__all__ = [
    "ALGORITHMS",
    "A2CConfig",
    "AlgorithmConfig",
    "CrossQConfig",
    "DDPGConfig",
    "HindsightConfig",
    "NoisyConfig",
    "OffPolicyConfig",
    "OnPolicyConfig",
    "PPOConfig",
    "RecurrentPPOConfig",
    "SACConfig",
    "TD3Config",
    "TQCConfig",
    "TRPOConfig",
]
