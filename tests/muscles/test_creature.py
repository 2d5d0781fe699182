"""Muscles in a model: where they act, how they turn, and what is wrong with a model."""

import mujoco
import numpy as np
import pytest

from flyrl.bodies.fly import build_fly
from flyrl.muscles import attach_muscles, load_creature, movement
from tests.muscles.images import save_profile

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


@pytest.fixture
def profiles(tmp_path):
    folder = tmp_path / "profiles"
    folder.mkdir()
    save_profile(folder / "steep.png", [0, 1, 3])
    save_profile(folder / "even.png", [2, 2])
    return folder


def specification(sites=SITES, custom=CUSTOM, bodies=BODIES, rest=""):
    return mujoco.MjSpec.from_string(
        f"""<mujoco> <custom>{custom}</custom> {rest}
        <worldbody> <body name="muscles">{sites}</body> {bodies} </worldbody> </mujoco>"""
    )


def profile_of(*muscles):
    return "".join(f'<text name="{name}/profile" data="steep.png"/>' for name in muscles)


def bodies_of(spec, profiles):
    return [attached.body for attached in attach_muscles(spec, profiles)]


# ------------------------------------------------------------------ what is attached


def test_muscles_come_in_the_order_of_their_sites(profiles):
    muscles = attach_muscles(specification(), profiles)
    assert [(attached.name, attached.body) for attached in muscles] == [
        ("M1", "low"),
        ("M2", "arm"),
    ]
    assert [attached.muscle.strength for attached in muscles] == [1.0, 5.0]
    assert [attached.muscle.pool.forces.tolist() for attached in muscles] == [[0, 1, 3], [2, 2]]
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


def test_sensors_of_a_muscles_site_stay(profiles):
    spec = specification(rest='<sensor> <framepos objtype="site" objname="M1"/> </sensor>')
    model = load_creature(spec, profiles).model
    assert model.site(model.sensor_objid[0]).name == "M1"


def test_defaults_for_motors_do_not_bound_a_muscle(profiles):
    rest = """<default> <motor ctrlrange="-0.1 0.1" forcerange="-0.1 0.1" gear="7"/> </default>"""
    creature = load_creature(specification(rest=rest), profiles)
    movement(creature)([2, 1])
    mujoco.mj_forward(creature.model, creature.data)
    np.testing.assert_allclose(creature.data.actuator_force, [1.0, 5.0])


def test_a_file_and_a_specification_give_the_same_creature(profiles, tmp_path):
    spec = specification()
    (tmp_path / "creature.xml").write_text(spec.to_xml())
    names = [attached.name for attached in load_creature(spec, profiles).muscles]
    assert names == [
        attached.name
        for attached in load_creature(str(tmp_path / "creature.xml"), profiles).muscles
    ]
    # the specification has its muscles still
    assert names == [site.name for site in spec.body("muscles").sites]


# ------------------------------------------------------------------ the nearest body


def test_the_nearest_surface_counts_not_the_nearest_centre(profiles):
    """A large ball, 3 - 2.5 = 0.5 off; a small one whose centre is nearer, 2 - 0.1 = 1.9 off."""
    bodies = """
        <body name="small" pos="2 0 0"> <geom size="0.1"/> </body>
        <body name="large" pos="-3 0 0"> <geom size="2.5"/> </body>
    """
    spec = specification('<site name="M"/>', profile_of("M"), bodies)
    assert bodies_of(spec, profiles) == ["large"]


def test_every_geom_of_a_body_counts(profiles):
    """The second geom of a body is nearest; its own frame is far away. So is a box's middle."""
    bodies = """
        <body name="near" pos="0 0 3"> <geom size="0.5"/> </body>
        <body name="far" pos="90 0 0"> <geom size="1"/> <geom size="1" pos="-88 0 0"/> </body>
        <body name="box" pos="0 40 0"> <geom type="box" size="1 36 1"/> </body>
    """
    spec = specification(
        '<site name="M"/><site name="B" pos="0 3 -1"/>', profile_of("M", "B"), bodies
    )
    assert bodies_of(spec, profiles) == ["far", "box"]


def test_inside_of_two_geoms_the_deeper_one_counts(profiles):
    """0.2 inside of one ball, 0.7 inside of the other."""
    bodies = """
        <body name="shallow" pos="0.8 0 0"> <geom size="1"/> </body>
        <body name="deep" pos="-1.3 0 0"> <geom size="2"/> </body>
    """
    spec = specification('<site name="M"/>', profile_of("M"), bodies)
    assert bodies_of(spec, profiles) == ["deep"]


def test_the_world_does_not_count(profiles):
    bodies = '<geom size="1"/> <body name="far" pos="50 0 0"> <geom size="1"/> </body>'
    spec = specification('<site name="M" pos="0 0 1"/>', profile_of("M"), bodies)
    assert bodies_of(spec, profiles) == ["far"]


