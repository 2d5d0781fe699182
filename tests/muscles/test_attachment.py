"""Muscles in a model: what becomes of them, how they turn, and what is wrong with a model."""

import mujoco
import numpy as np
import pytest

from flyrl.bodies.fly import build_fly
from flyrl.muscles import attach_muscles, load_creature, movement
from tests.muscles.creatures import CUSTOM, SITES, profile_of, save_profile, specification

# ------------------------------------------------------------------ what is attached


def test_muscles_come_in_the_order_of_their_sites(profiles):
    muscles = attach_muscles(specification(), profiles)
    assert [(name, body, muscle.strength) for name, muscle, body in muscles] == [
        ("M1", "low", 1.0),
        ("M2", "arm", 5.0),
    ]
    assert [each.muscle.pool.forces.tolist() for each in muscles] == [[0, 1, 3], [2, 2]]
    names = [f"M{i}" for i in (5, 2, 9, 1)]
    sites = "".join(f'<site name="{name}"/>' for name in names)
    muscles = attach_muscles(specification(sites, profile_of(*names)), profiles)
    assert [attached.name for attached in muscles] == names


def test_the_model_has_a_motor_per_muscle_and_nothing_else_is_left(profiles):
    rest = '<actuator> <position name="servo" joint="elbow"/> </actuator>'
    spec = specification(custom=CUSTOM + '<numeric name="other" data="1 2"/>', rest=rest)
    attach_muscles(spec, profiles)
    model = spec.compile()
    assert [model.actuator(i).name for i in range(model.nu)] == ["servo", "M1", "M2"]
    assert [model.body(i).name for i in range(model.nbody)] == ["world", "low", "arm"]
    assert (model.ntext, model.nnumeric) == (0, 1)


def test_sites_keep_their_place_and_orientation_in_the_world(profiles):
    """Also in turned frames and bodies, and whatever the model's defaults say."""
    sites = """
        <frame pos="1 2 3" euler="0 30 20"> <site name="M1" pos="0 1 1" euler="50 0 0"/> </frame>
        <site name="M2" type="capsule" fromto="1 1 0 1 2 1"/>
    """
    bodies = """
        <body name="low" pos="1 1 0" euler="0 50 10"> <freejoint align="true"/>
          <geom type="capsule" size="0.2 1" pos="0.3 0 0"/>
          <frame euler="0 0 70">
            <body name="arm" pos="3 0 1" euler="9 8 7">
              <joint name="elbow" axis="0 0 1"/> <geom size="1"/>
            </body>
          </frame>
        </body>
    """
    rest = '<default> <site euler="10 20 30" size="0.3" rgba="1 0 0 1" group="4"/> </default>'
    before = specification(sites, bodies=bodies, rest=rest).compile()
    creature = load_creature(specification(sites, bodies=bodies, rest=rest), profiles)
    old = mujoco.MjData(before)
    for model, data in ((before, old), (creature.model, creature.data)):
        mujoco.mj_kinematics(model, data)
    assert {attached.body for attached in creature.muscles} == {"low", "arm"}
    for name in ("M1", "M2"):
        np.testing.assert_allclose(creature.data.site(name).xpos, old.site(name).xpos, atol=1e-12)
        np.testing.assert_allclose(creature.data.site(name).xmat, old.site(name).xmat, atol=1e-12)
        for look in ("type", "size", "rgba", "group"):
            np.testing.assert_array_equal(
                getattr(creature.model.site(name), look), getattr(before.site(name), look)
            )


def test_what_refers_to_a_site_and_defaults_for_motors_do_no_harm(profiles):
    rest = """
        <default> <motor ctrlrange="-0.1 0.1" forcerange="-0.1 0.1" gear="7"/> </default>
        <sensor> <framepos objtype="site" objname="M1"/> </sensor>
    """
    creature = pulling(specification(rest=rest), profiles, [2, 1])
    np.testing.assert_allclose(creature.data.actuator_force, [1.0, 5.0])
    assert creature.model.site(creature.model.sensor_objid[0]).name == "M1"


# ------------------------------------------------------------------ how it turns


def pulling(spec, profiles, n):
    """Creature whose muscles are recruited up to n, with the forces that follow."""
    creature = load_creature(spec, profiles)
    movement(creature)(n)
    mujoco.mj_forward(creature.model, creature.data)
    return creature


@pytest.mark.parametrize(
    ("euler", "torque"),
    [("0 0 0", 0.0), ("90 0 0", 1.0), ("-90 0 0", -1.0), ("60 0 0", np.sin(np.pi / 3))],
)
def test_a_muscle_turns_about_its_sites_y_axis(euler, torque, profiles):
    """Turned by 90 degrees about x, the y axis is the world's z, about which the arm turns."""
    spec = specification(f'<site name="M2" pos="4 0 0" euler="{euler}"/>')
    creature = pulling(spec, profiles, [1])
    np.testing.assert_allclose(creature.data.qfrc_actuator, [5 * torque], atol=1e-12)
    creature.data.ctrl[:] = -2.0
    mujoco.mj_forward(creature.model, creature.data)
    np.testing.assert_allclose(creature.data.qfrc_actuator, [-2 * torque], atol=1e-12)


