"""The examples come with the package: listed, copied and run by name."""

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


def test_unclear_names_list_what_there_is():
    for name, words in (("9", "09_bring_your_own_planner_ros_tcp"), ("zeppelin", "known: 01_fly")):
        result = RUNNER.invoke(app, ["examples", name])
        assert result.exit_code == 2
        assert words in result.stderr
    assert RUNNER.invoke(app, ["examples", "studies", "--run"]).exit_code == 2


def test_an_example_runs_and_its_exit_code_is_passed_on(tmp_path, monkeypatch, capfd):
    for name, code in (("01_good.py", "print('it ran')"), ("02_bad.py", "raise SystemExit(3)")):
        (tmp_path / name).write_text(code)
    monkeypatch.setattr(examples, "all_examples", lambda: sorted(tmp_path.iterdir()))
    assert RUNNER.invoke(app, ["examples", "good", "--run"]).exit_code == 0
    assert "it ran" in capfd.readouterr().out
    assert RUNNER.invoke(app, ["examples", "bad", "--run"]).exit_code == 3


def test_an_example_gets_its_arguments(tmp_path, monkeypatch, capfd):
    (tmp_path / "01_one.py").write_text("import sys; print(sys.argv[1:])")
    monkeypatch.setattr(examples, "all_examples", lambda: sorted(tmp_path.iterdir()))
    assert RUNNER.invoke(app, ["examples", "1", "--run", "region", "7"]).exit_code == 0
    assert "['region', '7']" in capfd.readouterr().out
    assert RUNNER.invoke(app, ["examples", "1", "--run", "--", "--side", "7"]).exit_code == 0
    assert "['--side', '7']" in capfd.readouterr().out
    refused = RUNNER.invoke(app, ["examples", "1", "region", "--to", str(tmp_path / "new")])
    assert refused.exit_code == 2
    assert "volery examples 1 --run" in refused.stderr
