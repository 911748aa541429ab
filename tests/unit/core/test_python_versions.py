"""Tests that classifiers, requires-python, dependencies and linters agree on Python versions."""

import re
import sys
import tomllib
from importlib.metadata import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.version import Version

from volery.cli.doctor import _PYTHON

ROOT = Path(__file__).parents[3]
FILE = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = FILE["project"]
VERSIONS = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
RUNNING = Version(f"{sys.version_info[0]}.{sys.version_info[1]}")
DEPENDENCIES = [Requirement(text) for text in PROJECT["dependencies"]]


def test_classifiers_are_the_versions_from_the_minimum_without_gaps():
    minors = [int(version.removeprefix("3.")) for version in VERSIONS]
    assert PROJECT["requires-python"] == f">=3.{minors[0]}"
    assert minors == list(range(minors[0], minors[0] + len(minors)))
    assert FILE["tool"]["ruff"]["target-version"] == f"py3{minors[0]}"
    assert (3, minors[0]) == _PYTHON


@pytest.mark.parametrize("requirement", DEPENDENCIES, ids=lambda requirement: requirement.name)
def test_a_dependency_supports_every_python_version(requirement):
    """From the running version on; for older ones pip installs older releases."""
    found = metadata(requirement.name)
    assert requirement.specifier.contains(found["Version"], prereleases=True)
    supported = SpecifierSet(found["Requires-Python"] or "")
    later = [each for each in VERSIONS if Version(each) >= RUNNING]
    assert [version for version in later if f"{version}.9" not in supported] == []


def test_the_short_suite_uses_ranges_of_the_extra_test():
    tests = set(PROJECT["optional-dependencies"]["test"])
    assert set(FILE["dependency-groups"]["short-suite"]) <= tests


def test_the_short_suite_names_what_exists():
    lines = (ROOT / ".ci/short_suite").read_text().splitlines()
    paths = [line.split("#")[0].strip().removeprefix("--ignore=") for line in lines]
    paths = [path for path in paths if path]
    assert len(paths) > 5
    assert [path for path in paths if not (ROOT / path).exists()] == []
