import datetime
import json
from dataclasses import replace

import pytest

from flyrl.envs.core import EnvConfig
from flyrl.envs.record import env_record
from flyrl.tasks import FAILURES, TASKS, RewardTerm, Termination, extended
from flyrl.training.algorithms import ALGORITHMS, A2CConfig, CrossQConfig, SACConfig, TD3Config
from flyrl.training.config import ScheduleConfig, TrainingConfig, training_record
from flyrl.training.curriculum import CurriculumConfig


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        *[
            (name, key, value)
            for name in ALGORITHMS
            for key, value in (
                ("learning_rate", 0.0),
                ("learning_rate", float("nan")),
                ("gamma", 1.1),
                ("hidden_layers", (64, 0)),
                ("activation", "elu"),
            )
        ],
        *[
            (name, key, 10**9)
            for name, key in (
                ("ppo", "hidden_layers"),
                ("ppo", "n_steps"),
                ("ppo", "batch_size"),
                ("ppo", "n_epochs"),
                ("recurrent_ppo", "lstm_hidden_size"),
                ("recurrent_ppo", "n_lstm_layers"),
                ("trpo", "cg_max_steps"),
                ("sac", "buffer_size"),
                ("sac", "batch_size"),
                ("sac", "gradient_steps"),
                ("tqc", "n_critics"),
                ("tqc", "n_quantiles"),
            )
        ],
        ("ppo", "hidden_layers", (10**9,)),
        ("ppo", "hidden_layers", (8,) * 17),
        ("ppo", "batch_size", 1),
        ("ppo", "n_steps", 0),
        ("ppo", "gae_lambda", 1.5),
        ("ppo", "clip_range", 0.0),
        ("ppo", "clip_range", 1e308),
        ("sac", "learning_rate", 1e9),
        ("ppo", "n_epochs", 0),
        ("ppo", "ent_coef", -1.0),
        ("ppo", "log_std_init", 3.0),
        ("a2c", "vf_coef", -1.0),
        ("a2c", "max_grad_norm", -1.0),
        ("trpo", "target_kl", 0.0),
        ("trpo", "n_critic_updates", 0),
        ("trpo", "cg_max_steps", 0),
        ("trpo", "cg_damping", -0.1),
        ("trpo", "line_search_max_iter", 0),
        ("trpo", "line_search_shrinking_factor", 1.2),
        ("recurrent_ppo", "lstm_hidden_size", 0),
        ("recurrent_ppo", "n_lstm_layers", 0),
        ("sac", "buffer_size", 10),
        ("sac", "learning_starts", -1),
        ("sac", "gradient_steps", 0),
        ("sac", "tau", 0.0),
        ("sac", "initial_ent_coef", 0.0),
        ("tqc", "tau", 1.5),
        ("tqc", "n_critics", 0),
        ("tqc", "n_quantiles", 0),
        ("tqc", "top_quantiles_to_drop_per_net", 25),
        ("crossq", "policy_delay", 0),
        ("crossq", "renorm_warmup_steps", -1),
        ("td3", "policy_delay", 0),
        ("td3", "target_policy_noise", 0.0),
        ("td3", "target_noise_clip", -1.0),
        ("ddpg", "action_noise_std", -0.1),
        ("ddpg", "tau", 0.0),
        ("sac", "n_sampled_goal", 0),
        ("td3", "goal_selection_strategy", "past"),
    ],
)
def test_bad_settings_of_an_algorithm_name_key_and_value(name, key, value):
    with pytest.raises(ValueError, match=rf"algo\.{key}(\[\d\])? must .*, got"):
        ALGORITHMS[name](**{key: value})


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
    algo = ALGORITHMS[name](n_steps=10, batch_size=64)
    schedule = ScheduleConfig(num_envs=8)
    with pytest.raises(ValueError, match=r"algo\.batch_size must divide 80.* got 64"):
        TrainingConfig(algo=algo, training=schedule)


@pytest.mark.parametrize("name", ["ppo", "a2c", "trpo"])
def test_an_update_must_fit_into_memory(name):
    algo = ALGORITHMS[name](n_steps=10**6)
    with pytest.raises(ValueError, match=r"n_steps x training\.num_envs must be at most 10000000,"):
        TrainingConfig(algo=algo, training=ScheduleConfig(num_envs=64))


def test_a_single_advantage_cannot_be_normalised():
    schedule = ScheduleConfig(num_envs=1)
    TrainingConfig(algo=A2CConfig(n_steps=1), training=schedule)
    with pytest.raises(ValueError, match=r"must be at least 2 .*got 1 x 1"):
        TrainingConfig(algo=A2CConfig(n_steps=1, normalize_advantage=True), training=schedule)


def test_a_replay_buffer_must_hold_all_environments():
    with pytest.raises(ValueError, match=r"algo\.buffer_size must be at least 500, got 300"):
        TrainingConfig(algo=TD3Config(buffer_size=300), training=ScheduleConfig(num_envs=500))


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
        TrainingConfig(env=EnvConfig(task="target_goal"), algo=CrossQConfig())


def _choosing(algo):
    return TrainingConfig(env=EnvConfig("worm_crawl"), algo=algo)


@pytest.mark.parametrize("name", ["ppo", "a2c", "trpo", "recurrent_ppo"])
def test_an_algorithm_may_choose_whole_numbers(name):
    assert _choosing(ALGORITHMS[name]()).algo.name == name


@pytest.mark.parametrize("name", ["sac", "tqc", "crossq", "td3", "ddpg"])
def test_an_algorithm_without_whole_numbers_is_refused_for_them(name):
    message = rf"algo must be one of ppo, a2c, trpo, recurrent_ppo .* 'worm_crawl', got '{name}'"
    with pytest.raises(ValueError, match=message):
        _choosing(ALGORITHMS[name]())
    TrainingConfig(env=EnvConfig("worm_crawl_box"), algo=ALGORITHMS[name]())


def _hindsight(task="target_goal", **changes):
    settings = {"learning_starts": 32 * 150, "buffer_size": 2 * 32 * 150, **changes}
    return TrainingConfig(env=EnvConfig(task=task), algo=SACConfig(her=True, **settings))


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
    config = TrainingConfig(env=EnvConfig(terrain="mixed"), algo=SACConfig(), seed=7)
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
