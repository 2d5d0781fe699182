"""The classic body beside flygym 0.2.5: what is stored of a run, and the two tables."""

from typing import Any

import numpy as np
import pytest

from benchmarks.fidelity import classic, results
from benchmarks.fidelity.statistics import trajectory


def walk(seconds: float) -> Any:
    """A fly that starts at x = 2 mm, walks 8 mm/s along x and leans further by 10 deg/s."""
    time = np.arange(0.0, seconds + 5e-4, 1e-3)
    position_w = np.zeros((len(time), 3))
    position_w[:, 0] = 2 + 8 * time
    still = np.zeros(len(time))
    return trajectory(
        {
            "time": time,
            "position_w": position_w,
            "yaw": still,
            "upright": np.cos(np.deg2rad(10 * time)),
            "end_effectors_w": np.zeros((len(time), 6, 3)),
            "contact": np.zeros((len(time), 6)),
            "power": still,
        }
    )


def test_a_row_has_the_way_in_half_a_second_and_the_path() -> None:
    found = classic.row(walk(1.0), seed=3)
    assert found["seed"] == 3
    assert found["final_x"] == pytest.approx(4.0)
    np.testing.assert_allclose(found["path"]["x"], 0.8 * np.arange(11), atol=1e-9)
    np.testing.assert_allclose(found["path"]["tilt_deg"], np.arange(11.0), atol=1e-9)
    assert classic.row(walk(0.3))["final_x"] is None


def run(controller: str, seed: int, speed: float, fall: int = 0, **about: Any) -> results.Row:
    place = {"terrain": "gapped", "controller": controller, "seed": seed, "outcome": "timeout"}
    figures = {"speed": speed, "fall": fall}
    return {**place, "final_x": speed / 2, "statistics": figures, **about}


def test_the_tables_pair_starts_and_keep_the_tutorials_apart() -> None:
    """Every fly gains 2 mm/s by the hybrid, and two more of five fall."""
    found = [run("cpg", seed, float(seed), int(seed == 0)) for seed in range(5)]
    found += [run("hybrid", seed, seed + 2.0, int(seed < 3)) for seed in range(5)]
    tutorial = [run("cpg", 0, 6.0, tutorial=True), run("hybrid", 0, 9.0, tutorial=True)]
    ours = [{**each, "physics": "balanced"} for each in found]
    lines = classic.tables(tutorial + found, ours).splitlines()
    assert "| flygym 0.2.5, tutorial | hybrid | - | 4.50 | - | - |" in lines
    assert "| flygym 0.2.5 | cpg | - | 1.00 (0.50, 1.50) | - | - |" in lines
    assert lines[-1] == "| balanced | gapped | 5 | 2.0 | 4.0 | 2.0 [2.0, 2.0] | 1, 3 |"
    assert sum("tutorial" in line for line in lines) == 2


def test_both_controllers_of_the_reference_have_walked_from_the_same_starts() -> None:
    runs = results.read(classic.REFERENCE)["runs"]
    starts = {
        (terrain, controller): {
            run["seed"]
            for run in runs
            if (run["terrain"], run["controller"]) == (terrain, controller)
        }
        for terrain in classic.GROUNDS
        for controller in classic.CONTROLLERS
    }
    for terrain in classic.GROUNDS:
        assert starts[terrain, "cpg"] == starts[terrain, "hybrid"] != set()
