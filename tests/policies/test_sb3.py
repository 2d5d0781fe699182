import base64
import json
import zipfile
from dataclasses import replace

import cloudpickle
import numpy as np
import pytest
import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.vec_env import VecNormalize

from flyrl.bodies.worm import CRAWLER
from flyrl.envs.core import EnvConfig
from flyrl.envs.record import env_record
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.policies import (
    LearnedPolicy,
    PolicyFileError,
    export_sb3,
    import_sb3,
    observation_layout,
)
from flyrl.policies.networks import Normaliser
from flyrl.policies.sb3 import bundle_from_sb3
from flyrl.tasks import TASKS, Neurons
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.models import build_model
from tests.policies.conftest import Bandit, random_lstm, random_network, same_weights

ENV = EnvConfig("target", terrain="gapped")
SIZE = sum(term.size for term in observation_layout(TASKS["target"]()))


@pytest.fixture(scope="module")
def fly_env():
    env = FlyrlVecEnv(ENV, 2, num_threads=1, seed=0)
    yield env
    env.close()


def _observations(n=200):
    return np.random.default_rng(0).normal(size=(n, SIZE)).astype(np.float32)


def _bundle(bundle, squashing="clip", activation="tanh", hidden=(16, 8)):
    """A bundle for the task Target."""
    return replace(
        bundle,
        network=random_network((SIZE, *hidden, 2), activation),
        squashing=squashing,
        observation=observation_layout(TASKS["target"]()),
        env=env_record(ENV),
    )


@pytest.mark.parametrize("algorithm", [PPO, SAC])
def test_imported_policy_acts_as_the_model(algorithm, fly_env, tmp_path):
    model = algorithm("MlpPolicy", fly_env, device="cpu", seed=0)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=generator))
    model.save(tmp_path / "model.zip")
    bundle = import_sb3(tmp_path / "model.zip", algorithm, ENV, trust=True)
    expected, _ = model.predict(_observations(), deterministic=True)
    actions, _ = LearnedPolicy(bundle).predict(_observations())
    assert np.ptp(expected) > 1
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)
    assert bundle.env == env_record(ENV)
    assert bundle.training["algo"] == algorithm.__name__.lower()


def test_a_model_with_hindsight_can_be_imported(tmp_path):
    config = EnvConfig("target_goal")
    env = FlyrlVecEnv(config, 2, num_threads=1, seed=0)
    model = build_model(
        AlgorithmConfig("sac", her=True, learning_starts=1000, hidden_layers=(8,)), env, seed=0
    )
    model.save(tmp_path / "model.zip")
    bundle = import_sb3(tmp_path / "model.zip", SAC, config, trust=True)
    weights = model.actor.latent_pi[0].weight.detach().numpy()
    np.testing.assert_array_equal(bundle.network.layers[0].weight, weights)
    env.close()


@pytest.fixture
def normalised(fly_env, tmp_path):
    """A model that was trained under VecNormalize, and the folder that it was saved in."""
    env = VecNormalize(fly_env, clip_obs=2.0)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=16, device="cpu", seed=0)
    model.learn(16)
    model.save(tmp_path / "model.zip")
    env.save(tmp_path / "vecnormalize.pkl")
    return model, tmp_path


def test_imported_policy_normalises_as_the_model_did(normalised):
    model, folder = normalised
    statistics = folder / "vecnormalize.pkl"
    bundle = import_sb3(folder / "model.zip", PPO, ENV, vec_normalize=statistics, trust=True)
    observations = model.get_vec_normalize_env().normalize_obs(_observations())
    expected, _ = model.predict(observations, deterministic=True)
    actions, _ = LearnedPolicy(bundle).predict(_observations())
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)


def test_statistics_that_are_none_are_refused(normalised):
    _, folder = normalised
    (folder / "vecnormalize.pkl").write_bytes(b"statistics")
    with pytest.raises(PolicyFileError, match=r"normalize\.pkl cannot be read as statistics"):
        import_sb3(
            folder / "model.zip", PPO, ENV, vec_normalize=folder / "vecnormalize.pkl", trust=True
        )


