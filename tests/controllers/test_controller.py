import numpy as np
import pytest

from flyrl.controllers.controller import CLOCK, advance_command


def drives_at_the_legs(
    commands: dict[int, tuple[float, float]], latency: int, places: int, steps: int
) -> list[tuple[float, ...]]:
    """Drive in every time step, of commands given before the time steps that they stand at."""
    clock = np.zeros(1, dtype=CLOCK)[0]
    clock["latency"] = latency
    command, arrived, queue = np.zeros(2), np.zeros(2), np.zeros((places, 3))
    found = []
    for step in range(steps):
        if step in commands:
            command[:] = commands[step]
        advance_command(clock, command, arrived, queue)
        found.append(tuple(arrived.tolist()))
    return found


STILL = (0.0, 0.0)
A, B, C = (1.0, 0.5), (0.2, 0.9), (-0.5, 1.5)


@pytest.mark.parametrize("latency", [0, 1, 7])
def test_a_command_arrives_exactly_so_many_steps_later(latency: int) -> None:
    found = drives_at_the_legs({2: A}, latency, 1, 12)
    assert found == [STILL] * (2 + latency) + [A] * (10 - latency)


def test_commands_on_their_way_arrive_in_their_order_and_distance() -> None:
    """Decisions every 2 steps, of which 3 are on their way at a latency of 5."""
    found = drives_at_the_legs({0: A, 2: B, 4: C, 6: A, 8: STILL}, 5, 3, 15)
    assert found == [STILL] * 5 + [A] * 2 + [B] * 2 + [C] * 2 + [A] * 2 + [STILL] * 2


def test_a_command_in_every_step_takes_a_place_per_step() -> None:
    commands = {step: (float(step), -float(step)) for step in range(40)}
    found = drives_at_the_legs(commands, 9, 9, 40)
    assert found == [STILL] * 9 + [commands[step] for step in range(31)]


def test_a_command_that_finds_no_place_waits_for_one_and_the_newest_goes() -> None:
    """A leaves its only place in step 6, where C has replaced B: C arrives in step 10."""
    found = drives_at_the_legs({2: A, 3: B, 5: C}, 4, 1, 12)
    assert found == [STILL] * 6 + [A] * 4 + [C] * 2
