"""On which body a muscle acts."""

import numpy as np
import pytest

from flyrl.muscles import attach_muscles
from tests.muscles.creatures import profile_of, specification


def bodies_of(profiles, bodies, pos="0 0 0"):
    """On which body a muscle at a place acts."""
    spec = specification(f'<site name="M" pos="{pos}"/>', profile_of("M"), bodies)
    return [attached.body for attached in attach_muscles(spec, profiles)]


def ball(name, pos, radius):
    return f'<body name="{name}" pos="{pos}"> <geom size="{radius}"/> </body>'


FAR = """
    <body name="near" pos="0 0 3"> <geom size="0.5"/> </body>
    <body name="far" pos="90 0 0"> <geom size="1"/> <geom size="1" pos="-88 0 0"/> </body>
    <body name="box" pos="0 40 0"> <geom type="box" size="1 36 1"/> </body>
"""


@pytest.mark.parametrize(
    ("nearest", "pos", "bodies"),
    [
        # a large ball, 3 - 2.5 = 0.5 off; a small one whose centre is nearer, 2 - 0.1 = 1.9 off
        ("b", "0 0 0", ball("a", "2 0 0", 0.1) + ball("b", "-3 0 0", 2.5)),
        # the second geom of a body is nearest; its own frame is far away. So is a box's middle
        ("far", "0 0 0", FAR),
        ("box", "0 3 -1", FAR),
        # 0.2 inside of one ball, 0.7 inside of the other
        ("b", "0 0 0", ball("a", "0.8 0 0", 1) + ball("b", "-1.3 0 0", 2)),
    ],
)
def test_the_nearest_surface_counts(nearest, pos, bodies, profiles):
    """The world, which is at the muscle, does not."""
    assert bodies_of(profiles, f'<geom pos="{pos}" size="1"/> {bodies}', pos) == [nearest]


@pytest.mark.parametrize("order", [("left", "right"), ("right", "left")])
def test_of_equally_near_bodies_the_first_is_taken(order, profiles):
    """Capsules that lean to either side are equally near but for rounding."""
    y = {"left": 0.3, "right": -0.3}
    bodies = "".join(
        f'<body name="{name}" pos="0 {y[name]} 0" euler="{100 * y[name]} 0 0">'
        '<geom type="capsule" size="0.1 1"/> </body>'
        for name in order
    )
    assert bodies_of(profiles, bodies, "0.1 0 0.1") == [order[0]]


def test_the_initial_pose_counts(profiles):
    """In the pose of the key frame, the arm would be at the muscle."""
    bodies = """
        <body name="arm"> <joint axis="0 0 1"/> <geom size="0.1" pos="3 0 0"/> </body>
        <body name="post" pos="0 5 0"> <geom size="0.1"/> </body>
    """
    spec = specification('<site name="M" pos="0 3 0"/>', profile_of("M"), bodies)
    spec.add_key(name="home", qpos=[np.pi / 2])
    assert [attached.body for attached in attach_muscles(spec, profiles)] == ["post"]
