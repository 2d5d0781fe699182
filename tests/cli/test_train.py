import re

from tests.tiny import TINY_ARGUMENTS


def test_help_names_the_choices(run_here):
    result = run_here("train.py", "--help")
    assert result.returncode == 0
    (terrains,) = re.findall(r"^terrain: (.*)", result.stdout, re.MULTILINE)
    assert {"air", "any", "ball", "blocks", "flat", "hills"} <= set(terrains.split(", "))


def test_a_folder_that_cannot_be_written_to_is_an_error_in_one_line(tmp_path, run_here):
    (tmp_path / "runs").write_text("a file")
    result = run_here("train.py", *TINY_ARGUMENTS)
    assert result.returncode == 2
    assert result.stderr.splitlines()[-1] == "error: [Errno 17] File exists: 'runs'"
