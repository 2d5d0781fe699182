"""What ran a benchmark."""

import os
import platform
from collections.abc import Iterable
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any


def machine(packages: Iterable[str] = ("mujoco", "numpy", "numba")) -> dict[str, Any]:
    """Describe what runs this: versions, processor, date."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        cpu = names[0].partition(":")[2].strip() if names else cpu
    return {
        "versions": {"python": platform.python_version()}
        | {package: version(package) for package in packages},
        "cpu": cpu,
        "cores": os.cpu_count(),
        "date": date.today().isoformat(),
    }
