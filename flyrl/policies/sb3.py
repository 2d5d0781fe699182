"""Policies from and to Stable-Baselines3's own models and zip files."""

import dataclasses
import os
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import MultiDiscrete
from sb3_contrib import TQC, TRPO, CrossQ, RecurrentPPO
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from sb3_contrib.common.torch_layers import BatchRenorm
from sb3_contrib.crossq.policies import CrossQPolicy
from sb3_contrib.tqc.policies import TQCPolicy
from stable_baselines3 import A2C, DDPG, PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.torch_layers import CombinedExtractor, FlattenExtractor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecNormalize
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import TD3Policy
from torch import Tensor, nn

from flyrl.entry_points import is_entry_point
from flyrl.envs.config import env_record
from flyrl.envs.core import EnvConfig
from flyrl.policies.bundle import (
    PolicyBundle,
    PolicyFileError,
    Squashing,
    TermLayout,
    action_bounds,
    observation_layout,
)
from flyrl.policies.learned import LearnedPolicy
from flyrl.policies.networks import LSTM_PARTS, Activation, Normaliser, Weights
from flyrl.tasks import Task, task_from
from flyrl.validation import FloatArray

ALGORITHMS: Final[Mapping[str, type[BaseAlgorithm]]] = {
    "ppo": PPO,
    "a2c": A2C,
    "sac": SAC,
    "td3": TD3,
    "ddpg": DDPG,
    "tqc": TQC,
    "trpo": TRPO,
    "crossq": CrossQ,
    "recurrent_ppo": RecurrentPPO,
}
"""Algorithms whose models a bundle can hold, by the names that flyrl has for them."""

ACTIVATION_MODULES: Final[dict[Activation, type[nn.Module]]] = {"tanh": nn.Tanh, "relu": nn.ReLU}
_LSTM_NAMES: Final = dict(
    zip(LSTM_PARTS, ("weight_ih", "weight_hh", "bias_ih", "bias_hh"), strict=True)
)
"""Names of an LSTM layer's weights in a bundle -> in torch, where the layer's number follows."""

# a policy needs no memory of what it learned from, and hindsight's cannot be made without its env
_WITHOUT_BUFFER: Final[dict[str, Any]] = {
    "buffer_size": 1,
    "replay_buffer_class": None,
    "replay_buffer_kwargs": {},
}
_COUNT_UNKNOWN: Final = 100_000
"""Observations that statistics stand for where nothing is recorded, about a short training's."""


