"""The door for tasks: a function from settings to a task's table, and how it is found by name.

The built-in tasks use the same door as a user's own.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from flyrl.bodies.worm import WormConfig
from flyrl.entry_points import look_up
from flyrl.tasks.actions import Drives, JointTargets
from flyrl.tasks.episode import TIME
from flyrl.tasks.extension import extended, load_terms
from flyrl.tasks.task import Task
from flyrl.validation import checked, checked_arguments, known_keys, positive, within

ALWAYS: Final = (
    "name", "decision_interval", "time_limit", "drive_time_constant", "terms", "without", "weights"
)  # fmt: skip
"""Settings that every task has."""

TIME_LIMIT: Final = 3.0
"""s; of tasks that have none of their own, which no training and no evaluation can do without."""

TASKS: Final[dict[str, TaskFunction]] = {}
"""Functions of the built-in tasks by name; `flyrl.tasks` fills it."""


class TaskFunction:
    """A function that returns a `Task`, whose arguments are checked against its annotations.

    The task carries the arguments and the name by which its function is found, so that records can
    give it back. Equal arguments give the same task. A parameter called `worm` makes it a task for
    worms: it takes the worm that is to do it, by default the usual one.

    Parameters
    ----------
    function
        Has named parameters; their annotations say what is allowed (see
        `flyrl.validation.check_fields`).
    base
        Of a variant: `function` takes the task that `base` makes, and the parameters are those of
        `base`.

    Attributes
    ----------
    worm
        The usual worm; None in a task for flies.

    Raises
    ------
    ValueError
        A parameter has the name of a setting that every task has, or `worm` has no worm as default.
    """

    __name__: str

    def __init__(self, function: Callable[..., Task], base: TaskFunction | None = None) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self._base = base
        self._signed: Callable[..., Any] = function if base is None else base._signed
        parameters = inspect.signature(self._signed).parameters
        for key in ALWAYS:
            if key in parameters and key != "time_limit":
                raise ValueError(f"a task must not have a parameter {key!r}, as {self.name} has")
        worm = parameters["worm"].default if "worm" in parameters else None
        if not isinstance(worm, WormConfig | None):
            raise ValueError(f"worm of {self.name} must be a WormConfig by default, got {worm!r}")
        self.worm = worm
        self._made = functools.cache(self._make)

    @property
    def name(self) -> str:
        """A built-in name, or module:attribute."""
        for name, built_in in TASKS.items():
            if built_in is self:
                return name
        return f"{self._function.__module__}:{self._function.__qualname__}"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of what can be set."""
        return tuple(each for each in inspect.signature(self._signed).parameters if each != "worm")

    def __call__(self, **given: Any) -> Task:
        """Make the task.

        Raises
        ------
        ValueError
            A parameter that does not exist, or a value that is not allowed.
        """
        arguments = tuple(checked_arguments(self._signed, given, "task").items())
        try:
            hash(arguments)
        except TypeError:  # as of a dict
            return self._make(arguments)
        return self._made(arguments)

    def _make(self, arguments: tuple[tuple[str, Any], ...]) -> Task:
        given = dict(arguments)
        base = self._base
        try:
            table = self._function(**given) if base is None else self._function(base(**given))
        except ValueError:
            raise
        except Exception as error:
            # the user's own code may raise anything
            raise ValueError(f"{self.name} raised {type(error).__name__}: {error}") from error
        if not isinstance(table, Task):
            raise ValueError(f"{self.name} must return a Task, got a {type(table).__name__}")
        worm = given.pop("worm", None)
        return replace(table, name=self.name, parameters=given, worm=worm)

    def __deepcopy__(self, memo: object) -> TaskFunction:
        return self  # as functions are

    def __reduce__(self) -> tuple[Any, ...]:
        return task_function, (self.name,)


def variant_of(base: TaskFunction) -> Callable[[Callable[[Task], Task]], TaskFunction]:
    """Decorate a function from a task to another: a task with the parameters of `base`."""
    return functools.partial(TaskFunction, base=base)


TaskSettings = str | Mapping[str, Any] | Callable[..., Task]
"""A task: its name, a mapping with the name and settings, or a task function."""


def task_function(given: TaskSettings) -> TaskFunction:
    """Task function that settings name, or that makes a task of a plain function.

    Raises
    ------
    ValueError
        If there is no such task.
    """
    if isinstance(given, Mapping):
        given = given.get("name", "")
    if isinstance(given, str):
        given = look_up("task", given, TASKS, _may_be_one, "task function")
    if not _may_be_one(given):
        raise ValueError(f"task must be a Task, a task function or the name of one, got {given!r}")
    return given if isinstance(given, TaskFunction) else _wrapped(given)


def _may_be_one(value: object) -> bool:
    return isinstance(value, TaskFunction) or inspect.isfunction(value)


_wrapped = functools.cache(TaskFunction)  # so that equal arguments give the same task


def task_from(settings: TaskSettings, worm: WormConfig | None = None) -> Task:
    """Task of its name and settings, as `task_record` and the group `task` have them.

    Parameters
    ----------
    settings
        A mapping holds the parameters of the task function and, of every task, `terms` (names,
        module:attribute), `without`, `weights` (see `extended`), `time_limit` (s) and
        `drive_time_constant` (s, see `Task`). None, for either, is the usual one.
        `decision_interval` belongs to the environment.
    worm
        Worm of a task for worms; None is the usual one.

    Raises
    ------
    ValueError
        There is no such task or setting, or a value that is not allowed.
    """
    function = task_function(settings)
    if not isinstance(settings, Mapping):
        settings = {}
    known_keys("task", settings, (*function.parameters, *ALWAYS))
    given = {key: settings[key] for key in function.parameters if key in settings}
    limit = settings.get("time_limit")
    if limit is None:
        given.pop("time_limit", None)
    if worm is not None and function.worm is not None:
        given["worm"] = worm
    task = function(**given)
    if limit is not None and "time_limit" not in function.parameters:
        task = replace(task, time_limit_s=positive("task.time_limit", limit))
    constant = settings.get("drive_time_constant")
    if constant is not None:
        task = _following(task, constant)
    terms = checked("task.terms", settings.get("terms", ()), tuple[str, ...])
    without = checked("task.without", settings.get("without", ()), tuple[str, ...])
    weights = checked("task.weights", settings.get("weights", {}), Mapping[str, float])
    return extended(task, load_terms(terms), weights, without)


def with_time_limit(task: TaskSettings | Task) -> TaskSettings | Task:
    """The same task, with the time limit `TIME_LIMIT` if it has none."""
    if isinstance(task, Task):
        return replace(task, time_limit_s=task.time_limit_s or TIME_LIMIT)
    if task_from(task).time_limit_s is not None:
        return task
    return {**(task if isinstance(task, Mapping) else {"name": task}), "time_limit": TIME_LIMIT}


def _following(task: Task, time_constant: Any) -> Task:
    """The task with a drive that follows its actions within a time constant, s."""
    seconds = within("task.drive_time_constant", time_constant, 0.0, TIME.high)
    if seconds and (not isinstance(task.actions, Drives) or isinstance(task.actions, JointTargets)):
        raise ValueError(
            f"task.drive_time_constant must be 0 in the task {task.name!r}, whose actions are no "
            f"drives, got {time_constant}"
        )
    return replace(task, drive_time_constant_s=seconds)
