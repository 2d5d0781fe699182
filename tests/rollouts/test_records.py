import dataclasses

import numpy as np
import pytest

from flyrl.rollouts import FAILURES
from flyrl.tasks import OUTCOMES
from tests.synthetic import make_record


@pytest.mark.parametrize("outcome", OUTCOMES[1:])
def test_success_and_failure_follow_the_outcome(outcome):
    record = make_record([(0, 0), (1, 0)], outcome=outcome)
    assert record.success == (outcome == "success")
    assert record.failed == (outcome in FAILURES)


def test_the_seed_is_the_episodes():
    assert make_record([(0, 0)], seed=17).seed == 17


def test_a_termination_of_a_users_own_is_a_failure():
    record = make_record([(0, 0)], outcome="slipped")
    assert record.failed
    assert not record.success


def test_an_episode_that_still_runs_is_no_record():
    with pytest.raises(ValueError, match=r"outcome.*'running'"):
        make_record([(0, 0)], outcome="running")


def test_samples_of_different_number_are_refused():
    with pytest.raises(ValueError, match=r"yaw must have shape \(2,\)"):
        make_record([(0, 0), (1, 1)], yaw=[0, 0, 0])


def test_a_fly_has_two_drives_and_a_worm_a_tension_per_muscle():
    fly = make_record([(0, 0), (1, 1), (2, 2)])
    worm = dataclasses.replace(fly, creature="worm", drive=np.zeros((3, 8)))
    assert worm.drive.shape == (3, 8)
    with pytest.raises(ValueError, match=r"drive must have shape \(3, 2\) .*, got \(3, 8\)"):
        dataclasses.replace(fly, drive=np.zeros((3, 8)))
    for wrong in ((2, 8), (3,), (3, 4, 2)):
        with pytest.raises(ValueError, match="drive must have shape"):
            dataclasses.replace(worm, drive=np.zeros(wrong))


def test_positions_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="position_w must be finite"):
        make_record([(0, 0), (np.nan, 1)])


def test_no_samples_are_refused():
    record = make_record([(0, 0)])
    with pytest.raises(ValueError, match="a sample"):
        dataclasses.replace(
            record,
            time_s=record.time_s[:0],
            position_w=record.position_w[:0],
            yaw=record.yaw[:0],
            drive=record.drive[:0],
        )
