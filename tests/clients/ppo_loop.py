"""PPO in one loop over `gymnasium.make_vec`, written without a thought of flyrl."""

from dataclasses import dataclass, field

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from torch import nn
from torch.distributions import Normal

GAMMA, LAMBDA, CLIP, LEARNING_RATE, EPOCHS = 0.99, 0.95, 0.2, 3e-3, 10


class Agent(nn.Module):
    """Gaussian policy with a mean from a small network, and a value beside it."""

    def __init__(self, num_inputs: int, num_actions: int) -> None:
        super().__init__()
        self.mean = nn.Sequential(nn.Linear(num_inputs, 32), nn.Tanh(), nn.Linear(32, num_actions))
        self.critic = nn.Sequential(nn.Linear(num_inputs, 32), nn.Tanh(), nn.Linear(32, 1))
        self.log_std = nn.Parameter(torch.full((num_actions,), -0.5))

    def distribution(self, observation: torch.Tensor) -> Normal:
        return Normal(self.mean(observation), self.log_std.exp())

    def value(self, observation: torch.Tensor) -> torch.Tensor:
        return self.critic(observation).squeeze(-1)


@dataclass
class Rollout:
    """What was collected, (horizon, n, ...); `is_real` is False where a step only reset."""

    observation: list = field(default_factory=list)
    action: list = field(default_factory=list)
    reward: list = field(default_factory=list)
    next_observation: list = field(default_factory=list)
    terminated: list = field(default_factory=list)
    done: list = field(default_factory=list)
    is_real: list = field(default_factory=list)

    def tensors(self) -> dict[str, torch.Tensor]:
        return {
            name: torch.as_tensor(np.array(values)).float() for name, values in vars(self).items()
        }


@dataclass
class Log:
    """Per update: the rollout, and the error of the values before and after the update."""

    rollouts: list[Rollout] = field(default_factory=list)
    value_errors: list[tuple[float, float]] = field(default_factory=list)


def train(envs: gymnasium.vector.VectorEnv, updates: int, horizon: int, seed: int) -> tuple:
    """Agent and log after so many updates of `horizon` steps each."""
    # an environment that is done resets in its next step, whose action and reward count for nothing
    assert envs.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    torch.manual_seed(seed)
    agent = Agent(envs.single_observation_space.shape[0], envs.single_action_space.shape[0])
    optimiser = torch.optim.Adam(agent.parameters(), lr=LEARNING_RATE)
    log = Log()
    observation, _ = envs.reset(seed=seed)
    done = np.zeros(envs.num_envs, dtype=bool)
    for _ in range(updates):
        rollout = Rollout()
        for _ in range(horizon):
            with torch.no_grad():
                action = agent.distribution(torch.as_tensor(observation)).sample().numpy()
            low, high = envs.single_action_space.low, envs.single_action_space.high
            after, reward, terminated, truncated, _ = envs.step(np.clip(action, low, high))
            was_done, done = done, terminated | truncated
            step = (observation, action, reward, after, terminated, done, ~was_done)
            for values, value in zip(vars(rollout).values(), step, strict=True):
                values.append(value)
            observation = after
        log.rollouts.append(rollout)
        log.value_errors.append(_update(agent, optimiser, rollout.tensors()))
    return agent, log


def _update(
    agent: Agent, optimiser: torch.optim.Optimizer, data: dict[str, torch.Tensor]
) -> tuple[float, float]:
    with torch.no_grad():
        value, after = agent.value(data["observation"]), agent.value(data["next_observation"])
        before = agent.distribution(data["observation"]).log_prob(data["action"]).sum(-1)
    # the observation after the last step of an episode is its own: a truncated one goes on from it
    delta = data["reward"] + GAMMA * after * (1 - data["terminated"]) - value
    advantage, following = torch.zeros_like(delta), torch.zeros_like(delta[0])
    for t in reversed(range(len(delta))):
        following = delta[t] + GAMMA * LAMBDA * (1 - data["done"][t]) * following
        advantage[t] = following
    returns = advantage + value
    real = data["is_real"].bool()
    scaled = (advantage[real] - advantage[real].mean()) / (advantage[real].std() + 1e-8)
    errors = []
    for _ in range(EPOCHS):
        value_error = (agent.value(data["observation"][real]) - returns[real]).square().mean()
        log_prob = agent.distribution(data["observation"][real]).log_prob(data["action"][real])
        ratio = (log_prob.sum(-1) - before[real]).exp()
        gain = torch.minimum(ratio * scaled, ratio.clamp(1 - CLIP, 1 + CLIP) * scaled).mean()
        optimiser.zero_grad()
        (0.5 * value_error - gain).backward()
        nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
        optimiser.step()
        errors.append(float(value_error.detach()))
    return errors[0], errors[-1]
