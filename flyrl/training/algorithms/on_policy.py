"""Algorithms that learn from what the present policy just did, and then forget it."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from flyrl.training.algorithms.base import (
    MOST_LAYERS,
    MOST_SAMPLES,
    MOST_UNITS,
    AlgorithmConfig,
)
from flyrl.validation import Within, at_least, positive, within


@dataclass(frozen=True, kw_only=True)
class OnPolicyConfig(AlgorithmConfig):
    """What these algorithms have in common.

    Attributes
    ----------
    n_steps
        Decisions per environment between two updates.
    gae_lambda
        Trade-off of bias and variance in the advantage.
    log_std_init
        Logarithm of the exploration noise's standard deviation at the start. Without effect where
        actions are whole numbers: those are drawn by the probability of each.
    """

    n_steps: Annotated[int, Within(1, 10**6)] = 64
    gae_lambda: float = 0.95
    log_std_init: float = -0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        within("algo.gae_lambda", self.gae_lambda, 0, 1)
        within("algo.log_std_init", self.log_std_init, -10, 2)

    def check_num_envs(self, num_envs: int) -> None:
        """Raise ValueError if an update is of more decisions than memory may hold."""
        if self.n_steps * num_envs > MOST_SAMPLES:
            raise ValueError(
                f"algo.n_steps x training.num_envs must be at most {MOST_SAMPLES}, got "
                f"{self.n_steps} x {num_envs}"
            )


@dataclass(frozen=True, kw_only=True)
class _BatchedConfig(OnPolicyConfig):
    """Algorithms that split the decisions of an update into batches.

    Attributes
    ----------
    batch_size
        Samples per gradient step.
    """

    batch_size: Annotated[int, Within(2, MOST_SAMPLES)] = 256

    def check_num_envs(self, num_envs: int) -> None:
        """Raise ValueError unless an update splits into whole batches."""
        super().check_num_envs(num_envs)
        collected = self.n_steps * num_envs
        if collected % self.batch_size:
            raise ValueError(
                f"algo.batch_size must divide {collected}, the algo.n_steps ({self.n_steps}) x "
                f"training.num_envs ({num_envs}) of an update, got {self.batch_size}"
            )


@dataclass(frozen=True, kw_only=True)
class _ClippedConfig(_BatchedConfig):
    """What PPO has with and without a memory.

    Attributes
    ----------
    n_epochs
        Passes over the collected decisions in an update.
    clip_range
        How far an update may move the policy's probabilities.
    ent_coef, vf_coef
        Weights of the entropy bonus and of the value loss.
    max_grad_norm
        The gradient is clipped to this norm.
    """

    n_epochs: Annotated[int, Within(1, 10**4)] = 10
    clip_range: float = 0.2
    ent_coef: float = 0.0
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("algo.clip_range", self.clip_range)
        at_least("algo.ent_coef", self.ent_coef, 0)
        at_least("algo.vf_coef", self.vf_coef, 0)
        at_least("algo.max_grad_norm", self.max_grad_norm, 0)


@dataclass(frozen=True, kw_only=True)
class PPOConfig(_ClippedConfig):
    """Proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347).

    Learning rate and discount are those of four pairs that reached targets the quickest on flat
    ground after 120,000 decisions.
    """

    name: ClassVar[str] = "ppo"

    learning_rate: float = 6e-4
    gamma: float = 0.98


@dataclass(frozen=True, kw_only=True)
class RecurrentPPOConfig(_ClippedConfig):
    """PPO with an LSTM (Hochreiter and Schmidhuber 1997) in front of the policy's hidden layers.

    Attributes
    ----------
    lstm_hidden_size
        Units of each LSTM layer.
    n_lstm_layers
        Number of LSTM layers.
    enable_critic_lstm
        Whether the value function has an LSTM of its own; else it has a linear layer instead.
    """

    name: ClassVar[str] = "recurrent_ppo"

    hidden_layers: Annotated[tuple[int, ...], Within(1, MOST_UNITS)] = (64,)
    lstm_hidden_size: Annotated[int, Within(1, MOST_UNITS)] = 64
    n_lstm_layers: Annotated[int, Within(1, MOST_LAYERS)] = 1
    enable_critic_lstm: bool = True


@dataclass(frozen=True, kw_only=True)
class A2CConfig(OnPolicyConfig):
    """Advantage actor-critic (Mnih et al. 2016, arXiv:1602.01783), without its many workers.

    Attributes
    ----------
    ent_coef, vf_coef
        Weights of the entropy bonus and of the value loss.
    max_grad_norm
        The gradient is clipped to this norm.
    use_rms_prop
        Whether the optimiser is RMSprop, as published; else it is Adam.
    normalize_advantage
        Whether the advantages of an update get mean 0 and standard deviation 1.
    """

    name: ClassVar[str] = "a2c"

    learning_rate: float = 7e-4
    n_steps: Annotated[int, Within(1, 10**6)] = 16
    ent_coef: float = 0.0
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    use_rms_prop: bool = True
    normalize_advantage: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        at_least("algo.ent_coef", self.ent_coef, 0)
        at_least("algo.vf_coef", self.vf_coef, 0)
        at_least("algo.max_grad_norm", self.max_grad_norm, 0)

    def check_num_envs(self, num_envs: int) -> None:
        """Raise ValueError if a single advantage is to be normalised."""
        super().check_num_envs(num_envs)
        if self.normalize_advantage and self.n_steps * num_envs < 2:
            raise ValueError(
                "algo.n_steps x training.num_envs must be at least 2 with "
                f"algo.normalize_advantage, got {self.n_steps} x {num_envs}"
            )


@dataclass(frozen=True, kw_only=True)
class TRPOConfig(_BatchedConfig):
    """Trust region policy optimisation (Schulman et al. 2015, arXiv:1502.05477).

    The policy takes one step per update, as far as the trust region allows; `learning_rate`,
    `batch_size` and `n_critic_updates` are those of the value function.

    Attributes
    ----------
    target_kl
        Radius of the trust region: Kullback-Leibler divergence from the policy before.
    n_critic_updates
        Passes of the value function over the collected decisions.
    cg_max_steps, cg_damping
        Most steps of the conjugate gradients, and damping of the Hessian in them.
    line_search_max_iter, line_search_shrinking_factor
        How often a step that is too long is tried again, and by how much it is shortened.
    """

    name: ClassVar[str] = "trpo"

    learning_rate: float = 1e-3
    target_kl: float = 0.01
    n_critic_updates: Annotated[int, Within(1, 10**4)] = 10
    cg_max_steps: Annotated[int, Within(1, 10**4)] = 15
    cg_damping: float = 0.1
    line_search_max_iter: Annotated[int, Within(1, 10**4)] = 10
    line_search_shrinking_factor: float = 0.8

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("algo.target_kl", self.target_kl)
        at_least("algo.cg_damping", self.cg_damping, 0)
        factor = positive("algo.line_search_shrinking_factor", self.line_search_shrinking_factor)
        within("algo.line_search_shrinking_factor", factor, 0, 1)
