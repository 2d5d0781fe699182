"""Which leg is cut off, read from a policy's memory.

From the root of the repository: `python -m benchmarks.memory <policy>`, of one with an LSTM that
was trained with `randomisation=lesion`.
"""

import argparse
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import LEGS
from flyrl.cli.config import training_config
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.config import FIRST_SEED
from flyrl.policies import LearnedPolicy, load_policy
from flyrl.rollouts import run_episodes

Array = NDArray[np.float64]

TIMES_S: Final = (0.02, 0.1, 0.2, 0.4, 0.6, 0.8)
"""Since the episode began; episodes that have ended by then are left out."""


class Watched:
    """A policy whose observations and hidden states are kept, by decision."""

    def __init__(self, policy: LearnedPolicy) -> None:
        self._policy = policy
        self.observations: list[Array] = []
        self.memories: list[Array] = []

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """As the policy's."""
        action, state = self._policy.predict(observation, state, episode_start, deterministic)
        self.observations.append(np.array(observation, np.float64))
        self.memories.append(np.array(state[0][-1]))
        return action, state


def share_right(features: Array, labels: NDArray[np.int64], folds: int = 5) -> float:
    """Share of labels that a linear reading of the features gets right, where it was not fitted.

    Ridge regression onto one column per label (Alain and Bengio 2016, arXiv:1610.01644), fitted on
    all folds but one and tried on that.

    Parameters
    ----------
    features, labels
        (n, k) and (n,), in an order that has nothing to do with the labels.
    """
    scaled = (features - features.mean(axis=0)) / (features.std(axis=0) + 1e-9)
    inputs = np.column_stack([scaled, np.ones(len(labels))])
    wanted = np.eye(labels.max() + 1)[labels]
    fold = np.arange(len(labels)) % folds
    right = np.zeros(len(labels), bool)
    for i in range(folds):
        x, y = inputs[fold != i], wanted[fold != i]
        weights = np.linalg.solve(x.T @ x + np.eye(x.shape[1]), x.T @ y)
        right[fold == i] = (inputs[fold == i] @ weights).argmax(axis=1) == labels[fold == i]
    return float(right.mean())


def main() -> None:
    """Print a table: the leg as read from what the fly feels at a time, and from the memory."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.memory", description=__doc__)
    parser.add_argument("policy", help="run folder or policy file")
    parser.add_argument("--episodes", type=int, default=300)
    given = parser.parse_args()
    policy = load_policy(given.policy)
    if not isinstance(policy, LearnedPolicy) or not policy.bundle.lstm_sizes:
        parser.error(f"{given.policy} has no memory")
    env_settings, training = policy.bundle.env, policy.bundle.training
    config: EnvConfig = training_config({**env_settings, **training["settings"], "seed": 0}).env
    episodes = [config.sample_episode(FIRST_SEED + i) for i in range(given.episodes)]
    legs = np.array([LEGS.index(each.randomisation.missing_leg) for each in episodes])
    watched = Watched(policy)
    records = run_episodes(BatchedEnv(config, given.episodes), watched, episodes)
    ends_s = np.array([record.duration_s for record in records])
    print("| time, s | flies | what it feels | memory |\n|---|---|---|---|")
    for time_s in TIMES_S:
        i, still = round(time_s / config.decision_interval_s) - 1, ends_s > time_s
        seen, kept = (
            share_right(rows[i][still], legs[still])
            for rows in (watched.observations, watched.memories)
        )
        print(f"| {time_s} | {still.sum()} | {100 * seen:.0f} % | {100 * kept:.0f} % |")


if __name__ == "__main__":
    main()
