"""Stable-Baselines3's models: built from settings, written down and restored to the bit.

Also hindsight replay. Private names of Stable-Baselines3 are used in this module alone.
"""

import inspect
import random
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.type_aliases import DictReplayBufferSamples
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from stable_baselines3.her import HerReplayBuffer

from flyrl.policies.sb3 import ACTIVATION_MODULES, ALGORITHMS
from flyrl.tasks import DECISIONS_LOST, IS_FAILURE
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.runs import flat


class HindsightBuffer(HerReplayBuffer):
    """Stable-Baselines3's HerReplayBuffer, in which a new goal also decides what is an end.

    There, a decision that is replayed with another goal keeps the end that it had with its own. So
    reaching the new goal would be no end, other than reaching one in the environment, and a
    decision that reached the old goal would be one even where it leads away from the new. A
    decision in which the fly failed stays an end with every goal, and is charged as it was.

    The parameters are those of HerReplayBuffer, but for `copy_info_dict`: of the infos, what
    rewards and ends take from them is kept, as arrays.

    Attributes
    ----------
    failures
        Whether the fly failed, and how many decisions that cut off, by key of `info`, (rows, n).
    """

    _new_goals: NDArray[np.float32]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **{**kwargs, "copy_info_dict": True})
        shape = self.buffer_size, self.n_envs
        self.failures = {
            IS_FAILURE: np.zeros(shape, dtype=bool),
            DECISIONS_LOST: np.zeros(shape, dtype=np.float32),
        }
        self.infos = _Infos(self.failures)  # type: ignore[assignment] # declared as an array

    def _sample_goals(
        self, batch_indices: NDArray[np.intp], env_indices: NDArray[np.intp]
    ) -> NDArray[np.float32]:
        # kept: those in the samples may be normalised
        self._new_goals = super()._sample_goals(batch_indices, env_indices)
        return self._new_goals

    def _get_virtual_samples(
        self,
        batch_indices: NDArray[np.intp],
        env_indices: NDArray[np.intp],
        env: VecNormalize | None = None,
    ) -> DictReplayBufferSamples:
        samples = super()._get_virtual_samples(batch_indices, env_indices, env)
        assert self.env is not None
        (is_end,) = self.env.env_method(
            "compute_terminated",
            self.next_observations["achieved_goal"][batch_indices, env_indices],
            self._new_goals,
            self.infos[batch_indices, env_indices],
            indices=[0],
        )
        ends = self.to_torch(is_end.astype(np.float32)).reshape(-1, 1)
        return samples._replace(dones=ends)


