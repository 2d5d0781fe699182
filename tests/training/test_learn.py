import pickle
from dataclasses import replace

import numpy as np
import pytest
from stable_baselines3 import PPO

from flyrl.envs.config import env_record
from flyrl.envs.core import EnvConfig
from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.policies import load_policy, observation_layout
from flyrl.tasks import TASKS
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.callback import held_out_episodes
from flyrl.training.config import CurriculumConfig
from flyrl.training.learn import resume, train
from flyrl.training.runs import read_rows, read_run
from flyrl.validation import plain
from tests.tiny import TINY

SCHEDULE = replace(TINY.training, total_timesteps=96)
PPO_CONFIG = replace(
    TINY,
    algo=TINY.algo.with_settings(
        hidden_layers=(16, 16), normalize_observation=True, normalize_reward=True
    ),
    training=SCHEDULE,
)
SAC_CONFIG = replace(
    PPO_CONFIG,
    algo=AlgorithmConfig(
        "sac", learning_starts=16, batch_size=16, gradient_steps=1, hidden_layers=(16,)
    ),
)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return train(PPO_CONFIG, tmp_path_factory.mktemp("runs"), ["train.py"])


OBSERVATIONS = np.random.default_rng(0).normal(size=(20, 47)).astype(np.float32)


def _actions(path):
    return load_policy(path).predict(OBSERVATIONS)[0]


def test_run_folder_is_complete(run):
    assert run.interrupted_by is None
    # there only where the checkout has changes
    assert {path.name for path in run.folder.iterdir()} - {"code.diff"} == {
        ".lock",
        "best.safetensors",
        "checkpoints",
        "command.txt",
        "config.yaml",
        "evaluations.csv",
        "last.safetensors",
        "model.zip",
        "progress.csv",
        "provenance.json",
        "status.json",
        "tensorboard",
        "vecnormalize.pkl",
    }
    assert any((run.folder / "tensorboard").iterdir())


def test_policy_knows_where_it_comes_from(run):
    bundle = load_policy(run.folder).bundle
    assert bundle.observation == observation_layout(TASKS["target"]())
    assert bundle.env == env_record(PPO_CONFIG.env)
    assert bundle.training["algo"] == "ppo"
    settings = bundle.training["settings"]  # which its seeds have in common
    assert settings["algo"] == {"name": "ppo", **plain(PPO_CONFIG.algo.settings)}
    assert settings["training"]["num_envs"] == PPO_CONFIG.training.num_envs


def test_last_policy_acts_as_the_sb3_model_on_its_statistics(run):
    with (run.folder / "vecnormalize.pkl").open("rb") as file:
        normaliser = pickle.load(file)
    # one observation of each fly at the start, one after each decision (and SB3 starts at 1e-4)
    assert normaliser.obs_rms.count == pytest.approx(4 + 96, abs=0.01)
    expected, _ = PPO.load(run.folder / "model.zip", device="cpu").predict(
        normaliser.normalize_obs(OBSERVATIONS), deterministic=True
    )
    actions = _actions(run.folder / "last.safetensors")
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-6)


def test_evaluations_and_best_policy(run):
    rows = read_run(run.folder).evaluations
    # after the updates at 32 and 64 decisions, and at the end
    assert [row["decisions"] for row in rows] == [32, 64, 96]
    best = max(rows, key=lambda row: (row["success_rate"], row["mean_return"]))
    bundle = load_policy(run.folder / "best.safetensors").bundle
    assert bundle.training["evaluation"].items() <= best.items()
    weights = {term.name: term.weight for term in PPO_CONFIG.env.resolved_task.reward}
    weighted = sum(weight * best[f"unweighted_{name}"] for name, weight in weights.items())
    assert weighted == pytest.approx(best["mean_return"])


