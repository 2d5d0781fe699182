import datetime
import json
from dataclasses import replace

import pytest

from flyrl.envs.core import EnvConfig
from flyrl.envs.record import env_record
from flyrl.tasks import FAILURES, TASKS, RewardTerm, Termination, extended
from flyrl.training.algorithms import ALGORITHMS, AlgorithmConfig
from flyrl.training.config import CurriculumConfig, ScheduleConfig, TrainingConfig, training_record


@pytest.mark.parametrize("value", [float("nan"), 1e13, -11])
@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_setting_of_an_algorithm_has_a_range(name, value):
    for key in ALGORITHMS[name]:
        with pytest.raises(ValueError, match=rf"algo\.{key} must .*, got"):
            AlgorithmConfig(name, **{key: value})


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        *[("ppo", dict.fromkeys([key], 0)) for key in ("learning_rate", "clip_range", "n_epochs")],
        *[("sac", dict.fromkeys([key], 0)) for key in ("initial_ent_coef", "tau", "batch_size")],
        *[("ppo", {"hidden_layers": sizes}) for sizes in ((64, 0), (10**9,), (8,) * 17)],
        ("ppo", {"gamma": 1.1}),
        ("ppo", {"activation": "elu"}),
        ("ppo", {"batch_size": 10**9}),
        ("trpo", {"line_search_shrinking_factor": 1.2}),
        ("sac", {"buffer_size": 10}),
        ("tqc", {"top_quantiles_to_drop_per_net": 25}),
        ("td3", {"goal_selection_strategy": "past"}),
    ],
)
def test_bad_settings_of_an_algorithm_name_key_and_value(name, settings):
    (key,) = settings
    with pytest.raises(ValueError, match=rf"algo\.{key}(\[\d\])? must .*, got"):
        AlgorithmConfig(name, **settings)


def test_a_setting_that_an_algorithm_lacks_is_named_with_the_closest_one():
    with pytest.raises(ValueError, match=r"algo has no 'clip_vf'; did you mean 'clip_range_vf'"):
        AlgorithmConfig("ppo", clip_vf=0.2)
    for ours in ("device", "policy_kwargs", "replay_buffer_class"):  # set by flyrl alone
        with pytest.raises(ValueError, match=f"algo has no '{ours}'"):
            AlgorithmConfig("sac", **{ours: None})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("total_timesteps", 0),
        ("num_envs", 0),
        ("num_threads", -1),
        ("torch_threads", 0),
        ("evaluation_interval", 0),
        ("evaluation_episodes", 0),
        ("evaluation_seed", -1),
        ("num_envs", 10**9),
        ("num_threads", 10**9),
        ("torch_threads", 10**9),
        ("evaluation_episodes", 10**9),
        ("checkpoints_kept", 10**9),
    ],
)
def test_bad_schedules_name_key_and_value(key, value):
    with pytest.raises(ValueError, match=rf"training\.{key} must be a whole .*, got {value}"):
        ScheduleConfig(**{key: value})


@pytest.mark.parametrize("name", ["ppo", "recurrent_ppo", "trpo"])
def test_an_update_must_split_into_batches(name):
    algo = AlgorithmConfig(name, n_steps=10, batch_size=64)
    schedule = ScheduleConfig(num_envs=8)
    with pytest.raises(ValueError, match=r"algo\.batch_size must divide 80.* got 64"):
        TrainingConfig(algo=algo, training=schedule)


@pytest.mark.parametrize("name", ["ppo", "a2c", "trpo"])
def test_an_update_must_fit_into_memory(name):
    algo = AlgorithmConfig(name, n_steps=10**6)
    with pytest.raises(ValueError, match=r"n_steps x training\.num_envs must be at most 10000000,"):
        TrainingConfig(algo=algo, training=ScheduleConfig(num_envs=64))


def test_a_single_advantage_cannot_be_normalised():
    schedule = ScheduleConfig(num_envs=1)
    TrainingConfig(algo=AlgorithmConfig("a2c", n_steps=1), training=schedule)
    with pytest.raises(ValueError, match=r"must be at least 2 .*got 1 x 1"):
        TrainingConfig(
            algo=AlgorithmConfig("a2c", n_steps=1, normalize_advantage=True), training=schedule
        )


def test_a_replay_buffer_must_hold_all_environments():
    with pytest.raises(ValueError, match=r"algo\.buffer_size must be at least 500, got 300"):
        TrainingConfig(
            algo=AlgorithmConfig("td3", buffer_size=300), training=ScheduleConfig(num_envs=500)
        )


def test_seed_outside_the_range():
    with pytest.raises(ValueError, match=r"seed must lie within 0 and .*, got 2147483648"):
        TrainingConfig(seed=2**31)


def test_a_controller_that_ignores_the_drive_is_refused():
    with pytest.raises(ValueError, match=r"controller must be hybrid or cpg.*'rule_based'.*drive"):
        TrainingConfig(env=EnvConfig(controller="rule_based"))


