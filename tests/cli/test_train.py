import pytest

from flyrl.policies import load_policy
from tests.tiny import TINY_ARGUMENTS


@pytest.mark.slow
def test_train_from_an_empty_folder(tmp_path, run_here):
    result = run_here("train.py", "task=target", "terrain=flat", *TINY_ARGUMENTS)
    assert result.returncode == 0, result.stderr
    last = result.stdout.splitlines()[-1]
    assert last.startswith("run: runs/")
    # the run folder, and no output of Hydra's
    assert [path.name for path in tmp_path.iterdir()] == ["runs"]
    folder = tmp_path / last.removeprefix("run: ")
    assert load_policy(folder / "last.safetensors").bundle.training["decisions"] == 64
    assert "train.py task=target" in (folder / "command.txt").read_text()
    assert (folder / "learning_curve.svg").is_file()
    assert (folder / "best.mp4").is_file() != ("Videos are left out: " in result.stderr)


def test_help_names_the_choices(run_here):
    result = run_here("train.py", "--help")
    assert result.returncode == 0
    assert "terrain: air, any, ball, blocks, flat, gapped, hills" in result.stdout


def test_a_folder_that_cannot_be_written_to_is_an_error_in_one_line(tmp_path, run_here):
    (tmp_path / "runs").write_text("a file")
    result = run_here("train.py", *TINY_ARGUMENTS)
    assert result.returncode == 2
    assert result.stderr.splitlines()[-1] == "error: [Errno 17] File exists: 'runs'"
