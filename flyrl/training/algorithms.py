"""Settings of the learning algorithms; the names are those of Stable-Baselines3's arguments."""

from dataclasses import dataclass
from typing import ClassVar, Final

from flyrl.policies.mlp import ACTIVATIONS, Activation
from flyrl.validation import at_least, one_of, positive, within


@dataclass(frozen=True, kw_only=True)
class AlgorithmConfig:
    """What every algorithm has.

    Attributes
    ----------
    hidden_layers
        Units of each hidden layer of the policy, and of the value function beside it.
    activation
        Between layers.
    learning_rate
        Step of the optimiser, at the start.
    learning_rate_decay
        Whether the learning rate falls linearly to 0 over the run.
    batch_size
        Samples per gradient step.
    gamma
        Discount per decision.
    """

    name: ClassVar[str]

    hidden_layers: tuple[int, ...] = (64, 64)
    activation: Activation = "tanh"
    learning_rate: float = 3e-4
    learning_rate_decay: bool = False
    batch_size: int = 256
    gamma: float = 0.99

    def __post_init__(self) -> None:
        for units in self.hidden_layers:
            at_least("algo.hidden_layers", units, 1)
        one_of("algo.activation", self.activation, ACTIVATIONS)
        positive("algo.learning_rate", self.learning_rate)
        at_least("algo.batch_size", self.batch_size, 2)
        within("algo.gamma", self.gamma, 0, 1)

    def check_num_envs(self, num_envs: int) -> None:
        """Raise ValueError if the settings do not go with this number of environments."""


@dataclass(frozen=True, kw_only=True)
class PPOConfig(AlgorithmConfig):
    """Proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347).

    Attributes
    ----------
    n_steps
        Decisions per environment between two updates.
    n_epochs
        Passes over the collected decisions in an update.
    gae_lambda
        Trade-off of bias and variance in the advantage.
    clip_range
        How far an update may move the policy's probabilities.
    ent_coef, vf_coef
        Weights of the entropy bonus and of the value loss.
    max_grad_norm
        The gradient is clipped to this norm.
    log_std_init
        Logarithm of the exploration noise's standard deviation at the start.
    """

    name: ClassVar[str] = "ppo"

    n_steps: int = 64
    n_epochs: int = 10
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    ent_coef: float = 0.0
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    log_std_init: float = -0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        at_least("algo.n_steps", self.n_steps, 1)
        at_least("algo.n_epochs", self.n_epochs, 1)
        within("algo.gae_lambda", self.gae_lambda, 0, 1)
        positive("algo.clip_range", self.clip_range)
        at_least("algo.ent_coef", self.ent_coef, 0)
        at_least("algo.vf_coef", self.vf_coef, 0)
        at_least("algo.max_grad_norm", self.max_grad_norm, 0)
        within("algo.log_std_init", self.log_std_init, -10, 2)

    def check_num_envs(self, num_envs: int) -> None:
        """Raise ValueError unless an update splits into whole batches."""
        collected = self.n_steps * num_envs
        if collected % self.batch_size:
            raise ValueError(
                f"algo.batch_size must divide {collected}, the algo.n_steps ({self.n_steps}) x "
                f"training.num_envs ({num_envs}) of an update, got {self.batch_size}"
            )


@dataclass(frozen=True, kw_only=True)
class SACConfig(AlgorithmConfig):
    """Soft actor-critic (Haarnoja et al. 2018, arXiv:1812.05905), with learned entropy weight.

    Attributes
    ----------
    buffer_size
        Decisions kept for replay.
    learning_starts
        Random decisions before the first update.
    gradient_steps
        Updates after each decision of all environments.
    tau
        Share by which the target networks follow in each update.
    initial_ent_coef
        Entropy weight at the start. Stable-Baselines3's own, 1, drowns the rewards of a decision,
        which are of the order of 0.05, for thousands of updates.
    """

    name: ClassVar[str] = "sac"

    activation: Activation = "relu"
    learning_rate: float = 1e-3
    buffer_size: int = 200_000
    learning_starts: int = 2_000
    gradient_steps: int = 16
    tau: float = 0.005
    initial_ent_coef: float = 0.02

    def __post_init__(self) -> None:
        super().__post_init__()
        at_least("algo.buffer_size", self.buffer_size, self.batch_size)
        at_least("algo.learning_starts", self.learning_starts, 0)
        at_least("algo.gradient_steps", self.gradient_steps, 1)
        within("algo.tau", positive("algo.tau", self.tau), 0, 1)
        positive("algo.initial_ent_coef", self.initial_ent_coef)


ALGORITHMS: Final[dict[str, type[AlgorithmConfig]]] = {
    config.name: config for config in (PPOConfig, SACConfig)
}
"""Name -> settings."""
