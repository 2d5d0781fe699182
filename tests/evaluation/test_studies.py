import pytest

from flyrl.evaluation.studies import EQUAL_WITHIN, Claim, Study, judge

FURTHER = Claim("hybrid", "cpg", "mixed")
AS_FAR = Claim("hybrid", "cpg", "mixed", is_equal=True)


def summary(low, high, *, reference="cpg", mean=10.0, condition=""):
    """What came out for hybrid and cpg, with an interval of (the other one) - reference."""
    other = {"cpg": "hybrid", "hybrid": "cpg"}[reference]
    value = None if low is None else (low + high) / 2
    difference = {"value": value or 1.0, "low": low, "high": high, "n": 20}
    paired = {"reference": reference, "differences": {"speed_mm_s": difference}}
    metrics = {"speed_mm_s": {"mean": mean}}
    common = {"terrain": "mixed", "condition": condition, "metrics": metrics}
    return [
        {**common, "controller": reference, "paired": None},
        {**common, "controller": other, "paired": paired},
    ]


def verdict(claim, rows):
    study = Study("", "", "speed_mm_s", (claim,), ())
    (judgement,) = judge(study, rows)
    return judgement["verdict"]


@pytest.mark.parametrize(
    ("claim", "low", "high", "reference", "expected"),
    [
        (FURTHER, 0.5, 2.0, "cpg", "holds"),
        (FURTHER, -0.1, 2.0, "cpg", "inconclusive"),
        (FURTHER, -2.0, -1.0, "cpg", "does not hold"),
        (FURTHER, None, None, "cpg", "inconclusive"),
        (AS_FAR, -0.9, 0.9, "cpg", "holds"),
        (AS_FAR, -0.5, 1.1, "cpg", "inconclusive"),
        (AS_FAR, 2.0, 3.0, "cpg", "does not hold"),
        # the other way round
        (FURTHER, -2.0, -0.5, "hybrid", "holds"),
        (FURTHER, 0.5, 2.0, "hybrid", "does not hold"),
    ],
)
def test_an_interval_decides(claim, low, high, reference, expected):
    assert EQUAL_WITHIN == 0.1
    assert verdict(claim, summary(low, high, reference=reference)) == expected


def test_another_ground_and_a_fly_that_was_changed_say_nothing():
    assert verdict(Claim("hybrid", "cpg", "blocks"), summary(1.0, 2.0)) == "not tested"
    assert verdict(FURTHER, summary(1.0, 2.0, condition="friction=0.5")) == "not tested"
