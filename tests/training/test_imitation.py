"""A training that starts from a teacher's decisions."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.policies import load_policy, named_policies
from flyrl.tasks import TASKS
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.config import ScheduleConfig, TrainingConfig
from flyrl.training.imitation import discounted_returns, imitate
from flyrl.training.learn import resume, train
from flyrl.training.models import build_model
from flyrl.training.runs import read_run
from tests.tiny import TINY, TINY_ENV

SCHEDULE = ScheduleConfig(
    num_envs=4, num_threads=1, progress_bar=False, teacher="pursuit", demonstrations=98
)
OF_ALGORITHM = {
    "crossq": {"hidden_layers": (8,)},
    "ppo": {"hidden_layers": (16,), "log_std_init": -1.0},
    "recurrent_ppo": {"hidden_layers": (16,), "lstm_hidden_size": 16},
}


def taught(algo, **changes):
    """Model after its teacher's decisions, and the same before."""
    config = TrainingConfig(
        env=TINY_ENV,
        algo=AlgorithmConfig(algo, **OF_ALGORITHM[algo]),
        training=replace(SCHEDULE, **changes),
    )
    torch.set_num_threads(1)  # as in a training
    env = FlyrlVecEnv(config.env, config.training.num_envs, num_threads=1)
    models = [build_model(config.algo, env, seed=0) for _ in range(2)]
    imitate(models[0], config)
    return models


@pytest.fixture(scope="module")
def buffer():
    model, _ = taught("crossq")
    return model.replay_buffer, model.policy


def test_a_replay_buffer_holds_what_the_teacher_did(buffer):
    kept, policy = buffer
    assert kept.pos == 25  # of four flies: 98 and two more
    seen = kept.observations[:25].reshape(100, -1)
    wanted, _ = load_policy("pursuit", TASKS["target"]()).predict(seen)
    done = policy.unscale_action(kept.actions[:25].reshape(100, -1))
    np.testing.assert_allclose(done, wanted, atol=1e-6)
    assert np.ptp(done, axis=0).min() > 0.5


def test_in_it_an_episode_ends_with_what_was_seen_at_its_end(buffer):
    kept, _ = buffer
    # all of ten decisions, that time ended
    assert np.flatnonzero(kept.dones[:25, 0]).tolist() == [9, 19]
    assert (kept.timeouts[:24] == kept.dones[:24]).all()
    follows = (kept.next_observations[:24] == kept.observations[1:25]).all(axis=2)
    assert (follows == (kept.dones[:24] == 0)).all()


def test_returns_over_several_decisions_do_not_run_on_from_it(buffer):
    kept, _ = buffer
    assert (kept.dones[24] == 0).all()  # in the midst of an episode, and no failure
    assert (kept.timeouts[24] == 1).all()


@pytest.mark.parametrize("algo", ["ppo", "recurrent_ppo"])
def test_what_has_no_replay_buffer_learns_to_act_as_the_teacher(algo, monkeypatch):
    monkeypatch.setattr("flyrl.training.imitation._UPDATES", 300)  # half of them
    model, untaught = taught(algo, num_envs=64, demonstrations=640)
    env = FlyrlVecEnv(TINY_ENV, num_envs=8, num_threads=1, seed=1000)
    seen = env.reset()
    wanted, _ = load_policy("pursuit", TASKS["target"]()).predict(seen)
    before, after = (
        np.abs(each.predict(seen, deterministic=True)[0] - wanted).mean()
        for each in (untaught, model)
    )
    assert after < 0.5 * before
    assert torch.equal(model.policy.log_std, untaught.policy.log_std)


@pytest.fixture
def few_updates(monkeypatch):
    """Cloning that is too short to act as the teacher."""
    monkeypatch.setattr("flyrl.training.imitation._UPDATES", 20)


def test_the_same_seed_learns_the_same_bits_of_it(few_updates):
    one, another = (taught("ppo")[0].policy.state_dict() for _ in range(2))
    assert all(torch.equal(one[name], another[name]) for name in one)


def test_returns_are_discounted_to_the_end_of_the_episode():
    rewards = torch.tensor([[1.0, 2.0, 4.0, 8.0]])
    done = torch.tensor([[False, True, False, False]])
    returns, is_known = discounted_returns(rewards, done, gamma=0.5)
    # the second episode goes on after what was seen
    assert returns.tolist() == [[1 + 0.5 * 2, 2.0, 4 + 0.5 * 8, 8.0]]
    assert is_known.tolist() == [[True, True, False, False]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"training": {"teacher": "pursuitt"}}, r"training\.teacher: .*did you mean 'pursuit'"),
        ({"task": "velocity"}, r"training\.teacher: 'pursuit' needs a task .* got 'velocity'"),
        ({"task": "target_goal", "algo": "sac"}, r"training\.teacher must be null in .* goals"),
        ({"training": {"teacher": None}}, r"demonstrations must be null without .* got 98"),
        ({"of_algo": {"normalize_observation": True}}, r"normalize_observation must be false"),
    ],
)
def test_a_teacher_that_does_not_fit_is_refused(tmp_path, changes, message):
    with pytest.raises(ValueError, match=message):
        train(
            TrainingConfig(
                env=replace(TINY_ENV, task=changes.get("task", "target")),
                algo=AlgorithmConfig(changes.get("algo", "ppo"), **changes.get("of_algo", {})),
                training=replace(SCHEDULE, **changes.get("training", {})),
            ),
            tmp_path,
        )
    assert not list(tmp_path.iterdir())


def test_a_run_goes_on_without_its_teacher(tmp_path, few_updates):
    teacher = Path(shutil.copy(named_policies()["target-flat"], tmp_path))
    schedule = replace(TINY.training, teacher=str(teacher), demonstrations=40)
    config = replace(TINY, training=schedule)
    folder = train(config, tmp_path / "runs", goes_on=lambda evaluations: False).folder
    teacher.unlink()
    resume(config, folder)
    assert read_run(folder).state == "finished"
