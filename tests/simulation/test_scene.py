import dataclasses

import numpy as np

from flyrl.simulation.scene import SceneConfig, build_scene


def test_a_scene_that_is_built_again_has_a_model_of_its_own():
    config = SceneConfig()
    for _ in range(2):
        first = build_scene(config)
        mass = first.model.body_mass.copy()
        first.model.body_mass[:] = 0.0
        again = build_scene(dataclasses.replace(config))
        np.testing.assert_array_equal(again.model.body_mass, mass)