def bundle_from_sb3(
    model: BaseAlgorithm,
    observation: Sequence[TermLayout],
    env: Mapping[str, Any],
    training: Mapping[str, Any],
) -> PolicyBundle:
    """Bundle of the deterministic policy of a model with an MLP, or with an LSTM before it.

    The models are those of `ALGORITHMS`, their actions a Box, or a MultiDiscrete from 0. If the
    environment is wrapped in a VecNormalize, its statistics of the observations come along.

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
    extractor, modules, squashing = _actor(policy)
    if not _is_flattening(extractor):
        raise ValueError("a bundle holds policies from flat observations, or dicts of them")
    low, high = action_bounds(model.action_space)
    linears = [module for module in modules if isinstance(module, nn.Linear)]
    lstm_sizes: list[int] = []
    if isinstance(policy, RecurrentActorCriticPolicy):
        lstm = policy.lstm_actor
        if lstm.bidirectional or lstm.proj_size or not lstm.bias:
            raise ValueError(
                "a bundle holds LSTMs with biases, in one direction, without projections"
            )
        lstm_sizes = [lstm.input_size, *[lstm.hidden_size] * lstm.num_layers]
    return PolicyBundle(
        weights=_weights(policy, modules),
        sizes=(linears[0].in_features, *(linear.out_features for linear in linears)),
        activation=_activation(modules),
        squashing=squashing,
        observation=tuple(observation),
        action_low=low,
        action_high=high,
        env=env,
        training=training,
        normaliser=_normaliser(model.get_vec_normalize_env()),
        lstm_sizes=tuple(lstm_sizes),
    )


def _actor(policy: BasePolicy) -> tuple[nn.Module, list[nn.Module], Squashing]:
    """Feature extractor, modules from there (or from the LSTM) to the output, and what follows."""
    if isinstance(policy, ActorCriticPolicy) and not policy.squash_output:
        modules = [*policy.mlp_extractor.policy_net.modules(), *policy.action_net.modules()]
        is_integer = isinstance(policy.action_space, MultiDiscrete)
        return policy.pi_features_extractor, modules, "argmax" if is_integer else "clip"
    if isinstance(policy, SACPolicy | TQCPolicy | CrossQPolicy):
        actor = policy.actor
        modules = [*actor.latent_pi.modules(), *actor.mu.modules()]
        return actor.features_extractor, modules, "tanh"
    if isinstance(policy, TD3Policy):
        *modules, _ = policy.actor.mu.modules()  # the last is the tanh
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


def _parameters(policy: BasePolicy, modules: Iterable[nn.Module]) -> dict[str, Tensor]:
    """Parameters of a policy's actor by the names of the weights in a bundle."""
    linears = [module for module in modules if isinstance(module, nn.Linear)]
    parameters: dict[str, Tensor] = {}
    for i, linear in enumerate(linears):
        parameters |= {f"{i}.weight": linear.weight, f"{i}.bias": linear.bias}
    if isinstance(policy, RecurrentActorCriticPolicy):
        lstm = policy.lstm_actor
        for i, (part, name) in product(range(lstm.num_layers), _LSTM_NAMES.items()):
            parameters[f"lstm.{i}.{part}"] = getattr(lstm, f"{name}_l{i}")
    return parameters


def _weights(policy: BasePolicy, modules: Sequence[nn.Module]) -> dict[str, Weights]:
    """Weights as in a bundle; what normalises a layer's inputs is folded into the layer."""
    parameters = _parameters(policy, modules)
    weights = {name: _float64(parameter) for name, parameter in parameters.items()}
    i = 0
    for module in modules:
        if isinstance(module, BatchRenorm):  # x -> scale x + shift
            scale = _float64(module.scale) / np.sqrt(
                _float64(module.get_buffer("ra_var")) + module.eps
            )
            shift = _float64(module.bias) - scale * _float64(module.get_buffer("ra_mean"))
            weights[f"{i}.bias"] += weights[f"{i}.weight"] @ shift
            weights[f"{i}.weight"] *= scale
        i += isinstance(module, nn.Linear)
    return {name: values.astype(np.float32) for name, values in weights.items()}


def _activation(modules: Iterable[nn.Module]) -> Activation:
    names = {module: name for name, module in ACTIVATION_MODULES.items()}
    others = (nn.Linear, nn.Sequential, BatchRenorm)
    kinds = {type(module) for module in modules if not isinstance(module, others)}
    for kind in kinds - names.keys():
        raise ValueError(f"layer: {kind.__name__}; allowed: Linear, Tanh, ReLU")
    if len(kinds) > 1:
        raise ValueError(f"activations: {sorted(names[kind] for kind in kinds)}; allowed: one kind")
    return names[kinds.pop()] if kinds else "tanh"


def _float64(parameter: Tensor) -> FloatArray:
    return parameter.detach().cpu().numpy().astype(np.float64)


def _normaliser(env: VecNormalize | None) -> Normaliser | None:
    """What a VecNormalize does to the observations, if it does anything to them."""
    if env is None or not env.norm_obs:
        return None
    parts = _moments(env)
    mean, variance = (np.concatenate([getattr(m, key) for m in parts]) for key in ("mean", "var"))
    return Normaliser(mean, variance, env.epsilon, env.clip_obs)