@pytest.mark.parametrize("order", [("left", "right"), ("right", "left")])
def test_of_equally_near_bodies_the_first_is_taken(order, profiles):
    """Capsules that lean to either side are equally near but for rounding."""
    y = {"left": 0.3, "right": -0.3}
    bodies = "".join(
        f'<body name="{name}" pos="0 {y[name]} 0" euler="{100 * y[name]} 0 0">'
        '<geom type="capsule" size="0.1 1"/> </body>'
        for name in order
    )
    spec = specification('<site name="M" pos="0.1 0 0.1"/>', profile_of("M"), bodies)
    assert bodies_of(spec, profiles) == [order[0]]


def test_the_initial_pose_counts(profiles):
    """In the pose of the key frame, the arm would be at the muscle."""
    bodies = """
        <body name="arm"> <joint axis="0 0 1"/> <geom size="0.1" pos="3 0 0"/> </body>
        <body name="post" pos="0 5 0"> <geom size="0.1"/> </body>
    """
    spec = specification('<site name="M" pos="0 3 0"/>', profile_of("M"), bodies)
    spec.add_key(name="home", qpos=[np.pi / 2])
    assert bodies_of(spec, profiles) == ["post"]


def test_without_any_body(profiles):
    spec = specification('<site name="M"/>', profile_of("M"), '<geom size="1"/><body name="a"/>')
    with pytest.raises(ValueError, match="muscle 'M' has no body to act on"):
        attach_muscles(spec, profiles)


# ------------------------------------------------------------------ how it turns


@pytest.mark.parametrize(
    ("euler", "torque"),
    [("0 0 0", 0.0), ("90 0 0", 1.0), ("-90 0 0", -1.0), ("60 0 0", np.sin(np.pi / 3))],
)
def test_a_muscle_turns_about_its_sites_y_axis(euler, torque, profiles):
    """Turned by 90 degrees about x, the y axis is the world's z, about which the arm turns."""
    spec = specification(f'<site name="M2" pos="4 0 0" euler="{euler}"/>')
    creature = load_creature(spec, profiles)
    movement(creature)([1])
    mujoco.mj_forward(creature.model, creature.data)
    np.testing.assert_allclose(creature.data.qfrc_actuator, [5 * torque], atol=1e-12)
    creature.data.ctrl[:] = -2.0
    mujoco.mj_forward(creature.model, creature.data)
    np.testing.assert_allclose(creature.data.qfrc_actuator, [-2 * torque], atol=1e-12)


def test_a_free_body_feels_a_pure_torque_about_the_sites_axis(profiles):
    """No force; the torque, in the body's frame, is that along the turned y axis."""
    bodies = '<body name="b" euler="0 0 30"> <freejoint/> <geom type="box" size="1 2 3"/> </body>'
    spec = specification('<site name="M2" pos="9 1 1" euler="20 0 75"/>', bodies=bodies)
    creature = load_creature(spec, profiles)
    movement(creature)([1])
    mujoco.mj_forward(creature.model, creature.data)
    axis_w = creature.data.site("M2").xmat.reshape(3, 3)[:, 1]
    axis_b = creature.data.body("b").xmat.reshape(3, 3).T @ axis_w
    np.testing.assert_allclose(creature.data.qfrc_actuator, [0, 0, 0, *(5 * axis_b)], atol=1e-12)


def test_movement_sets_forces_and_returns_tensions(profiles):
    rest = '<actuator> <position name="servo" joint="elbow"/> </actuator>'
    creature = load_creature(specification(rest=rest), profiles)
    creature.data.ctrl[0] = 0.7
    move = movement(creature)
    for n, tension in (((1, 0), (0.25, 0.5)), ((2, 1), (1, 1)), ((0, -4), (0, 0.5))):
        returned = move(n)
        assert returned.tolist() == list(tension)
        assert creature.data.ctrl.tolist() == [0.7, tension[0], 5 * tension[1]]


@pytest.mark.parametrize(
    ("n", "message"),
    [
        ([1], r"one whole number per muscle, shape \(2,\), got shape \(1,\)"),
        ([1, 2, 3], r"got shape \(3,\)"),
        ([[1, 2]], r"got shape \(1, 2\)"),
        (1, r"got shape \(\)"),
        ([1.0, 2.0], "whole numbers"),
        ([True, False], "whole numbers"),
        (["1", "2"], "whole numbers"),
    ],
)
def test_movement_asks_for_whole_numbers(n, message, profiles):
    creature = load_creature(specification(), profiles)
    with pytest.raises(ValueError, match=message):
        movement(creature)(n)
    assert creature.data.ctrl.tolist() == [0, 0]


# ------------------------------------------------------------------ what is wrong with a model


def one_muscle(profile="steep.png", more=""):
    return specification('<site name="M"/>', f'<text name="M/profile" data="{profile}"/>{more}')


