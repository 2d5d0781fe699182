"""How much of what fails is chance: the same episodes over again, with the drive disturbed.

From the root of the repository: `python -m benchmarks.room.luck unhurried flat --terrain gapped`.
Where the episode is to blame, what fails does so again; where chance is, it succeeds next
time as often as all others do.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.room.conditions import CONDITIONS
from benchmarks.room.planner import ROBUST
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.config import FIRST_SEED
from flyrl.policies import load_policy
from flyrl.rollouts import Policy, run_episodes
from flyrl.tasks import Episode


@dataclass(frozen=True)
class Disturbed:
    """A policy whose actions differ a little, decision by decision: as on the planner's copies."""

    policy: Policy
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    noise: float
    rng: np.random.Generator

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Actions (n, k) within their bounds, and the policy's next state."""
        actions, state = self.policy.predict(observation, state, episode_start, deterministic)
        noise = self.rng.normal(0.0, self.noise, actions.shape)
        return np.clip(actions + noise, self.low, self.high), state


def disturbed(
    env: BatchedEnv, policy: Policy, episodes: Sequence[Episode], draws: int, noise: float
) -> NDArray[np.bool_]:
    """Successes (draws, episodes); draw i has the generator of seed i."""
    low, high = env.task.actions.bounds
    policies = [
        Disturbed(policy, low, high, noise, np.random.default_rng(seed)) for seed in range(draws)
    ]
    return np.array(
        [
            [record.success for record in run_episodes(env, each, episodes)]
            for each in tqdm(policies, desc="disturbed", unit="draw")
        ]
    )


def summary(undisturbed: NDArray[np.bool_], again: NDArray[np.bool_]) -> str:
    """Success without a disturbance, with it, and with it where without it failed."""
    often = again.mean(axis=0)
    failed = ~undisturbed
    of_failed = f"{often[failed].mean():.0%}" if failed.any() else "none failed"
    return (
        f"undisturbed {undisturbed.mean():.0%}; disturbed {again.mean():.0%}, where it failed "
        f"undisturbed {of_failed}; never {np.mean(often == 0):.0%}"
    )


def main() -> None:
    """Walk the held-out episodes of one condition, once as they are and then disturbed."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.room.luck", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("policy", help="a law, a policy that comes with flyrl, a file or a run")
    parser.add_argument("condition", choices=tuple(CONDITIONS), metavar="CONDITION")
    parser.add_argument("--terrain", help="in place of the condition's")
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--noise", type=float, default=ROBUST.noise, help="in units of an action")
    given = parser.parse_args()
    config = replace(EnvConfig(), **CONDITIONS[given.condition])
    if given.terrain is not None:
        config = replace(config, terrain=given.terrain)
    env = BatchedEnv(config, 20)
    policy = load_policy(given.policy, env.task)
    episodes = [config.sample_episode(FIRST_SEED + i) for i in range(given.episodes)]
    undisturbed = np.array([record.success for record in run_episodes(env, policy, episodes)])
    print(summary(undisturbed, disturbed(env, policy, episodes, given.draws, given.noise)))


if __name__ == "__main__":
    main()
