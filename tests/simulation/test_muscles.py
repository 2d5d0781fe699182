"""A fly on muscles, against the same fly on servos."""

import numpy as np
import pytest
from PIL import Image

from flyrl.bodies.fly import FLIES, FlyConfig, LegMuscles
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.conditions import Condition
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.tasks import TASKS, extended, load_terms

LIMP = FlyConfig(muscles=LegMuscles(strength=0.0))


def walked(body, drive=1.0, num_flies=4, decisions=25, **config):
    env = BatchedEnv(EnvConfig(task="traverse", body=body, **config), num_flies, num_threads=1)
    env.reset(seeds=range(num_flies))
    action = np.tile(env.task.actions.of(np.full(2, drive)), (num_flies, 1))
    for _ in range(decisions):
        env.step(action)
    return env.state


def test_torques_are_those_of_the_tensions():
    state = walked("fly_muscles", num_flies=2, decisions=3)
    pairs = state.muscle_tensions.reshape(2, 42, 2)
    strength = FLIES["fly_muscles"].muscles.strength
    assert (pairs > 0).any(axis=2).all()
    np.testing.assert_allclose(
        state.actuator_torques, strength * (pairs[..., 0] - pairs[..., 1]), atol=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["rule_based", "hybrid"])
def test_a_fly_on_muscles_walks_as_fast_as_on_servos(controller):
    forward = {
        name: np.median(walked(name, controller=controller).position_w[:, 0])
        for name in ("current", "fly_muscles")
    }
    # the rules know no drive: their fly stays where its muscles have no strength
    at_rest = (LIMP, 1.0) if controller == "rule_based" else ("fly_muscles", 0.0)
    still = np.median(walked(*at_rest, controller=controller).position_w[:, 0])
    assert forward["fly_muscles"] == pytest.approx(forward["current"], rel=0.2)
    assert forward["fly_muscles"] > still + 3.0


def test_muscles_without_strength_carry_nothing():
    state = walked(LIMP, num_flies=1, decisions=10)
    assert not state.actuator_torques.any()
    assert state.position_w[0, 2] < 0.8 * walked("fly_muscles", 0.0, 1, 10).position_w[0, 2]


def test_one_side_can_be_weaker():
    body = FlyConfig(muscles=LegMuscles(strength=1.0, left=0.5))
    torques = np.abs(walked(body, num_flies=2, decisions=10).actuator_torques)
    left, right = torques.reshape(2, 2, 21).max(axis=(0, 2))
    assert left <= 0.5 < right <= 1.0


def test_the_order_of_recruitment_is_a_setting():
    # the first neurons of a human pool are weak: recruited last, the one at rest is a strong one
    for order, low, high in (("profile", 0.0, 0.0), ("reversed", 0.005, 1.0)):
        body = FlyConfig(muscles=LegMuscles(order=order))
        assert low <= walked(body, num_flies=1, decisions=2).muscle_tensions.min() <= high


def test_tensions_can_be_observed():
    name = "flyrl.tasks.senses:MUSCLE_TENSIONS"
    task = extended(TASKS["target"](), load_terms([name]), {})
    env = BatchedEnv(EnvConfig(task=task, body="fly_muscles"), 2, num_threads=1)
    env.reset(seeds=[0, 1])
    observation = env.step(np.ones((2, 2))).observation
    np.testing.assert_array_equal(
        observation[:, task.slices()["muscle_tensions"]],
        env.state.muscle_tensions.astype(np.float32),
    )


def test_a_side_is_weakened_as_a_condition_of_a_fly_with_muscles():
    weakened = Condition("left_muscles", 0.5).env(EnvConfig(body="fly_muscles"))
    assert weakened.scene.body.muscles == LegMuscles(left=0.5)
    assert Condition("left_muscles", 1.0).is_usual
    with pytest.raises(ValueError, match=r"left_muscles .*body=fly_muscles"):
        Condition("left_muscles", 0.5).env(EnvConfig())


def test_a_users_own_image_is_the_pool_and_is_read_anew_when_it_changes(tmp_path) -> None:
    """Blue of 200 and 55 is a force of 55 and 200: the first neuron does 55 / 255 of all."""
    path = tmp_path / "mine.png"
    for blues, first in (((200, 55), 55 / 255), ((55, 200), 200 / 255)):
        image = Image.new("RGB", (2, 1))
        image.putdata([(0, 0, blue) for blue in blues])
        image.save(path)
        config = SceneConfig(FlyConfig(muscles=LegMuscles(profile=str(path))))
        assert build_scene(config).model.numeric_data[-2:] == pytest.approx([first, 1.0])
