"""From a Stable-Baselines3 model to a bundle."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from gymnasium import Space
from gymnasium.spaces import Box, MultiDiscrete
from numpy.typing import NDArray
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from sb3_contrib.common.torch_layers import BatchRenorm
from sb3_contrib.crossq.policies import CrossQPolicy
from sb3_contrib.tqc.policies import TQCPolicy
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.torch_layers import CombinedExtractor, FlattenExtractor
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import TD3Policy
from torch import Tensor, nn

from flyrl.policies.bundle import PolicyBundle, Squashing, TermLayout
from flyrl.policies.networks import LSTM, MLP, Activation, Layer, LSTMLayer, Normaliser

ACTIVATION_MODULES: Final[dict[Activation, type[nn.Module]]] = {"tanh": nn.Tanh, "relu": nn.ReLU}
_ACTIVATIONS: Final = {module: name for name, module in ACTIVATION_MODULES.items()}


def bundle_from_sb3(
    model: BaseAlgorithm,
    observation: Sequence[TermLayout],
    env: Mapping[str, Any],
    training: Mapping[str, Any],
) -> PolicyBundle:
    """Bundle of the deterministic policy of a model with an MLP, or with an LSTM before it.

    The models are PPO, A2C, SAC, TD3 and DDPG, and sb3-contrib's TRPO, RecurrentPPO, TQC and
    CrossQ. If the model's environment is wrapped in a VecNormalize, its statistics of the
    observations come along.

    Actions are a Box, or a MultiDiscrete from 0, which PPO, A2C, TRPO and RecurrentPPO take.

    Parameters
    ----------
    model
        Trained on flat observations, or dicts of them.
    observation, env, training
        As in `PolicyBundle`.

    Raises
    ------
    ValueError
        A policy that a bundle cannot hold.
    """
    policy = model.policy
    extractor, modules, squashing = actor_modules(policy)
    bounds = _bounds(model.action_space)
    if not _is_flattening(extractor) or bounds is None:
        raise ValueError(
            "a bundle holds policies from flat observations, or dicts of them, to a Box of actions "
            f"or a MultiDiscrete from 0; got {model.action_space}"
        )
    return PolicyBundle(
        network=_network(modules),
        squashing=squashing,
        observation=tuple(observation),
        action_low=bounds[0],
        action_high=bounds[1],
        env=env,
        training=training,
        normaliser=normaliser_of(model.get_vec_normalize_env()),
        lstm=_lstm(policy.lstm_actor) if isinstance(policy, RecurrentActorCriticPolicy) else None,
    )


def _bounds(space: Space[Any]) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Bounds of the actions that a bundle can hold."""
    if isinstance(space, Box):
        return tuple(space.low.tolist()), tuple(space.high.tolist())
    if isinstance(space, MultiDiscrete) and not space.start.any():
        low, high = np.zeros(len(space.nvec)), space.nvec - 1.0
        return tuple(low.tolist()), tuple(high.tolist())
    return None


def actor_modules(policy: BasePolicy) -> tuple[nn.Module, list[nn.Module], Squashing]:
    """Feature extractor, modules from there (or from the LSTM) to the output, and what follows."""
    if isinstance(policy, ActorCriticPolicy) and not policy.squash_output:
        modules = [*policy.mlp_extractor.policy_net.modules(), *policy.action_net.modules()]
        is_integer = isinstance(policy.action_space, MultiDiscrete)
        return policy.pi_features_extractor, modules, "argmax" if is_integer else "clip"
    if isinstance(policy, SACPolicy | TQCPolicy | CrossQPolicy):
        actor = policy.actor
        return (
            actor.features_extractor,
            [*actor.latent_pi.modules(), *actor.mu.modules()],
            "tanh",
        )
    if isinstance(policy, TD3Policy):
        *modules, squashing = policy.actor.mu.modules()
        if not isinstance(squashing, nn.Tanh):
            raise ValueError(f"last layer: {type(squashing).__name__}; allowed: Tanh")
        return policy.actor.features_extractor, modules, "tanh"
    raise ValueError(
        f"policy: {type(policy).__name__}; allowed: the MlpPolicy of PPO, A2C, TRPO, SAC, TQC, "
        "CrossQ, TD3 and DDPG, the MlpLstmPolicy of RecurrentPPO, and their MultiInput… for dicts"
    )


def _is_flattening(extractor: nn.Module) -> bool:
    """Whether the features are the observation's values, in the order of the bundle."""
    if isinstance(extractor, CombinedExtractor):
        parts = dict(extractor.extractors.items())
        return list(parts) == sorted(parts) and all(
            isinstance(part, nn.Flatten) for part in parts.values()
        )
    return isinstance(extractor, FlattenExtractor)


def _network(modules: Iterable[nn.Module]) -> MLP:
    layers: list[Layer] = []
    activations: set[Activation] = set()
    norm: BatchRenorm | None = None
    for module in modules:
        if isinstance(module, nn.Linear):
            layers.append(_layer(module, norm))
            norm = None
        elif isinstance(module, BatchRenorm):
            norm = module
        elif type(module) in _ACTIVATIONS:
            activations.add(_ACTIVATIONS[type(module)])
        elif not isinstance(module, nn.Sequential):
            raise ValueError(f"layer: {type(module).__name__}; allowed: Linear, Tanh, ReLU")
    if len(activations) > 1:
        raise ValueError(f"activations: {sorted(activations)}; allowed: one kind")
    return MLP(tuple(layers), activations.pop() if activations else "tanh")


def _layer(linear: nn.Linear, norm: BatchRenorm | None) -> Layer:
    """A linear layer and, folded into it, what normalises its inputs.

    When it is not trained, batch renormalisation is the affine map x -> scale x + shift.
    """
    weight, bias = _float64(linear.weight), _float64(linear.bias)
    if norm is not None:
        scale = 1 / np.sqrt(_float64(norm.get_buffer("ra_var")) + norm.eps)
        shift = -_float64(norm.get_buffer("ra_mean")) * scale
        if norm.affine:
            scale, shift = (_float64(norm.scale) * part for part in (scale, shift))
            shift += _float64(norm.bias)
        weight, bias = weight * scale, bias + weight @ shift
    return Layer(weight.astype(np.float32), bias.astype(np.float32))


def _lstm(module: nn.LSTM) -> LSTM:
    if module.bidirectional or module.proj_size or not module.bias:
        raise ValueError("a bundle holds LSTMs with biases, in one direction, without projections")
    parts = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
    return LSTM(
        tuple(
            LSTMLayer(
                *(_float64(getattr(module, f"{part}_l{i}")).astype(np.float32) for part in parts)
            )
            for i in range(module.num_layers)
        )
    )


def normaliser_of(env: VecNormalize | None) -> Normaliser | None:
    """What a VecNormalize does to the observations, if it does anything to them."""
    if env is None or not env.norm_obs:
        return None
    moments = env.obs_rms
    if isinstance(moments, RunningMeanStd):
        return Normaliser(moments.mean, moments.var, env.epsilon, env.clip_obs)
    parts = [moments[name] for name in sorted(moments)]
    mean, variance = (np.concatenate([getattr(m, key) for m in parts]) for key in ("mean", "var"))
    return Normaliser(mean, variance, env.epsilon, env.clip_obs)


def _float64(parameter: Tensor) -> NDArray[np.float64]:
    return parameter.detach().cpu().numpy().astype(np.float64)
