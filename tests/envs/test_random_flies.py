"""Randomised flies in the environments: draws, options, determinism, going on."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import flyrl  # noqa: F401  (registers the ids)
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.simulation.randomisation import UNVARIED, Randomisation, RandomisationConfig

CONFIG = EnvConfig(physics="fast", randomisation="default")
PLAIN = EnvConfig(physics="fast")


def roll_out(env: BatchedEnv, decisions: int = 8) -> list[np.ndarray]:
    """Observations on a way that depends on the number of the decision alone."""
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (decisions, 1, 2))
    return [
        np.asarray(env.step(np.tile(action, (env.num_envs, 1))).observation) for action in actions
    ]


def test_randomisation_changes_nothing_else_about_an_episode() -> None:
    drawn = CONFIG.sample_episode(5)
    assert replace(drawn, randomisation=UNVARIED) == PLAIN.sample_episode(5)
    assert drawn.randomisation == CONFIG.resolved_randomisation.draw(5)
    assert drawn.randomisation != CONFIG.sample_episode(6).randomisation


def test_episodes_say_what_was_drawn_for_each_simulation() -> None:
    env = BatchedEnv(CONFIG, 2)
    env.reset(seeds=[5, 6])
    drawn = [episode.randomisation for episode in env.episodes if episode]
    assert drawn == [CONFIG.resolved_randomisation.draw(seed) for seed in (5, 6)]
    for sim, randomisation in enumerate(drawn):
        friction = env.flies._batch.get_model(sim).pair_friction
        np.testing.assert_array_equal(
            friction, env.scene.model.pair_friction * randomisation.friction
        )


@pytest.mark.parametrize("num_threads", [1, 2, 3])
def test_a_batch_of_random_flies_gives_the_bits_of_single_ones(num_threads: int) -> None:
    many = BatchedEnv(CONFIG, 3, num_threads)
    many.reset(seeds=[1, 2, 3])
    batched = roll_out(many)
    single = BatchedEnv(CONFIG, 1, 1)
    for i, seed in enumerate([1, 2, 3]):
        single.reset(seeds=[seed])
        np.testing.assert_array_equal(
            [row[i] for row in batched], [row[0] for row in roll_out(single)]
        )


def test_a_reset_of_one_random_fly_leaves_the_others_their_bits() -> None:
    env, twin = (BatchedEnv(CONFIG, 3) for _ in range(2))
    for each in (env, twin):
        each.reset(seeds=[1, 2, 3])
        roll_out(each, 3)
    observation, expected = env.reset(ids=[1]), twin.observe()
    np.testing.assert_array_equal(np.asarray(observation)[[0, 2]], np.asarray(expected)[[0, 2]])
    for ours, theirs in zip(roll_out(env), roll_out(twin), strict=True):
        np.testing.assert_array_equal(ours[[0, 2]], theirs[[0, 2]])


def test_a_restored_environment_of_random_flies_goes_on_with_the_same_bits() -> None:
    """Into one in which other flies walked, with new episodes after it."""
    env, twin = (BatchedEnv(CONFIG, 2) for _ in range(2))
    env.reset(seeds=[3, 4])
    roll_out(env)
    twin.reset(seeds=[8, 9])
    twin.restore(env.snapshot())
    assert twin.episodes == env.episodes
    np.testing.assert_array_equal(twin.observe(), env.observe())
    for _ in range(2):
        np.testing.assert_array_equal(roll_out(env), roll_out(twin))
        np.testing.assert_array_equal(env.reset(ids=[1]), twin.reset(ids=[1]))


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
    config = EnvConfig(
        physics="fast", randomisation=RandomisationConfig(drive_latency=(0.045,) * 2)
    )
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
def test_the_queue_has_a_place_for_every_drive_on_its_way(
    task: str, latency: float, interval: float | None, places: int
) -> None:
    drawn = RandomisationConfig(drive_latency=(0.0, latency))
    config = EnvConfig(task, physics="fast", decision_interval=interval, randomisation=drawn)
    assert config.scene.queue_places == places
    assert PLAIN.scene.queue_places == 0


def test_an_episode_of_more_latency_than_the_settings_have_is_refused_before_anything() -> None:
    env = BatchedEnv(PLAIN, 1)
    env.reset(seeds=[0])
    roll_out(env, 2)
    before = env.flies.integration_state()
    late = replace(PLAIN.sample_episode(1), randomisation=Randomisation(drive_latency=0.01))
    with pytest.raises(ValueError, match=r"drive_latency is 0\.01 s; .* at most 0\.0 s"):
        env.reset(episodes=[late])
    np.testing.assert_array_equal(env.flies.integration_state(), before)


def test_an_unknown_name_is_refused_with_the_closest() -> None:
    with pytest.raises(ValueError, match=r"randomisation must be one of .* did you mean 'default'"):
        EnvConfig(randomisation="defualt")


def test_gymnasium_makes_random_flies_and_tells_how() -> None:
    env = gymnasium.make("flyrl/Target-v0", randomisation="default")
    observation, info = env.reset(seed=4)
    assert Randomisation(**info["randomisation"]) == CONFIG.resolved_randomisation.draw(4)
    again, _ = env.reset(seed=4)
    np.testing.assert_array_equal(observation, again)
    _, info = gymnasium.make("flyrl/Target-v0").reset(seed=4)
    assert "randomisation" not in info


def test_reset_options_fix_what_they_name_and_leave_the_rest_as_drawn() -> None:
    env = gymnasium.make("flyrl/Target-v0", randomisation="default")
    fixed = {"friction": 0.5, "drive_latency": 0.01}
    _, info = env.reset(seed=4, options={"randomisation": fixed})
    drawn = CONFIG.resolved_randomisation.draw(4)
    assert Randomisation(**info["randomisation"]) == replace(drawn, **fixed)
    core = env.unwrapped.core
    friction = core.flies._batch.get_model(0).pair_friction
    np.testing.assert_array_equal(friction, core.scene.model.pair_friction / 2)
    assert core.flies.userdata["head"]["clock"]["latency"][0] == 25  # steps of 0.4 ms


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"frictoin": 1.0}, "did you mean 'friction'"),
        ({"mass": 0.0}, r"randomisation\.mass must be a finite number from 0\.01 to 100, got 0\.0"),
        (0.5, "'randomisation' must be a dict of numbers by name; got 0.5"),
        ({"drive_latency": 0.03}, r"drive_latency is 0\.03 s; .* at most 0\.02 s"),
    ],
)
def test_bad_options_are_refused(given: object, message: str) -> None:
    env = gymnasium.make("flyrl/Target-v0", randomisation="default")
    with pytest.raises(ValueError, match=message):
        env.reset(seed=0, options={"randomisation": given})


def test_the_vector_environment_of_random_flies_equals_gymnasiums_over_single_ones() -> None:
    settings = {"randomisation": "default", "physics": "fast", "decision_interval": 0.1}
    native = gymnasium.make_vec("flyrl/Target-v0", num_envs=2, **settings)
    plain = gymnasium.make_vec("flyrl/Target-v0", num_envs=2, vectorization_mode="sync", **settings)
    np.testing.assert_array_equal(native.reset(seed=7)[0], plain.reset(seed=7)[0])
    rng = np.random.default_rng(0)
    ends = 0
    for _ in range(34):
        actions = rng.uniform(-1, 1, (2, 2)).astype(np.float32)
        ours, theirs = native.step(actions), plain.step(actions)
        np.testing.assert_array_equal(ours[0], theirs[0])
        ends += int((ours[2] | ours[3]).sum())
    assert ends >= 2


def test_sb3s_environment_draws_another_fly_for_every_episode() -> None:
    env = FlyrlVecEnv(CONFIG, 2, num_threads=1, seed=5)
    first = np.asarray(env.reset())
    single = gymnasium.make("flyrl/Target-v0", physics="fast", randomisation="default")
    np.testing.assert_array_equal(first[1], single.reset(seed=6)[0])
    drawn = [episode.randomisation for episode in env.core.episodes if episode]
    env.core.flies._qpos[0, 3:7] = [0, 1, 0, 0]
    _, _, dones, _ = env.step(np.zeros((2, 2), dtype=np.float32))
    assert dones.tolist() == [True, False]
    after = [episode.randomisation for episode in env.core.episodes if episode]
    assert after[0] != drawn[0]
    assert after[1] == drawn[1]
