"""Policies from and to Stable-Baselines3's own models and zip files."""

import dataclasses
import os
import pickle
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
import torch
from gymnasium import Space
from sb3_contrib import TQC, TRPO, CrossQ, RecurrentPPO
from stable_baselines3 import A2C, DDPG, PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn

from flyrl.entry_points import is_entry_point
from flyrl.envs.core import EnvConfig
from flyrl.envs.options import action_space, observation_space
from flyrl.envs.record import env_record
from flyrl.policies.bundle import PolicyBundle, PolicyFileError, observation_layout
from flyrl.policies.export import (
    ACTIVATION_MODULES,
    actor_modules,
    bundle_from_sb3,
    normaliser_of,
)
from flyrl.policies.learned import LearnedPolicy
from flyrl.policies.networks import LSTM, Normaliser
from flyrl.tasks import Task, task_from

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

# a policy needs no memory of what it learned from, and hindsight's cannot be made without its env
_WITHOUT_BUFFER: Final[dict[str, Any]] = {
    "buffer_size": 1,
    "replay_buffer_class": None,
    "replay_buffer_kwargs": {},
}
_COUNT_UNKNOWN: Final = 100_000
"""Observations that statistics stand for where nothing is recorded, about a short training's."""


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
    with _unpickling(path, f"a model of {algorithm.__name__}"):
        model = algorithm.load(Path(path), device="cpu", custom_objects=_WITHOUT_BUFFER)
    task = env.resolved_task
    _check_space("observations", model.observation_space, observation_space(task), task)
    _check_space("actions", model.action_space, action_space(task), task)
    names = [name for name, known in ALGORITHMS.items() if known is algorithm]
    algo = names[0] if names else algorithm.__name__.lower()
    training = {"algo": algo, "decisions": int(model.num_timesteps)}
    bundle = bundle_from_sb3(model, observation_layout(task), env_record(env), training)
    if vec_normalize is None:
        return bundle
    with (
        _unpickling(vec_normalize, "statistics of VecNormalize"),
        Path(vec_normalize).open("rb") as file,
    ):
        wrapper: VecNormalize = pickle.load(file)
        return dataclasses.replace(bundle, normaliser=normaliser_of(wrapper))


@contextmanager
def _unpickling(path: str | os.PathLike[str], what: str) -> Iterator[None]:
    """Say what could not be read, whatever a pickle raises."""
    try:
        yield
    except Exception as error:
        raise PolicyFileError(
            f"{os.fspath(path)} cannot be read as {what}: {type(error).__name__}: {error}"
        ) from error


def _check_space(what: str, given: Space[Any], wanted: Space[Any], task: Task) -> None:
    if given != wanted:
        raise PolicyFileError(
            f"the model was trained on other {what} than those of {task.name}: {given}; "
            f"the task has {wanted}"
        )


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
    Model on the CPU, without an environment. Its deterministic actions differ from the bundle's by
    no more than rounding to float32 does; of whole numbers, that is where two are nearly as good.

    Raises
    ------
    PolicyFileError
        The task has other observations or actions than the bundle. A ValueError.
    ValueError
        The task is not known by name, or the bundle has a memory and a squashed output.
    """
    if bundle.lstm is not None and bundle.squashing == "tanh":
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
    LearnedPolicy(bundle).check_task(task)
    # a model without an environment, made as SB3's own `load` does it
    of_policy: dict[str, Any] = {
        "net_arch": list(bundle.network.sizes[1:-1]),
        "activation_fn": ACTIVATION_MODULES[bundle.network.activation],
    }
    memory = ""
    if bundle.lstm is not None:
        memory = "Lstm"
        of_policy["lstm_hidden_size"] = bundle.lstm.sizes[-1]
        of_policy["n_lstm_layers"] = len(bundle.lstm.layers)
    common: dict[str, Any] = {
        "policy": f"{'Mlp' if task.is_flat else 'MultiInput'}{memory}Policy",
        "env": None,
        "device": "cpu",
        "policy_kwargs": of_policy,
        "_init_setup_model": False,
    }
    model: BaseAlgorithm
    if bundle.lstm is not None:
        model = RecurrentPPO(**common)
    elif bundle.squashing == "tanh":
        # else SAC takes its default for this, minus the number of actions, from the environment
        model = SAC(**common, target_entropy=float(-len(bundle.action_low)))
    else:
        model = PPO(**common)
    model.observation_space, model.action_space = observation_space(task), action_space(task)
    model.n_envs = 1
    with torch.random.fork_rng(devices=[]), torch.no_grad():
        torch.manual_seed(seed)
        model._setup_model()
        _, modules, _ = actor_modules(model.policy)
        linears = [module for module in modules if isinstance(module, nn.Linear)]
        for linear, layer in zip(linears, bundle.network.layers, strict=True):
            linear.weight.copy_(torch.from_numpy(layer.weight))
            linear.bias.copy_(torch.from_numpy(layer.bias))
        if bundle.lstm is not None:
            _fill(model.policy.get_submodule("lstm_actor"), bundle.lstm)
    if bundle.normaliser is not None:
        model._vec_normalize_env = _vec_normalize(
            bundle.normaliser, model, bundle.training.get("decisions")
        )
    return model


def _fill(module: nn.Module, lstm: LSTM) -> None:
    for i, layer in enumerate(lstm.layers):
        for name, values in (
            ("weight_ih", layer.input_weight),
            ("weight_hh", layer.recurrent_weight),
            ("bias_ih", layer.input_bias),
            ("bias_hh", layer.recurrent_bias),
        ):
            module.get_parameter(f"{name}_l{i}").copy_(torch.from_numpy(values))


class _SpacesOnly(gymnasium.Env[Any, Any]):
    """What a VecNormalize needs to be made: spaces, and nothing behind them."""

    def __init__(self, model: BaseAlgorithm) -> None:
        self.observation_space, self.action_space = model.observation_space, model.action_space


def _vec_normalize(normaliser: Normaliser, model: BaseAlgorithm, decisions: Any) -> VecNormalize:
    """The statistics as Stable-Baselines3 keeps them; those of the rewards are not in a bundle."""
    env = VecNormalize(
        DummyVecEnv([lambda: _SpacesOnly(model)]),
        norm_reward=False,
        clip_obs=normaliser.clip,
        epsilon=normaliser.epsilon,
    )
    moments = env.obs_rms
    parts = [moments[name] for name in sorted(moments)] if isinstance(moments, dict) else [moments]
    ends = np.cumsum([len(part.mean) for part in parts])[:-1]
    means, variances = np.split(normaliser.mean, ends), np.split(normaliser.variance, ends)
    # else what is learned on first would outweigh them
    is_known = isinstance(decisions, int) and decisions > 0
    for part, mean, variance in zip(parts, means, variances, strict=True):
        part.mean, part.var = mean.copy(), variance.copy()
        part.count = float(decisions if is_known else _COUNT_UNKNOWN)
    return env
