"""Randomised flies in the environments: draws, options, determinism, going on."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import flyrl  # noqa: F401  (registers the ids)
from flyrl.anatomy import LEGS
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.randomisation import (
    RANDOMISATIONS,
    UNVARIED,
    Randomisation,
    RandomisationConfig,
)

CONFIG = EnvConfig(physics="fast", randomisation="default")
PLAIN = EnvConfig(physics="fast")


def test_episodes_hold_what_was_drawn_for_each_simulation_and_are_else_the_same() -> None:
    env = BatchedEnv(CONFIG, 2)
    env.reset(seeds=[5, 6])
    for sim, (seed, episode) in enumerate(zip((5, 6), env.episodes, strict=True)):
        assert episode.randomisation == CONFIG.resolved_randomisation.draw(seed)
        assert replace(episode, randomisation=UNVARIED) == PLAIN.sample_episode(seed)
        friction = env.flies._batch.get_model(sim).pair_friction
        expected = env.batch.scene.model.pair_friction * episode.randomisation.friction
        np.testing.assert_array_equal(friction, expected)


def test_mass_on_one_random_ground_leaves_nothing_behind_on_the_next() -> None:
    """MuJoCo derives what it needs from the masses and, by the way, the bounds of the boxes."""
    settings = EnvConfig("hybrid_turning", terrain="random_mixed", decision_interval=0.02)
    env, twin = (BatchedEnv(settings, 2) for _ in range(2))
    heavy = Randomisation(mass=2.0)
    env.reset(episodes=[replace(settings.sample_episode(s), randomisation=heavy) for s in (1, 2)])
    for each in (env, twin):
        each.reset(seeds=[3, 4])
        for _ in range(15):
            each.step(np.ones((2, 2)))
    np.testing.assert_array_equal(env.flies.integration_state(), twin.flies.integration_state())


def test_latency_holds_each_decision_back_by_its_time() -> None:
    """45 ms of 20 ms decisions: at 1 ms per step, the first is at the legs in step 46."""
    late = RandomisationConfig(drive_latency=(0.045,) * 2)
    config = EnvConfig("target_unfiltered", physics="fast", randomisation=late)
    assert config.scene.queue_places == 3
    env = BatchedEnv(config, 1)
    env.reset(seeds=[0])
    drives = []
    for number in range(6):
        env.step(env.task.actions.of(np.full((1, 2), 0.1 * (number + 1))))
        drives.append(float(env.flies.userdata["arrived"][0, 0]))
        # what the fly knows of is what it decided
        assert env.state.command[0, 0] == pytest.approx(0.1 * (number + 1))
    np.testing.assert_allclose(drives, [0.0, 0.0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize(
    ("task", "latency", "interval", "places"),
    [("target", 0.04, None, 2), ("target", 0.05, 0.01, 5), ("hybrid_turning", 0.05, None, 50)],
)
def test_the_queue_has_a_place_for_every_drive_on_its_way(task, latency, interval, places):
    drawn = RandomisationConfig(drive_latency=(0.0, latency))
    config = EnvConfig(task, physics="fast", decision_interval=interval, randomisation=drawn)
    assert config.scene.queue_places == places
    assert PLAIN.scene.queue_places == 0


def test_an_episode_of_more_latency_than_the_settings_have_is_refused_before_anything() -> None:
    env = BatchedEnv(PLAIN, 1)
    env.reset(seeds=[0])
    env.step(np.ones((1, 2)))
    before = env.flies.integration_state()
    late = replace(PLAIN.sample_episode(1), randomisation=Randomisation(drive_latency=0.01))
    with pytest.raises(ValueError, match=r"drive_latency is 0\.01 s; .* at most 0\.0 s"):
        env.reset(episodes=[late])
    np.testing.assert_array_equal(env.flies.integration_state(), before)


def test_reset_options_fix_what_they_name_and_leave_the_rest_as_drawn() -> None:
    env = gymnasium.make("flyrl/Target-v0", randomisation="default")
    fixed = {"friction": 0.5, "drive_latency": 0.01}
    _, info = env.reset(seed=4, options={"randomisation": fixed})
    drawn = CONFIG.resolved_randomisation.draw(4)
    assert info["randomisation"] == replace(drawn, **fixed).numbers()
    core = env.unwrapped.core
    friction = core.flies._batch.get_model(0).pair_friction
    np.testing.assert_array_equal(friction, core.batch.scene.model.pair_friction / 2)
    assert core.flies.userdata["head"]["clock"]["latency"][0] == 25  # steps of 0.4 ms


def test_the_missing_leg_is_an_option_by_name_and_information_by_number() -> None:
    env = gymnasium.make("flyrl/Target-v0", physics="fast", randomisation="lesion")
    _, info = env.reset(seed=4)
    drawn = RANDOMISATIONS["lesion"].draw(4)
    assert info["randomisation"]["missing_leg"] == LEGS.index(drawn.missing_leg)
    _, info = env.reset(seed=4, options={"randomisation": {"missing_leg": "RM"}})
    assert info["randomisation"] == Randomisation(missing_leg="RM").numbers()
