"""What a user gets from the built wheel, in an empty folder, away from the checkout."""

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from flyrl.policies import LearnedPolicy, observation_layout, save_bundle
from flyrl.tasks import TASKS
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

    def run(*arguments):
        return subprocess.run(
            [sys.executable, *arguments],
            cwd=empty,
            env=env,
            capture_output=True,
            text=True,
            check=True,
        ).stdout

    return run


def _files(folder):
    files = (path.relative_to(ROOT) for path in (ROOT / folder).rglob("*") if path.is_file())
    return {str(path) for path in files if "__pycache__" not in path.parts}


def test_wheel_holds_package_assets_and_configs(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    expected = (
        _files("flyrl")
        | _files("hydra_plugins")
        | {f"flyrl/{name}" for folder in ("assets", "configs") for name in _files(folder)}
    )
    assert expected <= names
    assert not {name for name in names if name.startswith(("tests", "assets", "configs"))}


def test_wheel_carries_licence_and_notice(wheel):
    with zipfile.ZipFile(wheel) as archive:
        (metadata,) = (Path(name) for name in archive.namelist() if name.endswith("/METADATA"))
        for file in ("LICENSE", "assets/NOTICE"):
            carried = archive.read(str(metadata.parent / "licenses" / file))
            assert carried == (ROOT / file).read_bytes()


def test_wheel_is_small(wheel):
    assert wheel.stat().st_size < 8 * 2**20


def test_commands_are_installed_scripts(wheel):
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith("entry_points.txt")]
        text = archive.read(name).decode()
    assert "flyrl = flyrl.cli.main:main" in text
    assert "flyrl-train = flyrl.cli.train:main" in text
    assert "flyrl-evaluate = flyrl.cli.evaluate:main" in text


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


@pytest.mark.parametrize(
    "needed", ["import fcntl", "os.sched_getaffinity(0)", "open('/proc/stat')"]
)
def test_what_only_linux_has_is_hidden(python, needed):
    with pytest.raises(subprocess.CalledProcessError):
        python("-c", ELSEWHERE + needed)


def test_every_module_can_be_imported_from_the_wheel_and_a_tiny_training_runs_elsewhere(python):
    arguments = (*TINY_ARGUMENTS, "video_after=false")
    where, *_, last = python("-c", ELSEWHERE + WORKS, *arguments).splitlines()
    assert not Path(where).is_relative_to(ROOT)
    assert last.startswith("run: runs/")


def _save_policy(path, seed):
    """Save a policy for the task Target, and return it."""
    rng = np.random.default_rng(seed)
    size = sum(term.size for term in observation_layout(TASKS["target"]()))
    weights = {
        "0.weight": rng.normal(size=(64, size)).astype(np.float32),
        "0.bias": np.zeros(64, np.float32),
        "1.weight": rng.normal(size=(2, 64)).astype(np.float32) / 8,
        "1.bias": np.zeros(2, np.float32),
    }
    bundle = target_bundle(weights=weights, sizes=(size, 64, 2), squashing="tanh")
    path.parent.mkdir(parents=True, exist_ok=True)
    save_bundle(bundle, path)
    return LearnedPolicy(bundle)


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


@pytest.fixture(scope="module")
def named(site):
    """A policy that comes with the installed package."""
    return _save_policy(site / "flyrl" / "assets" / "policies" / "tiny.safetensors", seed=1)


def test_policies_act_to_the_same_bits_by_path_and_by_name_and_a_path_comes_first(
    python, named, tmp_path
):
    mine, other = (_save_policy(tmp_path / name, seed) for name, seed in (("mine", 2), ("tiny", 3)))
    printed = python("-c", PRINT_ACTIONS, str(tmp_path / "mine"), "tiny", f"{tmp_path}/", "tiny")
    expected = [_actions(policy) for policy in (mine, named, other)]
    assert printed.split() == expected
    assert len(set(expected)) == 3
