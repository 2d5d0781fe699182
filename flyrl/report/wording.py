"""Words and numbers of a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import pandas as pd

from flyrl.evaluation.conditions import compared_conditions
from flyrl.evaluation.episodes import Json
from flyrl.evaluation.metrics import metric_label
from flyrl.evaluation.summary import Leader
from flyrl.evaluation.trainings import trainings
from flyrl.policies.laws import split_legs

NOTHING: Final = 1e-9
"""Numbers closer to 0 are written as 0."""

_SHARED: Final = ("goal", "command", "pushes")
"""Fields of an episode that are named where they hold something."""


def is_taught(entrant: Json) -> bool:
    """Whether an entrant may have been trained."""
    return entrant.get("kind") in ("learned", "own")


def headline(leaders: Sequence[Leader], controllers: int, condition: str = "") -> str:
    """Best controllers by terrain in one sentence.

    Parameters
    ----------
    leaders
        The best on each terrain.
    controllers
        How many took part.
    condition
        Under which the leaders were found; empty where nothing was varied.
    """
    winners: dict[frozenset[str], list[Leader]] = {}
    for leader in leaders:
        winners.setdefault(frozenset(leader.names), []).append(leader)
    text = "; ".join(_verdict(own, controllers) for own in winners.values())
    text = f"With {condition}: {text}" if condition else text
    # names are written as they are, also at the start
    text = f"N{text[1:]}" if text.startswith("no meaningful") else text
    return f"{text}."


def _verdict(leaders: Sequence[Leader], controllers: int) -> str:
    """Clause on terrains with the same leaders."""
    names, where = leaders[0].names, f"on {_listed([leader.terrain for leader in leaders])}"
    if controllers == 1:
        return f"{names[0]} {where}"
    if len(names) == 1:
        return f"{names[0]} is best {where}"
    if len(names) == controllers:
        return f"no meaningful difference between controllers {where}"
    return f"{_listed(names)} are level at the top {where}"


def usual_condition(protocol: Json) -> str:
    """Condition that the summary is about, and that it changes nothing if so; empty without any."""
    usual = compared_conditions(protocol["vary"])[0]
    if usual.name and usual.is_usual:
        return f"nothing changed ({usual.label})"
    return usual.label


def changes_text(leaders: Sequence[Leader], usual: Sequence[Leader]) -> str:
    """Sentence on how often other conditions have the same leaders; empty without others.

    Parameters
    ----------
    leaders
        The best on each terrain under each condition.
    usual
        Those under the usual one.
    """
    same: dict[str, list[bool]] = {}
    best = {each.terrain: each for each in usual}
    for each in leaders:
        known = best.get(each.terrain)
        if known and each.condition != known.condition:
            same.setdefault(each.terrain, []).append(set(each.names) == set(known.names))
    if not same:
        return ""
    counts = [f"{sum(found)} of {len(found)} on {terrain}" for terrain, found in same.items()]
    return f"Of the other conditions, the leaders are the same under {_listed(counts)}."


def leaders_by_condition(leaders: Sequence[Leader]) -> dict[str, dict[str, tuple[Leader, str]]]:
    """Condition -> terrain -> the best there, with their mean and lead in words.

    Parameters
    ----------
    leaders
        The best on each terrain under each condition.
    """
    table: dict[str, dict[str, tuple[Leader, str]]] = {}
    for leader in leaders:
        cells = leader_cells(leader)
        ahead = f"{cells['difference']} to {leader.next_name}" if leader.next_name else "all level"
        text = f"{cells['value']}; {ahead}"
        table.setdefault(leader.condition, {})[leader.terrain] = (leader, text)
    return table


def effects_text(protocol: Json) -> str:
    """Smallest effects of interest of the decisive metrics; empty without any on record."""
    parts = []
    for metric in protocol["decisive"]:
        if effect := protocol["smallest_effects"].get(metric):
            scale, (name, unit) = 1, _name_and_unit(metric_label(metric))
            if metric == "success":
                scale, unit = 100, "%"
            amount = f"{scale * effect:g}\u00a0{unit}".rstrip("\u00a0")
            parts.append(f"{amount} in {name}")
    return " or ".join(parts)


def _name_and_unit(label: str) -> tuple[str, str]:
    """`("speed", "mm/s")` of the label `speed (mm/s)`."""
    name, _, unit = label.partition(" (")
    return name, unit.removesuffix(")")


def training_note(protocol: Json) -> str:
    """Number of training seeds behind each learned policy, with a caution at one."""
    found = trainings(protocol["entrants"])
    # those that were put on other legs were not trained once more
    found = {each: names for each, names in found.items() if not split_legs(names[0])[1]} or found
    parts = [
        f"{label}: {len(names)} training seed{'s' if len(names) > 1 else ''}"
        for label, names in found.items()
    ]
    single = any(len(names) == 1 for names in found.values())
    caution = " (other seeds may do better or worse)" if single else ""
    text = f"{'; '.join(parts)}{caution}." if parts else ""
    return text[:1].upper() + text[1:]


def contrast_text(protocol: Json, terrain: str) -> str:
    """Sentence on why an episode was chosen to be filmed; empty where none was chosen."""
    chosen = protocol.get("film", {}).get(terrain)
    if not chosen:
        return ""
    start = f"Episode {chosen['episode']}: the"
    if "metric" not in chosen:
        return f"{start} first, since no learned policy differs from the reference here."
    names, values = [chosen["controller"], chosen["reference"]], chosen["values"]
    if chosen["metric"] == "success":
        better, worse = sorted(names, key=lambda name: -values[names.index(name)])
        does = "reaches the target" if protocol["task"] == "target" else "succeeds"
        text = f"{start} first in which {better} {does} and {worse} does not"
        return f"{text}." if better == names[0] else f"{text}; the other way round there is none."
    name, unit = _name_and_unit(metric_label(chosen["metric"]))
    own, other = map(format_number, values)
    difference = f"{name}, {own} against {other} {unit}".rstrip()
    return f"{start} one in which {_listed(names)} differ most in {difference}."


def shared_text(drawn: Mapping[str, Sequence[Json]]) -> str:
    """Properties of an episode that all controllers share."""
    first = next((episodes[0] for episodes in drawn.values() if len(episodes)), {})
    return ", ".join(["same start", *(f"same {key}" for key in _SHARED if first.get(key))])


def held_out_text(protocol: Json) -> str:
    """Statement on whether policies were trained on the evaluation's episodes, where known.

    flyrl trains on seeds below those of evaluations; only its own trainings record their settings.
    """
    learned = [each for each in protocol["entrants"] if is_taught(each)]
    known = [each["name"] for each in learned if (each.get("training") or {}).get("settings")]
    unknown = [each["name"] for each in learned if each["name"] not in known]
    parts = []
    if known:
        parts.append(f"As recorded, {_listed(known)} trained in flyrl, on episodes of other seeds.")
    if unknown:
        parts.append(f"Nothing is recorded of the episodes that {_listed(unknown)} may know.")
    return " ".join(parts)


def rates(summary: Sequence[Json], protocol: Json) -> str:
    """Sentence on the success of the best learned policy and of the best of the others.

    Without a learned policy the best controller is spoken of first.
    """
    learned = [each["name"] for each in protocol["entrants"] if each.get("kind") == "learned"]
    counts = pd.DataFrame(summary).groupby("controller", sort=False)[["successes", "episodes"]]
    shares = counts.sum()["successes"] / counts.sum()["episodes"]
    is_learned = shares.index.isin(learned)
    first = str((shares[is_learned] if is_learned.any() else shares).idxmax())
    text = f"{first} succeeds in {_rates(summary, first)}."
    others = shares[~is_learned & (shares.index != first)]
    if len(others):
        best = str(others.idxmax())
        text += f" Best of the others is {best}, in {_rates(summary, best)}."
    return text


def leader_cells(leader: Leader) -> dict[str, str]:
    """Cells of a leader in a table: its value, the next's, the difference with its interval."""
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
    text = format_number(scale * value)
    return f"+{text}" if value > 0 and text != "0" else text


