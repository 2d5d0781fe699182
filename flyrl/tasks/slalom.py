"""Slalom: reach several targets in turn, against time."""

from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from flyrl.tasks import terms
from flyrl.tasks.episode import TIME, Episode, beyond_reach, draw_inside
from flyrl.tasks.function import TaskFunction
from flyrl.tasks.hybrid_turning import sample_episode as bare_episode
from flyrl.tasks.senses import direction_term, distance_term, steering
from flyrl.tasks.task import ErrorTerm, Mask, ObservationTerm, RewardTerm, Task, TaskState
from flyrl.terrains import Prop, Terrain
from flyrl.validation import FloatArray, Within


def sample_episode(
    terrain: Terrain,
    seed: int,
    difficulty: float = 1.0,
    *,
    gates: int,
    spacing: tuple[float, float],
    turn: float,
) -> Episode:
    """Draw a spawn, a chain of gates on the terrain (uniform spacings and turns), the CPG's start.

    With the difficulty, the largest spacing grows from the smallest, mm, and the turns from none to
    all up to `turn`, deg, to either side. The first gate turns off the fly's heading.

    Raises
    ------
    ValueError
        If the terrain has no room for the gates.
    """
    episode = bare_episode(terrain, seed, difficulty)
    rng = np.random.default_rng([seed, 1])
    nearest, farthest = spacing
    farthest = nearest + difficulty * (farthest - nearest)
    sharpest = difficulty * np.deg2rad(turn)

    def draw() -> tuple[FloatArray, FloatArray]:
        length = rng.uniform(nearest, farthest, size=gates)
        direction = np.cumsum(rng.uniform(-sharpest, sharpest, size=gates))
        steps = length[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
        places = episode.spawn_position_w[:2] + np.cumsum(steps, axis=0)
        return places, places

    places = draw_inside(terrain.bounds, "task.spacing and task.gates", (spacing, gates), draw)
    heights = np.full((gates, 1), terrain.base_height)
    return replace(episode, props=tuple(np.hstack([places, heights]).ravel().tolist()))


def _passed(state: TaskState) -> NDArray[np.intp]:
    """Number of gates that were reached so far, (n,)."""
    # the reward of this name counts up once it was asked, so the rewards up to it see those before
    # this decision, and terminations and observations those after it
    return np.round(state.totals["gates"]).astype(np.intp)


def gate(state: TaskState, ahead: int = 0) -> FloatArray:
    """Place of the gate that is due, or `ahead` after it, mm, (n, 2); at the end the last."""
    places = state.props[:, :, :2]
    due = np.minimum(_passed(state) + ahead, places.shape[1] - 1)
    chosen: FloatArray = places[np.arange(len(places)), due]
    return chosen


def has_passed_all(state: TaskState, gates: int) -> Mask:
    """Whether every gate was reached, (n,)."""
    return _passed(state) >= gates


def gates_left(state: TaskState, gates: int) -> FloatArray:
    """Number of gates that were not reached yet, (n,)."""
    return np.maximum(gates - state.totals["gates"], 0.0)


def gate_marker(index: int, gates: int, reach: float) -> Prop:
    """Marker of a gate; from the first to the last they go from red to yellow."""
    green = 0.2 + 0.6 * index / max(1, gates - 1)
    return Prop(f"gate_{index + 1}", "marker", (reach,), (0.85, green, 0.2, 0.6))


@TaskFunction
def slalom(
    gates: Annotated[int, Within(1, 100)] = 5,
    spacing: Annotated[tuple[float, float], Within(0, 1000)] = (3.0, 8.0),
    turn: Annotated[float, Within(0, 180)] = 90.0,
    reach: Annotated[float, Within(1e-3, 1000)] = 1.0,
    time_limit: Annotated[float, TIME] = 6.0,
) -> Task:
    """Reach several targets, the gates, in turn.

    Parameters
    ----------
    gates
        Number of gates.
    spacing
        Least and greatest distance of a gate from the one before, of the first from the start, mm.
    turn
        Greatest angle, to either side, by which the way to a gate turns off the way to the one
        before, to the first off the heading at the start, deg.
    reach
        A gate is reached within this horizontal distance of the thorax, mm.
    time_limit
        s until the episode is cut off.
    """
    near, far = beyond_reach("task.spacing", spacing, reach)
    at_gate = partial(terms.is_at_target, reach=reach, place=gate)
    to_next = partial(terms.target_direction_b, place=partial(gate, ahead=1))
    return steering(
        observation=(
            direction_term(
                partial(terms.target_direction_b, place=gate), "the bearing of the gate that is due"
            ),
            distance_term(partial(terms.target_distance, place=gate), "the gate that is due"),
            ObservationTerm(
                "next_direction", (2,), -1.0, 1.0, to_next,
                "cos and sin of the bearing of the gate after it, of the last again",
            ),
        ),
        reward=(
            RewardTerm(
                "progress", 0.2, partial(terms.progress, place=gate),
                "mm closer to the gate that is due",
            ),
            RewardTerm("gates", 1.0, at_gate, "a gate is reached"),
            *terms.cost_of_time(),
        ),
        solved=partial(has_passed_all, gates=gates),
        time_limit_s=time_limit,
        props=tuple(gate_marker(index, gates, reach) for index in range(gates)),
        sample_episode=partial(sample_episode, gates=gates, spacing=spacing, turn=turn),
        difficulty=f"spacing of the gates, from {near:g} mm to {near:g}-{far:g}, and turns from "
        f"one to the next, from 0 to ±{turn:g}°",
        success=f"thorax within {reach:g} mm of {gates} gates, in turn",
        errors=(
            terms.error("heading_error_deg", 180.0, partial(terms.turn_to_target, place=gate)),
            ErrorTerm(
                "gates_left", gates, partial(gates_left, gates=gates),
                "gates that were not reached yet", smallest_effect=0.25,
            ),
        ),
        compared=("time_to_goal_s", "gates_left"),
    )  # fmt: skip
