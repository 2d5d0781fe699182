"""Task, control loop, trainings and origin of an evaluation, for the report's template."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from markupsafe import Markup

from flyrl.evaluation.results import Json, Results, episodes_digest
from flyrl.evaluation.trainings import Generalisation, generalisation, trainings
from flyrl.report.curves import Evaluations, learning_curves_svg
from flyrl.report.sections import usual_rows
from flyrl.validation import plain_record

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


def generalisation_section(results: Results) -> Generalisation | None:
    """Every training on every terrain; None where there is but one terrain."""
    rng = np.random.default_rng(results.protocol["seed"])
    return generalisation(results.protocol, usual_rows(results), rng)


def curves_section(entrants: Sequence[Json], curves: Mapping[str, Evaluations]) -> str:
    """Figure of the learning curves, a line per training; empty without an evaluation.

    Parameters
    ----------
    entrants
        Of the protocol.
    curves
        As in `flyrl.report.html.Additions`.
    """
    groups = [
        (label, [curves[name] for name in names if curves.get(name)])
        for label, names in trainings(entrants).items()
    ]
    if not any(runs for _, runs in groups):
        return ""
    return Markup(learning_curves_svg(groups, "learning-curves"))


ORIGIN_SCHEMA: Final = "flyrl.report/1"
ORIGIN_ID: Final = "origin"
"""Of the element in a report that says how to repeat it."""


def origin_json(results: Results) -> str:
    """JSON from which the evaluation can be repeated and compared, to stand in a script element."""
    protocol = results.protocol
    origin = {
        "schema": ORIGIN_SCHEMA,
        "settings": protocol["settings"],
        "versions": protocol["versions"],
        "policies": {entrant["name"]: entrant["sha256"] for entrant in protocol["entrants"]},
        "episodes_sha256": episodes_digest(results.episodes),
    }
    return json.dumps(origin).replace("<", "\\u003c")


def read_origin(path: Path) -> Json:
    """What a report holds of where it comes from: settings, versions, hashes.

    Raises
    ------
    ValueError
        The file is no report, or of another version.
    OSError
        It cannot be read.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    found = re.search(rf'<script type="application/json" id="{ORIGIN_ID}">(.*?)</script>', text)
    try:
        origin: Json = json.loads(found.group(1)) if found else {}
    except (ValueError, RecursionError):
        origin = {}
    if not isinstance(origin, dict) or origin.get("schema") != ORIGIN_SCHEMA:
        raise ValueError(f"{path} is no report of this version of flyrl")
    plain_record("the origin", origin)
    for key in ("settings", "versions", "policies"):
        if not isinstance(origin.get(key), dict):
            raise ValueError(f"{path}: {key!r} must be an object, got {origin.get(key)!r:.60}")
    if not isinstance(digest := origin.get("episodes_sha256"), str):
        raise ValueError(f"{path}: 'episodes_sha256' must be text, got {digest!r:.60}")
    return origin
