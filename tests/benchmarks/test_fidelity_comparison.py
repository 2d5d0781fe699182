"""From trajectories to stored results to the tables, of both bodies."""

import numpy as np
import pytest

from benchmarks.fidelity import classic, results
from benchmarks.fidelity.comparison import by_seed, hybrid_over, reference_speed, table, verdict
from benchmarks.fidelity.flyrl_runs import config, rows, walk_straight
from tests.benchmarks.made import keep, run, series, standing


def test_collected_runs_are_read_back_in_order(tmp_path):
    """A fly that walks 15 mm in 1.5 s."""
    position_w = np.zeros((1501, 3), dtype=np.float32)
    position_w[:, 0] = np.linspace(0, 15, 1501)
    about = {"terrain": "gapped", "controller": "hybrid", "outcome": "timeout"}
    known = {"machines": [], "runs": []}
    for number, seeds in enumerate([[2], [10, 2, 0]]):
        folder = tmp_path / str(number)
        folder.mkdir()
        for seed in seeds:
            walked = series(1501, position_w=position_w)
            keep(folder / f"{seed}.npz", walked, **about, seed=seed, machine={"cpu": "one"})
        (folder / ".partial-1-gapped-hybrid-3.npz").write_bytes(b"half")
        known = results.collect(folder, known)
    results.write(tmp_path / "reference.json", known)
    found = results.read(tmp_path / "reference.json")
    assert [each["seed"] for each in found["runs"]] == [0, 2, 10]
    assert found["machines"] == [{"cpu": "one"}]
    assert found["runs"][0]["statistics"]["speed"] == 10.0
    assert found["runs"][0]["statistics"]["stride_length"] is None


def test_the_table_has_medians_and_speeds_over_the_reference_s_without_runs_that_blew_up():
    """Of falls it has the share; medians are over the runs that have a statistic."""
    walked = [run(1.0), run(9.0, fall=1), run(10.0), run(None)]
    lost = run(99.0, outcome="unstable", seconds=0.3)
    head, *cells, last = table([run(10.0)], [*walked, lost]).splitlines()
    reference, balanced = (dict(zip(head.split(), cell.split(), strict=True)) for cell in cells)
    assert [reference[name] for name in ("physics", "n", "speed")] == ["flygym", "1", "10"]
    assert [balanced[name] for name in ("n", "speed", "fall")] == ["4", "9", "0.25"]
    assert (reference["speed_ratio"], balanced["speed_ratio"]) == ("1", "0.9")
    assert last == "blew up: flat cpg balanced, seed 7, after 0.3 s"


def test_earlier_runs_count_in_the_reference():
    # 14.3, 14.4, 14.4, 14.4, 20, 30
    found = [run(20.0, seed=0), run(30.0, seed=1), run(8.0, terrain="blocks")]
    assert reference_speed(found, "flat", "cpg") == pytest.approx(14.4)
    assert reference_speed(found, "blocks", "cpg") == 8.0
    stored = results.read(results.REFERENCE)["runs"]
    assert reference_speed(stored, "gapped", "hybrid") == pytest.approx(12.13, abs=0.05)


def test_the_hybrid_is_compared_seed_by_seed():
    """The hybrid is 1 to 3 mm/s faster, however fast the fly; a seed alone is left out."""
    found = [run(2.0 * seed, seed=seed) for seed in range(9)]
    found += [run(2.0 * seed + 1 + seed % 3, controller="hybrid", seed=seed) for seed in range(9)]
    found += [run(1000.0, controller="hybrid", seed=99), run(1.0, seed=99, outcome="unstable")]
    between = hybrid_over(by_seed(results.frame(found)), "cpg")
    assert (between.value, between.n) == (2.0, 9)
    assert 1.0 < between.low < 2.0 < between.high < 3.0


def test_a_line_of_the_verdict_needs_five_runs_of_all_controllers():
    found = [run(s, controller=name, seed=s) for s in range(5) for name in results.CONTROLLERS]
    reference = [run(4.0, controller=name, terrain="blocks") for name in results.CONTROLLERS]
    found = [{**each, "terrain": "blocks"} for each in found]
    assert "2.00 (0.50)" in verdict(reference, found)
    assert "blocks" not in verdict(reference, found[:-1])


def test_flies_are_sampled_about_every_ms_from_the_spawn_of_their_seed():
    """The thorax starts where the task's episode places it, whichever fly of the batch it is.

    A walk lasts as long as asked where samples of 0.8 ms do not divide it.
    """
    walks = walk_straight(config("cpg", "flat", "balanced"), [3, 0], 0.01, num_threads=1)
    (one, _), (other, outcome) = walks
    np.testing.assert_allclose(other.time, 8e-4 * np.arange(14))  # two physics steps
    assert outcome == "timeout"
    apart = one.position_w[0, :2] - other.position_w[0, :2]
    spawns = [np.random.default_rng(seed).uniform(-2, 2, size=2) for seed in (3, 0)]
    np.testing.assert_allclose(apart, spawns[0] - spawns[1], atol=1e-12)


def test_the_classic_body_is_stored_with_its_path():
    """Walking 8 mm/s from x = 2 mm, leaning further by 10 deg/s."""
    time = np.arange(1001) / 1000
    position_w = np.column_stack([2 + 8 * time, 0 * time, 0 * time])
    upright = np.cos(np.deg2rad(10 * time))
    found = classic.row(standing(1001, position_w=position_w, upright=upright), seed=3)
    assert (found["seed"], found["final_x"]) == (3, pytest.approx(4.0))
    np.testing.assert_allclose(found["path"]["x"], 0.8 * np.arange(11), atol=1e-9)
    np.testing.assert_allclose(found["path"]["tilt_deg"], np.arange(11.0), atol=1e-9)
    assert classic.row(standing(301))["final_x"] is None
    (walked,) = rows("fast", "gapped", "hybrid", [0], 1, 0.01, classic.classic_config, classic.row)
    assert (walked["seed"], walked["outcome"], walked["physics"]) == (0, "timeout", "fast")


def test_the_classic_tables_pair_starts_and_keep_the_tutorials_apart():
    """Every fly gains 2 mm/s by the hybrid, and two more of five fall."""
    found = [run(float(seed), int(seed == 0), seed=seed) for seed in range(5)]
    found += [run(seed + 2.0, int(seed < 3), "hybrid", seed) for seed in range(5)]
    tutorial = [run(6.0, tutorial=True), run(9.0, controller="hybrid", tutorial=True)]
    found, tutorial = (
        [{**each, "terrain": "gapped", "final_x": each["statistics"]["speed"] / 2} for each in part]
        for part in (found, tutorial)
    )
    lines = [line.split() for line in classic.tables(tutorial + found, found).splitlines()]
    assert ["hybrid", "4.50", "(4.50,", "4.50)"] in lines  # the tutorial's
    assert ["flygym", "0.2.5", "cpg", "1.00", "(0.50,", "1.50)"] in lines
    assert lines[-1] == ["balanced", "gapped", "5", "2.0", "4.0", "2.00", "1,", "3"]


def test_both_controllers_of_the_classic_reference_have_walked_from_the_same_starts():
    runs = results.read(classic.REFERENCE)["runs"]
    starts = {controller: set() for controller in classic.CONTROLLERS}
    for each in runs:
        starts[each["controller"]].add((each["terrain"], each["seed"]))
    assert starts["cpg"] == starts["hybrid"]
    assert {terrain for terrain, _ in starts["cpg"]} == set(classic.GROUNDS)
