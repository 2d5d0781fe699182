"""Medians beside the reference's, and paired comparisons."""

import numpy as np
import pytest

from benchmarks.fidelity.verdict import compare_hybrid, reference_speed, verdict


def run(controller: str, seed: int, speed: float, outcome: str = "timeout", **about: str):
    place = {"terrain": "blocks", "physics": "balanced", "controller": controller}
    return {**place, "seed": seed, "outcome": outcome, "statistics": {"speed": speed}, **about}


def test_earlier_runs_count_in_the_reference() -> None:
    found = [run("cpg", 0, 20.0, terrain="flat"), run("cpg", 1, 30.0, terrain="flat")]
    # 14.3, 14.4, 14.4, 14.4, 20, 30
    assert reference_speed(found, "flat", "cpg") == pytest.approx(14.4)
    assert reference_speed([run("cpg", 0, 8.0)], "blocks", "cpg") == 8.0


def test_the_hybrid_is_compared_seed_by_seed() -> None:
    """Every fly is 2 mm/s faster with the hybrid, however fast; a seed alone is left out."""
    flies = np.arange(1.0, 11.0)
    found = [run("cpg", seed, 2 * speed) for seed, speed in enumerate(flies)]
    found += [run("hybrid", seed, 2 * speed + 2) for seed, speed in enumerate(flies)]
    found += [run("hybrid", 99, 1000.0), run("cpg", 99, 1.0, outcome="unstable")]
    comparison = compare_hybrid(found, "blocks", "cpg")
    assert (comparison.low, comparison.high) == pytest.approx((2.0, 2.0))
    assert comparison.ratio == pytest.approx(11.0 / 13.0)


def test_an_interval_is_wide_where_flies_differ() -> None:
    found = [run("cpg", seed, 20.0) for seed in range(20)]
    found += [run("hybrid", seed, 20.0 + 10.0 * (-1) ** seed) for seed in range(20)]
    comparison = compare_hybrid(found, "blocks", "cpg")
    assert comparison.low < -2.0
    assert comparison.high > 2.0


def test_a_line_needs_five_runs_of_all_controllers() -> None:
    found = [
        run(name, seed, float(seed))
        for name in ("cpg", "rule_based", "hybrid")
        for seed in range(5)
    ]
    reference = [run(name, 0, 4.0) for name in ("cpg", "rule_based", "hybrid")]
    assert "hybrid  2.00 (0.50)" in verdict(reference, found)
    assert "blocks" not in verdict(reference, found[:-1])
