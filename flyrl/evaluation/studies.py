"""Published studies: their claims, their measurements, and whether the claims hold here."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

Json = Mapping[str, Any]
Verdict = Literal["holds", "does not hold", "inconclusive", "not tested"]

EQUAL_WITHIN: Final = 0.1
"""Means that differ by less than this share of the larger one are called equal."""


@dataclass(frozen=True)
class Claim:
    """Claim that one controller covers more ground than another, or as much, on a terrain.

    Attributes
    ----------
    better, other
        Names of the two; if they are said to be equal, in any order.
    terrain
        Where.
    is_equal
        Whether they are said to be equal.
    """

    better: str
    other: str
    terrain: str
    is_equal: bool = False

    @property
    def text(self) -> str:
        """The claim, in words."""
        relation = "walks as far as" if self.is_equal else "walks further than"
        return f"{self.better} {relation} {self.other} on {self.terrain}"


@dataclass(frozen=True)
class Figures:
    """Published measurements of one of our metrics, run by run, by terrain and controller.

    `body` names the fly that was measured, as in `flyrl.envs.config.BODIES`.
    """

    metric: str
    source: str
    body: str
    values: Mapping[tuple[str, str], tuple[float, ...]]


@dataclass(frozen=True)
class Study:
    """A published comparison.

    Attributes
    ----------
    title
        Of the comparison.
    source
        Where it was published.
    metric
        By which we judge its claims.
    claims
        The statement, in words.
    figures
        What was measured, by its authors or others.
    """

    title: str
    source: str
    metric: str
    claims: tuple[Claim, ...]
    figures: tuple[Figures, ...]


_ROUGH: Final = ("gapped", "blocks", "mixed")
"""Terrains of the study, whatever others flyrl may have."""

STUDIES: Final[Mapping[str, Study]] = {
    "controller_comparison": Study(
        title="Leg controllers on flat and rough ground",
        source="Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y",
        metric="speed_mm_s",
        claims=(
            *(
                Claim("hybrid", other, terrain)
                for terrain in _ROUGH
                for other in ("cpg", "rule_based")
            ),
            Claim("hybrid", "cpg", "flat", is_equal=True),
        ),
        figures=(
            Figures(
                "speed_mm_s",
                "flygym-gymnasium 1.3.2, four runs of 1.5 s from seeds 0 to 3",
                "current",
                {
                    ("flat", "cpg"): (14.3, 14.4, 14.4, 14.4),
                    ("flat", "rule_based"): (10.2, 11.1, 10.5, 10.2),
                    ("flat", "hybrid"): (14.1, 13.8, 14.3, 14.0),
                    ("gapped", "cpg"): (13.8, 4.2, 4.0, 2.9),
                    ("gapped", "rule_based"): (7.1, 0.7, 8.9, 8.3),
                    ("gapped", "hybrid"): (13.2, 11.1, 10.7, 11.7),
                },
            ),
        ),
    ),
}


def judge(study: Study, summary: Sequence[Json]) -> list[Json]:
    """Put a study's claims to the test.

    That one walks further holds where the interval of the paired difference lies above zero, and
    does not hold where it lies below. That both walk as far holds where it lies within
    `EQUAL_WITHIN` of the larger mean, and does not hold where it lies outside. Any other interval,
    and none, is inconclusive; a pair that was not compared is not tested.

    Parameters
    ----------
    summary
        Of results whose reference is one of the two controllers of a claim.

    Returns
    -------
    Per claim: the `claim`; the mean `difference` better - other with its interval, or None; and the
    `verdict`.
    """
    rows = {(row["terrain"], row["controller"]): row for row in summary if not row["condition"]}
    return [_judge(claim, study.metric, rows) for claim in study.claims]


def _judge(claim: Claim, metric: str, rows: Mapping[tuple[str, str], Json]) -> Json:
    names = (claim.better, claim.other)
    both = [rows.get((claim.terrain, name)) for name in names]
    for row, other, sign in zip(both, names[::-1], (1, -1), strict=True):
        paired = (row or {}).get("paired")
        if not paired or paired["reference"] != other or metric not in paired["differences"]:
            continue
        found = paired["differences"][metric]
        low, high = (
            None if found[end] is None else sign * found[end] for end in ("low", "high")[::sign]
        )
        difference = {"value": sign * found["value"], "low": low, "high": high, "n": found["n"]}
        margin = EQUAL_WITHIN * max(row["metrics"][metric]["mean"] for row in both if row)
        bounds = (-margin, margin) if claim.is_equal else (0.0, math.inf)
        verdict = _verdict(low, high, *bounds)
        return {"claim": claim, "difference": difference, "verdict": verdict}
    return {"claim": claim, "difference": None, "verdict": "not tested"}


def _verdict(low: float | None, high: float | None, least: float, most: float) -> Verdict:
    """Verdict on a difference that is claimed to lie between `least` and `most`."""
    if low is None or high is None:
        return "inconclusive"
    if least < low and high < most:
        return "holds"
    return "does not hold" if high < least or low > most else "inconclusive"
