"""Errors of the user's end in one message; errors of ours keep their traceback."""

import errno
import sys
import warnings
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from flyrl.cli.main import main
from flyrl.cli.terminal import Failure, reported


@pytest.mark.parametrize(
    "error",
    [
        ValueError("two lines\nwith \x1b[2J\u202e"),
        FileNotFoundError(errno.ENOENT, "wrong"),
        RecursionError(),
        MemoryError(),
    ],
)
def test_an_error_of_the_user_is_a_message_with_status_2(error, capsys):
    with pytest.raises(Failure) as failure, reported():
        raise error
    assert failure.value.code == 2
    told = capsys.readouterr().err
    assert told == f"error: {failure.value.message}\n"
    assert not {"\x1b", "\u202e"} & {*told}  # which would steer the terminal


def test_a_warning_is_one_line_without_code(capsys):
    with reported():
        warnings.simplefilter("default")
        warnings.warn("an old policy", stacklevel=1)
    assert capsys.readouterr().err == "warning: an old policy\n"


def test_an_error_of_a_config_file_is_a_message(capsys):
    with pytest.raises(Failure), reported():
        OmegaConf.to_container(OmegaConf.create({"a": "${b}"}), resolve=True)
    assert capsys.readouterr().err.startswith("error: Interpolation key 'b' not found")


@pytest.mark.parametrize(("error", "asked"), [(ZeroDivisionError, ""), (ValueError, "1")])
def test_a_bug_keeps_its_traceback_and_every_error_if_asked(monkeypatch, error, asked):
    monkeypatch.setenv("HYDRA_FULL_ERROR", asked)
    with pytest.raises(error), reported():
        raise error


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_output_that_was_closed_is_no_error(monkeypatch, stream):
    monkeypatch.setattr(sys, stream, None)
    with reported():
        getattr(sys, stream).write("to nobody")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device here")
@pytest.mark.parametrize("arguments", [["runs", "."], ["train", "--cfg", "all"]])
def test_output_that_is_full_is_an_error_in_one_line(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["flyrl"])
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main(arguments) == 2
    assert capsys.readouterr().err == "error: [Errno 28] No space left on device\n"