class _Trap:
    """Leaves a file behind where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (self.path.touch, ())


@pytest.fixture
def trap(tmp_path):
    """A zip of SB3's make whose pickle does something."""
    pickled = base64.b64encode(cloudpickle.dumps(_Trap(tmp_path / "sprung"))).decode()
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as archive:
        data = {"policy_class": {":type:": "x", ":serialized:": pickled}}
        archive.writestr("data", json.dumps(data))
    return path


def test_nothing_is_opened_without_trust(trap):
    with pytest.raises(PolicyFileError, match=r"not opened.*pickles.*trust=True"):
        import_sb3(trap, PPO, ENV)
    assert not trap.with_name("sprung").exists()


def test_a_word_is_no_trust(trap):
    with pytest.raises(PolicyFileError, match="not opened"):
        import_sb3(trap, PPO, ENV, trust="no")
    assert not trap.with_name("sprung").exists()


def test_the_trap_would_have_sprung(trap):
    with pytest.raises(PolicyFileError, match="cannot be read as a model of PPO"):
        import_sb3(trap, PPO, ENV, trust=True)
    assert trap.with_name("sprung").exists()


def test_what_is_no_zip_is_refused(tmp_path):
    (tmp_path / "model.zip").write_bytes(b"weights")
    with pytest.raises(PolicyFileError, match=r"model\.zip cannot be read as a model of PPO"):
        import_sb3(tmp_path / "model.zip", PPO, ENV, trust=True)


def test_another_algorithm_is_refused(fly_env, tmp_path):
    PPO("MlpPolicy", fly_env, device="cpu").save(tmp_path / "model.zip")
    with pytest.raises(PolicyFileError, match="cannot be read as a model of SAC"):
        import_sb3(tmp_path / "model.zip", SAC, ENV, trust=True)


def test_other_observations_are_refused(tmp_path):
    PPO("MlpPolicy", Bandit(SIZE), device="cpu").save(tmp_path / "model.zip")
    with pytest.raises(PolicyFileError, match="other observations than those of target"):
        import_sb3(tmp_path / "model.zip", PPO, ENV, trust=True)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("squashing", ["clip", "tanh"])
@pytest.mark.parametrize("hidden", [(16, 8), ()])
def test_exported_model_acts_as_the_bundle(bundle, squashing, activation, hidden):
    bundle = _bundle(bundle, squashing, activation, hidden)
    expected, _ = LearnedPolicy(bundle).predict(_observations())
    actions, _ = export_sb3(bundle).predict(_observations(), deterministic=True)
    assert np.ptp(expected) > 1
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)


@pytest.mark.parametrize(("squashing", "algorithm"), [("clip", PPO), ("tanh", SAC)])
def test_out_and_in_again_is_the_same_policy(bundle, squashing, algorithm, tmp_path):
    bundle = _bundle(bundle, squashing)
    export_sb3(bundle).save(tmp_path / "model.zip")
    again = import_sb3(tmp_path / "model.zip", algorithm, ENV, trust=True)
    assert same_weights(again, bundle)
    for name in ("squashing", "observation", "action_low", "action_high", "env"):
        assert getattr(again, name) == getattr(bundle, name)
    assert again.network.activation == bundle.network.activation


@pytest.mark.parametrize(("squashing", "algorithm"), [("clip", PPO), ("tanh", SAC)])
def test_out_and_in_again_with_goals(bundle, squashing, algorithm, tmp_path):
    env = EnvConfig("target_goal")
    layout = observation_layout(env.resolved_task)
    bundle = replace(
        bundle,
        network=random_network((sum(term.size for term in layout), 16, 2), "tanh"),
        squashing=squashing,
        observation=layout,
        env=env_record(env),
    )
    model = export_sb3(bundle)
    seen = {
        name: np.random.default_rng(1).normal(size=(50, *space.shape)).astype(np.float32)
        for name, space in env.resolved_task.observation_space.items()
    }
    expected, _ = LearnedPolicy(bundle).predict(seen)
    actions, _ = model.predict(seen, deterministic=True)
    assert np.ptp(expected) > 0.5
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)
    model.save(tmp_path / "model.zip")
    again = import_sb3(tmp_path / "model.zip", algorithm, env, trust=True)
    assert same_weights(again, bundle)


