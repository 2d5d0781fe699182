"""What a Gymnasium adapter takes and shows: spaces of a task, options of `reset`."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from flyrl.controllers.controller import NUM_JOINTS, NUM_LEGS
from flyrl.simulation.randomisation import Randomisation
from flyrl.tasks import Episode, JointTargets, Neurons, ObservationTerm, Task
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


def action_space(task: Task) -> spaces.Box | spaces.MultiDiscrete | spaces.Dict:
    """A number per component of an action, a whole number per muscle, or joints and adhesion."""
    actions = task.actions
    if isinstance(actions, JointTargets) and actions.is_dict:
        low, high = (bound[:NUM_JOINTS].astype(np.float32) for bound in actions.bounds)
        joints = spaces.Box(low, high, dtype=np.float32)
        return spaces.Dict({"joints": joints, "adhesion": spaces.MultiBinary(NUM_LEGS)})
    if isinstance(actions, Neurons) and actions.is_integer:
        return spaces.MultiDiscrete(list(actions.pools))
    low, high = (bound.astype(np.float32) for bound in actions.bounds)
    return spaces.Box(low, high, dtype=np.float32)


def action_vectors(task: Task, actions: Any) -> NDArray[np.float64]:
    """Actions of n simulations, as the action space has them, as one vector each, (n, size)."""
    if not isinstance(actions, Mapping):
        return np.asarray(actions, dtype=np.float64)
    parts = (np.asarray(actions[name], dtype=np.float64) for name in ("joints", "adhesion"))
    return np.concatenate([*parts], axis=1)


def observation_space(task: Task) -> spaces.Box | spaces.Dict:
    """One vector, or a dict (see `Task.is_flat`); finite bounds, to which terms are clipped."""
    if task.is_flat:
        return _vector(task.observation)
    if task.has_goals:
        goals, others = task.observation[:2], task.observation[2:]
        return spaces.Dict({**_by_name(goals), "observation": _vector(others)})
    return spaces.Dict(_by_name(task.observation))


def _by_name(terms: Sequence[ObservationTerm]) -> dict[str, spaces.Space[Any]]:
    return {term.name: spaces.Box(term.low, term.high, term.shape, np.float32) for term in terms}


def _vector(terms: Sequence[ObservationTerm]) -> spaces.Box:
    low = np.concatenate([np.full(term.size, term.low, np.float32) for term in terms])
    high = np.concatenate([np.full(term.size, term.high, np.float32) for term in terms])
    return spaces.Box(low, high, dtype=np.float32)
