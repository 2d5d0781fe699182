"""Creatures with muscles, for tests: two balls, the second an arm that turns about z."""

import mujoco
import numpy as np
from PIL import Image

SITES = '<site name="M1" pos="0 0 3"/><site name="M2" pos="4 0 0" euler="0 0 90"/>'
CUSTOM = """
    <text name="M1/profile" data="steep.png"/> <text name="M2/profile" data="even.png"/>
    <numeric name="M2/strength" data="5"/>
"""
BODIES = """
    <body name="low"> <geom size="1"/>
      <body name="arm" pos="4 0 -3"> <joint name="elbow" axis="0 0 1"/> <geom size="1"/> </body>
    </body>
"""


def specification(sites=SITES, custom=CUSTOM, bodies=BODIES, rest=""):
    return mujoco.MjSpec.from_string(
        f"""<mujoco> <custom>{custom}</custom> {rest}
        <worldbody> <body name="muscles">{sites}</body> {bodies} </worldbody> </mujoco>"""
    )


def profile_of(*muscles):
    return "".join(f'<text name="{name}/profile" data="steep.png"/>' for name in muscles)


def save_profile(path, forces):
    """Save an image whose first row holds `forces` (whole numbers of 0 to 255); below it is none.

    Red and green tell nothing.
    """
    row = np.full((len(forces), 3), 255, np.uint8)
    row[:, 0] = 30
    row[:, 2] = 255 - np.asarray(forces)
    Image.fromarray(np.stack([row, np.full_like(row, 255)])).save(path)
    return path
