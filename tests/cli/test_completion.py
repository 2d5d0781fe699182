"""What the shell is offered, asked as it asks."""

import io
import subprocess
import sys
from pathlib import Path

import argcomplete
import pytest

from flyrl.cli.main import command_parsers
from flyrl.cli.main import offered as values_offered


class Finder(argcomplete.CompletionFinder):
    """One that leaves file descriptor 9 alone, which is pytest's here."""

    def _init_debug_stream(self):
        pass


@pytest.fixture
def offered(monkeypatch):
    """What stands in a menu after a command line, as whole words."""

    def offered(line):
        asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line}
        for name, value in {**asked, "COMP_POINT": str(len(line))}.items():
            monkeypatch.setenv(name, value)
        out = io.StringIO()
        Finder()(
            command_parsers()[0],
            exit_method=lambda status: None,
            output_stream=out,
            default_completer=values_offered,
        )
        return [word.replace("\\", "").strip() for word in out.getvalue().split("\n") if word]

    return offered


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("flyrl re", ["reproduce"]),
        ("flyrl figures cpg_", ["cpg_three", "cpg_tripod"]),
        ("flyrl runs --so", ["--sort"]),
        ("flyrl runs --sort d", ["decisions"]),
        ("flyrl play fly --terrain random_b", ["random_blocks"]),
        ("flyrl play --policy target-f", ["target-flat"]),
        ("flyrl reproduce runs/o", ["runs/one/"]),
    ],
)
def test_words_are_completed(offered, tmp_path, monkeypatch, line, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "one").mkdir(parents=True)
    assert offered(line) == words


def test_bash_is_answered_on_its_descriptor_without_anything_heavy():
    line = "flyrl figures cpg_tri"
    done = subprocess.run(
        ["bash", "-c", '"$0" -X importtime -m flyrl 8>&1 1>/dev/null', sys.executable],
        env={
            "PYTHONPATH": str(Path(__file__).parents[2]),
            "_ARGCOMPLETE": "1",
            "_ARGCOMPLETE_SHELL": "bash",
            "_ARGCOMPLETE_COMP_WORDBREAKS": " \t\n\"'><=;|&(:",
            "COMP_LINE": line,
            "COMP_POINT": str(len(line)),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "cpg_tripod "
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "argcomplete" in loaded
    assert not {"torch", "mujoco", "numba", "hydra", "numpy", "gymnasium"} & loaded
