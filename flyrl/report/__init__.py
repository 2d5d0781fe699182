"""Results -> figures, videos, one HTML file."""

from flyrl.report.curves import write_learning_curve, write_learning_curves
from flyrl.report.html import read_origin, write_report
from flyrl.report.video import Video, record_videos

__all__ = [
    "Video",
    "read_origin",
    "record_videos",
    "write_learning_curve",
    "write_learning_curves",
    "write_report",
]
