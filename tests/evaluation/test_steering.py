from dataclasses import replace

import numpy as np
import pytest

from flyrl.evaluation import EvaluationConfig
from flyrl.evaluation.drive_map import measure_steering
from flyrl.tasks import TASKS


def config(task="target", **settings):
    return EvaluationConfig(task=task, episodes=2, physics="fast", num_threads=1, **settings)


@pytest.fixture(scope="module")
def steering():
    asked = config(policies=("target-flat",), controllers=("pursuit", "cpg"))
    return measure_steering(asked, asked.terrain_configs[0])


def test_those_are_asked_that_see_the_bearing(steering):
    assert list(steering.drives) == ["target-flat", "pursuit"]  # cpg sees nothing
    assert steering.drives["pursuit"].shape == (2, len(steering.bearings_deg), 2)


@pytest.mark.parametrize("policy", ["target-flat", "pursuit"])
def test_the_far_legs_are_driven_more(steering, policy):
    left, right = steering.drives[policy].mean(axis=0).T
    to_left = steering.bearings_deg == 60
    to_right = steering.bearings_deg == -60
    assert right[to_left] > left[to_left] + 0.1
    assert left[to_right] > right[to_right] + 0.1


def test_pursuit_turns_as_its_rule_says(steering):
    # straight ahead: full drive of the quick setting to both
    ahead = steering.drives["pursuit"][:, steering.bearings_deg == 0]
    np.testing.assert_allclose(ahead, 1.5, atol=1e-6)


@pytest.mark.parametrize("task", ["velocity", "target_goal"])
def test_a_task_without_a_bearing_has_none(task):
    asked = config(task, controllers=("hybrid",))
    assert measure_steering(asked, asked.terrain_configs[0]) is None


def test_the_bearing_is_found_by_its_mark_not_by_its_name():
    first, *others = TASKS["target"]().observation
    unmarked = replace(TASKS["target"](), observation=(replace(first, is_bearing=False), *others))
    asked = config(unmarked, controllers=("pursuit",))
    assert measure_steering(asked, asked.terrain_configs[0]) is None
