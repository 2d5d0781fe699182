"""Policies that nobody trained."""

import numpy as np

from flyrl.policies import PolicyBundle, observation_layout
from flyrl.tasks import TASKS


def target_bundle(answer=(0.0, 0.0), **fields):
    """Bundle of a policy for the task Target that always answers the same; `fields` replace its."""
    layout = fields.get("observation", observation_layout(TASKS["target"]()))
    size = sum(term.size for term in layout)
    usual = {
        "weights": {
            "0.weight": np.zeros((2, size), np.float32),
            "0.bias": np.array(answer, np.float32),
        },
        "sizes": (size, 2),
        "activation": "tanh",
        "squashing": "clip",
        "observation": layout,
        "action_low": (-1.0, -1.0),
        "action_high": (1.0, 1.0),
        "env": {},
        "training": {},
    }
    return PolicyBundle(**{**usual, **fields})
