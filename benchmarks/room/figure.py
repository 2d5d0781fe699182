"""Picture of the room: what laws and the bound reach, condition by condition."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import matplotlib.pyplot as plt
import numpy as np

from flyrl.evaluation.statistics import success_rate
from flyrl.files import replacing

ENOUGH: Final = 0.85
"""Share of successes from which on a law is enough: above it there is no room to speak of."""

LEAST_ROOM: Final = 0.15
"""Between the better law and the bound, from which on learning is worth a try."""

LAWS: Final = ("tuned", "published", "usual")

_WHO: Final = {
    "published": ("law as published", "#9a9a9a"),
    "usual": ("flyrl's law", "#56b4e9"),
    "tuned": ("law tuned here", "#0072b2"),
    "robust": ("robust bound", "#cc79a7"),
    "bound": ("bound", "#d55e00"),
    "policy": ("learned", "#009e73"),
}


def rate(row: Mapping[str, Any], who: str) -> float:
    """Share of successes of a law or of a bound."""
    return float(np.mean(row[who]["success"]))


def better_law(row: Mapping[str, Any], first: int | None = None) -> str:
    """Law that succeeds most often, of those that walked, in all or in the first episodes."""
    walked = [law for law in LAWS if law in row]
    return max(walked, key=lambda law: float(np.mean(row[law]["success"][:first])))


def room(row: Mapping[str, Any]) -> float:
    """Success rate of the bound less that of the better law."""
    return rate(row, "bound") - rate(row, better_law(row))


def verdict(row: Mapping[str, Any]) -> str:
    """Whether a law is enough, there is room above both, or luck, or nothing helps much.

    It is luck where a planner that must not count on the very future reaches little more.
    """
    if room(row) >= LEAST_ROOM:
        if "robust" not in row:
            return "room"
        robust = row["robust"]["success"]
        law = better_law(row, len(robust))
        on_the_same = np.mean(row[law]["success"][: len(robust)])
        return "luck" if np.mean(robust) - on_the_same < LEAST_ROOM else "room"
    return "law" if rate(row, better_law(row)) >= ENOUGH else "nothing"


def draw(results: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Draw shares of successes with their 95 % intervals, most room on top; SVG or PNG."""
    ordered = sorted(results, key=lambda name: room(results[name]))
    figure, axes = plt.subplots(figsize=(7.0, 1.2 + 0.28 * len(ordered)), layout="constrained")
    offsets = np.linspace(0.35, -0.35, len(_WHO))
    for offset, (who, (label, colour)) in zip(offsets, _WHO.items(), strict=True):
        rows = [{**results[name], **results[name].get("learned", {})} for name in ordered]
        places = [i for i, row in enumerate(rows) if who in row]
        if not places:
            continue
        rates = [
            success_rate(sum(each), len(each)) for each in (rows[i][who]["success"] for i in places)
        ]
        values = np.array([[each.low, each.value, each.high] for each in rates], dtype=float)
        spread = np.abs(values[:, [0, 2]] - values[:, [1]]).T
        axes.errorbar(
            100 * values[:, 1], np.array(places) + offset, xerr=100 * spread, label=label,
            color=colour, fmt="o", markersize=4, linewidth=1,
        )  # fmt: skip
    for place, name in enumerate(ordered):
        if verdict(results[name]) == "room":
            axes.axhspan(place - 0.5, place + 0.5, color="#f0e442", alpha=0.25, linewidth=0)
    axes.set_yticks(range(len(ordered)), [name.replace("_", " ") for name in ordered])
    axes.set(
        xlabel="successes, % (95 % intervals)", xlim=(-2, 102), ylim=(-0.6, len(ordered) - 0.4)
    )
    figure.legend(loc="outside upper center", ncols=6, frameon=False, handlelength=1, fontsize=8)
    with replacing(path) as partial:
        figure.savefig(partial, format=path.suffix[1:])
    plt.close(figure)
