"""A browser to look at pages with."""

import os
import shutil
import subprocess
from contextlib import contextmanager

import pytest
from playwright.sync_api import sync_playwright

BROWSER_VARIABLE = "FLYRL_BROWSER"


@contextmanager
def chromium(*options):
    """Start the system's Chromium, or the one that the environment names; without one, skip."""
    path = find_browser()
    if path is None:
        pytest.skip(
            "no Chromium to open a page in: apt-get install chromium on Debian, "
            f"or name the program in {BROWSER_VARIABLE}"
        )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*options])
        yield browser
        browser.close()


def find_browser():
    """Path of the program; None without.

    One on the path may be a mere shell that asks for a package, as on Ubuntu: it has no version.
    """
    if named := os.environ.get(BROWSER_VARIABLE):
        return named
    found = map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))
    return next((path for path in found if path and runs(path)), None)


def runs(path):
    return subprocess.run([path, "--version"], check=False, capture_output=True).returncode == 0
