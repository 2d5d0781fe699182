"""Policies from models of Stable-Baselines3 and back: the same actions; no code without trust."""

import base64
import json
import re
import zipfile
from dataclasses import asdict, replace

import cloudpickle
import numpy as np
import pytest
import torch
from gymnasium.spaces import Dict, Discrete, MultiBinary, MultiDiscrete
from sb3_contrib import ARS, TQC, TRPO, CrossQ, RecurrentPPO
from stable_baselines3 import A2C, DDPG, PPO, SAC, TD3
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn

from flyrl.bodies.worm import CRAWLER
from flyrl.envs.config import env_record
from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.policies import (
    LearnedPolicy,
    PolicyBundle,
    PolicyFileError,
    TermLayout,
    export_sb3,
    import_sb3,
    load_bundle,
    observation_layout,
)
from flyrl.policies.bundle import action_bounds
from flyrl.policies.networks import Normaliser
from flyrl.policies.sb3 import ALGORITHMS, bundle_from_sb3
from flyrl.tasks import TASKS, Neurons
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.models import build_model
from tests.policies.conftest import Bandit, perturbed, random_network

# ------------------------------------------------------------------ from models

LAYOUT = (TermLayout("all", 40),)
DICT_LAYOUT = (
    TermLayout("achieved_goal", 2),
    TermLayout("desired_goal", 2),
    TermLayout("speed", 2),
    TermLayout("other", 3),
)


def _random(*shape):
    return np.random.default_rng(0).normal(size=shape).astype(np.float32)


PARTS = {"observation": 5, "desired_goal": 2, "achieved_goal": 2}
CHOOSING = MultiDiscrete([16, 8])
FLAT = [PPO, A2C, TRPO, SAC, TQC, CrossQ, TD3, DDPG]


@pytest.mark.parametrize(
    ("algorithm", "env", "activation"),
    [
        *[(algorithm, Bandit(), nn.ReLU) for algorithm in FLAT],
        *[(algorithm, Bandit(action_space=CHOOSING), nn.Tanh) for algorithm in (PPO, A2C, TRPO)],
        *[(algorithm, Bandit(PARTS), nn.Tanh) for algorithm in (PPO, SAC, TQC, TD3, RecurrentPPO)],
    ],
)
def test_same_actions_as_sb3(algorithm, env, activation):
    is_dict, memory = isinstance(env.observation_space, Dict), algorithm is RecurrentPPO
    name = f"{'MultiInput' if is_dict else 'Mlp'}{'Lstm' if memory else ''}Policy"
    network = {"net_arch": [64, 64], "activation_fn": activation}
    model = perturbed(algorithm(name, env, policy_kwargs=network, device="cpu", seed=0))
    bundle = bundle_from_sb3(model, DICT_LAYOUT if is_dict else LAYOUT, {}, {})
    parts = {name: _random(500 + i, size)[i:] for i, (name, size) in enumerate(PARTS.items())}
    observations = parts if is_dict else _random(500, 40)
    expected, _ = model.predict(observations, deterministic=True)
    actions, _ = LearnedPolicy(bundle).predict(observations)
    assert np.ptp(expected, axis=0).min() > 0.1
    assert actions.dtype == expected.dtype
    # ours are computed in float64; torch rounds to float32 in every layer
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)


def test_later_training_does_not_change_the_bundle():
    env = VecNormalize(DummyVecEnv([Bandit]))
    model = PPO("MlpPolicy", env, device="cpu")
    policy = LearnedPolicy(bundle_from_sb3(model, LAYOUT, {}, {}))
    before, _ = policy.predict(np.ones(40))
    perturbed(model)
    env.obs_rms.mean += 1
    after, _ = LearnedPolicy(policy.bundle).predict(np.ones(40))
    np.testing.assert_array_equal(before, after)
    env.norm_obs = False  # of rewards alone, there is no normaliser
    assert bundle_from_sb3(model, LAYOUT, {}, {}).normaliser is None


OTHER_SPACES = (Discrete(4), MultiBinary(4), MultiDiscrete([4, 2], start=np.array([0, 1])))


@pytest.mark.parametrize(
    ("algorithm", "space", "kwargs", "message"),
    [
        (ARS, None, {}, "policy: ARSPolicy"),
        (PPO, None, {"activation_fn": nn.ELU}, "ELU; allowed: Linear, Tanh, ReLU"),
        (RecurrentPPO, None, {"lstm_kwargs": {"bias": False}}, "LSTMs with biases"),
        *[(PPO, space, {}, f"got {re.escape(str(space))}") for space in OTHER_SPACES],
    ],
)
def test_what_a_bundle_cannot_hold_is_refused(algorithm, space, kwargs, message):
    env, policy = Bandit(), "MlpLstmPolicy" if algorithm is RecurrentPPO else "MlpPolicy"
    env.action_space = space or env.action_space
    model = algorithm(policy, env, policy_kwargs=kwargs, device="cpu")
    with pytest.raises(ValueError, match=message):
        bundle_from_sb3(model, LAYOUT, {}, {})