@pytest.mark.parametrize(
    ("squashing", "algorithm", "settings"),
    [("clip", PPO, {"n_steps": 4, "batch_size": 4}), ("tanh", SAC, {"learning_starts": 4})],
)
def test_exported_model_learns_on(bundle, squashing, algorithm, settings, fly_env, tmp_path):
    export_sb3(_bundle(bundle, squashing)).save(tmp_path / "model.zip")
    model = algorithm.load(tmp_path / "model.zip", env=fly_env, device="cpu", **settings)
    before = model.predict(_observations(), deterministic=True)[0]
    model.learn(16)
    assert np.any(model.predict(_observations(), deterministic=True)[0] != before)


@pytest.fixture
def remembering(bundle):
    """A bundle for the task Target that normalises, and remembers in two layers."""
    rng = np.random.default_rng(3)
    return replace(
        _bundle(bundle),
        network=random_network((6, 16, 2), "tanh"),
        lstm=random_lstm((SIZE, 6, 6)),
        normaliser=Normaliser(rng.normal(size=SIZE), rng.uniform(0.1, 4, SIZE), 1e-6, 1.5),
    )


def test_exported_model_normalises_and_remembers_as_the_bundle(remembering):
    policy, model = LearnedPolicy(remembering), export_sb3(remembering)
    statistics = model.get_vec_normalize_env()
    rng = np.random.default_rng(4)
    state = own_state = None
    for observations in np.split(_observations(), 40):
        starts = rng.random(5) < 0.2
        expected, state = policy.predict(observations, state, starts)
        seen = statistics.normalize_obs(observations)
        actions, own_state = model.predict(seen, own_state, starts, deterministic=True)
        np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)
    np.testing.assert_allclose(own_state, state, rtol=0, atol=5e-6)
    assert np.abs(state).max() > 0.5


def test_memory_and_statistics_come_back_from_their_files(remembering, tmp_path):
    model = export_sb3(remembering)
    model.save(tmp_path / "model.zip")
    model.get_vec_normalize_env().save(tmp_path / "statistics.pkl")
    again = import_sb3(
        tmp_path / "model.zip",
        RecurrentPPO,
        ENV,
        vec_normalize=tmp_path / "statistics.pkl",
        trust=True,
    )
    assert same_weights(again, remembering)
    for name in ("mean", "variance", "epsilon", "clip"):
        given = getattr(remembering.normaliser, name)
        np.testing.assert_array_equal(getattr(again.normaliser, name), given)
    assert again.training["algo"] == "recurrent_ppo"


def test_statistics_of_dicts_come_back(bundle):
    env = EnvConfig("target_goal")
    layout = observation_layout(env.resolved_task)
    size, rng = sum(term.size for term in layout), np.random.default_rng(5)
    bundle = replace(
        bundle,
        network=random_network((size, 8, 2), "tanh"),
        observation=layout,
        env=env_record(env),
        normaliser=Normaliser(rng.normal(size=size), rng.uniform(0.1, 4, size), 1e-8, 10.0),
    )
    again = bundle_from_sb3(export_sb3(bundle), layout, {}, {})
    np.testing.assert_array_equal(again.normaliser.mean, bundle.normaliser.mean)
    np.testing.assert_array_equal(again.normaliser.variance, bundle.normaliser.variance)


def test_exported_memory_and_statistics_learn_on(remembering, fly_env, tmp_path):
    model = export_sb3(replace(remembering, training={"decisions": 900}))
    model.save(tmp_path / "model.zip")
    model.get_vec_normalize_env().save(tmp_path / "statistics.pkl")
    env = VecNormalize.load(tmp_path / "statistics.pkl", fly_env)
    model = RecurrentPPO.load(tmp_path / "model.zip", env=env, n_steps=8, n_epochs=1)
    before = model.predict(_observations(), deterministic=True)[0]
    model.learn(16)
    assert np.any(model.predict(_observations(), deterministic=True)[0] != before)
    # 2 observations from the reset and 16 from the steps, on top of what is recorded
    assert env.obs_rms.count == 900 + 2 + 16


