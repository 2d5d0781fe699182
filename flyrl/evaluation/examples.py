"""Some episodes of everyone, to be looked at closely."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant
from flyrl.evaluation.entrants import make_entrants
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.tasks import Episode
from flyrl.terrains import Terrain


def walk_examples(
    config: EvaluationConfig, walked: Sequence[EpisodeRecord] = ()
) -> list[EpisodeRecord]:
    """Records of the episodes to `film`: as in the evaluation, to the bit, with all of the gait.

    Parameters
    ----------
    config
        Of the evaluation; where it varies something, nothing is varied here.
    walked
        Those that were kept from the evaluation; the others are walked again.

    Returns
    -------
    One per terrain, episode and entrant, in this order, but for those that raise an error.
    """
    drawn = [
        (terrain, index, config.draw_episodes(terrain)[index])
        for terrain in config.terrain_configs
        for index in config.film
    ]

    kept = {(record.controller, record.terrain, record.index): record for record in walked}

    def walk(entrant: Entrant) -> list[EpisodeRecord | None]:
        return [
            kept.get((entrant.name, terrain.label, index))
            or _walk(entrant, config, terrain, index, episode)
            for terrain, index, episode in drawn
        ]

    # one fly at a time keeps one core busy: as many at once as there are cores
    with ThreadPoolExecutor(config.num_threads or os.cpu_count()) as executor:
        records = list(executor.map(walk, make_entrants(config)))
    return [record for of_episode in zip(*records, strict=True) for record in of_episode if record]


def _walk(
    entrant: Entrant, config: EvaluationConfig, terrain: Terrain, index: int, drawn: Episode
) -> EpisodeRecord | None:
    """Record of one entrant on one episode; None if it raises an error."""
    env = BatchedEnv(entrant.env(config, terrain), 1, num_threads=1)
    try:
        (record,) = run_episodes(
            env, entrant.policy, [drawn], controller=entrant.name, first_index=index
        )
    except Exception:
        return None
    return record