def _moments(env: VecNormalize) -> list[RunningMeanStd]:
    """Statistics of the observation, or of the parts of a dict, in the order of the bundle."""
    moments = env.obs_rms
    return [moments[name] for name in sorted(moments)] if isinstance(moments, dict) else [moments]


def import_sb3(
    path: str | os.PathLike[str],
    algorithm: type[BaseAlgorithm],
    env: EnvConfig,
    *,
    vec_normalize: str | os.PathLike[str] | None = None,
    trust: bool = False,
) -> PolicyBundle:
    """Bundle of the deterministic policy in a zip file that Stable-Baselines3 saved.

    Such a file holds pickles, and unpickling runs whatever code its author put there.

    Parameters
    ----------
    path
        What `model.save` wrote.
    algorithm
        Class of the model, such as `stable_baselines3.PPO`.
    env
        What it was trained in.
    vec_normalize
        What `VecNormalize.save` wrote, if the model was trained under one: the statistics are not
        in the model's file. This is a pickle as well.
    trust
        Whether you know where the file comes from. Without, it is not even opened.

    Raises
    ------
    PolicyFileError
        `trust` is not True, the file is no model of the algorithm, or the model was trained on
        other observations or actions than the task's. A ValueError.
    ValueError
        A policy that a bundle cannot hold.
    """
    if trust is not True:
        raise PolicyFileError(
            f"{os.fspath(path)} was not opened: a zip file of Stable-Baselines3 holds pickles, "
            "which can run any code when they are read. Say trust=True if you know who made it"
        )
    model = _unpickled(
        path,
        f"a model of {algorithm.__name__}",
        lambda file: algorithm.load(file, device="cpu", custom_objects=_WITHOUT_BUFFER),
    )
    task = env.resolved_task
    for what, given, wanted in (
        ("observations", model.observation_space, task.observation_space),
        ("actions", model.action_space, task.actions.space),
    ):
        if given != wanted:
            raise PolicyFileError(
                f"the model was trained on other {what} than those of {task.name}: {given}; "
                f"the task has {wanted}"
            )
    names = {known: name for name, known in ALGORITHMS.items()}
    algo = names.get(algorithm, algorithm.__name__.lower())
    training = {"algo": algo, "decisions": int(model.num_timesteps)}
    bundle = bundle_from_sb3(model, observation_layout(task), env_record(env), training)
    if vec_normalize is None:
        return bundle
    wrapper = _unpickled(
        vec_normalize, "statistics of VecNormalize", lambda file: pickle.loads(file.read_bytes())
    )
    return dataclasses.replace(bundle, normaliser=_normaliser(wrapper))


def _unpickled(path: str | os.PathLike[str], what: str, read: Callable[[Path], Any]) -> Any:
    """What `read` makes of a file; PolicyFileError whatever its pickles raise."""
    try:
        return read(Path(path))
    except Exception as error:
        raise PolicyFileError(
            f"{os.fspath(path)} cannot be read as {what}: {type(error).__name__}: {error}"
        ) from error


