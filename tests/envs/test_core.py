"""The batched environment: bits, ends of episodes, goals, means and pushes."""

import dataclasses
import functools

import numpy as np
import pytest

from flyrl.anatomy import LEGS
from flyrl.bodies.surface import ContactConfig, SurfaceContact
from flyrl.envs.adapter import row_of
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.envs.task_batch import Transition
from flyrl.policies import OpenLoop
from flyrl.simulation.physics import PhysicsConfig
from flyrl.simulation.randomisation import RANDOMISATIONS, RandomisationConfig
from flyrl.tasks import TASKS, Episode, MeanTerm, Neurons, ObservationTerm, RewardTerm, Task
from flyrl.tasks.target import compute_reward, compute_terminated
from flyrl.terrains import LITERATURE

STIFF = SurfaceContact(solref=(-1e5, -2e3))
FAST = PhysicsConfig(timestep=5e-4, contact=ContactConfig(plane=STIFF, box=STIFF))


NOISY = RandomisationConfig(sensor_noise=0.1)
VARIED = dataclasses.replace(RANDOMISATIONS["default"], missing_leg=LEGS)
CONFIGS = {
    "target": EnvConfig(physics=FAST, terrain="mixed"),
    "velocity": EnvConfig("velocity", physics=FAST, terrain="mixed"),
    "heading": EnvConfig("heading", terrain="random_mixed", physics="fast", randomisation=VARIED),
    "joints": EnvConfig("joints_box", physics="fast", decision_interval=0.02),
    "worm_crawl": EnvConfig("worm_crawl", randomisation=NOISY),
    "worm_hang_box": EnvConfig("worm_hang_box", randomisation=NOISY),
}
EVERY_CONFIG = pytest.mark.parametrize("name", CONFIGS)


def decide(env: BatchedEnv, seeds: list[int], decision: int) -> np.ndarray:
    """Result of a decision, where each simulation does what its seed says, (n, size)."""
    actions = env.task.actions
    high = np.array(actions.pools) if isinstance(actions, Neurons) else actions.bounds[1]
    rngs = [np.random.default_rng([seed, decision]) for seed in seeds]
    if isinstance(actions, Neurons) and actions.is_integer:
        drawn = [rng.integers(0, high) for rng in rngs]
    else:
        drawn = [rng.uniform(-1, 1, actions.size) for rng in rngs]
    transition = env.step(np.array(drawn))
    shown = transition.observation
    parts = [*shown.values()] if isinstance(shown, dict) else [shown]
    parts += [transition.reward, env.state.position_w]
    return np.concatenate([part.reshape(len(seeds), -1) for part in parts], axis=1)


def roll_out(env: BatchedEnv, seeds: list[int], decisions: int = 8) -> np.ndarray:
    """Results of decisions, (decisions, n, size); simulations start anew one after the other."""
    env.reset(seeds=list(seeds))
    rows = []
    for decision in range(decisions):
        rows.append(decide(env, seeds, decision))
        if anew := [i for i, seed in enumerate(seeds) if decision == 2 + seed % 4]:
            env.reset(ids=anew)
    return np.array(rows)


@functools.cache
def alone(name: str) -> list[np.ndarray]:
    """Roll-outs of single environments, with the seeds 11, 12 and 13."""
    single = BatchedEnv(CONFIGS[name], 1, 1)
    return [roll_out(single, [seed])[:, 0] for seed in (11, 12, 13)]


@pytest.mark.parametrize("num_threads", [1, 3])
@EVERY_CONFIG
def test_a_batch_gives_the_bits_of_single_environments(name: str, num_threads: int) -> None:
    many = roll_out(BatchedEnv(CONFIGS[name], 3, num_threads), [11, 12, 13])
    np.testing.assert_array_equal(many.swapaxes(0, 1), alone(name))


