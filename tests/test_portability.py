"""flyrl without what only Linux has: file locks by fcntl, a process's CPUs, /proc, SIGPIPE."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.tiny import TINY_ARGUMENTS

ROOT = Path(__file__).parents[1]

ELSEWHERE = """
import builtins, importlib, io, os, pkgutil, signal, sys
import psutil  # has code of its own for each system

for name in ("fcntl", "resource", "termios", "pwd", "grp"):
    sys.modules[name] = None
del os.sched_getaffinity, signal.SIGPIPE
opened = io.open

def without_proc(file, *args, **kwargs):
    if str(file).startswith("/proc"):
        raise FileNotFoundError(2, "No such file or directory", str(file))
    return opened(file, *args, **kwargs)

io.open = builtins.open = without_proc
"""
WORKS = """
import flyrl, hydra_plugins.flyrl_ray_launcher
for module in pkgutil.walk_packages(flyrl.__path__, "flyrl."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
print("imported")
from flyrl.cli.train import main
main()
"""


def _run(code, *arguments, **where):
    command = [sys.executable, "-c", ELSEWHERE + code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, **where)


@pytest.mark.parametrize(
    "needed", ["import fcntl", "os.sched_getaffinity(0)", "open('/proc/stat')"]
)
def test_what_only_linux_has_is_hidden(needed):
    assert _run(needed).returncode == 1


@pytest.mark.slow
def test_every_module_can_be_imported_and_a_tiny_training_runs_elsewhere(tmp_path):
    done = _run(WORKS, *TINY_ARGUMENTS, "video_after=false", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, *_, last = done.stdout.splitlines()
    assert first == "imported"
    assert last.startswith("run: runs")
