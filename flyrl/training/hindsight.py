"""Hindsight experience replay (Andrychowicz et al. 2017, arXiv:1707.01495)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.type_aliases import DictReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.her import HerReplayBuffer

from flyrl.tasks import DECISIONS_LOST, IS_FAILURE


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
