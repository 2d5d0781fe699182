"""A small thing to play: a cart on the ground that a slider drives, with every widget there is.

Run as a program, it is served like what `flyrl play` knows, with the same options.
"""

import argparse
import sys
import time

import mujoco
import numpy as np

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
    interval_s = 0.002
    hint = "arrow keys: drive"
    time_s = 0.0

    def __init__(self):
        self.keys = {"up": "faster", "down": "slower", "h": "hop", "click": "move the target"}
        self.hops, self.is_bright = 0, False
        self.target = (3.0, 2.0)
        self.camera = mujoco.MjvCamera()
        self.camera.azimuth, self.camera.elevation, self.camera.distance = 90.0, -35.0, 18.0
        self._build("box")

    def _build(self, shape):
        self.shape = shape
        spin = '<joint name="spin" type="hinge" axis="0 0 1"/>' if shape == "ball" else ""
        self.model = mujoco.MjModel.from_xml_string(_XML.format(shape=_SHAPES[shape], spin=spin))
        self.reset(self.seed)

    def step(self, number):
        self.time_s += number * self.interval_s
        self.data.qpos[0] += number * self.interval_s * self.speed

    def reset(self, seed):
        self.seed, self.time_s, self.speed = seed, 0.0, 0.0
        self.data = mujoco.MjData(self.model)
        self._place()

    def press(self, key):
        if key == "h":
            self.hops += 1
        else:
            self.speed += 0.5 if key == "up" else -0.5

    def change(self, name, value):
        if name == "speed":
            self.speed = value
        elif name == "shape":
            if value == "cube":
                raise ValueError("shape must be one of 'box', 'ball', got 'cube'")
            self._build(value)
        elif name == "bright":
            self.is_bright = value

    def point(self, x_w, y_w):
        self.target = (x_w, y_w)
        self._place()

    def relax(self):
        self.speed = 0.0

    def _place(self):
        self.data.mocap_pos[0] = (*self.target, 0.2)

    def draw(self, panel):
        turns = np.linspace(0, 2 * np.pi, 6, endpoint=False)
        legs = ("LF", "LM", "LH", "RF", "RM", "RH")
        if panel.section("Drive"):
            panel.slider("speed", "speed", -2.0, 2.0, self.speed)
            panel.choice("shape", "shape", ("box", "ball", "cube"), self.shape)
            panel.switch("bright", "bright lights", self.is_bright)
            panel.integer("number", "number", 7)
            panel.text("A line of text that is so long that it does not fit into the panel.")
            panel.bars({"one": 0.3, "the other": 1.0})
        if panel.section("What it does"):
            panel.values({"place (mm)": float(self.data.qpos[0]), "hops": self.hops})
            panel.dials(legs, turns, np.linspace(0.3, 1, 6))
            panel.raster(legs, np.eye(6, 12, dtype=bool), 16, 1.0)
            panel.bars({f"muscle {number}": number / 13 for number in range(14)})

    def figures(self):
        x, y = self.target
        return {
            "x": round(float(self.data.qpos[0]), 4),
            "speed_x": round(self.speed, 2),
            "shape": self.shape,
            "is_bright": self.is_bright,
            "hops": self.hops,
            "target_x": round(x, 2),
            "target_y": round(y, 2),
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
