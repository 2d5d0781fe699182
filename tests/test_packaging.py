"""What a user gets from the built wheel, in an empty folder, away from the checkout."""

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from flyrl.policies import LearnedPolicy, load_bundle, save_bundle
from tests.bundles import target_bundle
from tests.tiny import TINY_ARGUMENTS

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    # by way of the sdist, so that this shows too whether it is complete
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def site(wheel, tmp_path_factory):
    """Folder that the wheel is installed in."""
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture(scope="module")
def python(site, tmp_path_factory):
    """Run Python with the wheel installed and the checkout out of reach."""
    empty = tmp_path_factory.mktemp("empty")
    env = {"PYTHONPATH": str(site), "PATH": "/usr/bin:/bin", "HOME": str(empty)}
    env["NUMBA_OPT"] = "0"  # compiles faster
    options = {"cwd": empty, "env": env, "capture_output": True, "text": True}

    def run(*arguments):
        return subprocess.run([sys.executable, *arguments], check=True, **options).stdout

    return run


def _files(folder):
    files = (path.relative_to(ROOT) for path in (ROOT / folder).rglob("*") if path.is_file())
    return {str(path) for path in files if "__pycache__" not in path.parts}


@pytest.fixture(scope="module")
def archive(wheel):
    with zipfile.ZipFile(wheel) as archive:
        yield archive


def test_wheel_holds_package_assets_and_configs_and_is_small(wheel, archive):
    names = set(archive.namelist())
    expected = (
        _files("flyrl")
        | _files("hydra_plugins")
        | {f"flyrl/{name}" for folder in ("assets", "configs") for name in _files(folder)}
    )
    assert expected <= names
    assert not {name for name in names if name.startswith(("tests", "assets", "configs"))}
    assert wheel.stat().st_size < 8 * 2**20


def test_wheel_carries_licence_notice_and_commands(archive):
    (metadata,) = (Path(name) for name in archive.namelist() if name.endswith("/METADATA"))
    for file in ("LICENSE", "assets/NOTICE"):
        carried = archive.read(str(metadata.parent / "licenses" / file))
        assert carried == (ROOT / file).read_bytes()
    commands = archive.read(str(metadata.parent / "entry_points.txt")).decode()
    assert "flyrl = flyrl.cli.main:main" in commands
    assert "flyrl-train = flyrl.cli.train:main" in commands
    assert "flyrl-evaluate = flyrl.cli.evaluate:main" in commands


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
for needed in ("import fcntl", "os.sched_getaffinity(0)", "open('/proc/stat')"):
    try:
        exec(needed)
    except (ImportError, AttributeError, OSError):
        continue
    raise SystemExit(f"{needed} is not hidden")
"""
"""What only Linux has is gone: file locks by fcntl, a process's CPUs, /proc, SIGPIPE."""

WORKS = """
import flyrl, hydra_plugins.flyrl_ray_launcher
print(flyrl.__file__)
for module in pkgutil.walk_packages(flyrl.__path__, "flyrl."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
from flyrl.cli.train import main
main()
"""


def test_every_module_can_be_imported_from_the_wheel_and_a_tiny_training_runs_elsewhere(python):
    arguments = (*TINY_ARGUMENTS, "video_after=false")
    where, *_, last = python("-c", ELSEWHERE + WORKS, *arguments).splitlines()
    assert not Path(where).is_relative_to(ROOT)
    assert last.startswith("run: runs/")


def _actions(policy):
    observations = np.random.default_rng(0).normal(size=(50, policy.bundle.num_inputs))
    return policy.predict(observations)[0].tobytes().hex()


PRINT_ACTIONS = """
import os, sys, flyrl, numpy as np
for name in sys.argv[1:]:
    if name.endswith("/"):
        os.chdir(name)
        continue
    policy = flyrl.load_policy(name)
    observations = np.random.default_rng(0).normal(size=(50, policy.bundle.num_inputs))
    print(policy.predict(observations)[0].tobytes().hex())
"""


def test_policies_act_to_the_same_bits_by_path_and_by_name_and_a_path_comes_first(python, tmp_path):
    mine, other = target_bundle((0.5, -0.5)), target_bundle((0.2, 0.1))
    save_bundle(mine, tmp_path / "mine")
    save_bundle(other, tmp_path / "target-flat")
    names = (f"{tmp_path}/mine", "target-flat", f"{tmp_path}/", "target-flat")
    bundles = (mine, load_bundle("target-flat"), other)
    expected = [_actions(LearnedPolicy(bundle)) for bundle in bundles]
    assert python("-c", PRINT_ACTIONS, *names).split() == expected
    assert len(set(expected)) == 3
