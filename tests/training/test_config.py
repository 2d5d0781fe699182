import datetime
from dataclasses import fields
from itertools import combinations

import pytest

from flyrl.envs.config import env_record
from flyrl.envs.core import EnvConfig
from flyrl.tasks import FAILURES, TASKS, RewardTerm, Termination, extended
from flyrl.training.algorithms import ALGORITHMS, ON_POLICY, AlgorithmConfig
from flyrl.training.config import CurriculumConfig, ScheduleConfig, TrainingConfig


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


@pytest.mark.parametrize("value", [-1, 2**63, 0.5])
def test_every_number_of_a_schedule_has_a_range(value):
    numbers = [field.name for field in fields(ScheduleConfig) if type(field.default) is int]
    for key in numbers:
        with pytest.raises(ValueError, match=rf"training\.{key} must be a whole .*, got {value}"):
            ScheduleConfig(**{key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [("start", 1.1), ("step", 0.0), ("window", 0), ("raise_at", -0.1), ("lower_at", 0.7)],
)
def test_bad_curricula_name_key_and_value(key, value):
    with pytest.raises(ValueError, match=rf"curriculum\.{key} must .*, got {value}"):
        CurriculumConfig(**{key: value})


def _config(task="target", algo="ppo", num_envs=32, curriculum=False, env=(), seed=0, **settings):
    schedule = ScheduleConfig(num_envs=num_envs, curriculum=CurriculumConfig(enabled=curriculum))
    return TrainingConfig(
        env=EnvConfig(task=task, **dict(env)),
        algo=AlgorithmConfig(algo, **settings),
        training=schedule,
        seed=seed,
    )


GOALS = TASKS["target_goal"]()
SPEED = RewardTerm("speed", 1.0, lambda state: state.fly.velocity_w[:, 0], "mm/s")
COLLAPSE = Termination("collapse", FAILURES[0].holds)
HINDSIGHT = {"task": "target_goal", "algo": "sac", "her": True}
WHOLE = {"learning_starts": 32 * 150, "buffer_size": 2 * 32 * 150}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        *[
            ({"algo": name, "n_steps": 10, "batch_size": 64, "num_envs": 8}, r"divide 80.* got 64")
            for name in ("ppo", "recurrent_ppo", "trpo")
        ],
        *[
            ({"algo": name, "n_steps": 10**6}, r"n_steps x training\.num_envs must be at most 1000")
            for name in ("ppo", "a2c", "trpo")
        ],
        (
            {"algo": "a2c", "n_steps": 1, "num_envs": 1, "normalize_advantage": True},
            r"must be at least 2 .*got 1 x 1",
        ),
        (
            {"algo": "td3", "buffer_size": 300, "num_envs": 500},
            r"algo\.buffer_size must be at least 500, got 300",
        ),
        ({"seed": 2**31}, r"seed must lie within 0 and .*, got 2147483648"),
        (
            {"env": {"controller": "rule_based"}},
            r"controller must be hybrid or cpg.*'rule_based'.*drive",
        ),
        ({"task": "target_goal", "algo": "crossq"}, r"algo must .* as 'target_goal', got 'crossq'"),
        *[
            (
                {"task": "worm_crawl", "algo": name},
                rf"one of ppo, a2c, trpo, recurrent_ppo .* 'worm_crawl', got '{name}'",
            )
            for name in sorted(ALGORITHMS.keys() - ON_POLICY)
        ],
        (
            {"task": "traverse", "curriculum": True},
            r"curriculum\.enabled must .* got true in 'traverse'",
        ),
        ({**HINDSIGHT, **WHOLE, "task": "target"}, r"algo\.her .* goals, got true in 'target' "),
        *[
            (
                {**HINDSIGHT, **WHOLE, "task": extended(GOALS, {"mine:TERM": term}, {})},
                f"got true in 'target_goal' with '{name}'",
            )
            for term, name in ((SPEED, "speed"), (COLLAPSE, "collapse"))
        ],
        *[
            (
                {**HINDSIGHT, **WHOLE, key: least - 1},
                rf"algo\.{key} with .* at least {least}, got {least - 1}",
            )
            for key, least in WHOLE.items()
        ],
    ],
)
def test_settings_that_do_not_go_together_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        _config(**settings)


@pytest.mark.parametrize(
    "settings",
    [
        *[{"task": "worm_crawl", "algo": name} for name in ON_POLICY],
        *[{"task": "worm_crawl_box", "algo": name} for name in ALGORITHMS],
        {"algo": "a2c", "n_steps": 1, "num_envs": 1},
        {"curriculum": True},
        {"task": "traverse", "curriculum": True, "env": {"terrain": "random_mixed"}},
        {**HINDSIGHT, **WHOLE},
    ],
)
def test_settings_that_go_together_are_accepted(settings):
    _config(**settings)


def test_name_of_a_run():
    config = TrainingConfig(env=EnvConfig(terrain="mixed"), algo=AlgorithmConfig("sac"), seed=7)
    now = datetime.datetime(2026, 1, 2, 3, 4, 5)
    assert config.name(now) == "2026-01-02_030405_target_mixed_sac_7"
    assert config.name(now, "tau-0.1") == "2026-01-02_030405_target_mixed_sac_7_tau-0.1"


def test_record_tells_environments_apart():
    changes = (
        {"terrain": "gapped"},
        {"body": "classic"},
        {"controller": "cpg"},
        {"physics": "reference"},
        {"randomisation": "default"},
        {"decision_interval": 0.01},
    )
    records = [env_record(EnvConfig(**change)) for change in ({}, *changes)]
    assert all(one != other for one, other in combinations(records, 2))
