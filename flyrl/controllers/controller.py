"""The door for leg controllers: what one senses, commands and keeps, and how it is found by name.

A controller is a frozen dataclass of settings, derived from `Controller`, with a kernel `step` that
the engine runs at every physics step. The built-in ones use the same door as a user's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Final, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from flyrl.anatomy import CONTACT_SEGMENTS, JOINTS, LEGS
from flyrl.controllers.compilation import as_kernel, entry_point, kernel, why_not_compiled
from flyrl.entry_points import name_of, settings_from, takes
from flyrl.validation import FloatArray

NUM_LEGS: Final = len(LEGS)
NUM_JOINTS: Final = len(JOINTS)

DRIVE_LOW: Final = -0.5
DRIVE_HIGH: Final = 1.5
"""Range of the descending drive on each side."""

SENSES: Final = np.dtype(
    [
        ("thorax_z", "f8"),  # mm
        ("end_effector_z", "f8", (NUM_LEGS,)),  # mm; of a missing leg the thorax's
        ("heading_w", "f8", (3,)),
        ("contact_forces_w", "f8", (len(CONTACT_SEGMENTS), 3)),  # µN
        ("joint_angles", "f8", (NUM_JOINTS,)),  # rad
        ("joint_velocities", "f8", (NUM_JOINTS,)),  # rad/s
        ("end_effectors_w", "f8", (NUM_LEGS, 3)),  # mm
    ],
    align=True,
)
"""Senses of a controller, from the physics step before, ordered as in `flyrl.anatomy`."""

OUTPUT: Final = np.dtype(
    [
        ("angles", "f8", (NUM_JOINTS,)),  # rad
        ("adhesion", "f8", (NUM_LEGS,)),  # 1 grips, 0 does not
    ],
    align=True,
)
"""Output of a controller: target angles of the joints, and which legs grip."""

Step = Callable[[Any, Any, Any, Any, Any], None]


class Command(NamedTuple):
    """Command that a controller takes from a policy: a name and a range for every number."""

    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]


DRIVE: Final = Command(("left", "right"), (DRIVE_LOW,) * 2, (DRIVE_HIGH,) * 2)
"""The descending drive to the left and to the right legs."""


def record_of(values: Mapping[str, ArrayLike]) -> np.void:
    """Record of float64 fields, each of the shape of its value."""
    arrays = {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}
    dtype = [(name, "f8", array.shape) for name, array in arrays.items()]
    record: np.void = np.zeros(1, dtype=dtype)[0]
    for name, array in arrays.items():
        record[name] = array
    return record


def _name(controller: Controller) -> str:
    return name_of(controller, CONTROLLERS)


@dataclass(frozen=True)
class Controller:
    """Settings of a leg controller; the base of every one.

    A controller of one's own sets `step`, and says with `parameters` and `initial_state` what it
    knows and what it keeps. Where the state has the fields "phases", "magnitudes", "retraction" or
    "stumbling", (6,) each, observations, gait diagrams and videos show them.

    Attributes
    ----------
    name
        A built-in name, or module:attribute of a user's own.
    command
        What it takes from a policy.
    follows_command
        Whether the command changes how it walks, so that a policy can steer it.
    step
        Kernel `step(parameters, state, senses, command, output)`: advances `state` and writes
        `output` in place, once per physics step. In the part of Python that Numba compiles; it
        allocates nothing and raises nothing.
    """

    # a property, and a field all the same, so that `dataclasses.asdict` includes it
    name: str = field(init=False, repr=False, compare=False, default=cast(str, property(_name)))

    command: ClassVar[Command] = DRIVE
    follows_command: ClassVar[bool] = True
    step: ClassVar[Step]

    def parameters(self, timestep: float) -> np.void:
        """Record of float64 fields that `step` gets as `parameters`, at a physics step (s)."""
        return record_of({"timestep": timestep})

    def initial_state(
        self,
        seed: int = 0,
        init_phases: ArrayLike | None = None,
        init_magnitudes: ArrayLike | None = None,
    ) -> np.void:
        """Record of float64 fields that `step` gets as `state`, as an episode starts.

        Parameters
        ----------
        seed
            Of whatever the controller draws.
        init_phases, init_magnitudes
            Of oscillators, rad and 1, (6,); a controller without oscillators ignores them.
        """
        return record_of({"unused": 0.0})


CONTROLLERS: Final[dict[str, type[Controller]]] = {}
"""Built-in controllers by name; `flyrl.controllers` fills it."""


def controller_from(given: str | Mapping[str, Any] | Controller) -> Controller:
    """Controller of a name, built-in or module:attribute, or of what `dataclasses.asdict` made.

    A controller stays as it is. Settings of other controllers, which old records hold, are ignored.

    Raises
    ------
    ValueError
        If there is no name, or no such controller, setting or value.
    """
    return settings_from("controller", given, CONTROLLERS, Controller, FORMER_FIELDS, {})


def settings_text(controller: Controller) -> str:
    """Name of a controller, with the settings that are not the usual ones: cpg(gait=wave)."""
    given = [(each, getattr(controller, each.name)) for each in fields(controller) if each.init]
    own = ", ".join(f"{each.name}={value}" for each, value in given if value != each.default)
    return f"{controller.name}({own})" if own else controller.name


FORMER_FIELDS: Final = frozenset(
    (
        "steps", "reflexes", "frequency_hz", "coupling_weight", "convergence_rate",
        "step_duration_s", "retraction", "stumbling",
    )
)  # fmt: skip
"""Settings that records held of every controller, whether it used them or not."""


def compiled_step(controller: Controller, timestep: float) -> int:
    """Address of the compiled kernel of a controller; one of a user's own has been run once.

    Raises
    ------
    ValueError
        If its records have other fields than float64, or its kernel is missing, cannot be compiled,
        or raises an error at once.
    """
    name = f"controller {controller.name!r}"
    parameters, state = controller.parameters(timestep), controller.initial_state()
    for which, record in (("parameters", parameters), ("initial_state", state)):
        _check_record(f"{which} of {name}", record.dtype)
    senses, output = (np.zeros(1, dtype)[0] for dtype in (SENSES, OUTPUT))
    command = np.zeros(len(controller.command.names))
    records = (parameters.dtype, state.dtype, SENSES, OUTPUT)
    step: Any = getattr(type(controller), "step", None)
    if not takes(getattr(step, "py_func", step), 5):
        raise ValueError(
            f"{name} must have a static method step(parameters, state, senses, command, output)"
        )
    try:
        address = entry_point(step, records, len(command))
    except Exception as error:
        # the user's own code: Numba may raise anything
        known = [field for dtype in records for field in dtype.names or ()]
        reason = why_not_compiled(error, known)
        raise ValueError(f"step of {name} cannot be compiled: {reason}") from error
    if type(controller) not in CONTROLLERS.values():
        try:  # MuJoCo, which calls it from then on, would not hear of an error
            as_kernel(step)(parameters, state, senses, command, output)
        except Exception as error:
            raise ValueError(
                f"step of {name} must raise nothing, got {type(error).__name__}: {error}"
            ) from error
    return address


def _check_record(name: str, dtype: np.dtype) -> None:
    """Raise ValueError unless a record has named fields, all of them float64."""
    if not dtype.names:
        raise ValueError(f"{name} must be a record with named fields, got {dtype}")
    for each in dtype.names:
        base = dtype[each].base
        if base != np.float64:
            raise ValueError(f"{name}: {each!r} must be float64, got {base}")


# ------------------------------------------------------------------ no controller at all


JOINTS_COMMAND: Final = Command(
    (*JOINTS, *(f"adhesion_{leg}" for leg in LEGS)),
    (-np.pi,) * NUM_JOINTS + (0.0,) * NUM_LEGS,
    (np.pi,) * NUM_JOINTS + (1.0,) * NUM_LEGS,
)
"""Target angles, rad, then adhesion: 1 grips, 0 does not."""


@kernel
def joints_step(parameters: Any, state: Any, senses: Any, command: Any, output: Any) -> None:
    """Hand the command on."""
    for joint in range(NUM_JOINTS):
        output.angles[joint] = command[joint]
    for leg in range(NUM_LEGS):
        output.adhesion[leg] = command[NUM_JOINTS + leg]


@dataclass(frozen=True)
class Joints(Controller):
    """The command itself: 42 target angles, rad, ordered as `anatomy.JOINTS`, and 6 adhesions.

    It is the published low-level environment (Wang-Chen et al. 2024, doi
    10.1038/s41592-024-02497-y), and the way for a program's own oscillators, or for a recording, to
    move the fly.
    """

    command: ClassVar[Command] = JOINTS_COMMAND
    step: ClassVar[Step] = staticmethod(joints_step)


# ------------------------------------------------------------------ latency of the command


CLOCK = np.dtype(
    [
        ("latency", "f8"),  # time steps from the command to the legs
        ("now", "f8"),  # time steps since the start, counted where there is latency
        ("num_pending", "f8"),  # commands on their way
        ("first_pending", "f8"),  # where the oldest of them stands in the queue
    ],
    align=True,
)
"""Clock of commands that are in flight: they wait in a queue until they arrive."""


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
