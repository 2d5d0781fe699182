"""A teacher, from whose decisions a training starts instead of from chance.

What has a replay buffer finds them there (Vecerik et al. 2017, arXiv:1707.08817); anything else
first learns to act as the teacher does, and what that is worth (behavioural cloning; Pomerleau
1991, doi:10.1162/neco.1991.3.1.88).
"""

from collections.abc import Iterator
from typing import Any, Final, NamedTuple, cast

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.policies import LearnedPolicy, load_policy
from flyrl.policies.fixed import FixedPolicy
from flyrl.progress import progress_bar
from flyrl.training.config import TrainingConfig

_UPDATES: Final = 3000
_LEARNING_RATE: Final = 3e-3
"""At first; it falls linearly. Fitted less closely, a fly that shall brake 1 mm before a place does
so 3 mm before it (of 96 paths, it follows 86 with 600 updates at a constant rate, and 94)."""
_BATCH: Final = 512
"""Decisions."""

_PIECE: Final = 50
"""Decisions in a row, for a policy with a memory."""

Values = NDArray[np.float32]


class _Decision(NamedTuple):
    """One decision of all flies, and what came of it."""

    observation: Any
    action: Values
    reward: Values
    next_observation: Any
    done: NDArray[np.bool_]
    infos: list[dict[str, Any]]


def imitate(model: BaseAlgorithm, config: TrainingConfig) -> None:
    """Start an untrained model from decisions of its teacher, in episodes of their own.

    Raises
    ------
    ValueError
        No such teacher, or it does not fit the task.
    """
    demonstration = _demonstration(config)
    if (buffer := getattr(model, "replay_buffer", None)) is not None:
        for each in demonstration:
            buffer.add(
                each.observation,
                each.next_observation,
                cast(Any, model.policy).scale_action(each.action),
                each.reward,
                each.done,
                each.infos,
            )
        # returns over several decisions end here, and not in the first episodes of the training
        last = buffer.pos - 1
        buffer.timeouts[last] = np.maximum(buffer.timeouts[last], 1 - buffer.dones[last])
    else:
        _clone(cast(OnPolicyAlgorithm, model), list(demonstration), config.seed)


def teacher_of(config: TrainingConfig) -> LearnedPolicy | FixedPolicy:
    """Load the teacher of a training; ValueError if there is none, or it does not fit the task."""
    try:
        return load_policy(str(config.training.teacher), config.env.resolved_task)
    except ValueError as error:
        raise ValueError(f"training.teacher: {error}") from error


def _demonstration(config: TrainingConfig) -> Iterator[_Decision]:
    """What the teacher does, and what comes of it, decision by decision."""
    schedule = config.training
    teacher = teacher_of(config)
    env = FlyrlVecEnv(config.env, schedule.num_envs, schedule.num_threads)
    env.seed(int(np.random.default_rng([config.seed, 1]).integers(2**30)))
    observation, state = env.reset(), None
    done = np.ones(schedule.num_envs, dtype=bool)
    count = -(-schedule.num_demonstrations // schedule.num_envs)
    with progress_bar(
        count * schedule.num_envs,
        is_shown=schedule.progress_bar,
        unit="decision",
        description="teacher",
    ) as bar:
        for _ in range(count):
            action, state = teacher.predict(observation, state, done)
            after, reward, done, infos = env.step(action)
            actual = np.array(after)
            for i in np.flatnonzero(done):
                actual[i] = infos[i]["terminal_observation"]
            yield _Decision(observation, action, reward, actual, done, infos)
            observation = after
            bar.update(schedule.num_envs)
    env.close()


def _clone(model: OnPolicyAlgorithm, decisions: list[_Decision], seed: int) -> None:
    """Fit actions and values of a policy to the teacher's, with the noise that it explores with."""
    policy = model.policy
    recurrent = policy if isinstance(policy, RecurrentActorCriticPolicy) else None
    parts = [np.stack(part, axis=1) for part in list(zip(*decisions, strict=True))[:5]]
    observations, actions, rewards, _, done = map(torch.as_tensor, parts)
    starts = torch.ones_like(rewards)
    starts[:, 1:] = done[:, :-1].float()
    returns, is_known = discounted_returns(rewards, done, model.gamma)
    length = min(_PIECE, len(decisions)) if recurrent else 1
    whole = len(decisions) // length * length
    pieces = [
        part[:, :whole].reshape(-1, length, *part.shape[2:])
        for part in (observations, actions, returns, is_known, starts)
    ]
    weights = [each for name, each in policy.named_parameters() if name != "log_std"]
    optimiser = torch.optim.Adam(weights, lr=_LEARNING_RATE)
    falls = torch.optim.lr_scheduler.PolynomialLR(optimiser, _UPDATES)
    generator = torch.Generator().manual_seed(seed)
    count = _BATCH // length
    for _ in range(_UPDATES):
        rows = torch.randint(len(pieces[0]), (count,), generator=generator)
        seen, acted, worth, is_known, first = (part[rows].flatten(0, 1) for part in pieces)
        memory = (_no_memory(recurrent, count), first) if recurrent else ()
        values, log_likelihood, _ = policy.evaluate_actions(seen, acted, *memory)
        missed = (values.flatten() - worth) * is_known
        optimiser.zero_grad()
        torch.autograd.backward(0.5 * missed.square().mean() - log_likelihood.mean())
        optimiser.step()
        falls.step()


def discounted_returns(
    rewards: torch.Tensor, done: torch.Tensor, gamma: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Discounted rewards until the episode's end, (n, t), and whether that is among them."""
    returns, is_known = torch.zeros_like(rewards), torch.zeros_like(done)
    later, known = torch.zeros(len(rewards)), torch.zeros(len(rewards), dtype=torch.bool)
    for t in reversed(range(rewards.shape[1])):
        known = known | done[:, t]
        later = rewards[:, t] + gamma * later * ~done[:, t]
        returns[:, t], is_known[:, t] = later, known
    return returns, is_known


def _no_memory(policy: RecurrentActorCriticPolicy, num_flies: int) -> RNNStates:
    lstm = policy.lstm_actor
    zeros = torch.zeros(lstm.num_layers, num_flies, lstm.hidden_size)
    return RNNStates((zeros, zeros), (zeros, zeros))
