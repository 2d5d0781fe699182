"""Latency of the descending drive: commands wait in a queue until they are at the legs."""

from typing import Any, Final

from flyrl.controllers.compilation import kernel
from flyrl.validation import FloatArray

PLACE_SIZE: Final = 3
"""Numbers per place of the queue: the time step in which a command arrives, its left and right."""


@kernel
def advance_drive(state: Any, queue: FloatArray) -> None:
    """Bring a leg controller's drive up to date, before each of its time steps, in place.

    A command that is new in this step arrives `state.latency` steps later, and holds until the
    next one does. It takes its place in the queue while it is not yet at the legs; where there is
    none, it sets out when one becomes free, unless another replaces it before.

    Parameters
    ----------
    state
        Record of type `leg_controller.STATE`.
    queue
        Shape (places, PLACE_SIZE). A ring: the oldest command stands at `state.first_pending`.
    """
    if state.latency == 0.0:
        state.drive[0] = state.command[0]
        state.drive[1] = state.command[1]
        return
    places = len(queue)
    waiting = int(state.num_pending)
    first = int(state.first_pending)
    if waiting > 0 and queue[first, 0] <= state.clock:
        state.drive[0] = queue[first, 1]
        state.drive[1] = queue[first, 2]
        first = (first + 1) % places
        waiting -= 1
    left, right = state.drive[0], state.drive[1]
    if waiting > 0:
        last = (first + waiting - 1) % places
        left, right = queue[last, 1], queue[last, 2]
    if waiting < places and (state.command[0] != left or state.command[1] != right):
        place = (first + waiting) % places
        queue[place, 0] = state.clock + state.latency
        queue[place, 1] = state.command[0]
        queue[place, 2] = state.command[1]
        waiting += 1
    state.num_pending = waiting
    state.first_pending = first
    state.clock += 1.0
