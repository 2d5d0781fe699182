import sys

import pytest

from flyrl.cli.main import main
from flyrl.play.server import listen


def only_line(capsys):
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    return line


def test_no_such_thing(capsys):
    assert main(["play", "wurm"]) == 2
    assert "must be one of 'fly', 'worm', got 'wurm'" in only_line(capsys)


@pytest.mark.parametrize("option", ["terrain", "controller", "physics", "body", "policy", "seed"])
def test_a_worm_has_none_of_a_flys_options(option, capsys):
    assert main(["play", "worm", f"--{option}", "1"]) == 2
    assert only_line(capsys) == f"error: --{option} goes with the fly only, got 'worm'"


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--terrain=sand", "terrain must be one of"),
        ("--terrain=no_such_lab:Ridge", "terrain is 'no_such_lab:Ridge', but no_such_lab cannot"),
        ("--controller=joints", "controller must be one that takes a drive, got 'joints'"),
        ("--policy=no-such", "policy must be a file, a run folder or one of pursuit, target-flat"),
        ("--policy=velocity-flat", "got 'velocity-flat': the policy was trained on other"),
    ],
)
def test_a_wrong_option_is_refused_before_an_address_is_printed(option, message, capsys):
    assert main(["play", option, "--no-browser", "--port", "0"]) == 2
    assert message in only_line(capsys)


@pytest.mark.parametrize("port", ["80", "70000", "-1"])
def test_no_such_port(port, capsys):
    assert main(["play", "worm", "--port", port]) == 2
    assert only_line(capsys) == f"error: --port must lie within 1024 and 65535, got {port}"


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