def test_the_policy_depends_on_the_seed_and_not_on_threads(run, tmp_path):
    again = train(replace(PPO_CONFIG, training=replace(SCHEDULE, num_threads=2)), tmp_path)
    policies = [(each.folder / "last.safetensors").read_bytes() for each in (run, again)]
    assert policies[0] == policies[1]
    other = train(replace(PPO_CONFIG, seed=1), tmp_path)
    assert np.abs(_actions(other.folder) - _actions(run.folder)).max() > 1e-3


def test_no_run_learns_from_held_out_episodes():
    held_out = held_out_episodes(PPO_CONFIG)
    assert held_out == held_out_episodes(replace(PPO_CONFIG, seed=5))
    assert len({episode.seed for episode in held_out}) == 2
    assert all(2**31 <= episode.seed < 3 * 2**30 for episode in held_out)


@pytest.mark.parametrize("config", [PPO_CONFIG, SAC_CONFIG], ids=["ppo", "sac"])
def test_a_training_that_diverges_says_so(config, tmp_path):
    algo = config.algo.with_settings(learning_rate=1e6)
    with pytest.raises(ValueError, match=r"diverged after \d+ decisions: .*algo\.learning_rate"):
        train(replace(config, algo=algo), tmp_path)


def test_a_run_that_shall_not_go_on_ends_after_the_evaluation_and_can_be_resumed(run, tmp_path):
    seen = []

    def goes_on(evaluations):
        seen.append([row["decisions"] for row in evaluations])
        return len(evaluations) < 2

    folder = train(PPO_CONFIG, tmp_path, goes_on=goes_on).folder
    pruned = read_run(folder)
    assert seen == [[32], [32, 64]]
    assert [row["decisions"] for row in pruned.evaluations] == [32, 64]
    assert pruned.state == "interrupted"
    assert pruned.decisions < PPO_CONFIG.training.total_timesteps
    resume(PPO_CONFIG, folder)
    assert read_run(folder).evaluations == read_run(run.folder).evaluations
    assert np.array_equal(_actions(folder), _actions(run.folder))


def test_a_policy_trained_on_goals_enters_an_evaluation(tmp_path):
    task = replace(TASKS["target_goal"](), time_limit_s=0.2)
    algo = SAC_CONFIG.algo.with_settings(her=True, learning_starts=40)
    run = train(replace(SAC_CONFIG, env=EnvConfig(task), algo=algo), tmp_path)
    results = evaluate(
        EvaluationConfig(
            policies=(str(run.folder / "last.safetensors"),),
            controllers=("zero",),
            task=task,
            episodes=1,
            num_threads=1,
            reference="zero",
        )
    )
    assert np.abs(results.trajectories[0].drive[1:]).max() > 0.01


def test_a_curriculum_makes_the_training_harder_but_not_the_evaluation(tmp_path):
    curriculum = CurriculumConfig(enabled=True, step=0.25, window=4, raise_at=0.0)
    config = replace(
        PPO_CONFIG,
        env=EnvConfig(replace(TASKS["target"](), time_limit_s=0.1)),
        training=replace(SCHEDULE, curriculum=curriculum),
    )
    run = train(config, tmp_path)
    # four episodes end at a time, after 5, 10, 15, 20 decisions; those that began as the difficulty
    # rose were drawn before, and do not count
    logged = (row["curriculum/difficulty"] for row in read_rows(run.folder / "progress.csv"))
    difficulties = [float(text) for text in logged if text]
    assert difficulties == sorted(difficulties)
    assert (difficulties[0], difficulties[-1]) == (0.25, 0.5)
    assert {episode.difficulty for episode in held_out_episodes(config)} == {1.0}


@pytest.mark.parametrize(("stop_at", "evaluations"), [(0.0, [32, 64]), (1.0, [32, 64, 96])])
def test_a_run_ends_once_two_evaluations_in_a_row_are_good_enough(tmp_path, stop_at, evaluations):
    config = replace(PPO_CONFIG, training=replace(SCHEDULE, stop_at=stop_at))
    ended = read_run(train(config, tmp_path).folder)
    assert [row["decisions"] for row in ended.evaluations] == evaluations
    assert ended.state == "finished"
