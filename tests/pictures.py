"""Pictures in tests: skipped where nothing can draw, and read from videos."""

import contextlib
import re
import subprocess

import imageio_ffmpeg
import numpy as np
import pytest

from flyrl.simulation.rendering import RenderingUnavailableError


@contextlib.contextmanager
def drawing():
    """Skip the test where no GL library can draw."""
    try:
        yield
    except RenderingUnavailableError as error:
        pytest.skip(str(error))


def decoded(path):
    """Report of ffmpeg on a video, and its pictures, (n, height, width, 3)."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24"]
    done = subprocess.run([*command, "-"], capture_output=True, check=True)
    facts = done.stderr.decode()
    width, height = map(int, re.search(r"Video: .*?, (\d+)x(\d+)", facts).groups())
    return facts, np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3)
