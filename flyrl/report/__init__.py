"""Results -> figures, videos, one HTML file."""
