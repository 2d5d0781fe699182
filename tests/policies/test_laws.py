import numpy as np
import pytest

from flyrl.envs.core import EnvConfig
from flyrl.policies import PolicyFileError, load_policy, named_policies, save_bundle
from flyrl.policies.bundle import policy_name
from flyrl.policies.laws import FIXED
from flyrl.tasks import TASKS
from tests.policies.conftest import observed


def test_an_unknown_name_lists_what_there_is():
    with pytest.raises(PolicyFileError) as error:
        load_policy("targt-flat")
    assert str(error.value) == (
        "no policy at targt-flat: there is no such file or folder, and no policy of that name; "
        f"did you mean 'target-flat'?; names: {', '.join((*named_policies(), *FIXED))}"
    )


@pytest.mark.parametrize("name", FIXED)
def test_a_fixed_law_is_loaded_by_name_for_the_first_task_that_shows_what_it_needs(name):
    env = EnvConfig(next(task for task in TASKS if FIXED[name].goes_with(TASKS[task]())))
    task = env.resolved_task
    observations = observed(task, 3)
    actions, _ = load_policy(name).predict(observations)
    assert actions.shape == (3, task.actions.size)
    np.testing.assert_array_equal(actions, load_policy(name, task.name).predict(observations)[0])


def test_a_fixed_law_is_made_for_the_task():
    pursuit, constant = load_policy("pursuit", "path"), load_policy("constant(1.2, 0.4)")
    # to the left, too far away to brake
    observation = observed(TASKS["path"](), target_direction=(0, 1), target_distance=1.0)
    drive = TASKS["path"]().actions.commands(pursuit.predict(observation)[0])
    np.testing.assert_allclose(drive, [[0.0, 1.5]], atol=1e-6)
    drive = TASKS["target"]().actions.commands(constant.predict(observation)[0])
    np.testing.assert_allclose(drive, [[1.2, 0.4]], atol=1e-6)


@pytest.mark.parametrize(("distance", "share"), [(5.0, 1.0), (1.5, 1.0), (1.125, 0.5), (0.7, 0.0)])
@pytest.mark.parametrize(("law", "ahead"), [("pursuit", 1.5), ("unhurried", 0.8)])
@pytest.mark.parametrize("name", ["stop", "path"])
def test_a_law_brakes_where_the_fly_is_to_stop(name, law, ahead, distance, share):
    task = TASKS[name]()
    shown = {"target_direction": (1, 0), "target_distance": distance / 15, "time_left": 1.0}
    drive = task.actions.commands(load_policy(law, name).predict(observed(task, **shown))[0])
    np.testing.assert_allclose(drive, [[ahead * share] * 2], atol=1e-6)


@pytest.mark.parametrize(
    ("distance_mm", "time_left_s", "ahead"),
    [(18.0, 2.2, 1.0), (18.0, 3.0, 18 / 2.8 / 9), (6.0, 3.0, 0.5), (22.0, 1.0, 1.5)],
)
def test_who_crosses_unhurriedly_takes_the_time_that_is_left(distance_mm, time_left_s, ahead):
    task = TASKS["traverse"]()
    shown = {
        "target_direction": (1, 0),
        "finish_distance": distance_mm / 15,
        "time_left": time_left_s / 3,
    }
    drive = task.actions.commands(
        load_policy("unhurried", "traverse").predict(observed(task, **shown))[0]
    )
    np.testing.assert_allclose(drive, [[ahead] * 2], atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *[((path,), "path of a policy must be the path of a folder") for path in ("", 5, None)],
        (("pursiut",), "did you mean 'pursuit'"),
        (("open_loop", "target"), "'open_loop' needs a task for flies that shows command"),
        (("target-flat", "velocity"), "observations that velocity does not show"),
    ],
)
def test_what_cannot_be_loaded_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        load_policy(*arguments)


def test_a_file_of_one_s_own_has_no_name(bundle, tmp_path):
    save_bundle(bundle, tmp_path / "mine.safetensors")
    assert policy_name(tmp_path / "mine.safetensors") is None
