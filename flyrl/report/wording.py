"""What a report says in words and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flyrl.evaluation.leaders import Leader
from flyrl.evaluation.rows import Json


def headline(leaders: Sequence[Leader], controllers: int) -> str:
    """Who wins where, in one sentence.

    Parameters
    ----------
    leaders
        The best on each terrain.
    controllers
        How many took part.
    """
    if controllers == 1:
        return f"{leaders[0].names[0]} on {_listed([leader.terrain for leader in leaders])}."
    winners: dict[tuple[str, ...], list[str]] = {}
    for leader in leaders:
        winners.setdefault(leader.names, []).append(leader.terrain)
    parts = []
    for names, terrains in winners.items():
        where = f"on {_listed(terrains)}"
        if len(names) == 1:
            parts.append(f"{names[0]} wins {where}")
        elif len(names) == controllers:
            parts.append(f"nobody is told apart from the others {where}")
        else:
            parts.append(f"{_listed(names)} are level at the top {where}")
    text = "; ".join(parts)
    # names are written as they are, also at the start
    return f"{text.replace('nobody', 'Nobody', 1) if text.startswith('nobody') else text}."


def rates(summary: Sequence[Json], protocol: Json) -> str:
    """How often the best learned policy succeeds, beside the best of the others, with intervals.

    Without a learned policy the best controller is spoken of first.
    """
    names = list(dict.fromkeys(row["controller"] for row in summary))
    kinds = {entrant["name"]: entrant.get("kind") for entrant in protocol["entrants"]}
    learned = [name for name in names if kinds.get(name) == "learned"]
    first = max(learned or names, key=lambda name: _share(summary, name))
    others = [name for name in names if name != first and name not in learned]
    verb, noun = ("reaches", "targets") if protocol["task"] == "target" else ("solves", "episodes")
    rows = [row for row in summary if row["controller"] == first]
    parts = [f"{row['successes']} of {row['episodes']} {noun} on {_place(row)}" for row in rows]
    text = f"{first} {verb} {_listed(parts)}: {_rates(rows)}."
    if others:
        best = max(others, key=lambda name: _share(summary, name))
        text += f" Best of the others, {best}: "
        text += f"{_rates([row for row in summary if row['controller'] == best])}."
    return text


def leader_cells(leader: Leader) -> dict[str, str]:
    """What a table says of a leader: its value, the next's, the difference with its interval."""
    scale, unit = (100, "\u00a0%") if leader.metric == "success" else (1, "")
    cells = {"value": f"{format_number(scale * leader.value)}{unit}", "next": "", "difference": ""}
    if leader.difference is not None and leader.next_value is not None:
        cells["next"] = f"{format_number(scale * leader.next_value)}{unit}"
        cells["difference"] = signed(leader.difference.value, scale)
        if leader.difference.low is not None:
            ends = (signed(end, scale) for end in (leader.difference.low, leader.difference.high))
            cells["difference"] += f" [{', '.join(ends)}]"
    return cells


def signed(value: float | None, scale: float = 1) -> str:
    """`scale` times a number, with a sign if it is above 0."""
    if value is None:
        return format_number(None)
    return f"{'+' if value > 0 else ''}{format_number(scale * value)}"


def _share(summary: Sequence[Json], name: str) -> float:
    rows = [row for row in summary if row["controller"] == name]
    return float(sum(row["successes"] for row in rows) / sum(row["episodes"] for row in rows))


def _rates(rows: Sequence[Json]) -> str:
    return ", ".join(
        f"{100 * row['success_rate']['value']:.0f}\u00a0% on {_place(row)} "
        f"(95\u00a0% interval {interval_text(row['success_rate'], 100)}\u00a0%)"
        for row in rows
    )


def _place(row: Json) -> str:
    """Terrain and condition, where there is one."""
    return f"{row['terrain']} ({row['condition']})" if row["condition"] else str(row["terrain"])


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def interval_text(interval: Mapping[str, Any], scale: float = 1) -> str:
    """`low to high` of an interval, in whole numbers of 1 / `scale`."""
    return f"{scale * interval['low']:.0f} to {scale * interval['high']:.0f}"


def format_number(value: float | None, digits: int = 3) -> str:
    """`value` to `digits` significant digits, without an exponent; a dash for None."""
    if value is None:
        return "\u2013"
    if value == 0:
        return "0"
    whole = len(str(int(abs(value)))) if abs(value) >= 1 else 0
    return f"{value:.{max(0, digits - max(whole, 1))}f}".replace("-", "\u2212")


def title(protocol: Json, summary: Sequence[Json]) -> str:
    """Task and terrains."""
    terrains = ", ".join(dict.fromkeys(row["terrain"] for row in summary))
    return f"{protocol['task']} on {terrains}"


def outcome_name(outcome: str) -> str:
    """How an episode ended, in words."""
    return "time out" if outcome == "timeout" else outcome.replace("_", " ")
