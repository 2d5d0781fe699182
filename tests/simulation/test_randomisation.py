import dataclasses
import itertools

import mujoco
import numpy as np
import pytest
from test_callback import FINE, make_batch, start, walk

from flyrl.anatomy import LEGS
from flyrl.bodies.surface import VISUAL_GROUP, ContactConfig, SurfaceContact
from flyrl.simulation.randomisation import (
    RANDOMISATIONS,
    UNVARIED,
    Randomisation,
    RandomisationConfig,
)
from flyrl.simulation.scene import build_scene


def test_without_ranges_every_fly_is_the_scenes_own() -> None:
    assert RandomisationConfig().draw(3) == UNVARIED == Randomisation(1, 1, 1, 1, 0, 0)


def test_draws_are_the_first_of_the_seeds_own_stream() -> None:
    """Each quantity has its place among them, whatever else is drawn."""
    friction, _, _, _, latency, leg = np.random.default_rng([8, 171_006_537]).random(6)
    config = RandomisationConfig((0.5, 1.5), (2, 2), None, (0, 0), 0.2, (0.0, 0.05), LEGS)
    expected = Randomisation(0.5 + friction, 2, 1, 0, 0.2, 0.05 * latency, LEGS[int(6 * leg)])
    assert config.draw(8) == expected
    without = dataclasses.replace(config, missing_leg=None).draw(8)
    assert without == dataclasses.replace(expected, missing_leg=None)


