"""The order of the tests."""


def pytest_collection_modifyitems(items):
    """Slow ones first: at the end, no process is to wait for another's long test."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
