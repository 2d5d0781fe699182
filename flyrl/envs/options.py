"""Options of `reset`: what a user fixes of an episode."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from flyrl.simulation.randomisation import Randomisation
from flyrl.tasks import Episode
from flyrl.validation import known_keys, one_of

# option -> attribute of an episode, and how many numbers; None: as many as the task has
_FIELDS = {
    "init_phases": ("init_phases", 6),
    "init_magnitudes": ("init_magnitudes", 6),
    "spawn_position": ("spawn_position_w", 3),
    "goal": ("goal", None),
    "command": ("command", None),
    "pushes": ("pushes", None),
    "props": ("props", None),
    "joint_angles": ("joint_angles", None),
}


def episode_with_options(episode: Episode, options: dict[str, Any] | None) -> Episode:
    """Replace parts of a drawn episode.

    Raises
    ------
    ValueError
        If an option is unknown, has the wrong number of values, or one that is not allowed.
    """
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options must be a mapping or None, got {options!r}")
    if not options:
        return episode
    allowed = (*_FIELDS, "spawn_yaw", "ground", "randomisation", "episode")
    known_keys("reset(options)", options, allowed)
    given = options.get("episode")
    if given is not None:
        if not isinstance(given, Episode):
            raise ValueError(f"reset option 'episode' must be an Episode; got {given!r}")
        episode = given
    changes: dict[str, Any] = {}
    for name, (attribute, size) in _FIELDS.items():
        if options.get(name) is None:
            continue
        values = np.asarray(options[name], dtype=np.float64)
        expected = len(getattr(episode, attribute)) if size is None else size
        if values.shape != (expected,) or not np.isfinite(values).all():
            raise ValueError(
                f"reset option {name!r} must be {expected} finite numbers; got {options[name]!r}"
            )
        changes[attribute] = tuple(float(value) for value in values)
    if options.get("spawn_yaw") is not None:
        changes["spawn_yaw"] = options["spawn_yaw"]
    if options.get("ground") is not None:
        changes["ground"] = _ground_seed(options["ground"])
    changes["randomisation"] = _changed(episode.randomisation, options.get("randomisation"))
    if "command" in changes and _leads_to_goal(episode):
        changes.setdefault("goal", changes["command"][-2:])
    changed = dataclasses.replace(episode, **changes)
    if _leads_to_goal(episode) and not _leads_to_goal(changed):
        raise ValueError(
            f"reset option 'goal' must be the last point of the command, {changed.command[-2:]}; "
            f"got {changed.goal}"
        )
    return changed


def _ground_seed(value: Any) -> int:
    is_integer = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_integer or not 0 <= value < 2**63:
        raise ValueError(
            f"reset option 'ground' must be an integer from 0 to 2**63 - 1; got {value!r}"
        )
    return int(value)


def _changed(drawn: Randomisation, given: Any) -> Randomisation:
    """`drawn` with what is given in its place, if anything is."""
    if given is None:
        return drawn
    if not isinstance(given, Mapping):
        raise ValueError(
            f"reset option 'randomisation' must be a dict of numbers by name; got {given!r}"
        )
    for name in given:
        one_of("reset option 'randomisation'", name, [f.name for f in dataclasses.fields(drawn)])
    return dataclasses.replace(drawn, **given)


def _leads_to_goal(episode: Episode) -> bool:
    """Whether the command is a path, whose last point is the goal."""
    return episode.goal != () and episode.command[-2:] == episode.goal
