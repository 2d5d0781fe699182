import pytest

from flyrl.evaluation import EvaluationConfig
from flyrl.evaluation.config import MAX_EPISODES, MAX_SEED
from flyrl.tasks import TASKS
from flyrl.terrains import TERRAINS, Blocks, Flat
from flyrl.training.callback import HELD_OUT_SEEDS

TALL = Blocks(height_range=(0.1, 0.4))


def test_no_seed_shares_an_episode_with_another_or_with_training():
    first, second, last = (
        EvaluationConfig(seed=seed, episodes=MAX_EPISODES).seeds() for seed in (0, 1, MAX_SEED)
    )
    assert 2**31 < HELD_OUT_SEEDS.stop <= first[0]
    assert set(first).isdisjoint(second)
    assert last[-1] == 2**32 - 1  # which is still a seed


def test_more_episodes_begin_with_the_same_ones():
    few = EvaluationConfig(episodes=3).draw_episodes(Flat())
    assert EvaluationConfig(episodes=5).draw_episodes(Flat())[:3] == few


@pytest.mark.parametrize("blocks", [TALL, {"name": "blocks", "height_range": (0.1, 0.4)}])
def test_terrains_by_name_by_config_and_by_fields(blocks):
    config = EvaluationConfig(terrains=("flat", blocks, "random_blocks"))
    assert config.terrain_configs == (Flat(), TALL, TERRAINS["random_blocks"])


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
        ({"terrains": (5,)}, r"terrains\[0\] must be text or a Terrain"),
        ({"vary": ["push"]}, "vary must be a Mapping"),
        ({"vary": {"fricton": (1.0,)}}, "did you mean 'friction'"),
        ({"vary": {"friction": ()}}, "vary must name values"),
        ({"vary": {"friction": (1.0, 1.0)}}, "vary must not hold 'friction=1' twice"),
        ({"vary": {"coupling": (-1.0,)}}, "vary.coupling"),
    ],
)
def test_what_is_not_allowed_is_named(changes, message):
    with pytest.raises(ValueError, match=message):
        EvaluationConfig(**changes)
