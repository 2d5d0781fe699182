"""Order of the tests, Ctrl-C in them, bytecode, garbage; modules and commands of users."""

import gc
import os
import signal
import subprocess
import sys

import pytest


def pytest_configure():
    """Mind Ctrl-C: a shell makes its background jobs, and all that they start, ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    # where no bytecode is kept, every process that a test starts compiles all that it imports:
    # most of the time of a short command
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    # the search for garbage took a twelfth of the time; what a test leaves open is still an error,
    # at the latest when pytest ends and frees everything
    gc.set_threshold(10_000, 10, 50)


def pytest_collection_modifyitems(items):
    """Slow ones first: at the end, no process is to wait for another's long test."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


def pytest_collection_finish():
    """Keep the modules, which last to the end, out of the search for garbage."""
    gc.freeze()


@pytest.fixture
def own_module(tmp_path, monkeypatch):
    """Write a user's module, given its name and code, to `tmp_path`; return the file.

    That is the current folder then, from which the module is imported anew.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    written = []

    def own_module(name, code):
        monkeypatch.delitem(sys.modules, name, raising=False)
        written.append(name)
        file = tmp_path / f"{name}.py"
        file.write_text(code)
        return file

    yield own_module
    for name in written:
        sys.modules.pop(name, None)


@pytest.fixture
def run_here(tmp_path, monkeypatch, capsys):
    """Run `train.py`, `evaluate.py` or `flyrl` with arguments, in `tmp_path`.

    It runs in this process, which has loaded everything: quicker.
    """
    from flyrl.cli import evaluate, train
    from flyrl.cli.main import main

    commands = {"train.py": train.main, "evaluate.py": evaluate.main, "flyrl": main}

    def run_here(program, *arguments):
        monkeypatch.chdir(tmp_path)
        command = [program, *arguments]
        monkeypatch.setattr(sys, "argv", command.copy())
        capsys.readouterr()
        try:
            status = commands[program]() or 0
        except SystemExit as end:
            status = end.code
        return subprocess.CompletedProcess(command, status, *capsys.readouterr())

    return run_here
