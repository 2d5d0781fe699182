import dataclasses

import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.policies import ConstantDrive, LearnedPolicy, observation_layout
from flyrl.rollouts import FAILURES, num_decisions, run_episodes
from flyrl.tasks import OUTCOMES, TASKS, ErrorTerm, Termination
from flyrl.terrains import Flat
from tests.bundles import target_bundle
from tests.synthetic import make_record

# Ends after 0.02, 0.04 … s, as the seed says, or after 0.1 s.
INTERVAL_S, LIMIT_S = 0.02, 0.1


def _is_over(state):
    return state.fly.time >= INTERVAL_S * state.goal[:, 0] - 1e-9


TASK = dataclasses.replace(
    TASKS["target_unfiltered"](),
    name="countdown",
    time_limit_s=LIMIT_S,
    terminations=(Termination("success", _is_over),),
)
WALK = ConstantDrive(1.0, 1.0, TASK)


def counting_policy():
    """Blind but for a memory that grows with every decision, and that the action follows."""
    size = sum(term.size for term in TASK.observation)
    # rows: input gate and forget gate open, a small candidate, output gate open
    weights = {
        "lstm.0.input_weight": np.zeros((4, size), np.float32),
        "lstm.0.recurrent_weight": np.zeros((4, 1), np.float32),
        "lstm.0.input_bias": np.array([20, 20, 0.3, 20], np.float32),
        "lstm.0.recurrent_bias": np.zeros(4, np.float32),
        "0.weight": np.ones((2, 1), np.float32),
        "0.bias": np.zeros(2, np.float32),
    }
    layout = observation_layout(TASK)
    return LearnedPolicy(
        target_bundle(weights=weights, sizes=(1, 2), observation=layout, lstm_sizes=(size, 1))
    )


def countdown(decisions):
    """An episode that ends with success after so many decisions."""
    episode = TASK.sample_episode(Flat(), decisions)
    return dataclasses.replace(episode, goal=(float(decisions), 0.0))


def make_env(num_envs, task=TASK, **changes):
    return BatchedEnv(EnvConfig(task=task, **changes), num_envs, num_threads=1)


@pytest.fixture(scope="module")
def env():
    return make_env(2)


@pytest.fixture(scope="module")
def records(env):
    return run_episodes(env, WALK, [countdown(n) for n in (3, 99, 1, 2, 99)], controller="walk")


def test_records_come_in_the_order_of_the_episodes_with_those_of_a_partial_batch(records):
    assert [record.index for record in records] == [0, 1, 2, 3, 4]
    assert [record.seed for record in records] == [3, 99, 1, 2, 99]
    ends = " ".join(record.outcome for record in records)
    assert ends == "success timeout success success timeout"
    durations = [record.duration_s for record in records]
    assert durations == pytest.approx([0.06, 0.1, 0.02, 0.04, 0.1])
    # a sample at the start and one after every decision
    assert [len(record.time_s) for record in records] == [4, 6, 2, 3, 6]
    record = records[0]
    np.testing.assert_allclose(record.time_s, [0, 0.02, 0.04, 0.06])
    assert (record.controller, record.task, record.terrain) == ("walk", "countdown", "flat")
    assert record.horizon_s == pytest.approx(LIMIT_S)
    assert record.gait is None  # the environment logs none


def test_a_record_starts_where_its_episode_spawns(records):
    # The thorax stands a fixed offset from the spawn, which is where the published body has its
    # origin.
    offsets = [record.position_w[0] - record.episode.spawn_position_w for record in records]
    np.testing.assert_allclose(offsets, offsets[:1] * 5, atol=1e-12)
    np.testing.assert_allclose([record.yaw[0] for record in records], 0, atol=1e-12)
    np.testing.assert_allclose(records[1].drive[1:], 1.0, atol=1e-6)  # the one that was held


def test_memory_lasts_for_an_episode_and_no_longer():
    # the third episode starts a new batch
    episodes = [countdown(n) for n in (99, 2, 99)]
    records = run_episodes(make_env(2), counting_policy(), episodes)
    # after k decisions the cell holds k tanh(0.3)
    memory = np.tanh(np.arange(1, 6) * np.tanh(0.3))
    drives = TASK.actions.commands(np.repeat(memory[:, None], 2, axis=1))
    for record, decisions in zip(records, (5, 2, 5), strict=True):
        np.testing.assert_allclose(record.drive[1:], drives[:decisions], atol=1e-6)