@EVERY_CONFIG
def test_restored_environments_and_copies_lead_to_the_same_bits(name: str) -> None:
    """Into one in which others walked, with new episodes after it."""
    env, twin = (BatchedEnv(CONFIGS[name], 2, num_threads) for num_threads in (2, 1))
    roll_out(env, [3, 4], 4)
    twin.reset(seeds=[8, 9])
    twin.restore(env.snapshot())
    assert twin.episodes == env.episodes
    for decision in range(4):
        ours, theirs = (decide(each, [5, 6], decision) for each in (env, twin))
        np.testing.assert_array_equal(ours, theirs)
        if decision == 2:
            np.testing.assert_equal(env.reset(ids=[1]), twin.reset(ids=[1]))
    copies = BatchedEnv(CONFIGS[name], 3, 1)
    shown, copied = env.observe(), copies.copy_from(env, [1, 0, 1])
    np.testing.assert_equal(copied, row_of(shown, [1, 0, 1]))
    for decision in range(4, 8):
        ours, theirs = decide(env, [5, 6], decision), decide(copies, [6, 5, 6], decision)
        np.testing.assert_array_equal(theirs, ours[[1, 0, 1]])
    with pytest.raises(ValueError, match="sims must be 3 simulations"):
        copies.copy_from(env, [0, 1])


FLY_TASKS = [name for name, task in TASKS.items() if not task.worm]


@pytest.mark.parametrize(
    ("task", "terrain"),
    [
        *((task, "mixed") for task in FLY_TASKS),
        *(("target", terrain) for terrain in LITERATURE if terrain != "mixed"),
    ],
)
def test_every_task_and_every_terrain_give_finite_numbers(task: str, terrain: str) -> None:
    env = BatchedEnv(EnvConfig(task=task, terrain=terrain, physics=FAST, decision_interval=0.02), 3)
    env.reset(seeds=[0, 1, 2])
    rng = np.random.default_rng(0)
    for _ in range(20):
        low, high = env.task.actions.bounds
        if task.startswith("joints"):  # of which most lead nowhere that a leg can go
            low, high = low / 10, high / 10
        transition = env.step(rng.uniform(low, high, (3, env.task.actions.size)))
        observation = transition.observation
        arrays = observation.values() if isinstance(observation, dict) else [observation]
        assert all(np.isfinite(array).all() for array in arrays)
        assert np.isfinite(transition.reward).all()
        assert "unstable" not in transition.outcome


def walk_to(goal: tuple[float, float]) -> Episode:
    return Episode(0, (0.0, 0.0, 0.5), 0.0, goal, (0.0, np.pi, 0.0, np.pi, 0.0, np.pi), (1.0,) * 6)


def fail(env: BatchedEnv) -> Transition:
    """Let the first three flies fall, diverge and leave the arena, in one decision of all."""
    env.flies._qpos[0, 3:7] = [0, 1, 0, 0]
    env.flies._qvel[1, 20] = 1e13
    env.flies._qpos[2, 1] = 500.0
    return env.step(np.zeros((env.num_envs, 2)))


@pytest.mark.parametrize(("task", "dof"), [("target", 20), ("worm_crawl", 5)])
def test_a_divergence_ends_its_own_episode_alone(task: str, dof: int) -> None:
    env, twin = (BatchedEnv(EnvConfig(task), 3) for _ in range(2))
    actions = np.ones((3, env.task.actions.size))
    for each in (env, twin):
        each.reset(seeds=[0, 1, 2])
        each.step(actions)
    env.batch._qvel[1, dof] = 1e13
    transition, expected = env.step(actions), twin.step(actions)
    assert transition.outcome.tolist() == ["running", "unstable", "running"]
    assert transition.terminated.tolist() == [False, True, False]
    assert np.isfinite(transition.observation).all()
    assert np.isfinite(transition.reward).all()
    np.testing.assert_array_equal(transition.observation[[0, 2]], expected.observation[[0, 2]])
    env.reset(ids=[1])
    assert env.step(actions).outcome.tolist() == ["running"] * 3


@pytest.mark.parametrize("task", ["target", "worm_crawl"])
def test_steps_of_some_leave_the_others_where_they_are(task: str) -> None:
    env = BatchedEnv(EnvConfig(task), 3)
    env.reset(seeds=[0, 1, 2])
    before, interval = env.state, env.config.decision_interval_s
    env.step(np.ones((3, env.task.actions.size)), ids=np.array([0, 2]))
    np.testing.assert_allclose(env.state.time, [interval, 0.0, interval])
    np.testing.assert_array_equal(env.state.joint_angles[1], before.joint_angles[1])


def target_with(**tables: tuple[object, ...]) -> Task:
    """Target with rows added to its tables."""
    task = TASKS["target"]()
    return dataclasses.replace(
        task, **{name: (*getattr(task, name), *rows) for name, rows in tables.items()}
    )


