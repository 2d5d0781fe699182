"""Learning algorithms: the settings of each, their defaults and what is allowed.

Names are those of Stable-Baselines3's arguments, where a setting has the same meaning. Importing
this loads neither torch nor Stable-Baselines3.
"""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

from flyrl.policies.networks import Activation
from flyrl.validation import Within, at_least, checked, known_keys, one_of, plain_record

_MOST_LAYERS: Final = 16
MOST_SAMPLES: Final = 10**7
"""Decisions of an update, of a batch or in a replay buffer: some GB."""

_COMMON: Final = {
    "hidden_layers": (64, 64),
    "activation": "tanh",
    "learning_rate": 3e-4,
    "learning_rate_decay": False,
    "gamma": 0.99,
    "normalize_observation": False,
    "normalize_reward": False,
}
_ON_POLICY: Final = _COMMON | {"n_steps": 64, "gae_lambda": 0.95, "log_std_init": -0.5}
_LOSSES: Final = {"ent_coef": 0.0, "vf_coef": 0.5, "max_grad_norm": 0.5}
_CLIPPED: Final = _ON_POLICY | {"batch_size": 256} | {"n_epochs": 10, "clip_range": 0.2} | _LOSSES
_OFF_POLICY: Final = _COMMON | {
    "activation": "relu",
    "learning_rate": 1e-3,
    "batch_size": 256,
    "buffer_size": 200_000,
    "learning_starts": 2_000,
    "gradient_steps": 16,
}
_HINDSIGHT: Final = _OFF_POLICY | {
    "her": False,
    "n_sampled_goal": 4,
    "goal_selection_strategy": "future",
}
# Stable-Baselines3's own weight of the entropy at the start, 1, drowns the rewards of a decision,
# which are of the order of 0.05, for thousands of updates.
_ENTROPY: Final = {"initial_ent_coef": 0.02}
# Noise that is drawn anew at every decision: Fujimoto et al. (2018) found nothing better in noise
# that drifts.
_NOISY: Final = _HINDSIGHT | {"tau": 0.005, "action_noise_std": 0.2}

ALGORITHMS: Final[Mapping[str, Mapping[str, Any]]] = {
    # learning rate and discount are those of four pairs that reached targets the quickest on flat
    # ground after 120,000 decisions
    "ppo": _CLIPPED | {"learning_rate": 6e-4, "gamma": 0.98},
    "a2c": _ON_POLICY
    | {"learning_rate": 7e-4, "n_steps": 16}
    | _LOSSES
    | {"use_rms_prop": True, "normalize_advantage": False},
    "trpo": _ON_POLICY
    | {
        "learning_rate": 1e-3,
        "batch_size": 256,
        "target_kl": 0.01,
        "n_critic_updates": 10,
        "cg_max_steps": 15,
        "cg_damping": 0.1,
        "line_search_max_iter": 10,
        "line_search_shrinking_factor": 0.8,
    },
    "recurrent_ppo": _CLIPPED
    | {
        "hidden_layers": (64,),
        "lstm_hidden_size": 64,
        "n_lstm_layers": 1,
        "enable_critic_lstm": True,
    },
    "sac": _HINDSIGHT | _ENTROPY | {"tau": 0.005},
    "tqc": _HINDSIGHT
    | _ENTROPY
    | {"tau": 0.005, "n_critics": 2, "n_quantiles": 25, "top_quantiles_to_drop_per_net": 2},
    "crossq": _OFF_POLICY | _ENTROPY | {"policy_delay": 3, "renorm_warmup_steps": 100_000},
    "td3": _NOISY | {"policy_delay": 2, "target_policy_noise": 0.2, "target_noise_clip": 0.5},
    "ddpg": _NOISY,
}
"""Name -> settings with their defaults."""

ON_POLICY: Final = ("ppo", "a2c", "trpo", "recurrent_ppo")
"""Those that learn from what the present policy just did; the others keep it in a buffer."""

