import dataclasses

import numpy as np
import pytest

from flyrl.rollouts import FAILURES
from flyrl.tasks import OUTCOMES
from tests.synthetic import make_record


@pytest.mark.parametrize("outcome", [*OUTCOMES[1:], "slipped"])
def test_success_and_failure_follow_the_outcome(outcome):
    record = make_record([(0, 0), (1, 0)], outcome=outcome, seed=17)
    assert record.success == (outcome == "success")
    assert record.failed == (outcome in (*FAILURES, "slipped"))  # one of a user's own, too
    assert record.seed == 17


def test_a_fly_has_two_drives_and_a_worm_a_tension_per_muscle():
    fly = make_record([(0, 0), (1, 1), (2, 2)])
    worm = dataclasses.replace(fly, creature="worm", drive=np.zeros((3, 8)))
    assert worm.drive.shape == (3, 8)
    with pytest.raises(ValueError, match=r"drive must have shape \(3, 2\) .*, got \(3, 8\)"):
        dataclasses.replace(fly, drive=np.zeros((3, 8)))
    for wrong in ((2, 8), (3,), (3, 4, 2)):
        with pytest.raises(ValueError, match="drive must have shape"):
            dataclasses.replace(worm, drive=np.zeros(wrong))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"outcome": "running"}, r"outcome.*'running'"),
        ({"yaw": np.zeros(3)}, r"yaw must have shape \(2,\)"),
        ({"position_w": np.array([[0, 0, 0], [np.nan, 1, 0]])}, "position_w must be finite"),
        (
            {
                "time_s": np.zeros(0),
                "position_w": np.zeros((0, 3)),
                "yaw": np.zeros(0),
                "drive": np.zeros((0, 2)),
            },
            "a sample",
        ),
    ],
)
def test_what_is_no_record_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(make_record([(0, 0), (1, 0)]), **changes)
