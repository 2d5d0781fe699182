import numpy as np
import pytest

from benchmarks.fidelity.steering import Row
from benchmarks.fidelity.steering_table import (
    fall_rate,
    fall_ratio,
    paired_falls,
    pairs,
    percentile,
    table,
    tilt_counts,
    tilt_ratio,
)


def run(seed: int, outcome: str = "timeout", **changes: object) -> Row:
    about = {"physics": "balanced", "terrain": "blocks", "kind": "turn", "seed": seed}
    found = {"outcome": outcome, "seconds": 1.5, "tilt_deg": [1, 2, 9], "speed": 8.0, "yaw_deg": 90}
    return {**about, **found, **changes}


def hundred(falls: int, **changes: object) -> list[Row]:
    return [run(seed, "fall" if seed < falls else "timeout", **changes) for seed in range(100)]


FELL, FEWER = hundred(30), hundred(20)


def test_differences_and_ratios_of_falls_are_paired() -> None:
    """Ten runs of a hundred differ: the error is that of a share of 0.1, 0.03, not of 0.3."""
    found = paired_falls(FELL, FEWER)
    assert found == pytest.approx((0.1, 0.1 - 1.96 * 0.03, 0.1 + 1.96 * 0.03), abs=0.01)
    assert found.value == pytest.approx(0.1)
    ratio = fall_ratio(FELL, FEWER)
    assert ratio.value == pytest.approx(1.5)
    assert 1.1 < ratio.low < 1.5 < ratio.high < 2.2
    assert np.isnan(fall_ratio(FELL, hundred(0))).all()
    assert fall_rate([run(0), run(1, "fall", seconds=0.5)]) == 0.5
    first, second = pairs([run(2), run(1)], [run(1, "fall"), run(3), run(2)])
    assert [row["seed"] for row in first] == [row["seed"] for row in second] == [1, 2]


@pytest.mark.parametrize(("percent", "degrees"), [(5, 0), (50, 1), (60, 1), (61, 3), (100, 3)])
def test_percentiles_of_counted_tilts(percent: float, degrees: int) -> None:
    """0, 0, 1, 1, 1, 1, 3, 3, 3, 3: a tenth of the samples each."""
    assert percentile(np.array([2, 4, 0, 4]), percent) == degrees


def test_ratio_of_tilts() -> None:
    steeper, level = hundred(0, tilt_deg=[20] * 10), hundred(0, tilt_deg=[10] * 10)
    assert tuple(tilt_ratio(steeper, level)) == (2.0, 2.0, 2.0)
    counts = tilt_counts([run(0), run(1, tilt_deg=[])])
    assert counts.shape == (2, 181)
    assert counts.sum(axis=0)[[1, 2, 9]].tolist() == [1, 1, 1]


def test_the_table_sets_presets_and_the_published_package_beside_reference() -> None:
    reference, published = hundred(20, physics="reference"), hundred(20, physics="flygym")[:14]
    _, first, second, third, fourth = table(published, [*reference, *FELL]).splitlines()
    assert first.split()[:5] == ["blocks", "turn", "reference", "100", "20.0%"]
    assert second.split()[:5] == ["blocks", "turn", "balanced", "100", "30.0%"]
    assert "+10.0% [+" in second and "1.50 [1." in second and "1.00 [1.00, 1.00]" in second
    assert third.split()[2:5] == ["(reference)", "14", "100.0%"]
    assert fourth.split()[2:5] == ["flygym", "14", "100.0%"]
    lost = table([], [run(0), run(1, "unstable")])
    assert lost.splitlines()[-1] == "blew up: blocks turn balanced, seed 1"
