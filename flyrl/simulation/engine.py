"""Records that a model and its simulations carry for the control callback, see `callback`.

A model that flyrl built carries the record `ENGINE`, the controller's parameters and the muscles in
its first custom numeric. `mjData.userdata`, which is part of MuJoCo's integration state, holds the
record of `userdata_dtype`: what the controller senses, its state, its output, and the commands that
are on their way to it. So saving, restoring and replaying a simulation includes its controller,
exactly. Worms have a mark of their own: their models carry the muscles, and their userdata how many
neurons are recruited and the muscles' tensions.
"""

import secrets
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from flyrl.controllers.controller import CLOCK, NUM_JOINTS, NUM_LEGS, OUTPUT, SENSES
from flyrl.controllers.gait_log import GAIT_LOG
from flyrl.muscles import Muscle, pack_muscles

MAGIC = 20_261_121.0
"""Marks a model as flyrl's; a number that no other model's first numeric begins with."""

CREATURE_MAGIC = 20_261_122.0
"""Marks a model of another creature, which has muscles and no leg controller."""

CREATURE_HEAD = 3
"""How many numbers a creature's model carries before its muscles' arrays."""

NUM_SENSED_SEGMENTS = 6
NUM_MUSCLES = 2 * NUM_JOINTS

PROCESS: Final = float(secrets.randbits(52))
"""Beside it in a model, the address of a kernel is one of this process."""

ENGINE = np.dtype(
    [
        ("magic", "f8"),
        ("process", "f8"),
        ("kernel", "f8"),  # address
        ("is_elliptic", "f8"),
        ("thorax_body", "f8"),
        ("num_neurons", "f8"),
        ("senses_contact", "f8"),
        ("is_missing", "f8", (NUM_LEGS,)),
        ("tibia_bodies", "f8", (NUM_LEGS,)),
        ("end_effector_bodies", "f8", (NUM_LEGS,)),
        ("timestep", "f8"),  # s
        ("steps_per_gait_sample", "f8"),
        # how many numbers, and after how many numbers, there are in the userdata
        ("userdata_size", "f8"),
        ("command_size", "f8"),
        ("command_at", "f8"),
        ("arrived_at", "f8"),
        ("queue_places", "f8"),
        ("queue_at", "f8"),
        ("controller_at", "f8"),
        ("retraction_at", "f8"),
        ("stumbling_at", "f8"),
        ("tensions_at", "f8"),
        ("gait_log_at", "f8"),
        ("gait_places", "f8"),
        ("gait_samples_at", "f8"),
        # after how many numbers the muscles follow in the model's data
        ("muscles_at", "f8"),
    ],
    align=True,
)
"""Where the callback finds everything; every field a float64."""

HEAD = np.dtype(
    [
        ("last_time", "f8"),  # s
        ("senses", SENSES),
        ("output", OUTPUT),
        ("clock", CLOCK),
        ("is_grounded", "f8", (NUM_LEGS,)),
        ("none", "f8", (NUM_LEGS,)),  # reflexes of a controller that has none
    ],
    align=True,
)
"""What every simulation carries, at the beginning of its userdata."""


ENGINE_SIZE = ENGINE.itemsize // 8


def bytes_before(field: str) -> int:
    """Offset of a field of HEAD, bytes."""
    assert HEAD.fields is not None
    return int(HEAD.fields[field][1])


def userdata_dtype(
    state: np.dtype, command_size: int, queue_places: int, gait_places: int, has_muscles: bool
) -> np.dtype:
    """Record that a simulation carries for the callback.

    Parameters
    ----------
    state
        Of the controller.
    command_size
        How many numbers a command has.
    queue_places
        How many commands may be on their way.
    gait_places
        How many samples of the gait are kept; with 0 there is no log of it.
    has_muscles
        Whether muscles move the legs.
    """
    fields: list[Any] = [
        ("head", HEAD),
        ("command", "f8", (command_size,)),  # as last commanded
        ("arrived", "f8", (command_size,)),  # at the legs
        ("controller", state),
    ]
    if queue_places:
        fields.append(("queue", "f8", (queue_places, 1 + command_size)))
    if has_muscles:
        fields.append(("tensions", "f8", (NUM_MUSCLES,)))
    if gait_places:
        fields += [("gait_log", GAIT_LOG), ("gait_samples", "f8", (gait_places,))]
    return np.dtype(fields, align=True)


def place_fields(engine: np.void, userdata: np.dtype) -> None:
    """Write the offsets of the fields of a simulation's record into its model's ENGINE record."""
    assert userdata.fields is not None
    at = {name: field[1] // 8 for name, field in userdata.fields.items()}
    engine["userdata_size"] = userdata.itemsize // 8
    engine["command_size"] = userdata["command"].shape[0]
    for name in ("command", "arrived", "controller", "queue", "tensions"):
        engine[f"{name}_at"] = at.get(name, 0)
    if "queue" in at:
        engine["queue_places"] = userdata["queue"].shape[0]
    if "gait_log" in at:
        engine["gait_places"] = userdata["gait_samples"].shape[0]
        engine["gait_log_at"], engine["gait_samples_at"] = at["gait_log"], at["gait_samples"]
    own: Any = userdata["controller"].fields or {}
    for name in ("retraction", "stumbling"):
        kept = at["controller"] + own[name][1] // 8 if name in own else bytes_before("none") // 8
        engine[f"{name}_at"] = kept


def pack_model_data(engine: np.void, parameters: np.void, muscles: np.ndarray) -> np.ndarray:
    """Concatenate what a model carries for the callback into one float64 array.

    The last is what `fly_scene.pack_leg_muscles` gives.
    """
    engine["muscles_at"] = (ENGINE.itemsize + parameters.nbytes) // 8
    return np.concatenate(
        [np.frombuffer(engine.tobytes()), np.frombuffer(parameters.tobytes()), muscles]
    )


def creature_userdata_size(num_muscles: int) -> int:
    """How many numbers a creature carries: its muscles' neurons, then their tensions."""
    return 2 * num_muscles


def pack_creature_data(muscles: Sequence[Muscle]) -> np.ndarray:
    """Concatenate what a creature's model carries for the callback into one float64 array.

    The mark, the number M of muscles, that of the entries of their tables, and `PackedMuscles`:
    starts (M + 1), strengths (M), recruitment tables. Actuator i is muscle i.
    """
    packed = pack_muscles(muscles)
    head = (CREATURE_MAGIC, len(packed.strengths), len(packed.recruitment))
    return np.concatenate([head, packed.starts, packed.strengths, packed.recruitment])
