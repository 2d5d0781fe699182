"""Every algorithm: its settings reach the model, and a checkpoint holds all of it."""

import dataclasses

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3.common.buffers import DictReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import DummyVecEnv
from stable_baselines3.her import GoalSelectionStrategy

from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.policies import LearnedPolicy, TermLayout
from flyrl.policies.sb3 import bundle_from_sb3
from flyrl.tasks import TASKS
from flyrl.training.algorithms import ALGORITHMS, ON_POLICY, AlgorithmConfig
from flyrl.training.models import HindsightBuffer, build_model, learner_state, restore_learner
from flyrl.training.run_folder import load_checkpoint, save_checkpoint
from tests.tiny import TINY_ENV
from tests.training.folders import same

TRANSLATED = {
    "hidden_layers": (6, 7),
    "activation": "relu",
    "learning_rate": 2e-3,
    "learning_rate_decay": True,
    "normalize_reward": True,
}
"""Settings that Stable-Baselines3 takes as something else."""

ELSEWHERE = {"normalize_observation", "use_rms_prop", "initial_ent_coef", "action_noise_std"}
ELSEWHERE |= {"her", "n_sampled_goal", "goal_selection_strategy"}
"""Settings of other tests."""


def _known(name, settings):
    return {key: value for key, value in settings.items() if key in ALGORITHMS[name]}


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    """One thread of torch, as in a training."""
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def fly_envs():
    """Two that draw the same."""
    return [FlyrlVecEnv(TINY_ENV, num_envs=4, num_threads=1) for _ in range(2)]


@pytest.fixture(scope="module")
def build(fly_envs):
    return lambda name, **settings: build_model(AlgorithmConfig(name, **settings), fly_envs[0], 3)


def _at_the_edge(terrain, seed, difficulty=1.0):
    """An episode in which some flies leave the arena."""
    episode = TASKS["target_goal"]().sample_episode(terrain, seed, difficulty)
    edge = terrain.bounds.x_max - 0.2 * (1 + seed % 8)
    return dataclasses.replace(episode, spawn_position_w=(edge, *episode.spawn_position_w[1:]))


@pytest.fixture(scope="module")
def goal_envs():
    """Two with goals, and episodes of 10 decisions or less."""
    task = dataclasses.replace(
        TASKS["target_goal"](), time_limit_s=0.2, sample_episode=_at_the_edge
    )
    config = EnvConfig(task, physics="fast")
    return [FlyrlVecEnv(config, num_envs=4, num_threads=1) for _ in range(2)]


def test_settings_of_hindsight_reach_the_buffer(goal_envs):
    plain = AlgorithmConfig("sac", buffer_size=1000)
    algo = plain.with_settings(her=True, n_sampled_goal=3, goal_selection_strategy="final")
    buffer = build_model(algo, goal_envs[0], seed=0).replay_buffer
    assert isinstance(buffer, HindsightBuffer)
    assert buffer.n_sampled_goal == 3
    assert buffer.goal_selection_strategy is GoalSelectionStrategy.FINAL
    assert type(build_model(plain, goal_envs[0], 0).replay_buffer) is DictReplayBuffer


@pytest.mark.parametrize("name", ALGORITHMS)
def test_settings_reach_the_model(name, build):
    model = build(name, **TRANSLATED)
    assert model.policy_kwargs["net_arch"] == [6, 7]
    assert model.policy_kwargs["activation_fn"] is torch.nn.ReLU
    assert model.lr_schedule(0.5) == 1e-3
    assert model.seed == 3
    others = ALGORITHMS[name].keys() - TRANSLATED.keys() - ELSEWHERE
    for key in others:
        given = model.policy_kwargs.get(key, getattr(model, key, None))
        assert (given(1.0) if callable(given) else given) == ALGORITHMS[name][key], key


def test_settings_that_stable_baselines_takes_as_something_else(build):
    for name in ("sac", "tqc", "crossq"):
        weight = build(name, initial_ent_coef=0.3).log_ent_coef.exp().item()
        assert weight == pytest.approx(0.3)
    for use_rms_prop, kind in ((True, torch.optim.RMSprop), (False, torch.optim.Adam)):
        assert isinstance(build("a2c", use_rms_prop=use_rms_prop).policy.optimizer, kind)


def test_further_arguments_of_stable_baselines_reach_the_model(build):
    assert build("ppo", clip_range_vf=0.1).clip_range_vf(1) == 0.1
    assert build("tqc", target_entropy=-3).target_entropy == -3
    with pytest.raises(ValueError, match=r"algo=ppo: Stable-Baselines3 refuses: .*clip_range_vf"):
        build("ppo", clip_range_vf=-1)


def test_normalisation(build):
    assert build("ppo").get_vec_normalize_env() is None
    for observation, reward in ((True, False), (False, True), (True, True)):
        chosen = {"normalize_observation": observation, "normalize_reward": reward}
        normaliser = build("ppo", gamma=0.9, **chosen).get_vec_normalize_env()
        assert (normaliser.norm_obs, normaliser.norm_reward) == (observation, reward)
        assert normaliser.gamma == 0.9


def test_action_noise(build):
    noise = build("td3", action_noise_std=0.3).action_noise
    assert isinstance(noise, NormalActionNoise)
    draws = np.array([noise() for _ in range(1000)])
    assert draws.std(axis=0) == pytest.approx([0.3, 0.3], rel=0.1)