_RANGES: Final[tuple[tuple[Any, str], ...]] = (
    (bool, "learning_rate_decay normalize_observation normalize_reward normalize_advantage"),
    (bool, "enable_critic_lstm her use_rms_prop"),
    (Activation, "activation"),
    (Literal["future", "final", "episode"], "goal_selection_strategy"),
    (Annotated[tuple[int, ...], Within(1, 4096)], "hidden_layers"),
    (Annotated[int, Within(1, 4096)], "lstm_hidden_size"),
    (Annotated[int, Within(1, _MOST_LAYERS)], "n_lstm_layers"),
    (Annotated[int, Within(1, 100)], "n_critics"),
    (Annotated[int, Within(1, 1000)], "n_sampled_goal"),
    (Annotated[int, Within(1, 10**4)], "n_epochs n_critic_updates n_quantiles cg_max_steps"),
    (Annotated[int, Within(1, 10**4)], "line_search_max_iter"),
    (Annotated[int, Within(1, 10**6)], "n_steps gradient_steps policy_delay"),
    (Annotated[int, Within(2, MOST_SAMPLES)], "batch_size buffer_size"),
    (Annotated[int, Within(0, 10**12)], "learning_starts renorm_warmup_steps"),
    (Annotated[int, Within(0, 10**4)], "top_quantiles_to_drop_per_net"),
    (Annotated[float, Within(0, 1)], "gamma gae_lambda"),
    (Annotated[float, Within(1e-12, 1)], "tau line_search_shrinking_factor"),
    (Annotated[float, Within(1e-12, 1e6)], "learning_rate clip_range target_kl"),
    (Annotated[float, Within(1e-12, 1e6)], "initial_ent_coef target_policy_noise"),
    (Annotated[float, Within(0, 1e6)], "ent_coef vf_coef max_grad_norm cg_damping"),
    (Annotated[float, Within(0, 1e6)], "action_noise_std target_noise_clip"),
    (Annotated[float, Within(-10, 2)], "log_std_init"),
)
_ALLOWED: Final = {name: allowed for allowed, names in _RANGES for name in names.split()}
"""Type and range of every setting."""

_SET_BY_FLYRL: Final = (
    # by other settings, or by the run
    *("policy", "env", "seed", "device", "verbose", "tensorboard_log", "policy_kwargs"),
    *("action_noise", "replay_buffer_class", "replay_buffer_kwargs", "_init_setup_model"),
    # checkpoints and exported policies know nothing of these
    *("rollout_buffer_class", "rollout_buffer_kwargs", "optimize_memory_usage"),
    *("use_sde", "sde_sample_freq", "use_sde_at_warmup"),
)
"""Arguments of Stable-Baselines3's classes that are no settings."""


def further_settings(name: str) -> set[str]:
    """Arguments of Stable-Baselines3's class that have no default here, but can be given."""
    from flyrl.policies.sb3 import ALGORITHMS as CLASSES  # noqa: PLC0415 - takes torch

    arguments = inspect.signature(CLASSES[name]).parameters.keys() - {*_SET_BY_FLYRL}
    # of the algorithms with an entropy weight that is learned, ent_coef says only how it starts
    is_learned = "initial_ent_coef" in ALGORITHMS[name]
    return arguments - ALGORITHMS[name].keys() - ({"ent_coef"} if is_learned else set())


@dataclass(frozen=True, init=False)
class AlgorithmConfig:
    """A learning algorithm and its settings, such as `AlgorithmConfig("sac", gamma=0.98)`.

    Attributes
    ----------
    name
        One of `ALGORITHMS`.
    settings
        All settings by name, the given ones and the defaults of the others; further arguments of
        Stable-Baselines3's class as far as they are given.
    """

    name: str
    settings: Mapping[str, Any]

    def __init__(self, name: str = "ppo", /, **settings: Any) -> None:
        given = {**ALGORITHMS[one_of("algo", name, ALGORITHMS)], **settings}
        if further := settings.keys() - ALGORITHMS[name].keys():
            known_keys("algo", settings, (*ALGORITHMS[name], *sorted(further_settings(name))))
            for key in further:
                plain_record(f"algo.{key}", given[key])
        for key, value in given.items():
            given[key] = checked(f"algo.{key}", value, _ALLOWED.get(key, Any))
        if len(given["hidden_layers"]) > _MOST_LAYERS:
            raise ValueError(
                f"algo.hidden_layers must be at most {_MOST_LAYERS}, got "
                f"{len(given['hidden_layers'])}"
            )
        if "buffer_size" in given:
            at_least("algo.buffer_size", given["buffer_size"], given["batch_size"])
        if "n_quantiles" in given:
            dropped, most = given["top_quantiles_to_drop_per_net"], given["n_quantiles"] - 1
            checked("algo.top_quantiles_to_drop_per_net", dropped, Annotated[int, Within(0, most)])
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "settings", given)

    def with_settings(self, **changes: Any) -> "AlgorithmConfig":
        """The same algorithm with some other settings."""
        return AlgorithmConfig(self.name, **{**self.settings, **changes})
