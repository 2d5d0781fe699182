"""Ctrl-C and SIGTERM end a run in order: the work in hand is finished and the policy saved."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Remembers the first signal that asked the run to end.

    Attributes
    ----------
    signal
        The signal, or None.
    """

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None

    def __bool__(self) -> bool:
        return self.signal is not None

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.signal is not None:
            raise KeyboardInterrupt  # asked twice: drop everything
        self.signal = signal.Signals(number)


@contextmanager
def interruption() -> Iterator[Interruption]:
    """Catch the signals inside the block; outside the main thread, nothing is caught."""
    asked = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    previous = {number: signal.signal(number, asked._ask) for number in _SIGNALS}
    try:
        yield asked
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
