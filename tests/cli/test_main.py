"""The command as a whole: what it lists, how it refuses, how it ends."""

import os
import re
import signal
import subprocess
import sys
from importlib import metadata

import pytest

from flyrl.cli.entry import run_command
from flyrl.cli.main import COMPOSED, command_parsers, main
from flyrl.cli.terminal import program
from flyrl.resources import DISTRIBUTION

COMMANDS = (
    "train", "evaluate", "play", "walk", "figures", "runs", "sweep", "reproduce", "tune",
)  # fmt: skip


def test_help_lists_every_command_with_a_line_and_that_of_each_has_an_example(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    text = capsys.readouterr().out
    for name in COMMANDS:
        assert re.search(rf"^    {name} +\w+ \w+", text, re.MULTILINE), name
        if name not in COMPOSED:
            assert f"flyrl {name} " in " ".join(command_parsers()[1][name].format_help().split())


def test_version(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"flyrl {metadata.version(DISTRIBUTION)}\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evalute"], "there is no command 'evalute'; did you mean 'evaluate'?"),
        (["runs", "--sotr"], "unrecognized arguments: --sotr; did you mean '--sort'?"),
    ],
)
def test_what_does_not_exist_gets_the_closest(capsys, arguments, message):
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert message in capsys.readouterr().err


def test_an_error_is_one_line_with_status_2(capsys, tmp_path):
    assert main(["runs", str(tmp_path / "none")]) == 2
    assert capsys.readouterr().err == f"error: there is no folder {tmp_path / 'none'}\n"


def test_ctrl_c_ends_a_command_with_130_and_a_word(capsys, monkeypatch, tmp_path):
    class Interrupted:
        def write(self, text):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(sys, "stdout", Interrupted())
    assert main(["runs", str(tmp_path)]) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_a_closed_pipe_ends_a_command_quietly(capsys, monkeypatch, tmp_path):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        assert main(["runs", "--csv", str(tmp_path)]) == 128 + signal.SIGPIPE
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("command", "asked"),
    [("evaluate", ("--cfg", "job", "physics=fast")), ("train", ("task=targt",))],
)
def test_a_command_does_what_its_script_does(run_here, command, asked):
    script = run_here(f"{command}.py", *asked)
    done = run_here("flyrl", command, *asked)
    for said in ("returncode", "stdout", "stderr"):
        assert getattr(done, said) == getattr(script, said)


@pytest.mark.parametrize(
    ("script", "noted"),
    [
        ("/bin/flyrl", ("/bin/flyrl",)),
        ("/lib/flyrl/__main__.py", ("-m", "flyrl")),
        ("train.py", ("train.py",)),
    ],
)
def test_the_program_is_noted_as_it_can_be_started_again(monkeypatch, script, noted):
    monkeypatch.setattr(sys, "argv", [script, "seed=1"])
    assert program() == (sys.executable, *noted)


def test_the_subcommand_is_noted_between_program_and_arguments(monkeypatch):
    noted = []
    monkeypatch.setattr(sys, "argv", ["/bin/flyrl", "episodes=3"])
    run_command("evaluate", lambda _, start: noted.append(start), subcommand=("evaluate",))
    assert noted[0].command == (sys.executable, "/bin/flyrl", "evaluate", "episodes=3")


def test_nothing_heavy_is_loaded_to_answer():
    """Torch alone would take seconds."""
    code = (
        "import sys; from flyrl.cli.main import command_parsers; "
        "command_parsers()[0].format_help(); "
        "print({'torch', 'mujoco', 'numba', 'hydra', 'matplotlib', 'pandas'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