def test_dict_observations_without_goals_are_refused():
    with pytest.raises(ValueError, match=r"task\.time_limit must be a time in 'hybrid_turning'"):
        TrainingConfig(env=EnvConfig(task="hybrid_turning"))


def test_an_algorithm_without_dicts_is_refused_in_a_task_with_goals():
    with pytest.raises(ValueError, match=r"algo must .* as 'target_goal', got 'crossq'"):
        TrainingConfig(env=EnvConfig(task="target_goal"), algo=AlgorithmConfig("crossq"))


def _choosing(algo):
    return TrainingConfig(env=EnvConfig("worm_crawl"), algo=algo)


@pytest.mark.parametrize("name", ["ppo", "a2c", "trpo", "recurrent_ppo"])
def test_an_algorithm_may_choose_whole_numbers(name):
    assert _choosing(AlgorithmConfig(name)).algo.name == name


@pytest.mark.parametrize("name", ["sac", "tqc", "crossq", "td3", "ddpg"])
def test_an_algorithm_without_whole_numbers_is_refused_for_them(name):
    message = rf"algo must be one of ppo, a2c, trpo, recurrent_ppo .* 'worm_crawl', got '{name}'"
    with pytest.raises(ValueError, match=message):
        _choosing(AlgorithmConfig(name))
    TrainingConfig(env=EnvConfig("worm_crawl_box"), algo=AlgorithmConfig(name))


def _hindsight(task="target_goal", **changes):
    settings = {"learning_starts": 32 * 150, "buffer_size": 2 * 32 * 150, **changes}
    return TrainingConfig(
        env=EnvConfig(task=task), algo=AlgorithmConfig("sac", her=True, **settings)
    )


def test_hindsight_is_refused_where_it_cannot_be():
    _hindsight()
    with pytest.raises(ValueError, match=r"algo\.her .* without goals, got true in 'target' "):
        _hindsight("target")
    goals = TASKS["target_goal"]()
    speed = RewardTerm("speed", 1.0, lambda state: state.fly.velocity_w[:, 0], "mm/s")
    collapse = Termination("collapse", FAILURES[0].holds)
    for term, name in ((speed, "speed"), (collapse, "collapse")):
        with pytest.raises(ValueError, match=f"got true in 'target_goal' with '{name}'"):
            _hindsight(extended(goals, {"mine:TERM": term}, {}))


@pytest.mark.parametrize(("key", "least"), [("learning_starts", 4800), ("buffer_size", 9600)])
def test_hindsight_needs_whole_episodes(key, least):
    with pytest.raises(ValueError, match=rf"algo\.{key} with .* at least {least}, got {least - 1}"):
        _hindsight(**{key: least - 1})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("start", 1.1),
        ("step", 0.0),
        ("step", 1.5),
        ("window", 0),
        ("raise_at", -0.1),
        ("lower_at", 2.0),
        ("lower_at", 0.7),
    ],
)
def test_bad_curricula_name_key_and_value(key, value):
    message = rf"training\.curriculum\.{key} must .*, got {value}"
    with pytest.raises(ValueError, match=message):
        CurriculumConfig(**{key: value})


def test_a_curriculum_needs_a_task_or_a_ground_that_can_be_easier():
    schedule = ScheduleConfig(curriculum=CurriculumConfig(enabled=True))
    TrainingConfig(training=schedule)
    with pytest.raises(ValueError, match=r"curriculum\.enabled must .* got true in 'traverse'"):
        TrainingConfig(env=EnvConfig(task="traverse"), training=schedule)
    TrainingConfig(env=EnvConfig(task="traverse", terrain="random_mixed"), training=schedule)


def test_name_of_a_run():
    config = TrainingConfig(env=EnvConfig(terrain="mixed"), algo=AlgorithmConfig("sac"), seed=7)
    now = datetime.datetime(2026, 1, 2, 3, 4, 5)
    assert config.name(now) == "2026-01-02_030405_target_mixed_sac_7"
    assert config.name(now, "tau-0.1") == "2026-01-02_030405_target_mixed_sac_7_tau-0.1"


def test_record_is_plain_json():
    record = training_record(TrainingConfig())
    assert json.loads(json.dumps(record)) == record
    assert record["task"] == {
        "name": "target",
        "distance": [5.0, 15.0],
        "bearing": 180.0,
        "reach": 1.0,
        "terms": [],
        "without": [],
        "weights": {"progress": 0.2, "success": 2.0, "time": -0.5, "lost_time": -0.5},
        "time_limit": 3.0,
        "decision_interval": 0.02,
    }
    assert record["algo"]["name"] == "ppo"
    assert record["algo"]["hidden_layers"] == [64, 64]


def test_record_tells_environments_apart():
    config = EnvConfig()
    assert env_record(config) == env_record(EnvConfig())
    for other in (
        EnvConfig(terrain="gapped"),
        EnvConfig(body="classic"),
        EnvConfig(controller="cpg"),
        EnvConfig(physics="reference"),
        EnvConfig(randomisation="default"),
        replace(config, decision_interval=0.01),
    ):
        assert env_record(other) != env_record(config)
