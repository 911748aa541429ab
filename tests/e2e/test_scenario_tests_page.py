"""The document on scenario tests: its workflow runs step by step, as in a runner."""

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from volery.scenario.load import load_scenario
from volery.verdicts import judged_flight

PAGE = (Path(__file__).parents[2] / "docs" / "scenario_tests.md").read_text("utf-8")
PASSES = "always(speed < 3)"


def block(language, first_line):
    """Returns the block of code that starts with a comment."""
    (found,) = re.findall(rf"^```{language}\n# {first_line}\n(.*?)^```", PAGE, re.DOTALL | re.M)
    return found


@pytest.fixture
def steps():
    """Returns the steps of the workflow's only job."""
    workflow = YAML(typ="safe").load(block("yaml", r"\.github/workflows/flights\.yml"))
    (job,) = workflow["jobs"].values()
    return job["steps"]


@pytest.fixture
def checkout(tmp_path):
    """Returns a repository that holds the document's scenario."""
    folder = tmp_path / "scenarios"
    folder.mkdir()
    scenario = block("toml", r"hop\.toml")
    assert PASSES in scenario
    (folder / "hop.toml").write_text(scenario, encoding="utf-8")
    return tmp_path


def run(steps, checkout, seeds=20):
    """Runs the commands as a runner does, up to the first that fails; returns its exit code."""
    install, *commands = [step["run"] for step in steps if "run" in step]
    assert install == "pip install volery"  # test_wheel.py installs it
    path = f"{Path(sys.executable).parent}:/usr/bin:/bin"
    for command in commands:
        assert "--seeds 20" in command
        changed = command.replace("--seeds 20", f"--seeds {seeds}")
        done = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", changed],
            check=False,
            cwd=checkout,
            env={"PATH": path, "HOME": str(checkout), "CI": "true", "GITHUB_ACTIONS": "true"},
            capture_output=True,
            text=True,
            timeout=900.0,
        )
        if done.returncode:
            return done.returncode
    return 0


def test_flights_that_pass(steps, checkout):
    assert run(steps, checkout) == 0
    suite = ET.parse(checkout / "results.xml").getroot()
    assert len(list(suite.iter("testcase"))) == 20 * 3  # seeds, expectations
    assert not list(suite.iter("failure"))


def test_flights_that_fail_leave_what_is_uploaded(steps, checkout):
    file = checkout / "scenarios" / "hop.toml"
    file.write_text(
        file.read_text("utf-8").replace(PASSES, "always(speed < 0.5)"), encoding="utf-8"
    )
    assert run(steps, checkout, seeds=2) == 1
    upload = steps[-1]
    assert upload["if"] == "failure()"
    kinds = set()
    for pattern in upload["with"]["path"].splitlines():
        matched = checkout.glob(pattern.replace("**", "**/*"))  # as the action reads it
        files = [path for path in matched if path.is_file()]
        assert files, pattern
        kinds |= {path.suffix for path in files}
    assert {".xml", ".mcap", ".png"} <= kinds


@pytest.fixture(name="own_checks")
def _own_checks():
    """The module of this name is imported anew, and forgotten."""
    sys.modules.pop("own_checks", None)
    yield
    sys.modules.pop("own_checks", None)


@pytest.mark.usefixtures("own_checks")
def test_functions_of_the_document_judge_its_flight(checkout):
    expectations = re.findall(
        r'^```toml\n(\[\[expect\]\]\nkind = "predicate"\n.*?)^```', PAGE, re.DOTALL | re.M
    )
    functions = re.findall(
        r"^```python\n((?:import numpy.*?)?^def .*?)^```", PAGE, re.DOTALL | re.M
    )
    assert (len(expectations), len(functions)) == (2, 2)
    folder = checkout / "scenarios"
    (folder / "own_checks.py").write_text("".join(functions), encoding="utf-8")
    file = folder / "hop.toml"
    file.write_text("\n".join([file.read_text("utf-8"), *expectations]), encoding="utf-8")
    verdicts = judged_flight(load_scenario(file, trust=True)).verdicts
    assert [verdict.outcome for verdict in verdicts] == ["passed"] * 5
    assert [0.0 < verdict.margin < 5.0 for verdict in verdicts[3:]] == [True, True]


def test_the_examples_in_python_run(tmp_path):
    (flown,) = re.findall(
        r"^```python\n(from volery import load_scenario\n.*?)^```", PAGE, re.DOTALL | re.M
    )
    (tested,) = re.findall(r"^```python\n(import pytest\n.*?)^```", PAGE, re.DOTALL | re.M)
    names = {}
    exec(compile(flown, "scenario_tests.md", "exec"), names)
    assert names["judged"].is_passed
    (tmp_path / "test_hover.py").write_text(tested, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "--volery-seeds", "2"],
        check=False,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=900.0,
    )
    assert "2 passed" in done.stdout, done.stdout
