"""Many flies or worms as a Stable-Baselines3 VecEnv, over the native batch."""

import time
from collections.abc import Mapping, Sequence
from typing import Any, Final

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from flyrl.envs.adapter import Adapter, row_of
from flyrl.envs.bodies import RENDERING
from flyrl.envs.core import EnvConfig
from flyrl.tasks.target import compute_reward, compute_terminated
from flyrl.validation import random_seed

_OF_GOALS: Final = {"compute_reward": compute_reward, "compute_terminated": compute_terminated}


class FlyrlVecEnv(Adapter, VecEnv):
    """`num_envs` flies or worms on native threads, with SB3's conventions.

    An episode that ends is reset at once; `infos` then carries "terminal_observation",
    "TimeLimit.truncated" and "episode" (return "r", length "l", wall time "t"), as SB3's Monitor
    would, and "difficulty". "outcome" (a code, whose name is `outcomes[code]`) and "is_success" are
    there at every step; in a task with goals "is_failure" and "decisions_lost", too (see
    `FlyrlEnv`). A copy, deep or by pickle, is a new one of the same settings, and must be reset.

    Parameters
    ----------
    config
        The settings.
    num_envs
        Number of flies.
    num_threads
        Native threads; 0 takes one per CPU.
    seed
        Fly i starts with the seed `seed + i`; None draws from the operating system.
    render_mode
        None or "rgb_array".
    **settings
        Fields of `EnvConfig`, in place of those of `config`, and of `flyrl.envs.bodies.View`,
        and settings of the task.

    Raises
    ------
    ValueError
        An argument that is not allowed.
    """

    def __init__(
        self,
        config: EnvConfig | None = None,
        num_envs: int = 1,
        num_threads: int = 0,
        seed: int | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        own = {"config": config, "num_envs": num_envs, "num_threads": num_threads, "seed": seed}
        self._make_core({**own, "render_mode": render_mode}, settings)
        task = self.core.task
        super().__init__(num_envs, task.observation_space, task.actions.space)
        self.metadata = RENDERING
        self._actions: NDArray[Any] = np.zeros((num_envs, self.core.task.actions.size))
        self._returns = np.zeros(num_envs)
        self._lengths = np.zeros(num_envs, dtype=np.int64)
        self._start = time.time()
        self.seed(seed)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the next reset: environment i with `seed + i`."""
        return super().seed(seed if seed is None else random_seed(seed))

    def reset(self) -> VecEnvObs:
        """Start an episode in every environment."""
        observation = self._reset(self._seeds, self._options)
        self.reset_infos = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        self._lengths[:] = 0
        return observation

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Hold the actions for a decision interval; reset what is done."""
        transition = self.core.step(self._actions)
        observation = transition.observation
        self._returns += transition.reward
        self._lengths += 1
        facts = {
            "outcome": transition.outcome_code,
            "is_success": transition.is_success,
            **self.core.failure_info(),
        }
        rows = zip(*(values.tolist() for values in facts.values()), strict=True)
        infos: list[dict[str, Any]] = [dict(zip(facts, row, strict=True)) for row in rows]
        ended = np.flatnonzero(transition.done)
        for i in ended:
            episode = self.core.episodes[i]
            infos[i]["terminal_observation"] = row_of(observation, i)
            infos[i]["difficulty"] = episode and episode.difficulty
            infos[i]["TimeLimit.truncated"] = bool(transition.truncated[i])
            infos[i]["episode"] = {
                "r": float(self._returns[i]),
                "l": int(self._lengths[i]),
                "t": round(time.time() - self._start, 6),
            }
        if len(ended):
            self._returns[ended] = 0.0
            self._lengths[ended] = 0
            observation = self.core.reset(ids=ended)
        return observation, transition.reward.astype(np.float32), transition.done, infos

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future depends on, for `restore`."""
        return {
            "core": self.core.snapshot(),
            "returns": self._returns.copy(),
            "lengths": self._lengths.copy(),
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Put back what `snapshot` returned, in an environment of the same settings."""
        self.core.restore(snapshot["core"])
        self._returns[:] = snapshot["returns"]
        self._lengths[:] = snapshot["lengths"]

    def close(self) -> None:
        """Free the renderer; to reset, step or render from now on is an error."""
        self.core.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Attribute of the batch, once per environment."""
        value = getattr(self, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the whole batch; single environments have none of their own."""
        if indices is not None:
            raise ValueError(
                "a fly of the batch has no attributes of its own; indices must be None"
            )
        setattr(self, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Result of `compute_reward` or `compute_terminated`, once per environment.

        Any other method raises: the flies are rows of a batch, not environment objects.
        """
        if method_name not in _OF_GOALS:
            raise NotImplementedError(
                f"a fly of the batch has no method {method_name!r} of its own"
            )
        result = _OF_GOALS[method_name](self.core.task, *method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(
        self,
        wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]],
        indices: VecEnvIndices = None,
    ) -> list[bool]:
        """No environment is wrapped; but episodes are monitored here, as SB3's Monitor does."""
        from stable_baselines3.common.monitor import Monitor  # noqa: PLC0415

        is_monitored = issubclass(Monitor, wrapper_class)
        return [is_monitored for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Pictures of the bodies, (height, width, 3) each."""
        return [self.core.render(i) for i in range(self.num_envs)]
