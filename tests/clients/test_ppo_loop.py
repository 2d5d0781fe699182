import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from tests.clients.ppo_loop import Agent, train

NUM_ENVS = 4
HORIZON = 32


@pytest.fixture(scope="module")
def run():
    settings = {"decision_interval": 0.1, "physics": "fast"}
    envs = gymnasium.make_vec("flyrl:flyrl/Target-v0", num_envs=NUM_ENVS, **settings)
    envs = RecordEpisodeStatistics(envs)
    agent, log = train(envs, updates=2, horizon=HORIZON, seed=0)
    envs.close()
    return agent, log, envs


def _steps(log, name):
    return np.concatenate([np.array(getattr(rollout, name)) for rollout in log.rollouts])


def test_the_loop_sums_up_the_episodes_that_gymnasium_sees(run):
    _, log, envs = run
    reward, done, is_real = (_steps(log, name) for name in ("reward", "done", "is_real"))
    returns, lengths = [], []
    total, length = np.zeros(NUM_ENVS), np.zeros(NUM_ENVS, dtype=int)
    for t in range(len(reward)):
        total += reward[t] * is_real[t]
        length += is_real[t]
        for i in np.flatnonzero(done[t]):
            returns.append(total[i])
            lengths.append(length[i])
            total[i] = length[i] = 0
    assert len(returns) >= 2 * NUM_ENVS
    np.testing.assert_array_equal(lengths, envs.length_queue)
    np.testing.assert_allclose(returns, envs.return_queue, rtol=0, atol=1e-9)


def test_a_step_that_resets_has_no_reward_and_shows_the_new_episode(run):
    _, log, _ = run
    real, reward = _steps(log, "is_real"), _steps(log, "reward")
    before, after = _steps(log, "observation"), _steps(log, "next_observation")
    assert (~real).sum() >= NUM_ENVS
    np.testing.assert_array_equal(reward[~real], 0)
    # a fly moves less in a decision than from the end of an episode to the start of the next
    jumps = np.abs(after - before).max(axis=-1)
    assert jumps[~real].min() > 0.1


def test_every_update_fits_the_values(run):
    _, log, _ = run
    for before, after in log.value_errors:
        assert after < before


def test_the_policy_changes(run):
    agent, _, _ = run
    torch.manual_seed(0)
    untrained = Agent(agent.mean[0].in_features, agent.mean[-1].out_features)
    for name, parameter in agent.named_parameters():
        assert torch.isfinite(parameter).all()
        assert not torch.equal(parameter, untrained.get_parameter(name)), name