def test_a_model_without_muscles(profiles):
    for spec in (build_fly(visual=False), mujoco.MjSpec()):
        with pytest.raises(ValueError, match="this model has no such body"):
            attach_muscles(spec, profiles)
    nested = specification("", "", '<body name="a"> <geom size="1"/> </body>')
    nested.delete(nested.body("muscles"))
    nested.body("a").add_body(name="muscles").add_site(name="M")
    with pytest.raises(ValueError, match="a child of the world"):
        attach_muscles(nested, profiles)
    with pytest.raises(ValueError, match="a site per muscle, it has none"):
        attach_muscles(specification(""), profiles)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("<body/>", "bodies"),
        ('<geom size="1"/>', "geoms"),
        ("<joint/><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/>", "joints"),
        ("<camera/>", "cameras"),
        ("<light/>", "lights"),
    ],
)
def test_the_muscles_body_holds_nothing_but_sites(content, what, profiles):
    with pytest.raises(ValueError, match=f"nothing but sites, it has {what}"):
        attach_muscles(specification(SITES + content), profiles)


def test_a_muscle_without_name(profiles):
    with pytest.raises(ValueError, match="needs a name; site 1 of 'muscles' has none"):
        attach_muscles(specification('<site name="M1"/><site/>'), profiles)


def test_two_muscles_of_the_same_name(profiles, tmp_path):
    with pytest.raises(ValueError, match="repeated name 'M1'"):
        specification('<site name="M1"/><site name="M1"/>')
    xml = specification().to_xml().replace("M2", "M1")
    (tmp_path / "creature.xml").write_text(xml)
    with pytest.raises(ValueError, match="repeated name 'M1"):
        load_creature(tmp_path / "creature.xml", profiles)


def test_an_actuator_of_the_muscles_name(profiles):
    rest = '<actuator> <motor name="M1" joint="elbow"/> </actuator>'
    with pytest.raises(ValueError, match="muscle 'M1': an actuator has that name already"):
        attach_muscles(specification(rest=rest), profiles)


def test_a_muscle_without_profile(profiles):
    with pytest.raises(ValueError, match=r"muscle 'M' has no profile: .*'M/profile'"):
        attach_muscles(specification('<site name="M"/>', ""), profiles)


def test_a_profile_that_is_missing_or_useless(profiles):
    with pytest.raises(FileNotFoundError, match=r"muscle 'M': .*none\.png: there is no such file"):
        attach_muscles(one_muscle("none.png"), profiles)
    (profiles / "text.png").write_text("no image")
    with pytest.raises(ValueError, match=r"muscle 'M': .*text\.png cannot be read"):
        attach_muscles(one_muscle("text.png"), profiles)
    save_profile(profiles / "white.png", [0, 0])
    with pytest.raises(ValueError, match=r"muscle 'M': .*white\.png: its first row is all white"):
        attach_muscles(one_muscle("white.png"), profiles)


def test_no_profile_lies_elsewhere(profiles):
    """Neither by its path nor by a link, even where an image lies."""
    outside = save_profile(profiles.parent / "outside.png", [1, 2])
    (profiles / "link.png").symlink_to(outside)
    for profile in ("../outside.png", str(outside), "link.png", ".", "../profiles"):
        with pytest.raises(ValueError, match="muscle 'M': its profile must be a file in "):
            attach_muscles(one_muscle(profile), profiles)


def test_profiles_may_lie_in_folders_below(profiles):
    (profiles / "legs").mkdir()
    save_profile(profiles / "legs" / "even.png", [1, 1])
    (attached,) = attach_muscles(one_muscle("legs/even.png"), profiles)
    assert len(attached.muscle.pool) == 2


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ('data="-2"', "finite number of at least 0, got -2.0"),
        ('data="1 2"', r"one number, got \[1.0, 2.0\]"),
        ('size="3" data="1"', "one number"),
    ],
)
def test_a_bad_strength(data, message, profiles):
    with pytest.raises(ValueError, match=f"muscle 'M': M/strength must be .*{message}"):
        attach_muscles(one_muscle(more=f'<numeric name="M/strength" {data}/>'), profiles)


def test_a_strength_that_is_not_finite(profiles):
    spec = one_muscle()
    spec.add_numeric(name="M/strength", data=[np.inf], size=1)
    with pytest.raises(ValueError, match="M/strength must be a finite number of at least 0"):
        attach_muscles(spec, profiles)


def test_after_an_error_the_specification_is_as_it_was(profiles):
    spec = specification(custom=CUSTOM + '<numeric name="M1/strength" data="-1"/>')
    with pytest.raises(ValueError, match="M1/strength"):
        attach_muscles(spec, profiles)
    spec.numeric("M1/strength").data = [3.0]
    assert [attached.name for attached in attach_muscles(spec, profiles)] == ["M1", "M2"]


def test_a_missing_model(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"creature .*none\.xml: there is no such file"):
        load_creature(tmp_path / "none.xml")


def test_profiles_are_looked_for_in_the_assets():
    creature = load_creature(one_muscle("linear.png"))
    assert creature.muscles[0].muscle.force(0) == 0
