"""From the settings of an algorithm to Stable-Baselines3's model of it."""

import dataclasses
from typing import Final

import numpy as np
from gymnasium import spaces
from sb3_contrib import TQC, TRPO, CrossQ, RecurrentPPO
from stable_baselines3 import A2C, DDPG, PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from flyrl.policies.export import ACTIVATION_MODULES
from flyrl.training.algorithms import (
    A2CConfig,
    AlgorithmConfig,
    CrossQConfig,
    DDPGConfig,
    HindsightConfig,
    NoisyConfig,
    PPOConfig,
    RecurrentPPOConfig,
    SACConfig,
    TD3Config,
    TQCConfig,
    TRPOConfig,
)
from flyrl.training.hindsight import HindsightBuffer

CLIP: Final = 10.0
"""Normalised observations and rewards lie within this of 0."""

_MODELS: Final[dict[type[AlgorithmConfig], type[BaseAlgorithm]]] = {
    PPOConfig: PPO,
    A2CConfig: A2C,
    TRPOConfig: TRPO,
    RecurrentPPOConfig: RecurrentPPO,
    SACConfig: SAC,
    TQCConfig: TQC,
    CrossQConfig: CrossQ,
    TD3Config: TD3,
    DDPGConfig: DDPG,
}

# Settings that are not arguments of the model: those of its policy, and those of other names.
_OF_POLICY: Final = {
    "enable_critic_lstm",
    "log_std_init",
    "lstm_hidden_size",
    "n_critics",
    "n_lstm_layers",
    "n_quantiles",
    "renorm_warmup_steps",
}
_TRANSLATED: Final = {
    "action_noise_std",
    "activation",
    "goal_selection_strategy",
    "her",
    "hidden_layers",
    "initial_ent_coef",
    "learning_rate",
    "learning_rate_decay",
    "n_sampled_goal",
    "normalize_observation",
    "normalize_reward",
}


def build_model(algo: AlgorithmConfig, env: VecEnv, seed: int) -> BaseAlgorithm:
    """Stable-Baselines3 model, untrained, on the CPU.

    Parameters
    ----------
    algo
        Settings.
    env
        Where it will learn; wrapped in a VecNormalize if the settings say so.
    seed
        Of the network and the exploration.
    """
    settings = {
        field.name: getattr(algo, field.name)
        for field in dataclasses.fields(algo)
        if field.name not in _TRANSLATED
    }
    of_policy = {name: settings.pop(name) for name in _OF_POLICY & settings.keys()}
    if hasattr(algo, "initial_ent_coef"):
        settings["ent_coef"] = f"auto_{algo.initial_ent_coef}"
    if isinstance(algo, NoisyConfig):
        shape = env.action_space.shape
        assert shape is not None
        std = np.full(shape, algo.action_noise_std)
        settings["action_noise"] = NormalActionNoise(np.zeros(shape), std)
    if isinstance(algo, HindsightConfig) and algo.her:
        settings["replay_buffer_class"] = HindsightBuffer
        settings["replay_buffer_kwargs"] = {
            "n_sampled_goal": algo.n_sampled_goal,
            "goal_selection_strategy": algo.goal_selection_strategy,
        }
    return _MODELS[type(algo)](
        policy=_policy(algo, env),
        env=_normalised(algo, env),
        learning_rate=(
            LinearSchedule(algo.learning_rate, 0.0, 1.0)
            if algo.learning_rate_decay
            else algo.learning_rate
        ),
        policy_kwargs={
            "net_arch": list(algo.hidden_layers),
            "activation_fn": ACTIVATION_MODULES[algo.activation],
            **of_policy,
        },
        seed=seed,
        device="cpu",
        **settings,
    )


def _policy(algo: AlgorithmConfig, env: VecEnv) -> str:
    """Name of the policy in Stable-Baselines3."""
    inputs = "MultiInput" if isinstance(env.observation_space, spaces.Dict) else "Mlp"
    memory = "Lstm" if isinstance(algo, RecurrentPPOConfig) else ""
    return f"{inputs}{memory}Policy"


def _normalised(algo: AlgorithmConfig, env: VecEnv) -> VecEnv:
    if not algo.normalize_observation and not algo.normalize_reward:
        return env
    return VecNormalize(
        env,
        norm_obs=algo.normalize_observation,
        norm_reward=algo.normalize_reward,
        clip_obs=CLIP,
        clip_reward=CLIP,
        gamma=algo.gamma,
    )
