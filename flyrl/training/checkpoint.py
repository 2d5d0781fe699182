"""Checkpoints: everything that a run's future depends on, in one file that executes no code.

A run that goes on from a checkpoint ends with the same bits as one that was never interrupted. The
file is PyTorch's, read with `weights_only=True`: tensors, numbers, text, lists and dicts.
"""

import io
import random
import zipfile
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.her import HerReplayBuffer

from flyrl.files import write_bytes
from flyrl.training.runs import ResumeError

_FORMAT: Final = 9

_PARTS: Final = frozenset(("learner", "env", "run", "settings"))

_COUNTERS: Final = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")
_LAST: Final = ("_last_obs", "_last_original_obs", "_last_episode_starts")
_BUFFER_ARRAYS: Final[tuple[str, ...]] = (
    "observations",
    "next_observations",
    "actions",
    "rewards",
    "dones",
    "timeouts",
)
_HINDSIGHT_ARRAYS: Final = ("ep_start", "ep_length", "failures")


def learner_state(model: BaseAlgorithm) -> dict[str, Any]:
    """Copy everything in a model that its learning depends on, except its environment.

    Call it between an update and the next decisions.

    Returns
    -------
    Parameters and optimisers, counters, last observations, statistics of the latest episodes, what
    waits to be logged, the state of every generator that Stable-Baselines3 draws from; and, where
    there are such, the replay buffer, the statistics that observations and rewards are normalised
    with, and the memory of a recurrent policy.
    """
    _, variables = model._get_torch_save_params()
    return {
        "parameters": model.get_parameters(),
        "variables": {name: getattr(model, name).detach() for name in variables},
        "attributes": {name: getattr(model, name) for name in _COUNTERS + _LAST},
        "episode_infos": list(model.ep_info_buffer or ()),
        "successes": list(model.ep_success_buffer or ()),
        "log": {
            "values": dict(model.logger.name_to_value),
            "counts": dict(model.logger.name_to_count),
            "excluded": dict(model.logger.name_to_excluded),
        },
        "replay_buffer": _replay_buffer_state(model),
        "normaliser": _normaliser_state(model),
        "memory": _memory(model),
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
    for name, value in state["variables"].items():
        getattr(model, name).data.copy_(torch.as_tensor(value))
    for name, value in state["attributes"].items():
        setattr(model, name, value)
    window = model._stats_window_size
    model.ep_info_buffer = deque(state["episode_infos"], maxlen=window)
    model.ep_success_buffer = deque(state["successes"], maxlen=window)
    model.logger.name_to_value.update(state["log"]["values"])
    model.logger.name_to_count.update(state["log"]["counts"])
    model.logger.name_to_excluded.update(state["log"]["excluded"])
    if state["replay_buffer"] is not None:
        _restore_replay_buffer(model, state["replay_buffer"])
    if state["normaliser"] is not None:
        _restore_normaliser(model, state["normaliser"])
    if state["memory"] is not None:
        _restore_memory(model, state["memory"])
    generators = state["generators"]
    random.setstate(generators["python"])
    np.random.set_state(generators["numpy"])
    torch.set_rng_state(torch.as_tensor(generators["torch"]))
    model.action_space.np_random.bit_generator.state = generators["action_space"]


def _replay_buffer_state(model: BaseAlgorithm) -> dict[str, Any] | None:
    if not isinstance(model, OffPolicyAlgorithm) or model.replay_buffer is None:
        return None
    buffer = model.replay_buffer
    filled = buffer.buffer_size if buffer.full else buffer.pos
    names, episode_starts = _BUFFER_ARRAYS, None
    if isinstance(buffer, HerReplayBuffer):
        names, episode_starts = _BUFFER_ARRAYS + _HINDSIGHT_ARRAYS, buffer._current_ep_start
    return {
        "pos": buffer.pos,
        "full": buffer.full,
        "episode_starts": episode_starts,
        "arrays": {
            name: {key: values[:filled] for key, values in _parts(buffer, name).items()}
            for name in names
        },
    }


def _restore_replay_buffer(model: BaseAlgorithm, state: Mapping[str, Any]) -> None:
    assert isinstance(model, OffPolicyAlgorithm)
    assert model.replay_buffer is not None
    buffer = model.replay_buffer
    buffer.pos, buffer.full = state["pos"], state["full"]
    if isinstance(buffer, HerReplayBuffer):
        buffer._current_ep_start = state["episode_starts"]
    for name, parts in state["arrays"].items():
        for key, values in parts.items():
            _parts(buffer, name)[key][: len(values)] = values


def _parts(buffer: ReplayBuffer, name: str) -> dict[str, np.ndarray]:
    """Arrays of a buffer's attribute by key; a single one has the key ""."""
    values = getattr(buffer, name)
    return values if isinstance(values, dict) else {"": values}


def _normaliser_state(model: BaseAlgorithm) -> dict[str, Any] | None:
    normaliser = model.get_vec_normalize_env()
    if normaliser is None:
        return None
    return {
        "statistics": {
            name: {"mean": moments.mean, "variance": moments.var, "count": moments.count}
            for name, moments in _moments(normaliser).items()
        },
        "returns": normaliser.returns.copy(),
    }


def _restore_normaliser(model: BaseAlgorithm, state: Mapping[str, Any]) -> None:
    normaliser = model.get_vec_normalize_env()
    assert normaliser is not None
    for name, moments in _moments(normaliser).items():
        values = state["statistics"][name]
        moments.mean, moments.var = values["mean"], values["variance"]
        moments.count = values["count"]
    normaliser.returns = state["returns"]


def _moments(normaliser: VecNormalize) -> dict[str, RunningMeanStd]:
    moments = {"return": normaliser.ret_rms}
    if normaliser.norm_obs:
        if isinstance(normaliser.obs_rms, RunningMeanStd):
            moments["observation"] = normaliser.obs_rms
        else:
            moments |= {f"observation.{key}": part for key, part in normaliser.obs_rms.items()}
    return moments


def _memory(model: BaseAlgorithm) -> dict[str, list[torch.Tensor]] | None:
    """State of a recurrent policy's LSTMs: the actor's and the critic's, hidden and cell each."""
    if not isinstance(model, RecurrentPPO):
        return None
    states: RNNStates = model._last_lstm_states  # type: ignore[assignment] # declared as None
    return {"actor": list(states.pi), "critic": list(states.vf)}


def _restore_memory(model: BaseAlgorithm, memory: Mapping[str, Any]) -> None:
    assert isinstance(model, RecurrentPPO)
    actor, critic = (
        tuple(torch.as_tensor(value) for value in memory[part]) for part in ("actor", "critic")
    )
    model._last_lstm_states = RNNStates(actor, critic)  # type: ignore[assignment] # as above


def save_checkpoint(path: Path, state: Mapping[str, Any]) -> None:
    """Write a checkpoint, whole or not at all.

    Parameters
    ----------
    path
        Where to.
    state
        Nested dicts, lists and tuples of arrays, tensors, numbers and text.

    Raises
    ------
    OSError
        The disk is full or the folder cannot be written to; what stood at `path` still does.
    """
    # in memory first: of a full disk, torch.save would say no more than that it failed
    data = io.BytesIO()
    torch.save({"format": _FORMAT, "state": _map(state, _to_tensor)}, data)
    write_bytes(path, data.getvalue())


def load_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint; what was an array or a tensor is an array, except in "parameters".

    Raises
    ------
    OSError
        The file cannot be opened.
    ResumeError
        It is damaged, or no checkpoint of flyrl.
    """
    with path.open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                if damaged := archive.testzip():  # torch.load compares no checksums
                    raise ResumeError(f"{path} is damaged: its {damaged} is not as it was written")
            file.seek(0)
            record = torch.load(file, weights_only=True)
            if record["format"] != _FORMAT:
                raise ResumeError(f"{path} has format {record['format']!r}, known is {_FORMAT}")
            state: dict[str, Any] = record["state"]
            parameters = state["learner"].pop("parameters")
            if missing := _PARTS - state.keys():
                raise ResumeError(f"{path} lacks {', '.join(sorted(missing))}")
            int(state["run"]["decisions"])
        except ResumeError:
            raise
        except Exception as error:
            # torch names no common class for what a damaged file may raise: OSError, too
            raise ResumeError(f"{path} is damaged, or no checkpoint: {error}") from error
    restored: dict[str, Any] = _map(state, _to_array)
    restored["learner"]["parameters"] = parameters
    return restored


def _map(tree: Any, convert: Any) -> Any:
    """Convert every leaf of nested dicts, lists and tuples."""
    if isinstance(tree, Mapping):
        return {key: _map(value, convert) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return type(tree)(_map(value, convert) for value in tree)
    return convert(tree)


def _to_tensor(leaf: Any) -> Any:
    is_array = isinstance(leaf, np.ndarray | np.number | np.bool_)
    return torch.from_numpy(np.asarray(leaf, order="C")) if is_array else leaf


def _to_array(leaf: Any) -> Any:
    # of a tensor without axes, [()] makes a NumPy scalar, which is what it was
    return leaf.numpy()[()] if isinstance(leaf, torch.Tensor) else leaf
