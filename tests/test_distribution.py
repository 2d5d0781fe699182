"""flyrl's distribution: its name, and that nothing leads to the stranger called flyrl on PyPI."""

import re
import tomllib
from importlib.metadata import distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from packaging.version import Version

from flyrl.resources import DISTRIBUTION, version

ROOT = Path(__file__).parents[1]
FOLDERS = (".ci", "benchmarks", "configs", "docs", "flyrl", "hydra_plugins", "tests", "tools")
FILES = [path for path in ROOT.iterdir() if path.is_file() and not path.name.startswith(".git")]
TEXTS = {".cff", ".css", ".ipynb", ".j2", ".js", ".md", ".py", ".svg", ".toml", ".txt", ".yaml", ""}

INSTALL = re.compile(r"\b(?:pipx? install|uv add|uvx)\b[^\n`]*?[ '\"=]flyrl(?!'s)(?:[^\w./-]|$)")
"""A command that installs a distribution called flyrl; flyrl's is another name, or the checkout."""


def _project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def _requirements():
    """All but that of the import of assets, which tests do not need."""
    project = _project()
    extras = project["optional-dependencies"]
    groups = [project["dependencies"], *(extras[name] for name in extras if name != "assets")]
    return [Requirement(each) for group in groups for each in group]


def _pinned(name):
    """Version of every package in a file of versions."""
    lines = [line for line in (ROOT / name).read_text().splitlines() if not line.startswith("#")]
    pins = (line.split("==") for line in lines)
    return {canonicalize_name(package): Version(version) for package, version in pins}


STRANGERS = ("flyrl", "'flyrl[ray]'", "-U flyrl", '"flyrl>=0.1"', "np flyrl x")
OWN = ("-e '.[ray]'", f"'{DISTRIBUTION}[ray]'", "flyrl-x", "./flyrl/x")


def _found(pattern):
    """What a pattern matches in the project's texts, by file."""
    inside = (path for folder in FOLDERS for path in (ROOT / folder).rglob("*"))
    files = [path for path in (*FILES, *inside) if path.suffix in TEXTS and path.is_file()]
    return {
        str(path.relative_to(ROOT)): match[0]
        for path in files
        if (match := pattern.search(path.read_text()))
    }


def test_nothing_tells_to_install_a_stranger():
    for named in (*STRANGERS, *OWN):
        assert bool(INSTALL.search(f"{'pip'} install {named}")) == (named in STRANGERS)
    assert _found(INSTALL) == {}


def test_a_fly_has_a_ventral_nerve_cord():
    assert _found(re.compile(r"\bspin(?:al|e)\b", re.IGNORECASE)).keys() <= {
        str(Path(__file__).relative_to(ROOT))
    }


def test_the_distribution_has_one_name_and_no_requirement_is_a_stranger():
    project = _project()
    assert project["name"] == DISTRIBUTION
    assert version("flyrl") == project["version"]
    assert version("no-such-distribution") is None
    assert "flyrl" not in {canonicalize_name(requirement.name) for requirement in _requirements()}


def test_the_lowest_versions_that_are_tested_are_those_that_are_allowed():
    pinned = _pinned("constraints-lowest.txt")
    lowest = {
        canonicalize_name(requirement.name): Version(bound.version)
        for requirement in _requirements()
        for bound in requirement.specifier
        if requirement.name != "torch"  # tested with the one that is at hand
    }
    assert {name: pinned.get(name) for name in lowest} == lowest


def test_the_versions_that_are_pinned_are_allowed():
    pinned = _pinned("constraints.txt")
    for requirement in _requirements():
        name = canonicalize_name(requirement.name)
        assert name == DISTRIBUTION or requirement.specifier.contains(pinned[name]), name


def test_the_oldest_python_that_is_allowed_can_install_the_versions_that_are_pinned():
    (oldest,) = SpecifierSet(_project()["requires-python"])
    pinned = _pinned("constraints.txt")
    needed = {
        f"{name}=={version}": distribution.metadata.get("Requires-Python", "")
        for distribution in distributions()
        if (name := canonicalize_name(distribution.name)) in pinned
        and (version := Version(distribution.version.split("+")[0])) == pinned[name]
    }
    assert {f"torch=={pinned['torch']}", f"numpy=={pinned['numpy']}"} <= needed.keys()
    refused = {
        pin: python
        for pin, python in needed.items()
        if not SpecifierSet(python).contains(oldest.version)
    }
    assert refused == {}
