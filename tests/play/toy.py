"""A small thing to play: a cart on the ground that a slider drives.

Run as a program, it is served like what `flyrl play` knows, with the same options.
"""

import argparse
import sys
import time
from typing import ClassVar

import mujoco

from flyrl.cli.play import add_to, serve
from flyrl.cli.terminal import reported
from flyrl.play.session import Playable

_SHAPES = {
    "box": 'type="box" size="1 0.6 0.4" rgba="0.8 0.3 0.2 1"',
    "ball": 'type="sphere" size="0.8" rgba="0.2 0.5 0.3 1"',
}

_XML = """
<mujoco>
  <visual><map zfar="100"/></visual>
  <worldbody>
    <light pos="0 0 20" dir="0 0 -1" directional="true"/>
    <geom type="plane" size="30 30 1" rgba="0.75 0.78 0.8 1"/>
    <body name="cart" pos="0 0 1">
      <joint name="along" type="slide" axis="1 0 0"/>
      {spin}
      <geom {shape} contype="0" conaffinity="0" mass="1"/>
    </body>
    <body name="target" mocap="true" pos="3 2 0.2">
      <geom type="sphere" size="0.4" rgba="0.1 0.2 0.9 1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""


class Toy(Playable):
    """A cart; as a ball it can spin, too, so that its state is of another shape."""

    title = "toy"
    hint = "arrow keys: drive"
    keys: ClassVar = {"up": "faster", "down": "slower", "h": "hop", "click": "move the target"}

    def __init__(self, interval_s=0.002):
        self.interval_s = interval_s
        self.hops = 0
        self.camera = mujoco.MjvCamera()
        self.camera.azimuth, self.camera.elevation, self.camera.distance = 90.0, -35.0, 18.0
        self._build("box")

    def _build(self, shape):
        self.shape = shape
        spin = '<joint name="spin" type="hinge" axis="0 0 1"/>' if shape == "ball" else ""
        self.model = mujoco.MjModel.from_xml_string(_XML.format(shape=_SHAPES[shape], spin=spin))
        self.reset(self.seed)

    def step(self):
        self.data.time += self.interval_s
        self.data.qpos[0] += self.interval_s * self.speed

    def reset(self, seed):
        self.seed, self.speed = seed, 0.0
        self.data = mujoco.MjData(self.model)

    def change(self, name, value):
        if name == "h":
            self.hops += 1
        elif name in ("up", "down"):
            self.speed += 0.5 if name == "up" else -0.5
        elif name == "speed":
            self.speed = value
        elif name == "click":
            self.data.mocap_pos[0, :2] = value
        elif value == "cube":
            raise ValueError("shape must be one of 'box', 'ball', got 'cube'")
        else:
            self._build(value)

    def relax(self):
        self.speed = 0.0

    def draw(self, panel):
        if panel.section("Drive"):
            panel.slider("speed", "speed", -2.0, 2.0, self.speed)
            panel.choice("shape", "shape", ("box", "ball", "cube"), self.shape)
            panel.bars({"one": 0.3, "the other": 1.0})

    def figures(self):
        place = dict(zip(("target_x", "target_y"), self.data.mocap_pos[0].tolist(), strict=False))
        x = round(float(self.data.qpos[0]), 4)
        return {
            "x": x,
            "speed_x": round(self.speed, 2),
            "shape": self.shape,
            "hops": self.hops,
            **place,
        }


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    add_to(parser.add_subparsers())
    options = parser.parse_args(["play", "toy", *sys.argv[1:]])

    def make():
        """Make it as soon as nothing says "wait"."""
        while (options.record_folder / "wait").exists():
            time.sleep(0.02)
        return Toy()

    with reported():
        sys.exit(serve(make, options))
