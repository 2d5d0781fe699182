import pytest

from flyrl.evaluation import EvaluationConfig
from flyrl.evaluation.config import FIRST_SEED, MAX_EPISODES, MAX_SEED
from flyrl.tasks import TASKS
from flyrl.terrains import TERRAINS, Blocks, Flat


def test_no_two_seeds_share_an_episode():
    first = set(EvaluationConfig(seed=3, episodes=MAX_EPISODES).seeds())
    assert first.isdisjoint(EvaluationConfig(seed=4, episodes=MAX_EPISODES).seeds())


def test_episodes_lie_beyond_every_seed_that_training_draws():
    assert EvaluationConfig(seed=0).seeds()[0] == FIRST_SEED > 2**31


def test_no_policy_is_chosen_on_an_episode_that_it_is_compared_on():
    from flyrl.training.callback import HELD_OUT_SEEDS

    assert HELD_OUT_SEEDS.stop <= FIRST_SEED


def test_the_last_seed_is_still_a_seed():
    assert EvaluationConfig(seed=MAX_SEED, episodes=MAX_EPISODES).seeds()[-1] == 2**32 - 1


def test_more_episodes_begin_with_the_same_ones():
    few = EvaluationConfig(episodes=3).draw_episodes(Flat())
    assert EvaluationConfig(episodes=5).draw_episodes(Flat())[:3] == few


def test_terrains_by_name_and_by_config():
    blocks = Blocks(height_range=(0.1, 0.4))
    config = EvaluationConfig(terrains=("flat", blocks, "random_blocks"))
    assert config.terrain_configs == (Flat(), blocks, TERRAINS["random_blocks"])


def test_a_terrain_by_its_fields():
    config = EvaluationConfig(terrains=({"name": "blocks", "height_range": (0.1, 0.4)},))
    assert config.terrains == (Blocks(height_range=(0.1, 0.4)),)


@pytest.mark.parametrize("task", ["hybrid_turning", TASKS["hybrid_turning"]()])
def test_a_task_without_a_time_limit_ends_after_3_s(task):
    assert EvaluationConfig(task=task).horizon_s == 3.0


def test_episodes_that_are_chosen_differ_between_terrains():
    config = EvaluationConfig(terrains=("flat", "mixed"), film="contrast")
    chosen = {"flat": {"episode": 0}, "mixed": {"episode": 7}}
    assert config.filmed(chosen) == {"flat": (0,), "mixed": (7,)}
    named = EvaluationConfig(terrains=("flat", "mixed"), film=(3, 1))
    assert named.filmed() == {"flat": (3, 1), "mixed": (3, 1)}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policies": (), "controllers": ()}, "policies or controllers"),
        ({"terrains": ()}, "terrains"),
        ({"terrains": ("flat", Flat(seed=1))}, "terrains must not hold 'flat' twice"),
        ({"episodes": MAX_EPISODES + 1}, "episodes"),
        ({"seed": MAX_SEED + 1}, "seed"),
        ({"episodes": 3, "film": (0, 3)}, r"film\[1\].* 2"),
        ({"film": (4, 4)}, "film must"),
        ({"film": "contrats"}, "film must be one of 'contrast'.*; did you mean 'contrast'"),
        ({"num_envs": 10**9}, "num_envs"),
        ({"num_threads": 10**9}, "num_threads"),
        ({"policies": (5,)}, r"policies\[0\] must be text"),
        ({"terrains": (5,)}, r"terrains\[0\] must be text or a Terrain"),
        ({"vary": ["push"]}, "vary must be a Mapping"),
    ],
)
def test_what_is_not_allowed_is_named(changes, message):
    with pytest.raises(ValueError, match=message):
        EvaluationConfig(**changes)