class _SaveAt(BaseCallback):
    """Saves a checkpoint between two updates, once so many decisions are made."""

    def __init__(self, path, decisions, env):
        super().__init__()
        self.path, self.decisions, self.fly_env = path, decisions, env

    def _on_step(self):
        return True

    def _on_rollout_start(self):
        if self.num_timesteps == self.decisions:
            state = {"learner": learner_state(self.model), "env": self.fly_env.snapshot()}
            save_checkpoint(self.path, {**state, "run": {"decisions": 0}, "settings": {}})


TINY = {
    "hidden_layers": (8,),
    "learning_rate_decay": True,
    "n_steps": 8,
    "batch_size": 16,
    "n_epochs": 2,
    "lstm_hidden_size": 4,
    "learning_starts": 20,
    "gradient_steps": 2,
    "policy_delay": 3,
    "renorm_warmup_steps": 20,
    "normalize_observation": True,
    "normalize_reward": True,
}


@pytest.fixture(scope="module")
def choosing_envs():
    """Two of worms, whose actions are whole numbers."""
    config = EnvConfig(dataclasses.replace(TASKS["worm_crawl"](), time_limit_s=0.5))
    return [FlyrlVecEnv(config, num_envs=4, num_threads=1) for _ in range(2)]


HINDSIGHT = {"her": True, "n_sampled_goal": 2, "learning_starts": 40}
WITHOUT_NORMALISATION = {"normalize_observation": False, "normalize_reward": False}


@pytest.mark.parametrize(
    ("kind", "name", "changes"),
    [
        *[("fly_envs", name, {}) for name in ALGORITHMS],
        ("fly_envs", "ddpg", {"normalize_observation": False}),
        # of Stable-Baselines3's own
        ("fly_envs", "ppo", {"clip_range_vf": 0.1, "target_kl": 0.01}),
        ("fly_envs", "sac", {"train_freq": 2, "n_steps": 3, "target_update_interval": 2}),
        ("goal_envs", "ppo", {}),
        ("goal_envs", "sac", HINDSIGHT),
        # a buffer of 20 rows, which wraps around before the end
        ("goal_envs", "td3", {**HINDSIGHT, **WITHOUT_NORMALISATION, "buffer_size": 80}),
        *[("choosing_envs", name, {"log_std_init": -3.0}) for name in ON_POLICY],
    ],
)
def test_going_on_from_a_checkpoint_gives_the_same_bits(kind, name, changes, tmp_path, request):
    env, other_env = request.getfixturevalue(kind)
    algo = AlgorithmConfig(name, **_known(name, TINY) | changes)
    total, interrupted_at = 96, 64
    path = tmp_path / "c.pt"

    whole = build_model(algo, env, seed=1)
    env.seed(5)
    whole.set_logger(Logger(None, []))
    whole.learn(total, callback=_SaveAt(path, interrupted_at, env))
    end = learner_state(whole)

    checkpoint = load_checkpoint(path)
    resumed = build_model(algo, other_env, seed=2)
    resumed.set_logger(Logger(None, []))
    other_env.restore(checkpoint["env"])
    restore_learner(resumed, checkpoint["learner"])
    assert resumed.num_timesteps == interrupted_at
    resumed.learn(total - interrupted_at, reset_num_timesteps=False)

    assert whole.num_timesteps == resumed.num_timesteps == total
    again = learner_state(resumed)
    # those hold wall-clock times
    for state in (end, again):
        del state["log"], state["episodes"]["infos"]
    assert [key for key in end if not same(end[key], again[key])] == []
    if "her" in changes:
        is_failure = end["replay_buffer"]["failures.is_failure"]
        assert 0 < is_failure.sum() < is_failure.size
    # of whole numbers, the noise of a range has no part in it
    is_range = kind != "choosing_envs" and name in ON_POLICY
    assert ("log_std" in end["parameters"]["policy"]) is is_range


class Follow(gymnasium.Env):
    """One-step problem: the action should be half of a goal, which is seen far from 0."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.goal = self.np_random.uniform(-1, 1, 2)
        return self.seen(self.goal), {}

    def step(self, action):
        reward = -np.square(action - 0.5 * self.goal).sum()
        return self.seen(self.goal), reward, True, False, {}

    @staticmethod
    def seen(goal):
        return (5 + 3 * goal).astype(np.float32)


@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_algorithm_learns(name):
    settings = {
        "hidden_layers": (32,),
        "lstm_hidden_size": 16,
        "learning_rate": 1e-2,
        "n_steps": 8,
        "batch_size": 64,
        "learning_starts": 200,
        "gradient_steps": 2,
    }
    algo = AlgorithmConfig(
        name, **_known(name, settings), normalize_observation=True, normalize_reward=True
    )
    env = DummyVecEnv([Follow] * 8)
    model = build_model(algo, env, seed=0)
    model.set_logger(Logger(None, []))
    # A2C makes a single step of the gradient per update, CrossQ one of the policy's per three
    model.learn({"a2c": 3200, "crossq": 1600}.get(name, 800))
    goals = np.random.default_rng(1).uniform(-1, 1, (500, 2))
    policy = LearnedPolicy(bundle_from_sb3(model, (TermLayout("goal", 2),), {}, {}))
    actions, _ = policy.predict(Follow.seen(goals), None, np.ones(500, bool))
    # the best that takes no notice of the goal is to stay at 0
    error, error_at_0 = (np.square(a - 0.5 * goals).mean() ** 0.5 for a in (actions, 0.0))
    assert error < 0.5 * error_at_0
