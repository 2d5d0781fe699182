"""Evaluations of worms: who may take part, what is measured, and that it all comes back."""

import dataclasses

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from flyrl.bodies.worm import CRAWLER
from flyrl.envs.config import EnvConfig
from flyrl.envs.core import BatchedEnv
from flyrl.evaluation import (
    EvaluationConfig,
    evaluate,
    load_results,
    make_entrants,
    write_results,
)
from flyrl.policies import PolicyFileError
from flyrl.rollouts import run_episodes
from flyrl.tasks import TASKS
from tests.tasks.test_worm import WORM_TASKS

CRAWL = dataclasses.replace(TASKS["worm_crawl"](), time_limit_s=0.3)
HANG = dataclasses.replace(TASKS["worm_hang"](), time_limit_s=0.3)
FLY = dataclasses.replace(TASKS["target"](), time_limit_s=0.2)
SHORTER = dataclasses.replace(CRAWLER, segments=4)
FIXED_OF = {"worm_crawl": ("worm_cpg", "relaxed"), "worm_hang": ("worm_reflex", "relaxed")}


@pytest.fixture(scope="module", params=[(CRAWL, "worm-crawl"), (HANG, "worm-hang")])
def results(request):
    task, policy = request.param
    return evaluate(EvaluationConfig(task=task, policies=(policy,), episodes=2, num_threads=1))


# ------------------------------------------------------------------ who takes part


@pytest.mark.parametrize("name", WORM_TASKS)
def test_by_default_those_for_worms_take_part_that_go_with_the_task(name):
    entrants = make_entrants(EvaluationConfig(task=name))
    assert tuple(each.name for each in entrants) == FIXED_OF[name.removesuffix("_box")]


@pytest.mark.parametrize(
    ("name", "task", "needed"),
    [
        ("cpg", CRAWL, "flies that shows anything"),
        ("worm_cpg", FLY, "a worm that shows heading"),
        ("worm_reflex", CRAWL, "a worm that shows bend_error"),
    ],
)
def test_controllers_of_another_creature_or_task_are_refused(name, task, needed):
    config = EvaluationConfig(task=task, controllers=(name,))
    with pytest.raises(ValueError) as error:
        make_entrants(config)
    assert str(error.value) == f"controllers: {name!r} needs a task for {needed}, got {task.name!r}"


@pytest.mark.parametrize(
    ("settings", "policy", "message"),
    [
        ({"task": CRAWL}, "worm-hang", r"does not show: command \(1 values\)"),
        ({"task": "worm_hang_box"}, "worm-hang", "are whole numbers within .*_box numbers within"),
        ({"task": "worm_crawl", "body": SHORTER}, "worm-crawl", r"\(5 values\).*\(3 values\)"),
    ],
)
def test_a_policy_of_another_task_or_worm_is_refused(settings, policy, message):
    config = EvaluationConfig(policies=(policy,), controllers=(), **settings)
    with pytest.raises(PolicyFileError, match=message):
        make_entrants(config)


def test_of_a_worm_nothing_but_the_noise_of_its_senses_is_varied():
    EvaluationConfig(task="worm_crawl", vary={"sensor_noise": (0.0, 1.0)})
    message = "vary.push is for flies; of a worm, sensor_noise can be varied"
    with pytest.raises(ValueError, match=message):
        EvaluationConfig(task="worm_crawl", vary={"push": (0.0,)})


# ------------------------------------------------------------------ what is measured


def test_worms_meet_the_same_episodes_recruit_neurons_and_have_no_gait(results, tmp_path):
    task = results.protocol["task"]
    own = results.episodes.groupby("controller", sort=False)
    assert list(own.groups) == [task.replace("_", "-"), *FIXED_OF[task]]
    assert own["seed"].agg(tuple).nunique() == 1
    assert results.protocol["reference"] == FIXED_OF[task][0]
    policy = results.protocol["entrants"][0]
    assert (policy["policy"], policy["leg_controller"]) == ("learned with ppo on flat", None)
    shares = own["recruited_share"].agg(list)
    assert shares["relaxed"] == [0.0, 0.0]
    assert all(0.01 < share < 0.9 for share in shares.iloc[0])
    gone = ["slip_share", "duty_factor", "tripod_coordination", "goal_distance_mm"]
    assert results.episodes[gone].isna().all(axis=None)
    write_results(results, tmp_path)
    again = load_results(tmp_path)
    assert_frame_equal(again.episodes, results.episodes, check_exact=True)
    muscles = {"worm_crawl": 10, "worm_hang": 8}[task]
    for row, path in results.trajectories.items():
        assert path.drive.shape == (7, muscles)  # the start, and 6 decisions of 0.05 s
        assert ((path.drive >= 0.0) & (path.drive <= 1.0)).all()
        np.testing.assert_array_equal(again.trajectories[row].drive, path.drive)


def test_a_bend_error_is_the_mean_over_the_decisions():
    """A worm that is straight and relaxed is off by all that is asked for, 0.5 rad."""
    env = BatchedEnv(EnvConfig(HANG), 1)
    drawn = dataclasses.replace(env.config.sample_episode(0), joint_angles=(), command=(0.5,))
    (relaxed,) = make_entrants(EvaluationConfig(task=HANG, controllers=("relaxed",)))
    (record,) = run_episodes(env, relaxed.policy, [drawn])
    assert record.creature == "worm"
    assert record.errors["bend_error_deg"] == pytest.approx(np.degrees(0.5), abs=1e-3)
    assert record.return_ == pytest.approx(6 * -0.5, abs=1e-3)
    assert record.outcome == "timeout"
