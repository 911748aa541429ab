"""The examples come with the package: listed, copied and run by name."""

import sys
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.cli import examples
from volery.cli.app import app

ROOT = Path(__file__).parents[3]
RUNNER = CliRunner()


def test_the_wheel_holds_the_examples():
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    assert build["targets"]["wheel"]["force-include"] == {"examples": "volery/examples"}


def test_all_examples_are_listed_with_what_they_do():
    result = RUNNER.invoke(app, ["examples"])
    assert result.exit_code == 0, result.output
    for path in (ROOT / "examples").glob("*.py"):
        assert path.stem in result.stdout
    assert "take-off, a flight to a position, landing" in " ".join(result.stdout.split())
    assert "studies" in result.stdout


@pytest.mark.parametrize("name", ["1", "01", "01_fly_one_uav", "fly_one_uav", "01_fly_one_uav.py"])
def test_an_example_is_copied_once(tmp_path, name):
    copied = tmp_path / "new" / "01_fly_one_uav.py"
    result = RUNNER.invoke(app, ["examples", name, "--to", str(copied.parent)])
    assert result.stdout.strip() == str(copied)
    assert copied.read_text() == (ROOT / "examples" / copied.name).read_text()
    again = RUNNER.invoke(app, ["examples", name, "--to", str(copied.parent)])
    assert again.exit_code == 2
    assert "exists already" in again.stderr


def test_a_folder_is_copied_as_a_whole(tmp_path):
    assert RUNNER.invoke(app, ["examples", "studies", "--to", str(tmp_path)]).exit_code == 0
    assert (tmp_path / "studies" / "gusts.toml").is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["9"], "09_bring_your_own_planner_ros_tcp"),
        (["fly"], "'fly' may be one of: 01_fly_one_uav, 06_fly_over_rosbridge"),
        (["zeppelin"], "no example 'zeppelin'. Known: 01_fly"),
        (["reed_a_lidar"], "did you mean 'read_a_lidar'?"),
        (["studies", "--run"], "is a folder"),
        (["1", "--run", "--seeds", "3"], "01_fly_one_uav takes no arguments"),
        (["1", "--run", "--to", "x"], "give one of them"),
        (["1", "region"], "arguments need --run"),
        (["1", "region", "--to", "x"], "arguments need --run"),
        (["--run"], "needs the name of an example"),
    ],
)
def test_what_cannot_run_or_be_copied_is_refused_with_advice(arguments, words):
    result = RUNNER.invoke(app, ["examples", *arguments])
    assert result.exit_code == 2
    assert words in result.stderr


def test_a_part_of_a_name_finds_the_one_that_has_it(tmp_path):
    result = RUNNER.invoke(app, ["examples", "over_ros", "--to", str(tmp_path)])
    assert result.stdout.strip().endswith("06_fly_over_rosbridge.py")


@pytest.fixture
def own_examples(tmp_path, monkeypatch):
    """Returns a function that makes an example the only one."""

    def make(source):
        (tmp_path / "01_one.py").write_text(source)
        monkeypatch.setattr(examples, "all_examples", lambda: [tmp_path / "01_one.py"])

    return make


def test_an_example_runs_and_its_exit_code_is_passed_on(own_examples):
    own_examples("import sys; print(__name__, sys.argv[1:]); sys.exit(len(sys.argv))")
    before = list(sys.path), list(sys.argv)
    for arguments in ([], ["region", "7"], ["--side", "7"], ["--", "--side", "7"]):
        result = RUNNER.invoke(app, ["examples", "1", "--run", *arguments])
        given = [each for each in arguments if each != "--"]
        assert result.stdout.strip() == f"__main__ {given}"
        assert result.exit_code == 1 + len(given)
    assert (sys.path, sys.argv) == before


def test_an_example_without_its_packages_says_what_to_install(own_examples):
    own_examples("import sys\nimport not_there\nfrom neither.part import x")
    result = RUNNER.invoke(app, ["examples", "1", "--run"])
    assert result.exit_code == 2
    assert "01_one needs neither and not_there: pip install neither not_there" in result.stderr


def test_a_refusal_in_an_example_is_one_line(own_examples):
    own_examples("import volery; volery.make('hoover')")
    result = RUNNER.invoke(app, ["examples", "1", "--run"])
    assert result.exit_code == 2
    assert result.stderr.startswith("error: no scenario 'hoover'")
    assert "Traceback" not in result.stderr
