"""Results -> figures, videos, one HTML file."""

from flyrl.report.html import Video, write_report

__all__ = ["Video", "write_report"]
