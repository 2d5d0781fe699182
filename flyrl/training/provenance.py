"""Where a run comes from: code, packages, machine."""

import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import flyrl

_PACKAGES: Final = (
    "flyrl",
    "gymnasium",
    "mujoco",
    "numba",
    "numpy",
    "sb3-contrib",
    "scipy",
    "stable-baselines3",
    "torch",
)


def provenance() -> dict[str, Any]:
    """Commit, versions and CPU, as plain JSON values; what cannot be known is null."""
    return {
        "git": _git(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in _PACKAGES},
        "system": platform.platform(),
        "cpu": _cpu(),
        "num_cpus": len(os.sched_getaffinity(0)),
    }


def code_changes() -> str:
    """What the checkout that flyrl runs from has beyond its commit, as `git diff` says it.

    Empty for an installed package, and where git cannot be asked.
    """
    checkout = _checkout()
    if checkout is None:
        return ""
    difference = _run("git", "-C", str(checkout), "diff", "HEAD")
    return difference + "\n" if difference else ""


def _checkout() -> Path | None:
    """The git checkout that flyrl runs from; None for an installed package."""
    folder = Path(flyrl.__file__).resolve().parents[1]
    return folder if (folder / ".git").exists() else None


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _git() -> dict[str, Any] | None:
    """Commit of the checkout that flyrl runs from; null for an installed package."""
    checkout = _checkout()
    if checkout is None:
        return None
    commit = _run("git", "-C", str(checkout), "rev-parse", "HEAD")
    changes = _run("git", "-C", str(checkout), "status", "--porcelain")
    if commit is None or changes is None:
        return None
    return {"commit": commit, "is_dirty": bool(changes)}


def _run(*command: str) -> str | None:
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.strip()


def _cpu() -> dict[str, Any]:
    model, flags = None, None
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        key, _, value = line.partition(":")
        if key.strip() == "model name" and model is None:
            model = value.strip()
        elif key.strip() == "flags" and flags is None:
            flags = value.strip()
    return {"model": model or platform.processor() or None, "flags": flags}
