import numpy as np
import pytest

from benchmarks.fidelity import results, steering
from benchmarks.fidelity.steering import figures, steer, walk
from tests.benchmarks.made import keep, series


def turning_left(count: int = 11) -> dict[str, np.ndarray]:
    """Walk along +x at 10 mm/s, level, and turn by 0.5 rad per sample."""
    position = np.zeros((count, 3))
    position[:, 0] = 10 * 0.02 * np.arange(count)
    yaw = (0.5 * np.arange(count) + np.pi) % (2 * np.pi) - np.pi
    return {"position_w": position, "yaw": yaw, "upright": np.ones(count)}


def test_figures_of_a_run() -> None:
    assert figures(turning_left(), "timeout") == {
        "outcome": "timeout",
        "seconds": 0.2,
        "tilt_deg": [0] * 10,
        "speed": 10.0,
        "yaw_deg": pytest.approx(np.rad2deg(5.0), abs=0.05),
    }
    # the tilt of the fall itself does not count
    fallen = turning_left(4) | {"upright": np.cos(np.deg2rad([0.0, 10.0, 20.0, 80.0]))}
    assert figures(fallen, "fall")["tilt_deg"] == [10, 20]


def test_driven_flies_go_further_than_at_zero_drive_the_same_in_any_company() -> None:
    standing = walk("fast", "mixed", [0, 1], np.zeros((2, 25, 2)), num_threads=1)
    for kind in steering.KINDS:
        driven = steer("fast", "mixed", kind, [0, 1], num_threads=1, seconds=0.5)
        for moved, stayed in zip(driven, standing, strict=True):
            assert moved["speed"] > stayed["speed"] + 2.0
    assert driven[1:] == steer("fast", "mixed", kind, [1], num_threads=1, seconds=0.5)


def test_pursuit_goes_to_targets_in_all_directions() -> None:
    rows = steer("fast", "blocks", "pursuit", range(8), num_threads=1)
    assert sum(row["outcome"] == "success" for row in rows) >= 4
    turned = [row["yaw_deg"] for row in rows]
    assert min(turned) < -30 < 30 < max(turned)


def test_runs_of_the_reference_are_sampled_as_flyrls_and_end_with_their_fall(tmp_path) -> None:
    upright = np.ones(101)
    upright[30:] = np.cos(np.deg2rad(70.0))
    upright[55:] = np.cos(np.deg2rad(76.0))
    about = {"terrain": "blocks", "controller": "hybrid", "drives": "turn", "outcome": "timeout"}
    walked = series(101, upright=upright)
    keep(tmp_path / "blocks-turn-1000.npz", walked, **about, seed=1000, machine={"cpu": "one"})
    place = {"physics": "flygym", "terrain": "blocks", "kind": "turn"}
    known = {
        "machines": [{"cpu": "two"}],
        "runs": [{**place, "seed": 1001}, {**place, "seed": 1000}],
    }
    found = results.collect(tmp_path, known, steering.reference_row, steering.place)
    assert found["machines"] == [{"cpu": "two"}, {"cpu": "one"}]
    row, kept = found["runs"]
    assert kept == known["runs"][0]
    assert row.items() >= {**place, "seed": 1000}.items()
    assert (row["outcome"], row["seconds"], row["tilt_deg"]) == ("fall", 0.06, [0, 70])
