"""Merging, timing and printing of the speed benchmark; no speeds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.speed import engine, overhead, results
from benchmarks.speed.__main__ import main
from benchmarks.speed.results import part_table
from flyrl.bodies.worm import WORMS
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.flies import FlyBatch

MACHINE = {"date": "2000-01-02", "cpu": "abacus", "cores": 3, "versions": {"mujoco": "4.0"}}


def part(**row: Any) -> results.Part:
    return {"machine": MACHINE, "settings": {}, "rows": [row]}


def cell(flies: int, speed: float, threads: int = 1, unstable: int = 0) -> results.Row:
    return {
        "physics": "fast",
        "terrain": "flat",
        "threads": threads,
        "flies": flies,
        "steps_per_s": speed,
        "real_time": speed * 1e-3,
        "unstable": unstable,
    }


def test_engine_table_has_a_column_per_number_of_flies_and_marks_unstable_ones() -> None:
    rows = [cell(64, 4000.0, unstable=1), cell(1, 1500.0), cell(64, 9000.0, threads=2)]
    head, one, two, note = part_table("engine", rows).splitlines()
    assert head.split() == ["physics", "terrain", "threads", "1", "flies", "64", "flies"]
    assert one.split() == ["fast", "flat", "1", "1,500", "(1.50)", "4,000", "(4.00)!"]
    assert two.split() == ["fast", "flat", "2", "-", "9,000", "(9.00)"]
    assert note.strip().startswith("!")
    assert part_table("rendering", [{"note": "not measured: no GL"}]) == (
        "  rendering: not measured: no GL"
    )


def test_what_is_stored_is_printed_in_order_with_the_machine_where_it_changes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "new" / "speed.json"
    main(["--show", "--output", str(path)])
    assert capsys.readouterr().out == "nothing measured yet\n"
    later = {**part(physics="fast", steps_per_s=1234.0), "machine": MACHINE | {"cpu": "quipu"}}
    results.write(path, {"worm": later, "overhead": later, "engine": part(**cell(1, 5.0))})
    main(["--show", "--output", str(path)])
    shown = capsys.readouterr().out
    places = [shown.index(text) for text in ("abacus", "engine:", "quipu", "overhead:", "worm:")]
    assert places == sorted(places)
    assert shown.count("quipu, cores: 3, mujoco 4.0") == 1
    assert shown.count("1,234") == 2


def test_a_larger_batch_repeats_the_settled_flies() -> None:
    scene, start = engine.settled_scene("fast", "flat", 5, most=2)
    np.testing.assert_array_equal(start[[0, 1, 0]], start[[2, 3, 4]])
    assert np.any(start[0] != start[1])
    flies = FlyBatch(scene, 5, 1)
    flies.restore(start)
    np.testing.assert_allclose(flies.state().time, engine.SETTLING_S)
    assert engine.steps_per_second(flies, start, 0.01) > 0
    assert flies.state().time[0] <= engine.SETTLING_S + engine.WINDOW_S + 1e-9


def test_worms_are_timed_by_name() -> None:
    rows = engine.measure_worms(0.01, worms=2)
    assert [row["worm"] for row in rows] == list(WORMS)
    assert all(row["steps_per_s"] > 0 and not row["unstable"] for row in rows)


def test_the_bare_replay_must_end_where_the_recording_did() -> None:
    env = BatchedEnv(EnvConfig(physics="fast"), 2, num_threads=1)
    recording = overhead.record(env, np.ones((2, 2)), 20)
    bare = overhead.Batch(env.batch.scene.model, 2, 1)
    assert overhead.replay(bare, env.batch.scene, recording) > 0
    recording.controls[1, 5, :3] += 0.1
    with pytest.raises(RuntimeError, match="left the recorded trajectory"):
        overhead.replay(bare, env.batch.scene, recording)
