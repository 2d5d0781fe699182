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


@pytest.mark.parametrize(
    ("arguments", "status", "told"),
    [
        (["--version"], 0, f"flyrl {metadata.version(DISTRIBUTION)}\n"),
        (["evalute"], 2, "there is no command 'evalute'; did you mean 'evaluate'?"),
        (["runs", "--sotr"], 2, "unrecognized arguments: --sotr; did you mean '--sort'?"),
        (["runs", "--sort", "sed"], 2, "invalid choice: 'sed'"),
    ],
)
def test_what_does_not_exist_gets_the_closest(capsys, arguments, status, told):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == status
    assert told in "".join(capsys.readouterr())


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
    [("/bin/flyrl", ["/bin/flyrl"]), ("/lib/flyrl/__main__.py", ["-m", "flyrl"])],
)
def test_a_command_is_noted_as_it_can_be_started_again(monkeypatch, script, noted):
    starts = []
    monkeypatch.setattr(sys, "argv", [script, "episodes=3"])
    run_command("evaluate", lambda _, start: starts.append(start), subcommand=("evaluate",))
    assert starts[0].command == (sys.executable, *noted, "evaluate", "episodes=3")


def test_nothing_heavy_is_loaded_to_answer():
    """Torch alone would take seconds."""
    code = (
        "import sys; from flyrl.cli.main import command_parsers; "
        "command_parsers()[0].format_help(); "
        "print({'torch', 'mujoco', 'numba', 'hydra', 'matplotlib', 'pandas'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
