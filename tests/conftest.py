"""The order of the tests, and Ctrl-C in them."""

import signal


def pytest_configure():
    """Mind Ctrl-C: a shell makes its background jobs, and all that they start, ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items):
    """Slow ones first: at the end, no process is to wait for another's long test."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