def test_each_leg_is_as_likely_to_be_missing() -> None:
    drawn = [RANDOMISATIONS["lesion"].draw(seed) for seed in range(1200)]
    # as a number, a missing leg is its place among the legs
    places = [each.numbers()["missing_leg"] for each in drawn]
    assert [LEGS[place] for place in places] == [each.missing_leg for each in drawn]
    assert all(150 < count < 250 for count in np.bincount(places))
    assert UNVARIED.numbers()["missing_leg"] == -1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"missing_leg": ("LF", "LF")}, r"randomisation\.missing_leg must not hold 'LF' twice"),
        ({"friction": (1.2, 0.8)}, r"randomisation\.friction must be \(least, greatest\), got \(1"),
        ({"drive_latency": (0, 0.06)}, r"drive_latency\[1\] must be .* from 0 to 0\.05, got 0\.06"),
    ],
)
def test_what_is_not_allowed_is_refused(settings: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RandomisationConfig(**settings)  # type: ignore[arg-type]


# ------------------------------------------------------------------ flies that differ


def test_flies_that_do_not_differ_share_the_scenes_model() -> None:
    batch = make_batch(num_sims=2)
    batch.vary(np.arange(2), [UNVARIED] * 2)
    for field in ("pair_friction", "body_mass", "actuator_gainprm", "numeric_data"):
        assert batch._batch.expanded(field) is None


@pytest.mark.parametrize(
    ("quantity", "fields", "index"),
    [
        ("friction", ("pair_friction", "geom_friction"), np.s_[:]),
        ("mass", ("body_mass", "body_inertia"), np.s_[:]),
        ("actuator_gain", ("actuator_gainprm",), np.s_[:42, 0]),
        ("actuator_gain", ("actuator_biasprm",), np.s_[:42, 1]),
        ("adhesion", ("actuator_gainprm",), np.s_[42:, 0]),
    ],
)
def test_a_factor_scales_its_fields_of_its_own_simulation(quantity, fields, index) -> None:
    """And always from the scene's figures: half of half is still half."""
    batch = make_batch(num_sims=3)
    for _ in range(2):
        batch.vary(np.array([1]), [Randomisation(**{quantity: 0.5})])
    for field, sim in itertools.product(fields, range(3)):
        expected = getattr(batch.scene.model, field).copy()
        assert np.any(expected[index] != 0)
        expected[index] *= 0.5 if sim == 1 else 1.0
        np.testing.assert_array_equal(getattr(batch._batch.get_model(sim), field), expected)


HALF = SurfaceContact(friction=(0.5, 0.0025, 0.00005))
SLIPPERY = {"physics": dataclasses.replace(FINE, contact=ContactConfig(plane=HALF, box=HALF))}


@pytest.mark.parametrize(
    ("terrain", "drawn", "compiled"),
    [
        ("flat", {"friction": 0.5}, SLIPPERY),
        ("blocks", {"friction": 0.5}, SLIPPERY),
        ("flat", {"adhesion": 0.5}, {"adhesion_gain": 20.0}),
        *(("flat", {"missing_leg": leg}, {"missing_legs": [leg]}) for leg in LEGS),
        *(("mixed", {"missing_leg": leg}, {"missing_legs": [leg]}) for leg in LEGS),
    ],
)
def test_a_varied_fly_walks_as_one_that_is_compiled_so(terrain, drawn, compiled) -> None:
    batch = make_batch(terrain=terrain, num_sims=2)
    batch.vary(np.array([1]), [Randomisation(**drawn)])
    plain, varied = walk(batch, 1000)
    expected = walk(make_batch(terrain=terrain, num_sims=2, **compiled), 1000)
    np.testing.assert_array_equal(varied, expected[1])
    np.testing.assert_array_equal(plain, walk(make_batch(terrain=terrain), 1000)[0])


def test_what_follows_from_masses_follows() -> None:
    batch = make_batch(num_sims=2)
    batch.vary(np.array([0]), [Randomisation(mass=2.0)])
    expected = batch._batch.get_model(1)
    expected.body_mass *= 2
    expected.body_inertia *= 2
    mujoco.mj_setConst(expected, mujoco.MjData(expected))
    heavy = batch._batch.get_model(0)
    for name in ("body_subtreemass", "body_invweight0", "dof_invweight0", "dof_M0"):
        np.testing.assert_array_equal(getattr(heavy, name), getattr(expected, name))
    root = batch.thorax_body
    assert heavy.body_subtreemass[root] == 2 * batch.scene.model.body_subtreemass[root]


# ------------------------------------------------------------------ a leg that is missing


def test_a_fly_without_a_leg_has_the_figures_of_one_that_is_compiled_so() -> None:
    """Under a factor on its mass, too."""
    varied, compiled = make_batch(), make_batch(missing_legs=("RH",))
    varied.vary(np.array([0]), [Randomisation(mass=1.1, missing_leg="RH")])
    compiled.vary(np.array([0]), [Randomisation(mass=1.1)])
    for name in ("body_mass", "body_inertia", "body_invweight0", "dof_invweight0", "dof_M0"):
        ours, theirs = (getattr(each._batch.get_model(0), name) for each in (varied, compiled))
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("first", "then", "compiled"),
    [
        ({"friction": 0.5, "mass": 2.0, "actuator_gain": 0.7, "adhesion": 0.4}, {}, {}),
        ({"missing_leg": "LF"}, {"missing_leg": "RM"}, {"missing_legs": ["RM"]}),
    ],
)
def test_nothing_is_left_of_the_fly_before(first, then, compiled) -> None:
    batch = make_batch(terrain="mixed", num_sims=2)
    batch.vary(np.array([1]), [Randomisation(**first)])
    walk(batch, 20)
    batch.vary(np.arange(2), [Randomisation(**then), UNVARIED])
    start(batch)
    varied, whole = walk(batch)
    np.testing.assert_array_equal(varied, walk(make_batch(terrain="mixed", **compiled))[0])
    np.testing.assert_array_equal(whole, walk(make_batch(terrain="mixed", num_sims=2))[1])


def test_a_leg_that_the_scenes_fly_lacks_stays_as_it_is() -> None:
    batch = make_batch(missing_legs=("LF",))
    batch.vary(np.array([0]), [Randomisation(missing_leg="LF")])
    own = batch.scene.model.body_mass
    np.testing.assert_array_equal(batch._batch.get_model(0).body_mass, own)


def test_a_missing_leg_is_not_drawn() -> None:
    batch = make_batch(num_sims=2)
    batch.vary(np.array([1]), [Randomisation(missing_leg="LM")])
    model = build_scene(batch.scene.config, visual=True).model
    shown = []
    for sim in (0, 1, 0):
        batch.copy_into(sim, model, mujoco.MjData(model))
        bodies = model.geom_bodyid[model.geom_group == VISUAL_GROUP]
        shown.append({model.body(body).name for body in bodies})
    assert {name[:2] for name in shown[0] - shown[1]} == {"LM"}
    assert not any(name.startswith("LM") for name in shown[1])
    assert shown[2] == shown[0]
