import sys

import pytest

from flyrl.cli.main import main
from flyrl.play.server import listen


def only_line(capsys):
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    return line


OF_THE_FLY = ("terrain", "controller", "physics", "body", "policy", "seed")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("wurm", "must be one of 'fly', 'worm', got 'wurm'"),
        *(
            (f"worm --{option} 1", f"--{option} goes with the fly only, got 'worm'")
            for option in OF_THE_FLY
        ),
        *(
            (f"worm --port {port}", f"--port must lie within 1024 and 65535, got {port}")
            for port in (80, 70000, -1)
        ),
        ("--terrain sand", "terrain must be one of"),
        ("--terrain no_such_lab:Ridge", "is 'no_such_lab:Ridge', but no_such_lab cannot be imp"),
        ("--controller joints", "controller must be one that takes a drive, got 'joints'"),
        ("--policy no-such", "policy must be a file, a run folder or one of pursuit, target-any"),
        (
            "--policy velocity-flat",
            "got 'velocity-flat': the policy was trained on observations that target does not",
        ),
    ],
)
def test_what_cannot_be_played_is_refused_before_an_address_is_printed(arguments, message, capsys):
    assert main(["play", *arguments.split(), "--no-browser"]) == 2
    assert message in only_line(capsys)


def test_a_port_in_use(capsys):
    with listen(0) as taken:
        port = taken.getsockname()[1]
        assert main(["play", "worm", "--no-browser", "--port", str(port)]) == 2
    assert only_line(capsys) == (
        f"error: cannot listen on port {port} (address already in use); "
        "choose another with --port, 0 for any"
    )


def test_a_log_that_cannot_be_written(tmp_path, capsys):
    log = tmp_path / "missing" / "log.jsonl"
    assert main(["play", "worm", "--no-browser", "--port", "0", "--log", str(log)]) == 2
    assert str(log) in only_line(capsys)


def test_without_the_web_viewer(monkeypatch, capsys):
    for name in ("flyrl.play.page", "flyrl.play.server"):  # imported above
        monkeypatch.delattr(name, raising=False)
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "mujoco.studio.web", None)
    assert main(["play", "worm", "--no-browser", "--port", "0"]) == 2
    line = only_line(capsys)
    assert line.startswith("error: mujoco.studio, which shows the page, cannot be")
    assert line.endswith("pip install -e . in flyrl's checkout")
