"""Measurements of speed and of walking."""
