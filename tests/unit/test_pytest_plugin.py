"""The plugin of pytest, in processes of its own: scenario files, the fixture, failures."""

from __future__ import annotations

import subprocess
import sys
from xml.etree import ElementTree

import pytest

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
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["volery.pytest_plugin"]\n')

    def run(*words):
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-rA", "-p", "no:cacheprovider", *words],
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
    assert sorted(path.rpartition(".")[2] for path in kept) == ["mcap", "mcap", "png", "png"]
    from pathlib import Path

    assert all(Path(path).stat().st_size > 1000 for path in kept)


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
    assert "FlightFailedError" in done.stdout
    assert "failed  speed <= 0.1 m/s" in done.stdout


def test_a_file_that_cannot_be_read_is_a_collection_error(suite):
    (suite.folder / "test_bad.toml").write_text(HOP.replace("no_contact", "no_contacts"))
    (suite.folder / "test_empty.toml").write_text(HOP[: HOP.index("[[expect]]")])
    done = suite()
    assert done.returncode == 2
    assert "did you mean 'no_contact'?" in done.stdout
    assert "expects nothing: add [[expect]]" in done.stdout
