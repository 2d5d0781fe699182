"""Hindsight experience replay (Andrychowicz et al. 2017, arXiv:1707.01495)."""

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.type_aliases import DictReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.her import HerReplayBuffer


class HindsightBuffer(HerReplayBuffer):
    """Stable-Baselines3's HerReplayBuffer, in which a new goal also decides what is an end.

    There, a decision that is replayed with another goal keeps the end that it had with its own. So
    reaching the new goal would be no end, other than reaching one in the environment, and a
    decision that reached the old goal would be one even where it leads away from the new.
    """

    _new_goals: NDArray[np.float32]

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
            None,
            indices=[0],
        )
        ends = self.to_torch(is_end.astype(np.float32)).reshape(-1, 1)
        return samples._replace(dones=ends)
