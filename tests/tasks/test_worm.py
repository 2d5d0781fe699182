"""Tasks for worms: their episodes, and that they are made to measure."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from flyrl.bodies.worm import HANGER
from flyrl.tasks import TASKS, Neurons
from flyrl.terrains import Flat

FLAT = Flat()
WORM_TASKS = [name for name, function in TASKS.items() if function.worm]
NAMES = pytest.mark.parametrize("name", WORM_TASKS)


def test_a_task_by_its_name_is_for_its_usual_worm() -> None:
    # two muscles per joint, of the 16 neurons of small.png
    assert TASKS["worm_crawl"]().actions == Neurons((16,) * 10)
    assert TASKS["worm_crawl_box"]().actions == Neurons((16,) * 10, is_integer=False)
    assert TASKS["worm_hang"]().actions == Neurons((16,) * 8)
    assert TASKS["worm_hang_box"]().actions == Neurons((16,) * 8, is_integer=False)
    assert {name: TASKS[name]().name for name in WORM_TASKS} == {n: n for n in WORM_TASKS}


@NAMES
def test_a_task_is_made_to_measure_for_another_worm(name: str) -> None:
    worm = replace(TASKS[name].worm, segments=4)
    task = TASKS[name](worm=worm)
    assert task.actions.size == 6
    sizes = {term.name: term.size for term in task.observation}
    assert (sizes["joint_angles"], sizes["joint_velocities"], sizes["tensions"]) == (3, 3, 6)
    assert len(task.sample_episode(FLAT, 0).joint_angles) == 3


def test_worms_start_a_little_bent_and_turned() -> None:
    episodes = [TASKS["worm_crawl"]().sample_episode(FLAT, seed) for seed in range(300)]
    angles = np.array([(episode.spawn_yaw, *episode.joint_angles) for episode in episodes])
    assert angles.shape == (300, 6)
    for column in angles.T:
        assert -0.2 <= column.min() < -0.19
        assert 0.19 < column.max() <= 0.2
    assert {episode.spawn_position_w for episode in episodes} == {(0.0, 0.0, 0.0)}
    assert {episode.command for episode in episodes} == {()}


def test_bends_are_asked_for_to_either_side() -> None:
    episodes = [TASKS["worm_hang"]().sample_episode(FLAT, seed) for seed in range(300)]
    bends = np.array([episode.command for episode in episodes])
    assert bends.shape == (300, 1)
    assert -1.5 <= bends.min() < -1.45
    assert 1.45 < bends.max() <= 1.5
    # a hanging worm cannot be turned
    assert {episode.spawn_yaw for episode in episodes} == {0.0}


def test_a_worm_of_a_users_own_profile_has_as_many_neurons_as_the_image_pixels(tmp_path) -> None:
    Image.new("RGB", (7, 1), (200, 0, 0)).save(tmp_path / "mine.png")
    task = TASKS["worm_hang"](worm=replace(HANGER, profile=str(tmp_path / "mine.png")))
    assert task.actions.pools == (7,) * 8  # two muscles at each of four joints
