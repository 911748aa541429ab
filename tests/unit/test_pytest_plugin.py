"""The plugin of pytest, in processes of its own: scenario files, the fixture, failures."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from volery.cli.app import app

HOP = """
name = "hop"
duration_s = 1.5
[types.bird]
airframe = "f450"
[[uavs]]
type = "bird"
position_m = [0.0, 0.0]
on_start = "take_off"
[[expect]]
kind = "no_contact"
[[expect]]
kind = "speed"
at_most_m_s = 5.0
"""


@pytest.fixture
def suite(tmp_path):
    """A folder of tests, and what runs pytest in it."""

    def run(*words):
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-rA", "-p", "no:cacheprovider", *words],
            env={**os.environ, "COLUMNS": "200"},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            timeout=900,
        )

    run.folder = tmp_path
    return run


def test_scenario_files_are_tests(suite):
    (suite.folder / "test_hop.toml").write_text(HOP)
    (suite.folder / "slow_test.toml").write_text(HOP.replace("5.0", "0.1"))
    (suite.folder / "other.toml").write_text("[tool]\n")
    done = suite("--volery-seeds", "2", "--junit-xml", "out.xml")
    assert done.returncode == 1, done.stdout
    assert "2 failed, 2 passed" in done.stdout
    assert "failed  speed <= 0.1 m/s" in done.stdout
    assert "Traceback" not in done.stdout
    cases = ElementTree.parse(suite.folder / "out.xml").getroot().iter("testcase")
    kept = [p.get("value") for case in cases for p in case.iter("property")]
    files = [Path(value) for value in kept if not value.startswith("volery run ")]
    assert sorted(file.suffix for file in files) == [".mcap", ".mcap", ".png", ".png"]
    assert all(file.stat().st_size > 1000 for file in files)


def test_a_failed_flight_can_be_repeated(suite):
    (suite.folder / "slow_test.toml").write_text(HOP.replace("5.0", "0.1"))
    done = suite("--volery-seeds", "1")
    replay = re.search(r"replay +volery (run .*) --page", done.stdout)[1]
    again = CliRunner().invoke(app, [*shlex.split(replay), "--fail-on", "expectation"])
    assert again.exit_code == 1, again.output
    measured = re.search(r"failed +(speed .*)", done.stdout)[1]
    assert measured in again.output


def test_the_plugin_may_be_named_and_switched_off(suite):
    (suite.folder / "test_hop.toml").write_text(HOP)
    assert "no tests ran" in suite("-p", "no:volery.pytest_plugin").stdout
    (suite.folder / "conftest.py").write_text('pytest_plugins = ["volery.pytest_plugin"]\n')
    assert "1 passed" in suite().stdout


def test_the_fixture_flies_with_each_seed(suite):
    (suite.folder / "hop.toml").write_text(HOP)
    (suite.folder / "test_hops.py").write_text(
        "import pytest\n"
        "@pytest.mark.seeds(3)\n"
        "def test_it_hops(flight, seed):\n"
        "    judged = flight('hop.toml', seed=seed, wind=[1.0, 0.0, 0.0])\n"
        "    assert judged.flight.seed == seed\n"
        "    assert judged.flight.position_map[0, -1, 2] > 0.3\n"
        "def test_it_is_slow(flight):\n"
        "    flight('hop.toml', **{'expect[1].at_most_m_s': 0.1})\n"
        "def test_verdicts_alone(flight):\n"
        "    judged = flight('hop.toml', check=False, **{'expect[1].at_most_m_s': 0.1})\n"
        "    assert [v.is_passed for v in judged.verdicts] == [True, False]\n"
    )
    done = suite()
    assert "1 failed, 4 passed" in done.stdout, done.stdout
    assert "failed  speed <= 0.1 m/s" in done.stdout
    (summary,) = re.findall(r"FAILED test_hops.py::test_it_is_slow - (.*)", done.stdout)
    assert "FlightFailedError: hop, seed 1: speed <= 0.1 m/s: " in summary
    assert "_check(request.node" not in done.stdout  # no lines of the plugin


def test_an_unknown_scenario_has_the_nearest_name(suite):
    (suite.folder / "test_hoover.py").write_text("def test_it(flight):\n    flight('hoover')\n")
    done = suite()
    assert "no scenario 'hoover'; did you mean 'hover'?" in done.stdout
    assert "pytest_plugin.py" not in done.stdout


def test_a_file_that_cannot_be_read_is_a_collection_error(suite):
    (suite.folder / "test_bad.toml").write_text(HOP.replace("no_contact", "no_contacts"))
    (suite.folder / "test_empty.toml").write_text(HOP[: HOP.index("[[expect]]")])
    (suite.folder / "test_other.toml").write_text("[tool]\n")
    (suite.folder / "test_broken.toml").write_text(HOP.replace("= 1.5", "="))
    done = suite()
    assert done.returncode == 2
    assert "did you mean 'no_contact'?" in done.stdout
    assert "expects nothing: add [[expect]]" in done.stdout
    assert "test_broken.toml: not valid TOML" in done.stdout
    assert "3 errors" in done.stdout
