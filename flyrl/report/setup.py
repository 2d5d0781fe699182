"""Task, control loop and trainings of an evaluation, for the report's template."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from flyrl.evaluation.rows import Json

_LONGEST: Final = 400
"""Characters of a text from a policy file that are shown."""


class Part(NamedTuple):
    """A part of the control loop, and what it sends to the next.

    Attributes
    ----------
    name, lines
        Title, and lines of text below it.
    sends
        Lines of text beside the arrow to the next part; none from the last.
    is_learned
        Whether training changes it.
    """

    name: str
    lines: tuple[str, ...]
    sends: tuple[str, ...] = ()
    is_learned: bool = False


def control_loop(protocol: Json) -> list[Part]:
    """Parts of the control loop from the policy to the ground; the last one's senses close it."""
    policy, world = ("“brain”: learned,", "or fixed by hand"), Part("body and ground", ("MuJoCo",))
    if protocol["table"]["actions"] == "neurons":
        return [
            Part("policy", policy, ("motor", "neurons"), is_learned=True),
            Part("muscles", ("motor pools",), ("tensions",)),
            world,
        ]
    has_muscles = bool((protocol.get("body") or {}).get("muscles"))
    return [
        Part("policy", policy, ("drive", "left, right"), is_learned=True),
        Part("leg controller", ("in place of the", "ventral nerve cord"), ("angles,", "adhesion")),
        Part("muscles" if has_muscles else "servos", ("of 42 joints",), ("torques",)),
        world,
    ]


def trainings_section(entrants: Sequence[Json]) -> list[dict[str, str]]:
    """Algorithm, decisions, seed and settings of each learned entrant, as its file tells them."""
    return [
        {
            "name": entrant["name"],
            "algo": _text(training.get("algo")),
            "decisions": _text(training.get("decisions")),
            "seed": _text(training.get("seed")),
            "settings": _text(
                {
                    **_mapping(settings.get("algo")),
                    "num_envs": _mapping(settings.get("training")).get("num_envs"),
                }
            ),
        }
        for entrant in entrants
        if entrant.get("kind") == "learned"
        for training in [_mapping(entrant.get("training"))]
        for settings in [_mapping(training.get("settings"))]
    ]


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _text(value: Any) -> str:
    """A value of a policy file; "not recorded" without one, settings with commas in between."""
    if isinstance(value, Mapping):
        value = ", ".join(
            f"{key} {each}" for key, each in value.items() if key != "name" and each is not None
        )
    text = "not recorded" if value in (None, "") else str(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} …"