def _rates(summary: Sequence[Json], name: str) -> str:
    parts = []
    for row in summary:
        if row["controller"] == name:
            where = f" ({row['condition']})" if row["condition"] else ""
            rate = row["success_rate"]
            parts.append(
                f"{row['successes']} of {row['episodes']} episodes on {row['terrain']}{where} "
                f"({percent(rate['value'])}\u00a0%, "
                f"95\u00a0% interval {interval_text(rate)}\u00a0%)"
            )
    return _listed(parts)


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def percent(share: float | None) -> str:
    """A share in per cent, as a whole number; a dash for None."""
    return format_number(None) if share is None else str(round(100 * share))


def interval_text(interval: Mapping[str, Any]) -> str:
    """`low to high` of the interval of a share, in per cent."""
    return f"{percent(interval['low'])} to {percent(interval['high'])}"


def format_number(value: float | None, digits: int = 3) -> str:
    """`value` to `digits` significant digits, without an exponent; a dash for None.

    Below 1 the first zero counts as a digit, but two others are shown; what is left of 0 by
    rounding errors (`NOTHING`) is 0.
    """
    if value is None:
        return "\u2013"
    if abs(value) < NOTHING:
        return "0"
    shown = digits if abs(value) >= 1 else max(2, digits - 1)
    exponent = int(f"{value:.{shown - 1}e}".partition("e")[2])  # after rounding: 9.996 is 10.0
    if exponent >= 0:
        shown = digits
    return f"{value:.{max(0, shown - 1 - exponent)}f}".replace("-", "\u2212")


def parameters_text(protocol: Json) -> str:
    """Parameters of the task except its time limit, as `key=value`; empty without any."""
    own = {key: value for key, value in protocol.get("parameters", {}).items() if value is not None}
    own.pop("time_limit", None)
    if constant_s := protocol.get("drive_time_constant"):
        own["drive_time_constant"] = constant_s
    return ", ".join(f"{key}={str(value).replace(' ', '')}" for key, value in own.items())


def outcome_name(outcome: str) -> str:
    """Outcome of an episode, in words."""
    return "time out" if outcome == "timeout" else outcome.replace("_", " ")
