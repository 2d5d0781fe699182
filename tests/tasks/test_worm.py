"""Tasks for worms: their episodes, terms against numbers worked out by hand, and their worms."""

import dataclasses

import numpy as np
import pytest
from PIL import Image

from flyrl.bodies.worm import HANGER
from flyrl.simulation.worms import WormState
from flyrl.tasks import TASKS, Neurons
from flyrl.tasks import worm as terms
from flyrl.tasks.terms import compass
from flyrl.terrains import Flat
from tests.tasks.test_tasks import drawn, is_spread
from tests.tasks.test_terms import task_state

WORM_TASKS = [name for name, function in TASKS.items() if function.worm]
CRAWL, HANG = TASKS["worm_crawl"](), TASKS["worm_hang"]()


def worm_state(n: int = 1, joints: int = 2, **changes: object) -> WormState:
    shapes = {"position_w": (3,), "velocity_w": (3,), "time": (), "yaw": ()}
    shapes |= dict.fromkeys(("joint_angles", "joint_velocities"), (joints,))
    shapes |= dict.fromkeys(("neurons", "tensions"), (2 * joints,))
    zeros = {name: np.zeros((n, *shape)) for name, shape in shapes.items()}
    given = {name: np.asarray(value, dtype=float) for name, value in changes.items()}
    return WormState(**zeros | given, is_unstable=np.zeros(n, dtype=bool))


def test_a_task_by_its_name_is_for_its_usual_worm() -> None:
    # two muscles per joint, of the 16 neurons of small.png
    assert CRAWL.actions == Neurons((16,) * 10)
    assert TASKS["worm_crawl_box"]().actions == Neurons((16,) * 10, is_integer=False)
    assert HANG.actions == Neurons((16,) * 8)
    assert TASKS["worm_hang_box"]().actions == Neurons((16,) * 8, is_integer=False)


@pytest.mark.parametrize("name", WORM_TASKS)
def test_a_task_is_built_for_another_worm(name: str) -> None:
    task = TASKS[name](worm=dataclasses.replace(TASKS[name].worm, segments=4))
    assert task.name == name
    assert task.actions.size == 6
    sizes = {term.name: term.size for term in task.observation}
    assert (sizes["joint_angles"], sizes["joint_velocities"], sizes["tensions"]) == (3, 3, 6)
    assert len(task.sample_episode(Flat(), 0).joint_angles) == 3


def test_a_worm_of_a_users_own_profile_has_as_many_neurons_as_the_image_pixels(tmp_path) -> None:
    Image.new("RGB", (7, 1), (200, 0, 0)).save(tmp_path / "mine.png")
    worm = dataclasses.replace(HANGER, profile=str(tmp_path / "mine.png"))
    assert TASKS["worm_hang"](worm=worm).actions.pools == (7,) * 8  # two at each of four joints


def test_crawling_worms_start_a_little_bent_and_turned() -> None:
    episodes = drawn(CRAWL, 300)
    angles = np.array([(episode.spawn_yaw, *episode.joint_angles) for episode in episodes])
    assert angles.shape == (300, 6)
    assert all(is_spread(column, -0.2, 0.2) for column in angles.T)
    assert {episode.spawn_position_w for episode in episodes} == {(0.0, 0.0, 0.0)}
    assert {episode.command for episode in episodes} == {()}


@pytest.mark.parametrize(("task", "bend"), [(HANG, 1.5), (TASKS["worm_hang_box"](bend=0.5), 0.5)])
def test_bends_are_asked_for_to_either_side(task, bend) -> None:
    episodes = drawn(task, 300)
    commands = np.array([episode.command for episode in episodes])
    assert commands.shape == (300, 1)
    assert is_spread(commands, -bend, bend)
    # a hanging worm cannot be turned
    assert {episode.spawn_yaw for episode in episodes} == {0.0}


def test_the_heading_is_a_cosine_and_a_sine() -> None:
    state = task_state(worm_state(2, yaw=[np.pi / 6, -np.pi / 2]))
    np.testing.assert_allclose(compass(state), [[np.sqrt(0.75), 0.5], [0.0, -1.0]], atol=1e-12)


def test_the_bend_error_is_the_sum_of_the_angles_less_the_command() -> None:
    worm = worm_state(2, joint_angles=[[0.5, 0.25], [-0.5, 0.1]], joint_velocities=[[5, -2.5]] * 2)
    state = task_state(worm, command=[[1.0], [-1.4]])
    np.testing.assert_allclose(terms.bend_error(state), [[-0.25], [1.0]])
    np.testing.assert_allclose(terms.absolute_bend_error(state), [0.25, 1.0])
    np.testing.assert_allclose(terms.bend_error_deg(state), [14.323945, 57.29578])
    np.testing.assert_allclose(terms.joint_velocities(state), [[1.0, -0.5]] * 2)


def test_a_worm_has_bent_if_it_is_off_by_less_than_the_tolerance() -> None:
    worm = worm_state(3, joint_angles=[[0.0, 0.099], [-0.099, 0.0], [0.0, 0.101]])
    state = task_state(worm, command=[[0.0]] * 3)
    assert HANG.succeeds_in_time(state).tolist() == [True, True, False]
    assert TASKS["worm_hang"](tolerance=0.3).succeeds_in_time(state).all()


@pytest.mark.parametrize(("lengths", "way"), [(2.0, 36.0), (0.5, 9.0)])
def test_a_worm_has_crawled_once_it_has_come_as_many_lengths_as_asked(lengths, way) -> None:
    # 5 segments of a worm are 18 mm
    state = task_state(worm_state(3), progress=[way - 0.1, way, -40.0])
    task = TASKS["worm_crawl"](lengths=lengths)
    assert task.succeeds_in_time(state).tolist() == [False, True, False]


def test_the_recruited_share_does_not_count_the_first_neurons() -> None:
    # of (16 - 1) + (16 - 1) + (6 - 1) + (6 - 1) = 40
    worm = worm_state(3, neurons=[[0, 0, 0, 0], [15, 15, 5, 5], [3, 0, 5, 2]])
    share = terms.recruited_share(task_state(worm), pools=(16, 16, 6, 6))
    np.testing.assert_allclose(share, [0.0, 1.0, 0.25])
    none = terms.recruited_share(task_state(worm_state(2)), pools=(1, 1, 1, 1))
    assert none.tolist() == [0.0, 0.0]
