"""One episode of everyone, walked again, to be looked at closely."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant
from flyrl.evaluation.entrants import make_entrants
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.tasks import Episode
from flyrl.terrains import TerrainConfig
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
    terrains = config.terrain_configs
    drawn = [config.draw_episodes(terrain)[episode] for terrain in terrains]

    def walk(entrant: Entrant) -> list[EpisodeRecord | None]:
        return [
            _walk(entrant, config, terrain, each, episode)
            for terrain, each in zip(terrains, drawn, strict=True)
        ]

    # one fly at a time keeps one core busy: as many at once as there are cores
    with ThreadPoolExecutor(config.num_threads or os.cpu_count()) as executor:
        walked = list(executor.map(walk, make_entrants(config)))
    return [record for of_terrain in zip(*walked, strict=True) for record in of_terrain if record]


def _walk(
    entrant: Entrant, config: EvaluationConfig, terrain: TerrainConfig, drawn: Episode, index: int
) -> EpisodeRecord | None:
    """Record of one entrant on one terrain; None if it raises an error."""
    env = BatchedEnv(entrant.env(config, terrain), 1, num_threads=1)
    try:
        (record,) = run_episodes(
            env, entrant.policy, [drawn], controller=entrant.name, first_index=index
        )
    except Exception:
        return None
    return record
