"""Latency of the command: commands wait in a queue until they are at the legs."""

from typing import Any

import numpy as np

from flyrl.controllers.compilation import kernel
from flyrl.validation import FloatArray

CLOCK = np.dtype(
    [
        ("latency", "f8"),  # time steps from the command to the legs
        ("now", "f8"),  # time steps since the start, counted where there is latency
        ("num_pending", "f8"),  # commands on their way
        ("first_pending", "f8"),  # where the oldest of them stands in the queue
    ],
    align=True,
)
"""What keeps the time of commands that are on their way."""


@kernel
def advance_command(
    clock: Any, command: FloatArray, arrived: FloatArray, queue: FloatArray
) -> None:
    """Bring the command at the legs up to date, before each of their time steps, in place.

    A command that is new in this step arrives `clock.latency` steps later, and holds until the
    next one does. It takes its place in the queue while it is not yet at the legs; where there is
    none, it sets out when one becomes free, unless another replaces it before.

    Parameters
    ----------
    clock
        Record of type `CLOCK`.
    command
        As last commanded, shape (k,).
    arrived
        At the legs, shape (k,).
    queue
        Shape (places, 1 + k): the time step in which a command arrives, and the command. A ring:
        the oldest command stands at `clock.first_pending`.
    """
    size = command.size
    if clock.latency == 0.0:
        for i in range(size):
            arrived[i] = command[i]
        return
    places = len(queue)
    waiting = int(clock.num_pending)
    first = int(clock.first_pending)
    if waiting > 0 and queue[first, 0] <= clock.now:
        for i in range(size):
            arrived[i] = queue[first, 1 + i]
        first = (first + 1) % places
        waiting -= 1
    last = (first + waiting - 1) % places
    is_new = False
    for i in range(size):
        latest = queue[last, 1 + i] if waiting > 0 else arrived[i]
        is_new = is_new or command[i] != latest
    if waiting < places and is_new:
        place = (first + waiting) % places
        queue[place, 0] = clock.now + clock.latency
        for i in range(size):
            queue[place, 1 + i] = command[i]
        waiting += 1
    clock.num_pending = waiting
    clock.first_pending = first
    clock.now += 1.0
