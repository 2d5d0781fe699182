from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fidelity import calibration
from benchmarks.fidelity.calibration import (
    Yardstick,
    asymmetry,
    candidate,
    creep,
    distance,
    objective,
)
from flyrl.simulation.physics import PHYSICS_PRESETS


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("speed over flygym's: flat cpg", 1.0, 0.0),
        ("speed over flygym's: flat cpg", 1.3, 2.0),
        ("speed over flygym's: flat cpg", 0.7, 2.0),
        ("hybrid - CPG, mm/s: mixed", 50.0, 0.0),
        ("abrupt, falls / reference: mixed", np.nan, 10.0),
        ("creep, mm", np.inf, 10.0),
    ],
)
def test_a_figure_is_so_many_tolerances_off(name: str, value: float, expected: float) -> None:
    assert distance(name, value) == pytest.approx(expected)


def test_the_objective_sums_squares() -> None:
    figures = {"turning, rms": 0.12, "creep, mm": 0.16, "CPG over hybrid: blocks": 0.5}
    assert objective(figures) == pytest.approx(2**2 + 3**2)


def test_a_candidate_without_changes_is_the_preset() -> None:
    for name in ("balanced", "fast"):
        kept, preset = candidate(name, {}), PHYSICS_PRESETS[name]
        assert kept.contact.box.solref == pytest.approx(preset.contact.box.solref)
        assert kept.contact.plane.solref == pytest.approx(preset.contact.plane.solref)
        assert replace(kept, contact=preset.contact) == preset


def test_a_contact_keeps_its_rate_and_its_damping_per_step_at_another_step() -> None:
    """Damping 1/step is 2000/s at 0.5 ms; pushed out at 28/s, the stiffness is 28 times that."""
    box = candidate("balanced", {"timestep": 5e-4}).contact.box
    assert box.solref == pytest.approx((-56_000.0, -2000.0))


def test_a_candidate_has_what_it_names() -> None:
    changes = {"box.friction": 0.9, "box.push_out": 50.0, "box.first": 0.8, "box.margin": 0.003}
    contact = candidate("balanced", {**changes, "plane.across": 1.4}).contact
    assert contact.box.friction[0] == 0.9
    assert contact.box.solref == pytest.approx((-125_000.0, -2500.0))
    assert contact.box.solimp == (0.8, 0.999, 0.002, 0.5, 2.0)
    assert (contact.box.margin, contact.plane_friction_across) == (0.003, 1.4)


def test_flies_stand_still_and_left_mirrors_right() -> None:
    balanced = PHYSICS_PRESETS["balanced"]
    assert creep(balanced) < 0.1
    assert asymmetry(balanced) < 1e-6


def test_choosing_stops_short_of_what_is_judged_with() -> None:
    with pytest.raises(ValueError, match="steered is 1001; allowed: up to 1000"):
        Yardstick(walks=1, steered=1001, turns=0)


def test_a_preset_measured_against_itself_is_as_true_as_can_be(monkeypatch) -> None:
    """Only falls are no figure where nobody falls."""
    monkeypatch.setattr(calibration, "STEERED_ON", ("mixed",))
    monkeypatch.setattr(calibration.results, "TERRAINS", ("flat", "mixed"))
    yardstick = Yardstick(walks=1, steered=1, turns=1, num_threads=1, preset="fast", levels=2)
    figures, speed = yardstick.measure(PHYSICS_PRESETS["fast"])
    assert figures["turning, rms"] == 0.0
    assert figures["pursuit, falls - reference: mixed"] == 0.0
    assert figures["tilt 95 % / reference: mixed abrupt"] == 1.0
    assert min(figures[f"speed over flygym's: mixed {who}"] for who in ("cpg", "hybrid")) > 0.0
    assert speed > 0.0