def test_same_seed_same_model(bundle):
    def parameters(seed):
        policy = export_sb3(_bundle(bundle), seed=seed).policy
        return np.concatenate([p.detach().numpy().ravel() for p in policy.parameters()])

    torch.manual_seed(5)
    state = torch.get_rng_state()
    np.testing.assert_array_equal(parameters(0), parameters(0))
    assert np.any(parameters(0) != parameters(1))
    assert torch.equal(torch.get_rng_state(), state)


def test_export_for_another_task_is_refused(bundle):
    with pytest.raises(PolicyFileError, match="other observations than those of velocity"):
        export_sb3(_bundle(bundle), "velocity")


def test_export_with_other_action_bounds_is_refused(bundle):
    narrow = replace(_bundle(bundle), action_high=(0.5, 0.5))
    with pytest.raises(PolicyFileError, match=r"within \(-1\.0, -1\.0\) and \(0\.5, 0\.5\)"):
        export_sb3(narrow)


def test_export_of_a_memory_with_squashed_output_is_refused(recurrent):
    with pytest.raises(
        ValueError, match="squashing: 'tanh'; allowed with a memory: 'clip', 'argmax'"
    ):
        export_sb3(replace(recurrent, squashing="tanh"))


def test_export_for_an_unknown_task_is_refused(bundle):
    with pytest.raises(ValueError, match=r"task must be one of .*got 'fly'"):
        export_sb3(replace(_bundle(bundle), env={"task": {"name": "fly"}}))


CHOICES = replace(TASKS["target"](), actions=Neurons((16, 8)), props=())
TWO_MUSCLES = replace(CRAWLER, segments=2)


@pytest.fixture(params=[PPO, RecurrentPPO])
def choosing_for_target(request, bundle, remembering):
    """Algorithm, and a bundle of whole numbers for `CHOICES` that such a model acts as."""
    is_recurrent = request.param is RecurrentPPO
    given = remembering if is_recurrent else _bundle(bundle)
    return request.param, replace(
        given,
        network=random_network((6 if is_recurrent else SIZE, 16, 24), "tanh"),
        squashing="argmax",
        action_low=(0.0, 0.0),
        action_high=(15.0, 7.0),
    )


def test_exported_model_chooses_as_the_bundle(choosing_for_target):
    algorithm, bundle = choosing_for_target
    bundle = replace(bundle, normaliser=None)
    model = export_sb3(bundle, CHOICES)
    expected, _ = LearnedPolicy(bundle).predict(_observations())
    actions, _ = model.predict(_observations(), deterministic=True)
    assert type(model) is algorithm
    assert np.ptp(expected, axis=0).all()
    np.testing.assert_array_equal(actions, expected)


def test_whole_numbers_out_and_in_again(choosing_for_target, tmp_path):
    algorithm, bundle = choosing_for_target
    export_sb3(bundle, CHOICES).save(tmp_path / "model.zip")
    again = import_sb3(
        tmp_path / "model.zip", algorithm, EnvConfig(CHOICES, TWO_MUSCLES), trust=True
    )
    assert same_weights(again, bundle)
    for name in ("squashing", "observation", "action_low", "action_high"):
        assert getattr(again, name) == getattr(bundle, name)


def test_whole_numbers_are_not_exported_for_a_task_of_drives(choosing_for_target):
    with pytest.raises(PolicyFileError, match=r"are whole numbers within .* of target numbers"):
        export_sb3(choosing_for_target[1], "target")


def test_import_of_other_numbers_is_refused(choosing_for_target, tmp_path):
    algorithm, bundle = choosing_for_target
    export_sb3(bundle, CHOICES).save(tmp_path / "model.zip")
    other = EnvConfig(replace(CHOICES, actions=Neurons((16, 9))), TWO_MUSCLES)
    with pytest.raises(PolicyFileError, match=r"on other actions .*\[16 +8\].* has .*\[16 +9\]"):
        import_sb3(tmp_path / "model.zip", algorithm, other, trust=True)
