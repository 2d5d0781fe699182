"""Algorithms that keep what happened in a buffer, and learn from all of it."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal, get_args

from flyrl.policies.networks import Activation
from flyrl.training.algorithms.base import MOST_SAMPLES, AlgorithmConfig
from flyrl.validation import Within, at_least, one_of, positive, within

GoalSelection = Literal["future", "final", "episode"]
GOAL_SELECTIONS: Final[tuple[GoalSelection, ...]] = get_args(GoalSelection)


@dataclass(frozen=True, kw_only=True)
class OffPolicyConfig(AlgorithmConfig):
    """What these algorithms have in common.

    Attributes
    ----------
    batch_size
        Samples per gradient step.
    buffer_size
        Decisions kept for replay.
    learning_starts
        Random decisions before the first update.
    gradient_steps
        Updates after each decision of all environments.
    """

    takes_whole_numbers: ClassVar[bool] = False

    activation: Activation = "relu"
    learning_rate: float = 1e-3
    batch_size: Annotated[int, Within(2, MOST_SAMPLES)] = 256
    buffer_size: Annotated[int, Within(2, MOST_SAMPLES)] = 200_000
    learning_starts: Annotated[int, Within(0, 10**12)] = 2_000
    gradient_steps: Annotated[int, Within(1, 10**6)] = 16

    def __post_init__(self) -> None:
        super().__post_init__()
        at_least("algo.buffer_size", self.buffer_size, self.batch_size)

    def check_num_envs(self, num_envs: int) -> None:
        """Raise ValueError unless the buffer holds a decision of every environment."""
        at_least("algo.buffer_size", self.buffer_size, num_envs)


@dataclass(frozen=True, kw_only=True)
class HindsightConfig(OffPolicyConfig):
    """Algorithms that can replay decisions as if another goal had been desired.

    Attributes
    ----------
    her
        Whether to use hindsight experience replay (Andrychowicz et al. 2017, arXiv:1707.01495); for
        tasks with goals.
    n_sampled_goal
        Decisions with a new goal per decision with its own, in what is learned from.
    goal_selection_strategy
        Which place that the fly came to in the same episode is the new goal: a later one
        ("future"), the last one ("final") or any ("episode").
    """

    her: bool = False
    n_sampled_goal: Annotated[int, Within(1, 1000)] = 4
    goal_selection_strategy: GoalSelection = "future"

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of("algo.goal_selection_strategy", self.goal_selection_strategy, GOAL_SELECTIONS)

    def check_episodes(self, num_envs: int, decisions: int) -> None:
        """Raise ValueError unless the buffer always holds a whole episode once it is needed.

        Parameters
        ----------
        num_envs
            Number of environments.
        decisions
            Of the longest episode.
        """
        needed = f"with algo.her ({num_envs} flies, {decisions} decisions an episode)"
        at_least(f"algo.learning_starts {needed}", self.learning_starts, num_envs * decisions)
        # one that goes on, and the one before
        at_least(f"algo.buffer_size {needed}", self.buffer_size, 2 * num_envs * decisions)


@dataclass(frozen=True, kw_only=True)
class _EntropyConfig(OffPolicyConfig):
    """Algorithms that also maximise the policy's entropy, with a learned weight.

    Attributes
    ----------
    initial_ent_coef
        Entropy weight at the start. Stable-Baselines3's own, 1, drowns the rewards of a decision,
        which are of the order of 0.05, for thousands of updates.
    """

    initial_ent_coef: float = 0.02

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("algo.initial_ent_coef", self.initial_ent_coef)


@dataclass(frozen=True, kw_only=True)
class SACConfig(_EntropyConfig, HindsightConfig):
    """Soft actor-critic (Haarnoja et al. 2018, arXiv:1812.05905), with learned entropy weight.

    Attributes
    ----------
    tau
        Share by which the target networks follow in each update.
    """

    name: ClassVar[str] = "sac"

    tau: float = 0.005

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_tau(self.tau)


@dataclass(frozen=True, kw_only=True)
class TQCConfig(_EntropyConfig, HindsightConfig):
    """Truncated quantile critics (Kuznetsov et al. 2020, arXiv:2005.04269).

    Attributes
    ----------
    tau
        Share by which the target networks follow in each update.
    n_critics, n_quantiles
        Number of critics, and of the quantiles of the return that each estimates.
    top_quantiles_to_drop_per_net
        How many of each critic's highest quantiles a target leaves out, against overestimation.
    """

    name: ClassVar[str] = "tqc"

    tau: float = 0.005
    n_critics: Annotated[int, Within(1, 100)] = 2
    n_quantiles: Annotated[int, Within(1, 10**4)] = 25
    top_quantiles_to_drop_per_net: int = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_tau(self.tau)
        within(
            "algo.top_quantiles_to_drop_per_net",
            self.top_quantiles_to_drop_per_net,
            0,
            self.n_quantiles - 1,
        )


@dataclass(frozen=True, kw_only=True)
class CrossQConfig(_EntropyConfig):
    """CrossQ (Bhatt et al. 2024, arXiv:1902.05605): SAC without target networks, with batch norm.

    Attributes
    ----------
    policy_delay
        Updates of the critics per update of the policy.
    renorm_warmup_steps
        Updates after which batches are normalised with running statistics instead of their own.
    """

    name: ClassVar[str] = "crossq"
    takes_dicts: ClassVar[bool] = False

    policy_delay: Annotated[int, Within(1, 10**6)] = 3
    renorm_warmup_steps: Annotated[int, Within(0, 10**12)] = 100_000


@dataclass(frozen=True, kw_only=True)
class NoisyConfig(HindsightConfig):
    """Algorithms with a deterministic policy, which explores by noise that is added to it.

    Attributes
    ----------
    tau
        Share by which the target networks follow in each update.
    action_noise_std
        Standard deviation of the noise, for actions of -1 ... 1. It is normal, drawn anew at every
        decision: Fujimoto et al. (2018) found nothing better in noise that drifts.
    """

    tau: float = 0.005
    action_noise_std: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_tau(self.tau)
        at_least("algo.action_noise_std", self.action_noise_std, 0)


@dataclass(frozen=True, kw_only=True)
class TD3Config(NoisyConfig):
    """Twin delayed DDPG (Fujimoto et al. 2018, arXiv:1802.09477).

    Attributes
    ----------
    policy_delay
        Updates of the critics per update of the policy and the target networks.
    target_policy_noise, target_noise_clip
        Standard deviation and bound of the noise on the target's actions.
    """

    name: ClassVar[str] = "td3"

    policy_delay: Annotated[int, Within(1, 10**6)] = 2
    target_policy_noise: float = 0.2
    target_noise_clip: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("algo.target_policy_noise", self.target_policy_noise)
        at_least("algo.target_noise_clip", self.target_noise_clip, 0)


@dataclass(frozen=True, kw_only=True)
class DDPGConfig(NoisyConfig):
    """Deep deterministic policy gradient (Lillicrap et al. 2015, arXiv:1509.02971)."""

    name: ClassVar[str] = "ddpg"


def _check_tau(tau: float) -> None:
    within("algo.tau", positive("algo.tau", tau), 0, 1)
