"""Policy and environment -> episode records."""

from flyrl.rollouts.records import FAILURES, SAMPLING_S, EpisodeRecord
from flyrl.rollouts.run import Policy, num_decisions, run_episodes
from flyrl.tasks import SUCCESS

__all__ = [
    "FAILURES",
    "SAMPLING_S",
    "SUCCESS",
    "EpisodeRecord",
    "Policy",
    "num_decisions",
    "run_episodes",
]
