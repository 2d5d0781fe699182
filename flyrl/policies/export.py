"""From a Stable-Baselines3 model to a bundle."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.sac.policies import SACPolicy
from torch import Tensor, nn

from flyrl.policies.bundle import PolicyBundle, Squashing, TermLayout
from flyrl.policies.mlp import MLP, Activation, Layer

_ACTIVATIONS: dict[type[nn.Module], Activation] = {nn.Tanh: "tanh", nn.ReLU: "relu"}


def bundle_from_sb3(
    model: BaseAlgorithm,
    observation: Sequence[TermLayout],
    env: Mapping[str, Any],
    training: Mapping[str, Any],
) -> PolicyBundle:
    """Bundle of the deterministic policy of a PPO, A2C or SAC model with an MLP.

    Parameters
    ----------
    model
        Trained on flat observations and a Box of actions.
    observation, env, training
        As in `PolicyBundle`.

    Raises
    ------
    ValueError
        A policy that a bundle cannot hold.
    """
    policy = model.policy
    hidden: nn.Module
    squashing: Squashing
    if isinstance(policy, ActorCriticPolicy) and not policy.squash_output:
        extractor, hidden, head = (
            policy.pi_features_extractor,
            policy.mlp_extractor.policy_net,
            policy.action_net,
        )
        squashing = "clip"
    elif isinstance(policy, SACPolicy):
        extractor, hidden, head = (
            policy.actor.features_extractor,
            policy.actor.latent_pi,
            policy.actor.mu,
        )
        squashing = "tanh"
    else:
        raise ValueError(
            f"policy: {type(policy).__name__}; allowed: the MlpPolicy of PPO, A2C and SAC"
        )
    if not isinstance(extractor, FlattenExtractor) or not isinstance(model.action_space, Box):
        raise ValueError("a bundle holds policies from flat observations to a Box of actions")
    linear, activation = _split([*hidden.modules(), *head.modules()])
    return PolicyBundle(
        network=MLP(tuple(linear), activation),
        squashing=squashing,
        observation=tuple(observation),
        action_low=tuple(model.action_space.low.tolist()),
        action_high=tuple(model.action_space.high.tolist()),
        env=env,
        training=training,
    )


def _split(modules: Sequence[nn.Module]) -> tuple[list[Layer], Activation]:
    layers: list[Layer] = []
    activations: set[Activation] = set()
    for module in modules:
        if isinstance(module, nn.Linear):
            layers.append(Layer(_array(module.weight), _array(module.bias)))
        elif type(module) in _ACTIVATIONS:
            activations.add(_ACTIVATIONS[type(module)])
        elif not isinstance(module, nn.Sequential):
            raise ValueError(f"layer: {type(module).__name__}; allowed: Linear, Tanh, ReLU")
    if len(activations) > 1:
        raise ValueError(f"activations: {sorted(activations)}; allowed: one kind")
    return layers, activations.pop() if activations else "tanh"


def _array(parameter: Tensor) -> np.ndarray[Any, np.dtype[np.float32]]:
    return parameter.detach().cpu().numpy().astype(np.float32, copy=True)