def test_a_running_mean_starts_at_0_and_forgets_exponentially() -> None:
    twos = MeanTerm("twos", 1, 0.05, lambda state: np.full((len(state.fly.time), 1), 2.0), "2")
    env = BatchedEnv(EnvConfig(task=target_with(means=(twos,)), physics=FAST), 2)
    env.reset(seeds=[0, 1])
    env.step(np.zeros((2, 2)))
    env.step(np.zeros((2, 2)), ids=np.array([1]))
    expected = 2 * (1 - np.exp([[-0.02 / 0.05], [-0.04 / 0.05]]))
    np.testing.assert_allclose(env.task_state().means["twos"], expected)
    env.reset(ids=[1])
    np.testing.assert_allclose(env.task_state().means["twos"], [expected[0], [0.0]])


@pytest.mark.parametrize(
    ("table", "kind", "arguments", "shape"),
    [
        ("observation", ObservationTerm, ((1,), 0.0, 1.0), ()),
        ("observation", ObservationTerm, ((1,), 0.0, 1.0), (2,)),
        ("reward", RewardTerm, (1.0,), (1,)),
    ],
)
def test_a_term_of_the_wrong_shape_is_refused_at_the_reset(table, kind, arguments, shape):
    wrong = kind("x", *arguments, lambda state: np.zeros((len(state.fly.time), *shape)), "")
    env = BatchedEnv(EnvConfig(task=target_with(**{table: (wrong,)}), physics=FAST), 3)
    with pytest.raises(ValueError, match=r"'x' must give an array of shape \('n',.*for 3"):
        env.reset(seeds=[0, 1, 2])


def test_commands_can_be_followed_and_standing_still_does_not_follow_them() -> None:
    env = BatchedEnv(EnvConfig(task="velocity", physics="fast"), 5)
    follow = OpenLoop(env.task)
    observation = env.reset(seeds=[0, 1, 2, 3, 0])
    for _ in range(200):
        action = follow.predict(observation)[0]
        action[4:] = env.task.actions.of(np.zeros(2))
        transition = env.step(action)
        observation = transition.observation
    assert transition.done.all()
    assert transition.is_success[:4].sum() >= 2
    assert transition.is_success[4:].sum() == 0


def pushed(*pushes: float) -> Episode:
    return dataclasses.replace(walk_to((0.5,)), goal=(), command=(0.5,), pushes=pushes)


def test_a_push_from_the_left_at_the_abdomen_turns_the_fly_to_the_left() -> None:
    heading = {"name": "heading", "drive_time_constant": 0.0}
    env = BatchedEnv(EnvConfig(heading, physics="fast"), 3)
    env.reset(episodes=[pushed(0.5, -8.0), pushed(), pushed(0.5, 8.0)])
    walk = env.task.actions.of(np.ones((3, 2)))
    for _ in range(25):
        env.step(walk)
    np.testing.assert_array_equal(env.state.yaw, env.state.yaw[[1, 1, 1]])
    twin = BatchedEnv(env.config, 3)
    for step in range(15):
        shown = env.step(walk).observation
        if step == 4:  # during the pushes
            twin.restore(env.snapshot())
        elif step > 4:
            np.testing.assert_array_equal(twin.step(walk).observation, shown)
    left, straight, right = np.rad2deg(env.state.yaw)
    assert 10 < left - straight < 60
    assert 10 < straight - right < 60


@pytest.mark.parametrize("interval", [0.02, 0.06, 0.5])
def test_a_push_has_the_same_impulse_whatever_the_decision_interval(interval: float) -> None:
    config = EnvConfig(task="heading", physics="fast", decision_interval=interval)
    env = BatchedEnv(config, 2)
    env.reset(episodes=[pushed(0.11, 5.0, 0.11, 1.0), pushed()])
    impulse, moment = np.zeros(2), np.zeros(2)
    for _ in range(round(1.5 / interval)):
        env.step(np.zeros((2, 2)))
        outer = env.flies._outer_forces[:, env.flies.thorax_body]
        impulse += interval * np.hypot(outer[:, 0], outer[:, 1])
        moment += interval * outer[:, 5]
    np.testing.assert_allclose(impulse, [6.0 * 0.2, 0.0])
    np.testing.assert_allclose(moment, [-1.5 * 6.0 * 0.2, 0.0])
    assert (env.flies._outer_forces == 0).all()


