import subprocess
import sys

import pytest

from flyrl.training.loggers import LOGGERS, LoggerConfig


class _Nowhere(LoggerConfig):
    name = "no_such_service"

    def open(self, run, run_id):
        raise NotImplementedError


MESSAGE = (
    "logger=no_such_service needs the package no_such_service: "
    r"pip install -e '\.\[no_such_service\]'"
)


def test_a_missing_package_is_told_with_its_extra():
    with pytest.raises(ValueError, match=MESSAGE):
        _Nowhere().check_installed()


def test_a_folder_of_that_name_is_no_package(tmp_path, monkeypatch):
    (tmp_path / "no_such_service").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match=MESSAGE):
        _Nowhere().check_installed()


@pytest.mark.parametrize("name", LOGGERS)
def test_the_services_that_are_tested_are_installed(name):
    LOGGERS[name]().check_installed()


def test_no_service_is_imported_before_one_is_asked_for():
    code = f"import sys, flyrl.training.learn; print({set(LOGGERS)!r} & set(sys.modules))"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout == "set()\n"