def test_an_episode_gives_the_same_record_in_any_batch_and_stands_still_once_it_has_ended():
    env = make_env(2)
    short, long = run_episodes(env, WALK, [countdown(1), countdown(99)])
    assert env.state.time == pytest.approx([0.02, 0.1])
    alone = run_episodes(make_env(1), WALK, [countdown(1), countdown(99)])
    for one, other in zip((short, long), alone, strict=True):
        np.testing.assert_array_equal(one.position_w, other.position_w)
        np.testing.assert_array_equal(one.yaw, other.yaw)
        assert (one.return_, one.outcome) == (other.return_, other.outcome)


def test_progress_adds_up_whatever_ends_early(env):
    settled = []
    run_episodes(env, WALK, [countdown(n) for n in (3, 99, 1)], on_progress=settled.append)
    assert sum(settled) == num_decisions(env, 3) == 15


def test_a_horizon_is_shorter_than_the_task_or_its_only_limit(env):
    (record,) = run_episodes(env, WALK, [countdown(99)], horizon_s=0.04)
    assert record.outcome == "timeout"
    assert record.duration_s == record.horizon_s == pytest.approx(0.04)
    endless = make_env(1, dataclasses.replace(TASK, time_limit_s=None))
    with pytest.raises(ValueError, match="horizon_s"):
        run_episodes(endless, WALK, [countdown(99)])


def test_fine_decisions_are_sampled_at_the_floor_and_at_the_end():
    env = make_env(1, decision_interval=0.004)
    (record,) = run_episodes(env, WALK, [countdown(99)], horizon_s=0.05)
    np.testing.assert_allclose(record.time_s, [0, 0.02, 0.04, 0.048])


def test_a_simulation_that_diverges_is_recorded_where_it_was_last_sound(env):
    # Oscillators this strong command angles that no physics can follow.
    broken = countdown(99)
    object.__setattr__(broken, "init_magnitudes", (1e12,) * 6)  # no episode is made like that
    unstable, other = run_episodes(env, WALK, [broken, countdown(99)])
    assert unstable.outcome == "unstable"
    assert np.isfinite(unstable.position_w).all()
    assert other.outcome == "timeout"


ERRING = dataclasses.replace(
    TASK,
    errors=(ErrorTerm("heading_error_deg", 180.0, lambda state: 1000 * state.fly.time, ""),),
)


@pytest.mark.parametrize(
    ("outcome", "expected"),
    [
        # after two decisions: 20 and 40, then the worst, 180, three times
        ("fall", (20 + 40 + 3 * 180) / 5),
        # a success has the errors of its own time
        ("success", 30),
    ],
)
def test_the_time_after_a_failure_counts_as_the_worst_error(outcome, expected):
    env = make_env(2, dataclasses.replace(ERRING, terminations=(Termination(outcome, _is_over),)))
    ended, late = run_episodes(env, WALK, [countdown(2), countdown(9)])
    assert [ended.outcome, late.outcome] == [outcome, "timeout"]
    errors = [record.errors["heading_error_deg"] for record in (ended, late)]
    assert errors == pytest.approx([expected, 60])


def test_gait_is_recorded_to_the_end_of_each_episode_the_same_in_any_batch():
    episodes = [countdown(2), countdown(9), countdown(4)]
    one_by_one, together = (
        run_episodes(make_env(n, log_gait=True), WALK, episodes) for n in (1, 3)
    )
    np.testing.assert_equal(*([vars(each.gait) for each in own] for own in (one_by_one, together)))
    early, late, _ = together
    assert early.gait.interval_s == pytest.approx(8e-4)  # two physics steps
    assert len(early.gait.stance) == 50
    assert len(late.gait.adhesion) == 125
    assert 0 < early.gait.work_nj < late.gait.work_nj
    assert late.gait.stance.any() and not late.gait.stance.all()


@pytest.mark.parametrize("outcome", [*OUTCOMES[1:], "slipped"])  # the last one is a user's own
def test_success_and_failure_follow_the_outcome(outcome):
    record = make_record([(0, 0), (1, 0)], outcome=outcome)
    assert record.success == (outcome == "success")
    assert record.failed == (outcome in (*FAILURES, "slipped"))


@pytest.mark.parametrize("name", ["position_w", "yaw", "drive"])
def test_a_record_that_is_not_finite_is_refused(name):
    record = make_record([(0, 0), (1, 0)])
    wrong = np.full_like(getattr(record, name), np.nan)
    with pytest.raises(ValueError, match=f"{name} of a record must be finite"):
        dataclasses.replace(record, **{name: wrong})