def check_goals(env: BatchedEnv, transition: Transition) -> None:
    """Rewards and ends are those that follow from the goals observed, to the bit."""
    goals = (transition.observation[name] for name in ("achieved_goal", "desired_goal"))
    given = (env.task, *goals, env.failure_info())
    np.testing.assert_array_equal(transition.reward, compute_reward(*given))
    np.testing.assert_array_equal(transition.terminated, compute_terminated(*given))


@pytest.mark.parametrize("task", ["target", "target_goal"])
def test_reaching_the_target_ends_in_success_with_its_bonus(task: str) -> None:
    """With goals, rewards and ends are those of the goals observed on the way, too."""
    env = BatchedEnv(EnvConfig(task, physics=FAST), 2)
    env.reset(episodes=[walk_to((5.0, 0.0)), walk_to((-5.0, 0.0))])
    straight = env.task.actions.of(np.ones((2, 2)))
    for _ in range(60):
        transition = env.step(straight)
        if env.task.has_goals:
            check_goals(env, transition)
        if transition.done[0]:
            break
    assert transition.outcome.tolist() == ["success", "running"]
    assert transition.is_success.tolist() == transition.terminated.tolist() == [True, False]
    if env.task.has_goals:
        assert transition.reward.tolist() == [0.0, -1.0]
    else:
        assert transition.reward[0] > 2.0
        assert transition.reward[1] < 0.0


@pytest.mark.parametrize(
    ("goal", "limit_s", "interval", "ends", "rewards"),
    [
        ((5.0, 0.0), 3.0, 0.02, ("fall", "running"), 3 * [-150] + [-1]),
        ((5.0, 0.0), 3.0, 0.05, ("fall", "running"), 3 * [-60] + [-1]),
        ((0.0, 0.0), 3.0, 0.02, ("success", "success"), [-149, -149, -150, 0]),
        ((5.0, 0.0), 0.02, 0.02, ("fall", "timeout"), 4 * [-1]),
    ],
)
def test_a_failure_saves_nothing_in_a_task_with_goals(goal, limit_s, interval, ends, rewards):
    """Of four flies three fail in the first decision, whether or not they are at the goal."""
    task = TASKS["target_goal"](time_limit=limit_s)
    env = BatchedEnv(EnvConfig(task, physics=FAST, decision_interval=interval), 4)
    env.reset(episodes=4 * [walk_to(goal)])
    transition = fail(env)
    assert transition.outcome.tolist() == [ends[0], "unstable", "left_arena", ends[1]]
    assert transition.terminated.tolist() == [True] * 3 + [ends[1] == "success"]
    assert transition.truncated.tolist() == [False] * 3 + [ends[1] == "timeout"]
    # as many decisions as without the failure
    assert transition.reward.tolist() == rewards
    check_goals(env, transition)
    info = env.failure_info()
    assert info["is_failure"].tolist() == [True, True, True, False]
    assert info["decisions_lost"].tolist() == 3 * [round(limit_s / interval) - 1] + [0]


def test_a_goal_that_is_moved_is_observed_and_rewarded_from_then_on() -> None:
    env = BatchedEnv(EnvConfig(physics=FAST), 2)
    before = env.reset(seeds=[0, 1])
    x, y = env.state.position_w[1, :2]
    seen = env.set_goals(np.array([[x + 3.0, y + 4.0]]), ids=[1])
    # the flies face +x: 3 mm ahead and 4 to the left is 5 mm away, in units of 15 mm
    np.testing.assert_allclose(seen[1, :3], [0.6, 0.8, 5 / 15], rtol=1e-6)
    np.testing.assert_array_equal(seen[0], before[0])
    env.step(np.ones((2, 2)))
    way = 5.0 - np.hypot(*(env.state.position_w[1, :2] - (x + 3.0, y + 4.0)))
    assert env.task_state().totals["progress"][1] == pytest.approx(way)
    with pytest.raises(ValueError, match=r"goals must have shape \(2, 2\), got shape \(1, 2\)"):
        env.set_goals(np.zeros((1, 2)))
    with pytest.raises(ValueError, match="goals must be at most 10000, got"):
        env.set_goals(np.array([[1e308, 0.0], [0.0, 0.0]]))
