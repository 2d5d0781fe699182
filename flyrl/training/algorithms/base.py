"""What every learning algorithm has."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

from flyrl.policies.networks import ACTIVATIONS, Activation
from flyrl.validation import Within, check_fields, one_of, positive, within

LARGEST_SETTING: Final = 1e6
MOST_LAYERS: Final = 16
MOST_UNITS: Final = 4096
MOST_SAMPLES: Final = 10**7
"""Decisions of an update, of a batch or in a replay buffer: some GB."""


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
    gamma
        Discount per decision.
    normalize_observation
        Whether the networks see observations with the mean subtracted and divided by the standard
        deviation, both over the run so far, and clipped to 10 of them.
    normalize_reward
        Whether to learn from rewards divided by the standard deviation of the discounted return
        over the run so far, and clipped to 10.
    """

    name: ClassVar[str]
    takes_dicts: ClassVar[bool] = True
    takes_whole_numbers: ClassVar[bool] = True

    hidden_layers: Annotated[tuple[int, ...], Within(1, MOST_UNITS)] = (64, 64)
    activation: Activation = "tanh"
    learning_rate: float = 3e-4
    learning_rate_decay: bool = False
    gamma: float = 0.99
    normalize_observation: bool = False
    normalize_reward: bool = False

    def __post_init__(self) -> None:
        check_fields(self, "algo")
        for name, value in vars(self).items():
            if isinstance(value, float):
                within(f"algo.{name}", value, -LARGEST_SETTING, LARGEST_SETTING)
        if len(self.hidden_layers) > MOST_LAYERS:
            raise ValueError(
                f"algo.hidden_layers must be at most {MOST_LAYERS}, got {len(self.hidden_layers)}"
            )
        one_of("algo.activation", self.activation, ACTIVATIONS)
        positive("algo.learning_rate", self.learning_rate)
        within("algo.gamma", self.gamma, 0, 1)

    def check_num_envs(self, num_envs: int) -> None:
        """Raise ValueError if the settings do not go with this number of environments."""