# ------------------------------------------------------------------ from files

ENV = EnvConfig("target", terrain="gapped")
SIZE = sum(term.size for term in observation_layout(TASKS["target"]()))


@pytest.fixture(scope="module")
def fly_env():
    env = FlyrlVecEnv(ENV, 2, num_threads=1, seed=0)
    yield env
    env.close()


def test_a_model_with_hindsight_can_be_imported(tmp_path):
    config = EnvConfig("target_goal")
    env = FlyrlVecEnv(config, 2, num_threads=1, seed=0)
    algo = AlgorithmConfig("sac", her=True, learning_starts=1000, hidden_layers=(8,))
    model = build_model(algo, env, seed=0)
    model.save(tmp_path / "model.zip")
    bundle = import_sb3(tmp_path / "model.zip", SAC, config, trust=True)
    weights = model.actor.latent_pi[0].weight.detach().numpy()
    np.testing.assert_array_equal(bundle.weights["0.weight"], weights)
    env.close()


class _Trap:
    """Leaves a file behind where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (self.path.touch, ())


def test_nothing_is_opened_without_trust(tmp_path):
    pickled = base64.b64encode(cloudpickle.dumps(_Trap(tmp_path / "sprung"))).decode()
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as archive:  # as SB3 makes one
        data = {"policy_class": {":type:": "x", ":serialized:": pickled}}
        archive.writestr("data", json.dumps(data))
    for trust in ({}, {"trust": "no"}):
        with pytest.raises(PolicyFileError, match=r"not opened.*pickles.*trust=True"):
            import_sb3(path, PPO, ENV, **trust)
    assert not (tmp_path / "sprung").exists()
    with pytest.raises(PolicyFileError, match="cannot be read as a model of PPO"):
        import_sb3(path, PPO, ENV, trust=True)
    assert (tmp_path / "sprung").exists()  # it would have


def test_files_of_other_things_are_refused(fly_env, tmp_path):
    model, other, broken = (tmp_path / name for name in ("model.zip", "other.zip", "broken"))
    PPO("MlpPolicy", fly_env, device="cpu").save(model)
    PPO("MlpPolicy", Bandit(SIZE), device="cpu").save(other)
    broken.write_bytes(b"weights")
    choosing = tmp_path / "choosing.zip"
    export_sb3(_bundle(PPO, CHOICES), CHOICES.resolved_task).save(choosing)
    other_choices = replace(CHOICES, task=replace(CHOICES.task, actions=Neurons((16, 9))))
    message = r"on other actions .*\[16 +8\].* has .*\[16 +9\]"
    with pytest.raises(PolicyFileError, match=message):
        import_sb3(choosing, PPO, other_choices, trust=True)
    for path, algorithm, statistics, message in (
        (broken, PPO, None, "broken cannot be read as a model of PPO"),
        (model, SAC, None, "cannot be read as a model of SAC"),
        (other, PPO, None, "other observations than those of target"),
        (model, PPO, broken, "broken cannot be read as statistics"),
    ):
        with pytest.raises(PolicyFileError, match=message):
            import_sb3(path, algorithm, ENV, vec_normalize=statistics, trust=True)


# ------------------------------------------------------------------ to models

CHOICES = EnvConfig(
    replace(TASKS["target"](), actions=Neurons((16, 8)), props=()), replace(CRAWLER, segments=2)
)


def _bundle(algorithm, env=ENV, hidden=(16, 8), activation="tanh", is_normalised=False):
    """A bundle with random weights for a task, as of an algorithm."""
    task, rng = env.resolved_task, np.random.default_rng(3)
    layout, (low, high) = observation_layout(task), action_bounds(task.actions.space)
    size = sum(term.size for term in layout)
    is_recurrent = algorithm is RecurrentPPO
    outputs = sum(task.actions.pools) if env is CHOICES else 2
    squashing = "tanh" if algorithm is SAC else "clip"
    statistics = Normaliser(rng.normal(size=size), rng.uniform(0.1, 4, size), 1e-6, 1.5)
    return PolicyBundle(
        **random_network(
            (6 if is_recurrent else size, *hidden, outputs),
            activation,
            (size, 6, 6) if is_recurrent else (),
        ),
        squashing="argmax" if env is CHOICES else squashing,
        observation=layout,
        action_low=low,
        action_high=high,
        env=env_record(env),
        training={"decisions": 900},
        normaliser=statistics if is_normalised else None,
    )


GOAL = EnvConfig("target_goal")


@pytest.fixture(
    params=[
        (PPO, ENV),
        (PPO, ENV, (16, 8), "relu"),
        (SAC, ENV, ()),
        (PPO, GOAL, (16,), "tanh", True),
        (SAC, GOAL),
        (RecurrentPPO, ENV, (16,), "tanh", True),
        (PPO, CHOICES, (16,)),
        (RecurrentPPO, CHOICES, (16,)),
    ],
    ids=lambda given: given[0].__name__,
)
def case(request):
    """An algorithm, what was trained in, a bundle, and the model that acts as it."""
    algorithm, env, *others = request.param
    bundle = _bundle(algorithm, env, *others)
    return algorithm, env, bundle, export_sb3(bundle, env.resolved_task)


def test_exported_model_acts_as_the_bundle(case):
    algorithm, env, bundle, model = case
    policy, statistics = LearnedPolicy(bundle), model.get_vec_normalize_env()
    assert type(model) is algorithm
    rng, given = np.random.default_rng(4), []
    state = own_state = None
    for observations in _random(40, 5, bundle.num_inputs):
        starts = rng.random(5) < 0.2
        expected, state = policy.predict(observations, state, starts)
        seen = observations
        if env is GOAL:
            parts = np.split(observations, [2, 4], axis=1)
            seen = dict(zip(("achieved_goal", "desired_goal", "observation"), parts, strict=True))
        seen = statistics.normalize_obs(seen) if statistics else seen
        actions, own_state = model.predict(seen, own_state, starts, deterministic=True)
        np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)
        given.append(expected)
    assert np.ptp(given) > 0.5
    if bundle.lstm_sizes:
        np.testing.assert_allclose(own_state, state, rtol=0, atol=5e-6)
        assert np.abs(state).max() > 0.5


def test_out_and_in_again_is_the_same_policy(case, tmp_path):
    algorithm, env, bundle, model = case
    files = {}
    model.save(tmp_path / "model.zip")
    if bundle.normaliser:
        files["vec_normalize"] = tmp_path / "statistics.pkl"
        model.get_vec_normalize_env().save(files["vec_normalize"])
    again = import_sb3(tmp_path / "model.zip", algorithm, env, **files, trust=True)
    assert ALGORITHMS[again.training["algo"]] is algorithm
    again = replace(again, training=bundle.training)
    np.testing.assert_equal(asdict(again), asdict(bundle))


@pytest.mark.parametrize(
    ("algorithm", "settings"),
    [
        (PPO, {"n_steps": 4, "batch_size": 4}),
        (SAC, {"learning_starts": 4}),
        (RecurrentPPO, {"n_steps": 8, "n_epochs": 1}),
    ],
)
def test_exported_model_and_its_statistics_learn_on(algorithm, settings, fly_env, tmp_path):
    model = export_sb3(_bundle(algorithm, is_normalised=True))
    model.save(tmp_path / "model.zip")
    model.get_vec_normalize_env().save(tmp_path / "statistics.pkl")
    env = VecNormalize.load(tmp_path / "statistics.pkl", fly_env)
    model = algorithm.load(tmp_path / "model.zip", env=env, device="cpu", **settings)
    before = model.predict(_random(200, SIZE), deterministic=True)[0]
    model.learn(16)
    assert np.any(model.predict(_random(200, SIZE), deterministic=True)[0] != before)
    # 2 observations from the reset and 16 from the steps, on top of what is recorded
    assert env.obs_rms.count == 900 + 2 + 16


def test_same_seed_same_model():
    def parameters(seed):
        policy = export_sb3(_bundle(PPO), seed=seed).policy
        return np.concatenate([p.detach().numpy().ravel() for p in policy.parameters()])

    torch.manual_seed(5)
    state = torch.get_rng_state()
    np.testing.assert_array_equal(parameters(0), parameters(0))
    assert np.any(parameters(0) != parameters(1))
    assert torch.equal(torch.get_rng_state(), state)


def test_exports_that_do_not_fit_are_refused():
    fitting = _bundle(PPO)
    squashed_memory = replace(_bundle(RecurrentPPO), squashing="tanh")
    for bundle, task, message in (
        (fitting, "velocity", "observations that velocity does not show"),
        (load_bundle("stop-flat"), None, "takes all that stop shows, .* without time_left"),
        (
            replace(fitting, action_high=(0.5, 0.5)),
            None,
            r"within \(-1\.0, -1\.0\) and \(0\.5, 0\.5\)",
        ),
        (squashed_memory, None, "squashing: 'tanh'; allowed with a memory: 'clip', 'argmax'"),
        (replace(fitting, env={"task": {"name": "fly"}}), None, "task must be one of .*'fly'"),
        (replace(fitting, env={"task": {"name": "a:b"}}), None, "code that would be run"),
        (_bundle(PPO, CHOICES), "target", "are whole numbers within .* of target numbers"),
    ):
        with pytest.raises(ValueError, match=message):
            export_sb3(bundle, task)
