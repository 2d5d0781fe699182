"""The only place that reads command lines."""
