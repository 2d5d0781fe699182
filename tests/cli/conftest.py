"""Commands of a terminal, run in this process, which has loaded everything: quicker."""

import subprocess
import sys

import pytest

from flyrl.cli import evaluate, train
from flyrl.cli.main import main

COMMANDS = {"train.py": train.main, "evaluate.py": evaluate.main, "flyrl": main}


@pytest.fixture
def run_here(tmp_path, monkeypatch, capsys):
    """Run `train.py`, `evaluate.py` or `flyrl` with arguments, in `tmp_path`."""

    def run_here(program, *arguments):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("FLYRL_SWEEP_PROCESS", "")  # so that what a sweep sets is put back
        command = [program, *arguments]
        monkeypatch.setattr(sys, "argv", command.copy())
        capsys.readouterr()
        try:
            status = COMMANDS[program]() or 0
        except SystemExit as end:
            status = end.code
        return subprocess.CompletedProcess(command, status, *capsys.readouterr())

    return run_here
