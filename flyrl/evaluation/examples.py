"""One episode of everyone, walked again, to be looked at closely."""

from __future__ import annotations

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrants import make_entrants
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.validation import within


def walk_examples(config: EvaluationConfig, episode: int = 0) -> list[EpisodeRecord]:
    """Records of one episode: those of the evaluation, to the bit, with all of the gait.

    Parameters
    ----------
    config
        Of the evaluation; where it varies something, nothing is varied here.
    episode
        Index of the episode.

    Returns
    -------
    One per terrain and entrant, but for those that raise an error.
    """
    within("episode", episode, 0, config.episodes - 1)
    records: list[EpisodeRecord] = []
    for terrain in config.terrain_configs:
        drawn = config.draw_episodes(terrain)[episode]
        for entrant in make_entrants(config):
            env = BatchedEnv(entrant.env(config, terrain), 1, num_threads=1)
            try:
                records += run_episodes(
                    env, entrant.policy, [drawn], controller=entrant.name, first_index=episode
                )
            except Exception:
                continue
    return records
