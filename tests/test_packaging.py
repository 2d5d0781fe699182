"""What a user gets from the built wheel, in an empty folder, away from the checkout."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

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
def python(wheel, tmp_path_factory):
    """Run Python with the wheel installed and the checkout out of reach."""
    site, empty = tmp_path_factory.mktemp("site"), tmp_path_factory.mktemp("empty")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)

    def run(*arguments):
        return subprocess.run(
            [sys.executable, *arguments],
            cwd=empty,
            env={"PYTHONPATH": str(site), "PATH": "/usr/bin:/bin", "HOME": str(empty)},
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
    expected = _files("flyrl") | {
        f"flyrl/{name}" for folder in ("assets", "configs") for name in _files(folder)
    }
    assert expected <= names
    assert not {name for name in names if name.startswith(("tests", "assets", "configs"))}


def test_wheel_is_small(wheel):
    assert wheel.stat().st_size < 8 * 2**20


def test_import_comes_from_the_wheel(python):
    where = python("-c", "import flyrl; print(flyrl.__file__)").strip()
    assert not Path(where).is_relative_to(ROOT)


def test_assets_and_environment_from_the_wheel(python):
    code = """
import gymnasium
env = gymnasium.make("flyrl:flyrl/Target-v0", terrain="mixed")
observation, info = env.reset(seed=0)
print(env.observation_space.contains(observation))
"""
    assert python("-c", code).strip() == "True"


@pytest.mark.parametrize("name", ["train", "evaluate"])
def test_commands_find_their_configs(python, name):
    code = f"from flyrl.cli.{name} import main; main()"
    assert f"flyrl-{name}:" in python("-c", code, "--help")


def test_commands_are_installed_scripts(wheel):
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith("entry_points.txt")]
        text = archive.read(name).decode()
    assert "flyrl = flyrl.cli.main:main" in text
    assert "flyrl-train = flyrl.cli.train:main" in text
    assert "flyrl-evaluate = flyrl.cli.evaluate:main" in text


def test_a_tiny_training_run_in_an_empty_folder(python):
    code = "from flyrl.cli.train import main; main()"
    output = python(
        "-c",
        code,
        "training.total_decisions=32",
        "training.num_envs=2",
        "training.evaluation_episodes=1",
        "algo.n_steps=16",
        "algo.batch_size=32",
        "video_after=false",
    )
    assert output.splitlines()[-1].startswith("run: runs/")
