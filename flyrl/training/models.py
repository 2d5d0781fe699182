"""Stable-Baselines3's model from the settings of an algorithm; hindsight replay."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.type_aliases import DictReplayBufferSamples
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from stable_baselines3.her import HerReplayBuffer

from flyrl.policies.sb3 import ACTIVATION_MODULES, ALGORITHMS
from flyrl.tasks import DECISIONS_LOST, IS_FAILURE
from flyrl.training.algorithms import AlgorithmConfig


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


CLIP: Final = 10.0
"""Normalised observations and rewards lie within this of 0."""

_OF_POLICY: Final[tuple[str, ...]] = (
    "enable_critic_lstm",
    "log_std_init",
    "lstm_hidden_size",
    "n_critics",
    "n_lstm_layers",
    "n_quantiles",
    "renorm_warmup_steps",
)
"""Settings that are arguments of the model's policy instead of the model."""


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
    policy_kwargs = {name: settings.pop(name) for name in _OF_POLICY if name in settings}
    policy_kwargs["net_arch"] = list(settings.pop("hidden_layers"))
    policy_kwargs["activation_fn"] = ACTIVATION_MODULES[settings.pop("activation")]
    norm_obs = settings.pop("normalize_observation")
    norm_reward = settings.pop("normalize_reward")
    if norm_obs or norm_reward:
        env = VecNormalize(
            env,
            norm_obs=norm_obs,
            norm_reward=norm_reward,
            clip_obs=CLIP,
            clip_reward=CLIP,
            gamma=settings["gamma"],
        )
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
    inputs = "MultiInput" if isinstance(env.observation_space, spaces.Dict) else "Mlp"
    memory = "Lstm" if algo.name == "recurrent_ppo" else ""
    try:
        return ALGORITHMS[algo.name](
            policy=f"{inputs}{memory}Policy",
            env=env,
            policy_kwargs=policy_kwargs,
            seed=seed,
            device="cpu",
            **settings,
        )
    except (AssertionError, TypeError, ValueError) as error:  # of settings without a range here
        raise ValueError(f"algo={algo.name}: Stable-Baselines3 refuses: {error}") from error