class _Infos:
    """Infos of decisions, written as one dict per fly and read as one dict of arrays.

    It stands in for HerReplayBuffer's array of dicts, which would take far more memory.
    """

    def __init__(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self._arrays = arrays

    def __setitem__(self, row: int, infos: Sequence[Mapping[str, Any]]) -> None:
        for key, values in self._arrays.items():
            values[row] = [info[key] for info in infos]

    def __getitem__(self, places: tuple[NDArray[np.intp], NDArray[np.intp]]) -> dict[str, Any]:
        return {key: values[places] for key, values in self._arrays.items()}


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

    Raises
    ------
    ValueError
        Stable-Baselines3 refuses a value.
    """
    settings = dict(algo.settings)
    policy_kwargs: dict[str, Any] = {
        "net_arch": list(settings.pop("hidden_layers")),
        "activation_fn": ACTIVATION_MODULES[settings.pop("activation")],
    }
    norm_obs = settings.pop("normalize_observation")
    norm_reward = settings.pop("normalize_reward")
    if norm_obs or norm_reward:
        gamma = settings["gamma"]
        env = VecNormalize(env, norm_obs=norm_obs, norm_reward=norm_reward, gamma=gamma)
    if settings.pop("learning_rate_decay"):
        settings["learning_rate"] = LinearSchedule(settings["learning_rate"], 0.0, 1.0)
    if "initial_ent_coef" in settings:
        settings["ent_coef"] = f"auto_{settings.pop('initial_ent_coef')}"
    if "action_noise_std" in settings:
        std = np.full(env.action_space.shape or (), settings.pop("action_noise_std"))
        settings["action_noise"] = NormalActionNoise(np.zeros_like(std), std)
    if "her" in settings:
        names = ("n_sampled_goal", "goal_selection_strategy")
        of_buffer = {name: settings.pop(name) for name in names}
        if settings.pop("her"):
            settings["replay_buffer_class"] = HindsightBuffer
            settings["replay_buffer_kwargs"] = of_buffer
    algorithm = ALGORITHMS[algo.name]
    of_policy = settings.keys() - inspect.signature(algorithm).parameters.keys()
    policy_kwargs |= {name: settings.pop(name) for name in of_policy}
    inputs = "MultiInput" if isinstance(env.observation_space, spaces.Dict) else "Mlp"
    memory = "Lstm" if algo.name == "recurrent_ppo" else ""
    try:
        return algorithm(
            policy=f"{inputs}{memory}Policy",
            env=env,
            policy_kwargs=policy_kwargs,
            seed=seed,
            device="cpu",
            **settings,
        )
    except (AssertionError, TypeError, ValueError) as error:  # of settings without a range here
        raise ValueError(f"algo={algo.name}: Stable-Baselines3 refuses: {error}") from error


# not all among what `model.save` keeps, but needed to end with the same bits: counters (some
# algorithms update the policy at every n-th update only, some log at every n-th episode), and what
# the next decision is made on
_COUNTERS: Final = (
    "num_timesteps",
    *("_n_updates", "_episode_num"),
    *("_last_obs", "_last_original_obs", "_last_episode_starts"),
)
_LOGGED: Final = ("name_to_value", "name_to_count", "name_to_excluded")


def learner_state(model: BaseAlgorithm) -> dict[str, Any]:
    """Return everything in a model that its learning depends on, except its environment.

    Call it between an update and the next decisions. The arrays are the model's own.

    Returns
    -------
    Parameters and optimisers, the weight of the entropy, counters, last observations, statistics of
    the latest episodes, what waits to be logged, the state of every generator that
    Stable-Baselines3 draws from; and, where there are such, the replay buffer, the statistics that
    observations and rewards are normalised with, and the memory of a recurrent policy.
    """
    infos, successes = model.ep_info_buffer, model.ep_success_buffer
    assert infos is not None  # made before the first decision
    assert successes is not None
    buffer = _replay_buffer(model)
    return {
        "parameters": model.get_parameters(),
        "entropy_weight": _entropy_weight(model),
        "attributes": {name: getattr(*place) for name, place in _attributes(model).items()},
        "episodes": {
            "window": infos.maxlen,
            "infos": list(infos),
            "successes": list(successes),
        },
        "log": {name: dict(getattr(model.logger, name)) for name in _LOGGED},
        "replay_buffer": {} if buffer is None else _filled(buffer),
        "generators": {
            "python": random.getstate(),
            "numpy": np.random.get_state(legacy=False),
            "torch": torch.get_rng_state(),
            "action_space": model.action_space.np_random.bit_generator.state,
        },
    }


def restore_learner(model: BaseAlgorithm, state: Mapping[str, Any]) -> None:
    """Put back what `learner_state` returned; the model has the same settings and a logger."""
    model.set_parameters(state["parameters"], exact_match=True)
    if (weight := _entropy_weight(model)) is not None:
        weight.copy_(torch.as_tensor(state["entropy_weight"]))
    for name, place in _attributes(model).items():
        setattr(*place, state["attributes"][name])
    if isinstance(model, RecurrentPPO):
        memories = state["attributes"]["_last_lstm_states"]
        actor, critic = (tuple(map(torch.as_tensor, memory)) for memory in memories)
        model._last_lstm_states = RNNStates(actor, critic)  # type: ignore[assignment] # declared as None
    episodes = state["episodes"]
    model.ep_info_buffer = deque(episodes["infos"], maxlen=episodes["window"])
    model.ep_success_buffer = deque(episodes["successes"], maxlen=episodes["window"])
    for name in _LOGGED:
        getattr(model.logger, name).update(state["log"][name])
    if (buffer := _replay_buffer(model)) is not None:
        for name, values in _filled(buffer).items():
            values[:] = state["replay_buffer"][name]
    generators = state["generators"]
    random.setstate(generators["python"])
    np.random.set_state(generators["numpy"])
    torch.set_rng_state(torch.as_tensor(generators["torch"]))
    model.action_space.np_random.bit_generator.state = generators["action_space"]


def _entropy_weight(model: BaseAlgorithm) -> torch.Tensor | None:
    """The learned weight's logarithm, without its gradient; its optimiser is a parameter."""
    weight = getattr(model, "log_ent_coef", None)
    return None if weight is None else weight.detach()


def _replay_buffer(model: BaseAlgorithm) -> ReplayBuffer | None:
    return getattr(model, "replay_buffer", None)


def _attributes(model: BaseAlgorithm) -> dict[str, tuple[Any, str]]:
    """Attributes that are kept as they are: object and name, by a name of its own for each."""
    places: dict[str, tuple[Any, str]] = {name: (model, name) for name in _COUNTERS}
    if isinstance(model, RecurrentPPO):
        places["_last_lstm_states"] = model, "_last_lstm_states"
    if (buffer := _replay_buffer(model)) is not None:
        names = ["pos", "full"]
        if isinstance(buffer, HindsightBuffer):
            names.append("_current_ep_start")  # of the episodes that have not ended
        places |= {f"replay_buffer.{name}": (buffer, name) for name in names}
    if (normaliser := model.get_vec_normalize_env()) is not None:
        observation = normaliser.obs_rms if normaliser.norm_obs else {}
        statistics = flat({"return": normaliser.ret_rms, "observation": observation})
        places["returns"] = normaliser, "returns"
        for name, moments in statistics.items():
            places |= {f"{name}.{part}": (moments, part) for part in ("mean", "var", "count")}
    return places


def _filled(buffer: ReplayBuffer) -> dict[str, NDArray[Any]]:
    """Filled rows of a replay buffer's arrays by name, a row per decision of all environments."""
    rows = buffer.buffer_size if buffer.full else buffer.pos
    return {
        name: values[:rows]
        for name, values in flat(vars(buffer)).items()
        if isinstance(values, np.ndarray)
        and values.shape[:2] == (buffer.buffer_size, buffer.n_envs)
        and not name.startswith("_")
    }
