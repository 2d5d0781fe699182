"""Minari's collector of data sets, around the id and nothing else."""

import gymnasium
import pytest

ID = "flyrl:flyrl/Target-v0"
LIMIT = 30  # decisions


@pytest.mark.filterwarnings("ignore")
def test_episodes_become_a_dataset_that_knows_its_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    import minari

    env = gymnasium.make(ID, physics="fast", decision_interval=0.1)
    collector = minari.DataCollector(env, record_infos=True)
    for seed in range(2):
        collector.reset(seed=seed)
        env.action_space.seed(seed)
        ends = False
        while not ends:
            _, _, terminated, truncated, _ = collector.step(env.action_space.sample())
            ends = terminated or truncated
    dataset = collector.create_dataset("flyrl/random-v0")
    episodes = list(dataset.iterate_episodes())
    assert [len(episode.rewards) for episode in episodes] == [LIMIT, LIMIT]
    assert set(episodes[0].infos) == {"is_success", "outcome", "time_s"}
    again = dataset.recover_environment()
    observation, _ = again.reset(seed=1)
    assert (observation == episodes[1].observations[0]).all()
