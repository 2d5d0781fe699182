"""A played fly to look at: body, ground and target, and from where."""

import mujoco

from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.terrains import FLAT_GROUND, Flat

AZIMUTH_DEG, ELEVATION_DEG, DISTANCE_MM = 25.0, -28.0, 9.0
"""From behind a fly that walks along +x, from its right and from above."""


class Scenery:
    """A scene as it is drawn, with the meshes, which have few triangles, and all props.

    Parameters
    ----------
    config
        The scene.

    Attributes
    ----------
    model, data
        Of MuJoCo; no leg controller belongs to them.
    camera
        Follows the thorax.
    """

    def __init__(self, config: SceneConfig) -> None:
        self.model = build_scene(config, visual=True).model
        # without its mark the model is not taken for a fly that walks, whoever steps it
        self.model.numeric_data[0] = 0.0
        if isinstance(config.terrain, Flat):
            self.model.geom(FLAT_GROUND).size[:2] = 0.0  # drawn without an end
        self.data = mujoco.MjData(self.model)
        self.camera = mujoco.MjvCamera()
        self.camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        self.camera.trackbodyid = self.model.body("Thorax").id
        self.camera.azimuth, self.camera.elevation = AZIMUTH_DEG, ELEVATION_DEG
        self.camera.distance = DISTANCE_MM

    def pose(self, flies: FlyBatch) -> None:
        """Pose the fly as the only one of a batch is."""
        flies.copy_into(0, self.model, self.data)
        self.camera.lookat[:] = self.data.qpos[:3]