def test_a_free_body_feels_a_pure_torque_about_the_sites_axis(profiles):
    """No force; the torque, in the body's frame, is that along the turned y axis."""
    bodies = '<body name="b" euler="0 0 30"> <freejoint/> <geom type="box" size="1 2 3"/> </body>'
    spec = specification('<site name="M2" pos="9 1 1" euler="20 0 75"/>', bodies=bodies)
    creature = pulling(spec, profiles, [1])
    axis_w = creature.data.site("M2").xmat.reshape(3, 3)[:, 1]
    axis_b = creature.data.body("b").xmat.reshape(3, 3).T @ axis_w
    np.testing.assert_allclose(creature.data.qfrc_actuator, [0, 0, 0, *(5 * axis_b)], atol=1e-12)


def anchored(anchor):
    return specification(
        '<site name="M2" pos="4 0 0" euler="90 0 0"/>',
        '<text name="M2/profile" data="even.png"/> <numeric name="M2/strength" data="5"/>'
        f'<text name="M2/anchor" data="{anchor}"/>',
        """<body name="low"> <freejoint/> <geom size="1"/>
             <body name="arm" pos="4 0 -3"> <joint axis="0 0 1"/> <geom size="1"/> </body>
           </body>""",
    )


def test_a_muscle_with_an_anchor_turns_the_joint_and_not_the_creature(profiles):
    """The arm by +5 about z, the body it pulls against by -5: in sum nothing."""
    creature = pulling(anchored("low"), profiles, [1])
    np.testing.assert_allclose(creature.data.qfrc_actuator, [0, 0, 0, 0, 0, 0, 5], atol=1e-12)
    assert (creature.model.ntext, creature.model.nsite) == (0, 2)
    # and without one, the whole creature
    spec = anchored("low")
    spec.delete(spec.text("M2/anchor"))
    creature = pulling(spec, profiles, [1])
    np.testing.assert_allclose(creature.data.qfrc_actuator, [0, 0, 0, 0, 0, 5, 5], atol=1e-12)


# ------------------------------------------------------------------ what is wrong with a model


def one_muscle(profile="steep.png", more="", **model):
    custom = f'<text name="M/profile" data="{profile}"/>{more}'
    return specification('<site name="M"/>', custom, **model)


def strong(data):
    return one_muscle(more=f'<numeric name="M/strength" {data}/>')


def nested():
    """A body "muscles" that is no child of the world."""
    spec = specification("", "", '<body name="a"> <geom size="1"/> </body>')
    spec.delete(spec.body("muscles"))
    spec.body("a").add_body(name="muscles").add_site(name="M")
    return spec


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (lambda: build_fly(visual=False), "this model has no such body"),
        (nested, "a child of the world"),
        (lambda: specification(""), "a site per muscle, it has none"),
        (lambda: specification(SITES + '<geom size="1"/>'), "nothing but sites, it has geoms"),
        (
            lambda: specification('<site name="M1"/><site/>'),
            "needs a name; site 1 of 'muscles' has none",
        ),
        (
            lambda: specification(rest='<actuator> <motor name="M1" joint="elbow"/> </actuator>'),
            "muscle 'M1': an actuator has that name already",
        ),
        (lambda: specification('<site name="M"/>', ""), "'M' has no profile: .*'M/profile'"),
        (
            lambda: specification('<site name="M"/>', profile_of("M"), '<geom size="1"/>'),
            "no body to",
        ),
        (lambda: strong('data="-2"'), "'M': M/strength must be a finite .* at least 0, got -2.0"),
        (lambda: strong('data="1 2"'), r"M/strength must be one number, got \[1.0, 2.0\]"),
        (lambda: strong('size="3" data="1"'), "M/strength must be one number"),
        (lambda: one_muscle("white.png"), r"muscle 'M': .*white\.png: its first row is all white"),
        (lambda: anchored("lwo"), "'M2': M2/anchor must be one of .* did you mean 'low'"),
        (lambda: anchored("arm"), "'M2' acts on body 'arm', its anchor: take another"),
    ],
)
def test_what_is_wrong_with_a_model_is_said(spec, message, profiles):
    save_profile(profiles / "white.png", [0, 0])
    with pytest.raises(ValueError, match=message):
        attach_muscles(spec(), profiles)


def test_no_profile_lies_elsewhere(profiles):
    """Neither by its path nor by a link, even where an image lies; but in a folder below."""
    outside = save_profile(profiles.parent / "outside.png", [1, 2])
    (profiles / "link.png").symlink_to(outside)
    for profile in ("../outside.png", str(outside), "link.png", ".", "../profiles"):
        with pytest.raises(ValueError, match="muscle 'M': its profile must be a file in "):
            attach_muscles(one_muscle(profile), profiles)
    with pytest.raises(FileNotFoundError, match=r"muscle 'M': .*none\.png: there is no such file"):
        attach_muscles(one_muscle("none.png"), profiles)
    (profiles / "legs").mkdir()
    save_profile(profiles / "legs" / "even.png", [1, 1])
    (attached,) = attach_muscles(one_muscle("legs/even.png"), profiles)
    assert len(attached.muscle.pool) == 2


def test_after_an_error_the_specification_is_as_it_was(profiles):
    spec = specification(custom=CUSTOM + '<numeric name="M1/strength" data="-1"/>')
    with pytest.raises(ValueError, match="M1/strength"):
        attach_muscles(spec, profiles)
    spec.numeric("M1/strength").data = [3.0]
    assert [attached.name for attached in attach_muscles(spec, profiles)] == ["M1", "M2"]
