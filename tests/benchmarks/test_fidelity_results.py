"""From trajectories to stored results to the table."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.fidelity import results
from benchmarks.fidelity.compare import table
from benchmarks.fidelity.flyrl_runs import config, walk_straight
from benchmarks.fidelity.statistics import STATISTICS


def run(speed: float | None, fall: float = 0.0, **about: Any) -> results.Row:
    figures = dict.fromkeys(STATISTICS, 1.0) | {"speed": speed, "fall": fall}
    place = {"terrain": "flat", "controller": "cpg", "seed": 7, "outcome": "timeout"}
    return {**place, "seconds": 1.5, **about, "statistics": figures}


def keep(folder: Path, seed: int, **machine: Any) -> None:
    """What `reference.py` leaves of a fly that walks 15 mm in 1.5 s."""
    samples = 1501
    position_w = np.zeros((samples, 3), dtype=np.float32)
    position_w[:, 0] = np.linspace(0, 15, samples)
    about = {"terrain": "gapped", "controller": "hybrid", "seed": seed, "outcome": "timeout"}
    np.savez_compressed(
        folder / f"gapped-hybrid-{seed}.npz",
        time=0.001 * np.arange(samples),
        position_w=position_w,
        yaw=np.zeros(samples),
        upright=np.ones(samples),
        end_effectors_w=np.zeros((samples, 6, 3)),
        contact=np.ones((samples, 6), dtype=bool),
        power=np.zeros(samples),
        about=json.dumps(about | {"machine": machine}),
    )


def test_collected_runs_are_read_back_in_order(tmp_path: Path) -> None:
    first, later = tmp_path / "first", tmp_path / "later"
    first.mkdir()
    later.mkdir()
    keep(first, 2, cpu="one")
    for seed in (10, 2, 0):
        keep(later, seed, cpu="one")
    known = results.collect(first, {"machines": [], "runs": []})
    (later / ".partial-1-gapped-hybrid-3.npz").write_bytes(b"half")
    path = tmp_path / "reference.json"
    results.write(path, results.collect(later, known))
    found = results.read(path)
    assert [each["seed"] for each in found["runs"]] == [0, 2, 10]
    assert found["machines"] == [{"cpu": "one"}]
    assert found["runs"][0]["statistics"]["speed"] == 10.0
    assert found["runs"][0]["statistics"]["stride_length"] is None


def test_summary_takes_medians_over_the_runs_that_have_a_statistic() -> None:
    figures = results.summary([run(1.0), run(5.0, fall=1.0), run(6.0), run(None)])
    assert figures["speed"] == 5.0
    assert figures["fall"] == 0.25


def test_the_table_has_speeds_over_the_reference_s_without_runs_that_blew_up() -> None:
    lost = run(99.0, physics="balanced", outcome="unstable", seconds=0.3)
    text = table([run(10.0)], [run(9.0, physics="balanced"), lost])
    _, reference, balanced, last = text.splitlines()
    assert reference.split()[:5] == ["flat", "cpg", "flygym", "1", "10.00"]
    assert balanced.split()[:5] == ["flat", "cpg", "balanced", "1", "9.00"]
    assert (reference.split()[-1], balanced.split()[-1]) == ("1.00", "0.90")
    assert last == "blew up: flat cpg balanced, seed 7, after 0.3 s"


def test_flies_are_sampled_about_every_ms_from_the_spawn_of_their_seed() -> None:
    """The thorax starts where the task's episode places it, whichever fly of the batch it is."""
    walks = walk_straight(config("cpg", "flat", "balanced"), [3, 0], 0.02, num_threads=1)
    assert [len(walk.time) for walk in walks] == [26, 26]
    np.testing.assert_allclose(np.diff(walks[0].time), 8e-4)  # two physics steps
    apart = walks[0].position_w[0, :2] - walks[1].position_w[0, :2]
    spawns = [np.random.default_rng(seed).uniform(-2, 2, size=2) for seed in (3, 0)]
    np.testing.assert_allclose(apart, spawns[0] - spawns[1], atol=1e-12)


def test_a_walk_lasts_as_long_as_asked_where_samples_do_not_divide_it() -> None:
    """Samples of 0.8 ms: 10 ms are twelve and a half."""
    (walk,) = walk_straight(config("cpg", "flat", "balanced"), [3], 0.01, num_threads=1)
    assert walk.time[-1] == pytest.approx(0.0104)
