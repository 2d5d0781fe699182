"""Where a report comes from, in the report itself: enough to repeat it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Final

from flyrl.evaluation.results import Results
from flyrl.evaluation.rows import Json, episodes_digest
from flyrl.validation import plain_record

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
