"""Wall time by name, of methods that are wrapped from outside."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any


class Stopwatch:
    """Adds up wall time by name; what runs inside another name's time counts for itself alone.

    Parameters
    ----------
    clock
        Gives the time, s.

    Attributes
    ----------
    seconds
        Time so far, by name.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._clock = clock
        self._running: list[str] = []
        self._since = 0.0

    @contextmanager
    def timing(self, name: str) -> Iterator[None]:
        """Count the block as `name`."""
        self._credit()
        self._running.append(name)
        try:
            yield
        finally:
            self._credit()
            self._running.pop()

    def wrap(self, owner: Any, method: str, name: str) -> None:
        """Count every call of `owner.method` from now on as `name`."""
        wrapped = getattr(owner, method)

        @wraps(wrapped)
        def timed(*args: Any, **kwargs: Any) -> Any:
            with self.timing(name):
                return wrapped(*args, **kwargs)

        setattr(owner, method, timed)

    def shares(self) -> dict[str, float]:
        """Share of each name in the time of all."""
        total = sum(self.seconds.values())
        return {name: seconds / total for name, seconds in self.seconds.items()}

    def _credit(self) -> None:
        now = self._clock()
        if self._running:
            self.seconds[self._running[-1]] += now - self._since
        self._since = now
