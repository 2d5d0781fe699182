"""Episode records made up from simple walks, so that results and reports need no physics."""

import json
from dataclasses import asdict

import numpy as np

from flyrl.evaluation.episodes import episode_row, episode_table, trajectory
from flyrl.evaluation.metrics import compared_metrics, decisive_metrics, smallest_effects
from flyrl.evaluation.results import Results
from flyrl.evaluation.summary import summarise
from flyrl.rollouts import EpisodeRecord
from flyrl.tasks import OUTCOMES, TASKS, Episode, task_table

HORIZON_S = 3.0
DECISION_S = 0.02
TASK = TASKS["target"]()


def make_record(
    position_w, *, goal=(), yaw=None, seed=None, interval_s=DECISION_S, drive=None, **fields
):
    """A record of the path `position_w` (T, 2) or (T, 3), sampled every `interval_s`."""
    position_w = np.asarray(position_w, dtype=float)
    samples = len(position_w)
    if position_w.shape[1] == 2:
        position_w = np.column_stack([position_w, np.full(samples, 1.5)])
    yaw = np.zeros(samples) if yaw is None else np.asarray(yaw, dtype=float)
    time_s = np.arange(samples) * interval_s
    index = fields.get("index", 0)
    usual = {
        "controller": "cpg",
        "task": "target",
        "terrain": "flat",
        "index": index,
        "episode": Episode(
            seed=index if seed is None else seed,
            spawn_position_w=tuple(map(float, position_w[0])),
            spawn_yaw=float(yaw[0]),
            goal=tuple(map(float, goal)),
            init_phases=(0.0,) * 6,
            init_magnitudes=(0.0,) * 6,
        ),
        "outcome": "timeout",
        "return_": 0.0,
        "duration_s": float(time_s[-1]),
        "horizon_s": HORIZON_S,
        "time_s": time_s,
        "position_w": position_w,
        "yaw": yaw,
        "drive": np.ones((samples, 2)) if drive is None else np.asarray(drive, dtype=float),
    }
    return EpisodeRecord(**{**usual, **fields})


# Forward speed (mm/s), turning gain (1/s), chance of a fall (1/s).
STYLES = {
    "target-ppo": (14.0, 9.0, 0.01),
    "cpg": (14.0, 0.0, 0.0),
    "rule_based": (9.5, 0.0, 0.0),
    "hybrid": (13.5, 0.0, 0.01),
    "pursuit": (12.0, 5.0, 0.04),
    "zero": (0.0, 0.0, 0.0),
}


def walk(controller, terrain, index, seed=0):
    """An episode of a point that walks as `STYLES` says, towards a target 5 to 15 mm away."""
    rng = np.random.default_rng([seed, index])
    spawn = rng.uniform(-2, 2, 2)
    bearing, distance = rng.uniform(-np.pi, np.pi), rng.uniform(5, 15)
    goal = spawn + distance * np.array([np.cos(bearing), np.sin(bearing)])
    speed, gain, fall_rate = STYLES[controller]
    if terrain == "gapped":
        speed, fall_rate = speed * (0.3 if controller == "cpg" else 0.8), fall_rate * 4
    noise = np.random.default_rng([seed, index, *map(ord, controller + terrain)])
    position, yaw, time, outcome = spawn.copy(), 0.0, 0.0, "timeout"
    positions, yaws = [position.copy()], [yaw]
    while time < HORIZON_S - 1e-9:
        to_goal = goal - position
        error = np.arctan2(to_goal[1], to_goal[0]) - yaw
        error = np.arctan2(np.sin(error), np.cos(error))
        yaw += (gain * np.clip(error, -0.6, 0.6) + noise.normal(0, 0.8)) * DECISION_S
        position += DECISION_S * speed * np.array([np.cos(yaw), np.sin(yaw)])
        position += noise.normal(0, 0.02, 2)
        time += DECISION_S
        positions.append(position.copy())
        yaws.append(yaw)
        if np.linalg.norm(goal - position) < 1.0:
            outcome = "success"
            break
        if noise.random() < fall_rate * DECISION_S:
            outcome = "fall"
            break
    progress = distance - np.linalg.norm(goal - position)
    return_ = progress + 10 * (outcome == "success") - time - 5 * (outcome == "fall")
    return make_record(
        np.array(positions),
        controller=controller,
        terrain=terrain,
        index=index,
        seed=2**31 + index,
        outcome=outcome,
        goal=goal,
        yaw=yaws,
        return_=float(return_),
        duration_s=time,
    )


def judged_by(task):
    """What a protocol says of how a task is judged."""
    return {
        "decisive": list(decisive_metrics(task)),
        "compared": list(compared_metrics(task)),
        "smallest_effects": smallest_effects(task),
        "horizon_s": HORIZON_S,
        "vary": {},
    }


def make_results(
    controllers=tuple(STYLES),
    terrains=("flat",),
    episodes=20,
    reference="hybrid",
    vary=None,
    study=None,
):
    """Results of an evaluation that never happened."""
    vary = vary or {}
    labels = [f"{name}={value:g}" for name, values in vary.items() for value in values] or [""]
    walks = [
        (walk(controller, terrain, index), label)
        for terrain in terrains
        for label in labels
        for controller in controllers
        for index in range(episodes)
    ]
    records = [record for record, _ in walks]
    rows = episode_table([episode_row(record, label) for record, label in walks])
    protocol = {
        **judged_by(TASK),
        "command": "flyrl-evaluate policies=[runs/target-ppo] episodes=20 note='<b>&'",
        "settings": {},
        "created_utc": "2026-01-01T00:00:00+00:00",
        "versions": {"flyrl": "0.1.0", "mujoco": "4.0.0", "numpy": "2.4.6", "python": "3.11.2"},
        "seed": 0,
        "task": "target",
        "table": task_table(TASK),
        "outcomes": list(OUTCOMES[1:]),
        "episodes_per_terrain": episodes,
        "reference": reference,
        "vary": vary,
        "entrants": [
            {
                "name": name,
                "kind": "learned" if name == "target-ppo" else "fixed",
                "leg_controller": name if name in ("cpg", "rule_based") else "hybrid",
                "policy": "drive (1, 1)",
                "source": "runs/target-ppo/best.safetensors" if name == "target-ppo" else None,
                "sha256": "0123456789abcdef" * 4 if name == "target-ppo" else None,
            }
            for name in controllers
        ],
        "terrains": [{"name": name, "config": {"name": name, "seed": 0}} for name in terrains],
        "study": study,
        "crashes": [],
        "physics": {"timestep": 1e-4, "integrator": "implicitfast"},
        "physics_preset": {"name": "balanced", "version": 2},
    }
    summary = summarise(rows, protocol, np.random.default_rng(0))
    protocol = json.loads(json.dumps(protocol))
    drawn = json.loads(json.dumps([asdict(record.episode) for record in records[:episodes]]))
    paths = {row: trajectory(record) for row, record in enumerate(records)}
    return Results(protocol, rows, summary, dict.fromkeys(terrains, drawn), paths)