def export_sb3(
    bundle: PolicyBundle, task: str | Task | None = None, *, seed: int = 0
) -> BaseAlgorithm:
    """Stable-Baselines3 model that acts as the bundle.

    It is a PPO, a SAC if the output is squashed, or a RecurrentPPO if the policy has a memory.
    `model.save` writes its zip file, from which `load` with an environment lets it learn on. The
    value function, the exploration noise and the optimiser are new: a bundle holds the
    deterministic policy alone.

    A model of Stable-Baselines3 takes observations that are normalised already. If the bundle
    normalises them, `model.get_vec_normalize_env()` is the VecNormalize that does the same: its
    `normalize_obs` makes the model's observations, its `save` writes what `VecNormalize.load`
    wraps an environment with. Else it is None.

    Parameters
    ----------
    bundle
        The policy.
    task
        Whose observations it takes; None means the task and the body that the bundle names.
    seed
        Of what is new in the model.

    Returns
    -------
    Model on the CPU; its environment has spaces and nothing behind them. Its deterministic actions
    differ from the bundle's by no more than rounding to float32 does; of whole numbers, that is
    where two are nearly as good.

    Raises
    ------
    PolicyFileError
        The task has other observations or actions than the bundle. A ValueError.
    ValueError
        The task is not known by name, or the bundle has a memory and a squashed output.
    """
    if bundle.lstm_sizes and bundle.squashing == "tanh":
        raise ValueError(
            f"squashing: {bundle.squashing!r}; allowed with a memory: 'clip', 'argmax' "
            "(as of RecurrentPPO)"
        )
    if task is None:
        record = bundle.env.get("task")
        name = str(record.get("name") if isinstance(record, Mapping) else record)
        if is_entry_point(name):
            raise PolicyFileError(
                f"the policy was trained in {name}, which is code that would be run; if you know "
                f"who made it, say task={name!r}"
            )
        task = EnvConfig(name, body=bundle.env.get("body"), as_vectors=True).resolved_task
    elif isinstance(task, str):
        task = task_from(task)
    task = task.flattened()
    LearnedPolicy(bundle, task)
    if bundle.observation != (shown := observation_layout(task)):
        more = ", ".join(term.name for term in shown if term not in bundle.observation)
        raise PolicyFileError(
            f"a model takes all that {task.name} shows, in that order, and the policy was trained "
            f"without {more or 'that order'}"
        )
    kind = "Mlp" if task.is_flat else "MultiInput"
    algorithm: type[PPO | SAC | RecurrentPPO] = SAC if bundle.squashing == "tanh" else PPO
    policy_kwargs: dict[str, Any] = {
        "net_arch": list(bundle.sizes[1:-1]),
        "activation_fn": ACTIVATION_MODULES[bundle.activation],
    }
    if bundle.lstm_sizes:
        kind, algorithm = f"{kind}Lstm", RecurrentPPO
        policy_kwargs["lstm_hidden_size"] = bundle.lstm_sizes[-1]
        policy_kwargs["n_lstm_layers"] = len(bundle.lstm_sizes) - 1
    env = _environment(task, bundle)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        model = algorithm(f"{kind}Policy", env, device="cpu", policy_kwargs=policy_kwargs)
    _, modules, _ = _actor(model.policy)
    with torch.no_grad():
        for name, parameter in _parameters(model.policy, modules).items():
            parameter.copy_(torch.from_numpy(bundle.weights[name]))
    return model


class _SpacesOnly(gymnasium.Env[Any, Any]):
    """What a model and a VecNormalize need to be made: spaces, and nothing behind them."""

    def __init__(self, task: Task) -> None:
        self.observation_space, self.action_space = task.observation_space, task.actions.space


def _environment(task: Task, bundle: PolicyBundle) -> VecEnv:
    """What the model is made for: spaces, under the statistics of the bundle if it has some."""
    spaces = DummyVecEnv([lambda: _SpacesOnly(task)])
    if bundle.normaliser is None:
        return spaces
    # statistics of the rewards are not in a bundle
    env = VecNormalize(
        spaces,
        norm_reward=False,
        clip_obs=bundle.normaliser.clip,
        epsilon=bundle.normaliser.epsilon,
    )
    parts, decisions = _moments(env), bundle.training.get("decisions")
    ends = np.cumsum([len(part.mean) for part in parts])[:-1]
    statistics = [np.split(v, ends) for v in (bundle.normaliser.mean, bundle.normaliser.variance)]
    # else what is learned on first would outweigh them
    count = decisions if isinstance(decisions, int) and decisions > 0 else _COUNT_UNKNOWN
    for part, mean, variance in zip(parts, *statistics, strict=True):
        part.mean, part.var, part.count = mean.copy(), variance.copy(), float(count)
    return env
