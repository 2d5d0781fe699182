"""Results as JSON: per part what was measured, with the machine that ran it."""

import json
from pathlib import Path
from typing import Any, Final

from flyrl.files import write_text

Row = dict[str, Any]
Part = dict[str, Any]
"""`machine`, `settings` and `rows`, the cells of the part's table."""

Results = dict[str, Part]

PARTS: Final[dict[str, str]] = {
    "engine": "physics steps/s of all flies together (simulated s per wall s), hybrid controller",
    "threads": "two threads over one",
    "overhead": "speed with controller, and with environment too, over bare MuJoCo's; one thread",
    "environment": "where a step of the vector environment spends its time",
    "scale": "many flies",
    "single": "one fly from Python, one physics step per step",
    "ppo": "where PPO's training spends its time",
    "worm": "physics steps/s of all worms together (simulated s per wall s), one thread",
    "rendering": "pictures/s of 640 x 480 of a fly, everything on",
    "peers": "simulated s per wall s on one core, beside other simulators of the fly",
}
"""What can be measured, in the order of the table, and what each is."""


def merged(stored: Results, measured: Results) -> Results:
    """Results with the parts just measured in place of those stored; in the order of PARTS."""
    both = stored | measured
    return {name: both[name] for name in PARTS if name in both}


def read(path: Path) -> Results:
    """Results that `write` wrote; none where there is no file.

    Raises
    ------
    ValueError
        The file holds something else.
    """
    from flyrl.validation import one_of  # noqa: PLC0415  (loads NumPy, which shells need not wait for)

    if not path.exists():
        return {}
    try:
        results: Results = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} holds no results of flyrl bench: {error}") from error
    if not isinstance(results, dict):
        raise ValueError(f"{path} holds no results of flyrl bench, got {results!r:.60}")
    for name, part in results.items():
        one_of(f"{path}: a part", name, PARTS)
        if not isinstance(part, dict) or not {"machine", "settings", "rows"} <= part.keys():
            raise ValueError(f"{path}: {name!r} must hold machine, settings and rows")
    return results


def write(path: Path, results: Results) -> None:
    """Write results as JSON, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps(results, indent=1) + "\n")


def significant(value: float, digits: int = 4) -> float:
    """A measured value, rounded to what is worth storing."""
    return float(f"{value:.{digits}g}")
