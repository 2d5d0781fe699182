import json

import numpy as np
import pytest

from benchmarks.fidelity import steering
from benchmarks.fidelity.steering import collect, figures, steer, walk

LEVEL = np.ones(11)


def turning_left(count: int = 11) -> dict[str, np.ndarray]:
    """Walk along +x at 10 mm/s, level, and turn by 0.5 rad per sample."""
    position = np.zeros((count, 3))
    position[:, 0] = 10 * 0.02 * np.arange(count)
    yaw = (0.5 * np.arange(count) + np.pi) % (2 * np.pi) - np.pi
    return {"position_w": position, "yaw": yaw, "upright": np.ones(count)}


def test_figures_of_a_run() -> None:
    found = figures(turning_left(), "timeout")
    assert found == {
        "outcome": "timeout",
        "seconds": 0.2,
        "tilt_deg": [0] * 10,
        "speed": 10.0,
        "yaw_deg": pytest.approx(np.rad2deg(5.0), abs=0.05),
    }


def test_the_tilt_of_the_fall_itself_does_not_count() -> None:
    series = turning_left(4) | {"upright": np.cos(np.deg2rad([0.0, 10.0, 20.0, 80.0]))}
    assert figures(series, "fall")["tilt_deg"] == [10, 20]


@pytest.mark.parametrize("kind", steering.KINDS)
def test_a_driven_fly_goes_further_than_one_at_zero_drive(kind: str) -> None:
    driven = steer("fast", "mixed", kind, [0, 1], num_threads=1, seconds=0.5)
    standing = walk("fast", "mixed", [0, 1], np.zeros((2, 25, 2)), num_threads=1)
    for moved, stayed in zip(driven, standing, strict=True):
        assert moved["speed"] > stayed["speed"] + 2.0


def test_a_run_is_the_same_in_any_company() -> None:
    alone = steer("fast", "mixed", "abrupt", [4], num_threads=1, seconds=0.2)
    assert alone == steer("fast", "mixed", "abrupt", [3, 4], num_threads=1, seconds=0.2)[1:]


def test_pursuit_goes_to_targets_in_all_directions() -> None:
    rows = steer("fast", "blocks", "pursuit", range(8), num_threads=1)
    assert sum(row["outcome"] == "success" for row in rows) >= 4
    turned = [row["yaw_deg"] for row in rows]
    assert min(turned) < -30 < 30 < max(turned)


KNOWN = {"physics": "flygym", "terrain": "blocks", "kind": "turn"}


def published(folder, upright: np.ndarray) -> None:
    about = {
        "terrain": "blocks", "controller": "hybrid", "drives": "turn", "seed": 1000,
        "outcome": "timeout", "machine": {"cpu": "one"},
    }  # fmt: skip
    count = len(upright)
    np.savez(
        folder / "blocks-turn-1000.npz",
        time=1e-3 * np.arange(count),
        position_w=np.zeros((count, 3)),
        yaw=np.zeros(count),
        upright=upright,
        about=json.dumps(about),
    )


def test_runs_of_the_reference_are_sampled_as_flyrls_and_end_with_their_fall(tmp_path) -> None:
    upright = np.ones(101)
    upright[30:] = np.cos(np.deg2rad(70.0))
    upright[55:] = np.cos(np.deg2rad(76.0))
    published(tmp_path, upright)
    runs = [{**KNOWN, "seed": 1001}, {**KNOWN, "seed": 1000}]
    known = {"machines": [{"cpu": "two"}], "runs": runs}
    found = collect(tmp_path, known)
    assert found["machines"] == [{"cpu": "two"}, {"cpu": "one"}]
    row, kept = found["runs"]
    assert kept == runs[0]
    assert (row["physics"], row["terrain"], row["kind"]) == ("flygym", "blocks", "turn")
    assert (row["outcome"], row["seconds"], row["tilt_deg"]) == ("fall", 0.06, [0, 70])
