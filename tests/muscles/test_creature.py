"""Creatures: loaded from a file or a specification, and moved."""

import pytest

from flyrl.muscles import load_creature, movement
from tests.muscles.creatures import specification


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
        ([[1, 2]], r"one whole number per muscle, shape \(2,\), got shape \(1, 2\)"),
        ([1.0, 2.0], "whole"),
    ],
)
def test_movement_asks_for_whole_numbers(n, message, profiles):
    creature = load_creature(specification(), profiles)
    with pytest.raises(ValueError, match=message):
        movement(creature)(n)
    assert creature.data.ctrl.tolist() == [0, 0]


def test_a_missing_model(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"creature .*none\.xml: there is no such file"):
        load_creature(tmp_path / "none.xml")
