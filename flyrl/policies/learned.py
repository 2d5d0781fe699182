"""A policy from a bundle."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.policies.bundle import (
    PolicyBundle,
    PolicyFileError,
    Sizes,
    TermLayout,
    action_bounds,
    load_bundle,
    observation_layout,
    policy_file,
)
from flyrl.policies.fixed import FixedPolicy
from flyrl.policies.laws import FIXED, fixed_policy, is_law
from flyrl.policies.networks import lstm_step, mlp, vectors
from flyrl.tasks import Task, task_from
from flyrl.validation import FloatArray, file_path


class LearnedPolicy:
    """The deterministic policy of a bundle.

    A row of observations gives the same action to the bit, alone and in any batch.

    Parameters
    ----------
    bundle
        Weights, layout and provenance.
    task
        What it acts in: the policy takes what it was trained on out of what that shows, whatever
        else there is. None shows what `bundle.observation` says.

    Raises
    ------
    PolicyFileError
        The task does not show that, or has other actions. A ValueError.
    """

    def __init__(self, bundle: PolicyBundle, task: Task | None = None) -> None:
        self.bundle = bundle
        shown = bundle.observation if task is None else _fitting_layout(bundle, task)
        self._term_sizes = {term.name: term.size for term in shown}
        self._num_shown = sum(term.size for term in shown)
        self._columns = np.arange(self._num_shown)
        if task is not None:
            places = task.slices()
            taken = [self._columns[places[term.name]] for term in bundle.observation]
            self._columns = np.concatenate(taken)
        self._low, self._high = np.array(bundle.action_low), np.array(bundle.action_high)
        self._is_integer = bundle.squashing == "argmax"

    def predict(
        self,
        observation: ArrayLike | Mapping[str, ArrayLike],
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Action for one observation or a batch, with the signature of Stable-Baselines3.

        Parameters
        ----------
        observation
            Shape (k,) or (n, k), laid out as the task's, or as `bundle.observation`; or a dict that
            `vectors` makes one of.
        state
            Of a policy with an LSTM: what the call before returned, or None to start with zeros.
            Any other policy hands it back.
        episode_start
            Of a policy with an LSTM: whether an episode starts with this observation, (n,); where
            one does, the state is set to zeros first. None means nowhere.
        deterministic
            Must be True: a bundle holds no exploration noise.

        Returns
        -------
        Action, shape (a,) or (n, a), inside the bounds: float32, or int64 of a policy of whole
        numbers (squashing "argmax"); and the state: of a policy with an LSTM, hidden and cell
        state, shape (layers, n, units) each (n is 1 for one observation).

        Raises
        ------
        ValueError
            Another shape, or `deterministic=False`.
        """
        if not deterministic:
            raise ValueError("deterministic: False; allowed: True (a bundle holds no noise)")
        values = vectors(observation, self._term_sizes)
        size = self._num_shown
        if values.ndim not in (1, 2) or values.shape[-1] != size:
            raise ValueError(
                f"observation of shape {values.shape}; allowed: ({size},) or (n, {size})"
            )
        bundle = self.bundle
        rows = np.take(np.atleast_2d(values), self._columns, axis=1)
        if bundle.normaliser is not None:
            rows = bundle.normaliser.apply(rows)
        if bundle.lstm_sizes:
            hidden, cell = _memory(bundle.lstm_sizes, len(rows), state, episode_start)
            state = lstm_step(bundle.weights, rows, hidden, cell)
            rows = state[0][-1]
        outputs = mlp(bundle.weights, len(bundle.sizes) - 1, bundle.activation, rows)
        actions = self._actions(outputs)
        return (actions if values.ndim == 2 else actions[0]), state

    def _actions(self, outputs: FloatArray) -> NDArray[Any]:
        """Actions (n, a) from the network's outputs."""
        if self._is_integer:
            ends = np.cumsum(self.bundle.action_counts)[:-1]
            parts = np.split(outputs, ends, axis=1)
            best = np.stack([part.argmax(axis=1) for part in parts], axis=1)
            return best + self._low.astype(np.int64)
        if self.bundle.squashing == "tanh":
            outputs = self._low + 0.5 * (np.tanh(outputs) + 1) * (self._high - self._low)
        return np.clip(outputs, self._low, self._high).astype(np.float32)


def _fitting_layout(bundle: PolicyBundle, task: Task) -> tuple[TermLayout, ...]:
    """Layout of a task's observation; PolicyFileError unless the policy can act in the task."""
    shown = observation_layout(task)
    for trained in bundle.observation:
        if trained not in shown:
            given = next((term for term in shown if term.name == trained.name), None)
            raise PolicyFileError(
                f"the policy was trained on observations that {task.name} does not show: "
                f"{_described(trained)}, here it is {_described(given)}"
            )
    is_integer = bundle.squashing == "argmax"
    own = (is_integer, bundle.action_low, bundle.action_high)
    here = (task.actions.is_integer, *action_bounds(task.actions.space))
    if own != here:
        was, wanted = (
            f"{'whole numbers' if is_integer else 'numbers'} within {low} and {high}"
            for is_integer, low, high in (own, here)
        )
        raise PolicyFileError(f"the policy's actions are {was}, those of {task.name} {wanted}")
    return shown


def _described(term: TermLayout | None) -> str:
    return "missing" if term is None else f"{term.name} ({term.size} values)"


def _memory(sizes: Sizes, num_rows: int, state: Any, episode_start: Any) -> FloatArray:
    """Hidden and cell state before a step, an array of its own: (2, layers, n, units)."""
    shape = (2, len(sizes) - 1, num_rows, sizes[-1])
    memory = np.zeros(shape) if state is None else np.array(state, dtype=np.float64)
    if memory.shape != shape:
        raise ValueError(f"state of shape {memory.shape}; allowed: None, or {shape}")
    if episode_start is not None:
        starts = np.atleast_1d(np.asarray(episode_start, dtype=bool))
        if starts.shape != (num_rows,):
            raise ValueError(f"episode_start of shape {starts.shape}; allowed: ({num_rows},)")
        memory[:, :, starts] = 0.0
    return memory


def load_policy(
    path: str | os.PathLike[str], task: str | Task | None = None
) -> LearnedPolicy | FixedPolicy:
    """Load a policy from a bundle, from a run folder (its best policy, else its last), or by name.

    Parameters
    ----------
    path
        File, folder, the name of a policy that comes with flyrl, or that of a fixed law, such as
        "pursuit" or "constant(1.2, 0.4)" (see `flyrl.policies.laws.FIXED`); what lies at a path
        comes before a name. Names of leg controllers walk straight on, with the legs that the
        environment has.
    task
        What it is to act in, which a learned policy must fit. None takes it as it was trained, and
        of a fixed law the first of `flyrl.tasks.TASKS` that shows what the law needs.

    Raises
    ------
    PolicyFileError
        It is missing, truncated, changed, or no policy of flyrl, or does not fit the task. A
        ValueError.
    ValueError
        No task of that name, or one that does not show what a fixed law needs.
    """
    if isinstance(task, str):
        task = task_from(task)
    path = file_path("path of a policy", Path(path) if isinstance(path, os.PathLike) else path)
    name = str(path)
    if is_law(name) and not path.exists():
        return fixed_policy(name, task)
    return LearnedPolicy(load_bundle(policy_file(path, FIXED)), task)
