"""Tests `volery --version`: version, commit, Python, platform, libraries and page of the build."""

import json
import platform
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.cli import build_info
from volery.cli.app import app
from volery.cli.commit import Commit, find_commit, read_commit

runner = CliRunner()
ID = "0123456789abcdef0123456789abcdef01234567"


def git(folder: Path, *words: str) -> str:
    settings = ["-c", "user.name=x", "-c", "user.email=x@example.org", "-c", "commit.gpgsign=no"]
    command = ["git", *settings, "-C", str(folder), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    git(tmp_path, "init", "--quiet")
    (tmp_path / "tracked").write_text("1")
    git(tmp_path, "add", "tracked")
    git(tmp_path, "commit", "--quiet", "-m", "first")
    return tmp_path


def test_the_first_line_begins_with_name_and_version() -> None:
    result = runner.invoke(app, ["--version"])
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert lines[0].split(" (")[0] == f"volery {version('volery')}"
    assert platform.python_version() in lines[1]
    assert platform.platform() in lines[1]
    assert f"numba {version('numba')}" in lines[2]
    assert lines[3].startswith("page ")


def test_json_has_all_fields() -> None:
    build = json.loads(runner.invoke(app, ["--version", "--json"]).stdout)
    assert list(build) == ["version", "commit", "python", "platform", "has_page", "libraries"]
    assert build["version"] == version("volery")
    assert build["libraries"]["numpy"] == version("numpy")
    assert json.loads(runner.invoke(app, ["--json", "--version"]).stdout) == build


def test_json_alone_is_refused() -> None:
    result = runner.invoke(app, ["--json", "list"])
    assert result.exit_code == 2
    assert "needs --version" in result.stderr


@pytest.mark.parametrize("built", [True, False])
def test_a_missing_page_names_its_command(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, built: bool
) -> None:
    page = tmp_path / "index.html"
    if built:
        page.touch()
    monkeypatch.setattr(build_info, "_PAGE", page)
    last = runner.invoke(app, ["--version"]).stdout.splitlines()[-1]
    assert last == ("page built" if built else "page not built: run `make web` in a clone")


def test_a_checkout_names_its_commit_and_changes(checkout: Path) -> None:
    head = git(checkout, "rev-parse", "HEAD")
    (checkout / "untracked").touch()
    assert read_commit(checkout) == Commit(head, is_changed=False)
    (checkout / "tracked").write_text("2")
    assert read_commit(checkout) == Commit(head, is_changed=True)
    assert str(Commit(ID, is_changed=True)) == "commit 0123456789ab, changed"


def test_a_wheel_names_the_recorded_commit(tmp_path: Path) -> None:
    recorded = tmp_path / "build_commit.json"
    assert find_commit(tmp_path, recorded) is None
    for invalid in ("", "[]", '"x"', "{}", '{"id": "a"}'):
        recorded.write_text(invalid)
        assert find_commit(tmp_path, recorded) is None
    recorded.write_text(Commit(ID, is_changed=False).to_json())
    assert find_commit(tmp_path, recorded) == Commit(ID, is_changed=False)


def test_without_git_a_checkout_has_no_commit(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert find_commit(checkout, checkout / "none") is not None
    monkeypatch.setenv("PATH", "")
    assert find_commit(checkout, checkout / "none") is None


def test_a_repository_around_an_installation_is_not_its_source(checkout: Path) -> None:
    inner = checkout / "lib" / "python3"
    inner.mkdir(parents=True)
    assert find_commit(inner, inner / "none") is None


def test_other_commands_load_neither_git_nor_libraries() -> None:
    code = (
        "import sys\n"
        "from typer.testing import CliRunner\n"
        "from volery.cli.app import app\n"
        "assert CliRunner().invoke(app, ['--help']).exit_code == 0\n"
        "assert 'volery.cli.build_info' not in sys.modules\n"
        "assert CliRunner().invoke(app, ['--version']).exit_code == 0\n"
        "heavy = {'numpy', 'numba', 'starlette', 'rosbags'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
