"""Folders that other users may write: nothing that runs or decides is read from there."""

from __future__ import annotations

import json
import logging
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from volery.cli import trust
from volery.cli.trust import may_run_local_code
from volery.core import compiled
from volery.core.errors import ScenarioError
from volery.core.private_folders import temporary_folder

CacheDir = Callable[[], Path]


@pytest.fixture
def cache_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CacheDir:
    """Finds the folder of compiled kernels as a new process does, below `tmp_path/cache`."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("VOLERY_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setattr(compiled, "_private_folder", compiled._private_folder.__wrapped__)
    monkeypatch.setattr(compiled, "_cache_key", lambda: "key")
    return compiled.cache_dir.__wrapped__  # type: ignore[no-any-return]


def test_kernels_get_a_private_folder(cache_dir: CacheDir, tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        folder = cache_dir()
    finally:
        os.umask(before)
    assert folder == tmp_path / "cache" / "volery" / "kernels" / "key"
    for each in (folder, folder.parent, folder.parent.parent):
        assert each.stat().st_mode & 0o777 == 0o700
    (folder / "ours.nbi").write_bytes(b"index")
    assert (cache_dir() / "ours.nbi").exists()


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702])
@pytest.mark.parametrize("level", [0, 1, 2])
def test_kernels_that_others_could_write_are_not_loaded(
    cache_dir: CacheDir, caplog: pytest.LogCaptureFixture, mode: int, level: int
) -> None:
    folder = cache_dir()
    (folder / "planted.nbi").write_bytes(b"code of another user")
    (folder, *folder.parents)[level].chmod(mode)
    with caplog.at_level(logging.WARNING):
        assert cache_dir() == folder
    assert list(folder.iterdir()) == []
    assert folder.stat().st_mode & 0o777 == 0o700
    assert "could write" in caplog.text


def test_kernels_behind_a_link_are_not_loaded(cache_dir: CacheDir, tmp_path: Path) -> None:
    folder = cache_dir()
    (tmp_path / "foreign.nbi").write_bytes(b"code of another user")
    (folder / "below").mkdir()
    (folder / "below" / "planted.nbi").symlink_to(tmp_path / "foreign.nbi")
    assert cache_dir() == folder
    assert list(folder.iterdir()) == []
    assert (tmp_path / "foreign.nbi").exists()


@pytest.mark.parametrize("name", ["volery", "kernels", "key"])
def test_a_linked_folder_of_kernels_is_refused(
    cache_dir: CacheDir, caplog: pytest.LogCaptureFixture, tmp_path: Path, name: str
) -> None:
    folder = cache_dir()
    link = next(each for each in (folder, *folder.parents) if each.name == name)
    link.rename(tmp_path / "foreign")
    link.symlink_to(tmp_path / "foreign")
    with caplog.at_level(logging.WARNING):
        found = cache_dir()
    assert found.is_relative_to(tmp_path / "temporary")
    assert f"{link} is a link" in caplog.text
    assert str(found) in caplog.text


def test_a_cache_below_a_folder_of_everyone_is_refused(
    cache_dir: CacheDir, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache").chmod(0o777)  # any user that may write it can replace what is below
    with caplog.at_level(logging.WARNING):
        assert cache_dir().is_relative_to(tmp_path / "temporary")
    assert f"other users can write {tmp_path / 'cache'}" in caplog.text
    (tmp_path / "cache").chmod(0o1777)  # like /tmp
    assert cache_dir().is_relative_to(tmp_path / "cache")


def test_kernels_of_another_user_are_not_loaded(
    cache_dir: CacheDir, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    foreign = cache_dir()
    owner = os.getuid()
    planted = temporary_folder("volery-")
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    planted.rename(planted.with_name(f"volery-{owner + 1}"))  # by its name, this user's
    found = cache_dir()
    assert not found.is_relative_to(foreign)
    assert not found.is_relative_to(planted.with_name(f"volery-{owner + 1}"))
    assert found.is_relative_to(tmp_path / "temporary")


def test_a_link_in_the_temporary_folder_is_not_followed(
    cache_dir: CacheDir, tmp_path: Path
) -> None:
    (tmp_path / "cache").write_text("no folder")
    (tmp_path / "foreign").mkdir()
    (tmp_path / "temporary" / f"volery-{os.getuid()}").symlink_to(tmp_path / "foreign")
    found = cache_dir()
    assert found.is_relative_to(tmp_path / "temporary")
    assert list((tmp_path / "foreign").iterdir()) == []


@pytest.mark.parametrize("hole", ["file", "folder", "above", "link"])
def test_answers_that_others_could_write_are_ignored(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    hole: str,
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    file = tmp_path / "scenario.toml"
    trust._remember(file, ["evil"])
    kept = trust.trust_file()
    assert may_run_local_code(file, ["evil"])
    if hole == "link":
        kept.rename(tmp_path / "foreign.json")
        kept.symlink_to(tmp_path / "foreign.json")
    else:
        {"file": kept, "folder": kept.parent, "above": tmp_path / "state"}[hole].chmod(0o777)
    with pytest.raises(ScenarioError, match="give --trust"):
        may_run_local_code(file, ["evil"])
    assert "saved answers about nodes are ignored" in capsys.readouterr().err
    trust._remember(file, ["mine"])  # in a private file, if the folder allows one
    if hole != "above":
        assert json.loads(kept.read_text()) == {str(file): ["mine"]}
        assert may_run_local_code(file, ["mine"])
