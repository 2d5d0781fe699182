"""Scenes that were compiled lately are copied."""

import dataclasses

import numpy as np

from flyrl.simulation.scene import SceneConfig, build_scene


def test_a_scene_that_is_built_again_has_a_model_of_its_own():
    for config, build in ((SceneConfig(), build_scene), (SceneConfig(), build_scene)):
        first = build(config)
        mass = first.model.body_mass.copy()
        first.model.body_mass[:] = 0.0
        again = build(dataclasses.replace(config))
        np.testing.assert_array_equal(again.model.body_mass, mass)
