"""What the shell is offered, asked as it asks."""

import io
import subprocess
import sys
from pathlib import Path

import argcomplete
import pytest

from flyrl.cli.completion import SHELLS, add_completers
from flyrl.cli.figures import FIGURES
from flyrl.cli.groups import config_groups
from flyrl.cli.main import command_parsers, main

ASKED = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "_ARGCOMPLETE_SUPPRESS_SPACE": "1"}
BREAKS = " \t\n\"'><=;|&(:"
"""Characters at which bash splits words."""


class Finder(argcomplete.CompletionFinder):
    """One that leaves file descriptor 9 alone, which is pytest's here."""

    def _init_debug_stream(self):
        pass


@pytest.fixture
def offered(monkeypatch):
    """What stands in a menu after a command line, as whole words."""

    def offered(line):
        asked = {**ASKED, "COMP_LINE": line, "COMP_POINT": str(len(line))}
        for name, value in asked.items():
            monkeypatch.setenv(name, value)
        parser, commands = command_parsers()
        add_completers(commands)
        out = io.StringIO()
        Finder()(parser, exit_method=lambda status: None, output_stream=out)
        return [word.replace("\\", "") for word in out.getvalue().split("\n") if word]

    return offered


def _make_run(folder):
    folder.mkdir(parents=True)
    (folder / "config.yaml").touch()


def test_commands(offered):
    assert offered("flyrl re") == ["reproduce"]


def test_figures(offered):
    assert offered("flyrl figures cpg_") == [name for name in FIGURES if name.startswith("cpg_")]


def test_options_and_their_choices(offered):
    assert offered("flyrl runs --so") == ["--sort"]
    assert "decisions" in offered("flyrl runs --sort d")


def test_choices_of_a_group(offered):
    assert offered("flyrl train task=w") == [
        f"task={name}" for name in config_groups()["task"] if name.startswith("w")
    ]


def test_one_more_choice_of_a_sweep(offered):
    assert offered("flyrl train -m algo=ppo,s") == ["algo=ppo,sac"]


def test_keys_of_the_choice_on_the_line(offered):
    assert offered("flyrl train al") == ["algo=", "algo."]
    assert "algo.n_steps=" in offered("flyrl train algo.")
    assert "algo.n_steps=" not in offered("flyrl train algo=sac algo.")


def test_keys_of_an_evaluation_are_its_own(offered):
    assert offered("flyrl evaluate epi") == ["episodes="]
    assert offered("flyrl evaluate algo") == []


def test_yes_or_no(offered):
    assert offered("flyrl train video_after=") == ["video_after=true", "video_after=false"]


def test_policies_in_a_list(offered):
    assert offered("flyrl evaluate policies=[worm-hang,target-f") == [
        "policies=[worm-hang,target-flat"
    ]


def test_run_folders(offered, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _make_run(tmp_path / "runs" / "one")
    _make_run(tmp_path / "runs" / "sweeps" / "all" / "two")
    assert offered("flyrl train resume=") == ["resume=runs/one", "resume=runs/sweeps/all/two"]
    assert offered("flyrl reproduce runs/o") == ["runs/one"]
    assert offered("flyrl runs runs/sw") == ["runs/sweeps/", "runs/sweeps/all/two"]
    assert {*offered("flyrl sweep runs/sweeps/a")} == {"runs/sweeps/all", "runs/sweeps/all/two"}


@pytest.mark.parametrize("shell", SHELLS)
def test_code_of_a_shell_names_the_command(shell, capsys):
    assert main(["completion", shell]) == 0
    assert "flyrl" in capsys.readouterr().out


def test_bash_is_answered_on_its_descriptor_without_anything_heavy():
    line = "flyrl train task=worm_hang_"
    done = subprocess.run(
        ["bash", "-c", '"$0" -X importtime -m flyrl 8>&1 1>/dev/null', sys.executable],
        env={
            "PYTHONPATH": str(Path(__file__).parents[2]),
            "_ARGCOMPLETE": "1",
            "_ARGCOMPLETE_SHELL": "bash",
            "_ARGCOMPLETE_COMP_WORDBREAKS": BREAKS,
            "COMP_LINE": line,
            "COMP_POINT": str(len(line)),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "worm_hang_box "
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "argcomplete" in loaded
    assert not {"torch", "mujoco", "numba", "hydra", "numpy", "gymnasium"} & loaded
