import datetime
import json
from dataclasses import replace

import pytest

from flyrl.envs.core import EnvConfig
from flyrl.envs.record import env_record
from flyrl.training.algorithms import PPOConfig, SACConfig
from flyrl.training.config import ScheduleConfig, TrainingConfig, training_record


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("learning_rate", 0.0),
        ("learning_rate", float("nan")),
        ("gamma", 1.1),
        ("batch_size", 1),
        ("hidden_layers", (64, 0)),
        ("activation", "elu"),
        ("n_steps", 0),
        ("clip_range", 0.0),
        ("ent_coef", -1.0),
        ("log_std_init", 3.0),
    ],
)
def test_bad_ppo_settings_name_key_and_value(key, value):
    with pytest.raises(ValueError, match=rf"algo\.{key} must .*, got"):
        PPOConfig(**{key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [("buffer_size", 10), ("learning_starts", -1), ("gradient_steps", 0), ("tau", 0.0)],
)
def test_bad_sac_settings_name_key_and_value(key, value):
    with pytest.raises(ValueError, match=rf"algo\.{key} must .*, got"):
        SACConfig(**{key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("total_decisions", 0),
        ("num_envs", 0),
        ("num_threads", -1),
        ("torch_threads", 0),
        ("evaluation_interval", 0),
        ("evaluation_episodes", 0),
        ("evaluation_seed", -1),
    ],
)
def test_bad_schedules_name_key_and_value(key, value):
    with pytest.raises(ValueError, match=rf"training\.{key} must be at least .*, got {value}"):
        ScheduleConfig(**{key: value})


def test_an_update_must_split_into_batches():
    algo = PPOConfig(n_steps=10, batch_size=64)
    schedule = ScheduleConfig(num_envs=8)
    with pytest.raises(ValueError, match=r"algo\.batch_size must divide 80.* got 64"):
        TrainingConfig(algo=algo, training=schedule)


def test_seed_outside_the_range():
    with pytest.raises(ValueError, match=r"seed must lie within 0 and .*, got 2147483648"):
        TrainingConfig(seed=2**31)


def test_dict_observations_are_refused():
    with pytest.raises(ValueError, match="flat observation, got 'hybrid_turning'"):
        TrainingConfig(env=EnvConfig(task="hybrid_turning"))


def test_name_of_a_run():
    config = TrainingConfig(env=EnvConfig(terrain="mixed"), algo=SACConfig(), seed=7)
    now = datetime.datetime(2026, 1, 2, 3, 4, 5)
    assert config.name(now) == "2026-01-02_030405_target_mixed_sac_7"


def test_record_is_plain_json():
    record = training_record(TrainingConfig())
    assert json.loads(json.dumps(record)) == record
    assert record["task"] == {
        "name": "target",
        "terms": [],
        "weights": {"progress": 0.2, "success": 2.0, "time": -0.5, "lost_time": -0.5},
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
        replace(config, decision_interval=0.01),
    ):
        assert env_record(other) != env_record(config)
