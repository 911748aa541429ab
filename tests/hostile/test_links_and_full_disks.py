"""Files that Volery writes: through no link, over no other file, and whole or not at all."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from typer.testing import CliRunner

from volery.autonomy.mapping.grid_files import write_grid
from volery.autonomy.mapping.map_files import write_map
from volery.bridges.logs.log_writer import create_log
from volery.cli import gcs
from volery.cli.app import app
from volery.cli.examples import _copy
from volery.cluster.errors import StudyError
from volery.cluster.folder_lock import FolderLock
from volery.cluster.results_folder import ResultsFolder
from volery.core import whole_files
from volery.core.errors import VoleryError
from volery.core.whole_files import open_new, open_to_append, whole_file, write_whole
from volery.graph.codecs.interface_packages import write_generator
from volery.report.page import write_page
from volery.runtime.replay.slam.map_image import write_image
from volery.runtime.replay.slam.trajectory import EstimatedTrajectory, write_tum
from volery.scenario.json_schema import write_schema
from volery.scenario.load import load_scenario

GRID = np.zeros((2, 2), np.int8)
PATH = EstimatedTrajectory(
    np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros((1, 3)), np.zeros((1, 4))
)


def station_log(path: Path) -> None:
    """Starts a ground station that ends before it connects."""
    with patch.object(gcs.asyncio, "run", lambda work: work.close()):
        gcs.command_station("127.0.0.1:1", 0, None, 4, path)


WRITERS: dict[str, Callable[[Path], Any]] = {
    "index.html": lambda path: write_page("page", path.parent, overwrite=True),
    "s.toml": lambda path: load_scenario("hover").save(path, overwrite=True),
    "s.schema.json": write_schema,
    "grid.pgm": lambda path: write_grid(path.with_suffix(""), GRID, np.zeros(2), 0.1),
    "grid.yaml": lambda path: write_grid(path.with_suffix(""), GRID, np.zeros(2), 0.1),
    "map.bt": lambda path: write_map(path, np.zeros(0, np.uint8), 0.1),
    "map.png": lambda path: write_image(path, GRID, np.zeros(2), 0.1, np.zeros((1, 2))),
    "path.tum": lambda path: write_tum(path, PATH),
    "flight.mcap": lambda path: create_log(path, overwrite=True).close(),
    "flight.bag": lambda path: create_log(path, overwrite=True).close(),
    "generate_python.py": lambda path: write_generator(path.parent),
    "worker_1.log": lambda path: open_new(path).close(),
    "gcs.log": station_log,
    "run.json": lambda path: ResultsFolder(path.parent).write_file(path, b"{}"),
}
"""What writes a file of this name."""
GROWING = ("flight", "worker_1", "gcs")
"""Files that hold what was written before a disk was full."""


@pytest.fixture
def precious(tmp_path: Path) -> Path:
    """A file that no command names."""
    path = tmp_path / "precious"
    path.write_text("precious")
    return path


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.parametrize("name", WRITERS)
def test_no_file_is_written_through_a_link(name: str, precious: Path, tmp_path: Path) -> None:
    target = tmp_path / "out" / name
    target.parent.mkdir()
    target.symlink_to(precious)
    WRITERS[name](target)
    assert precious.read_text() == "precious"
    assert target.is_file()
    assert not target.is_symlink()
    assert not list(target.parent.glob(".*"))


@pytest.mark.parametrize("name", [name for name in WRITERS if not name.startswith(GROWING)])
def test_a_full_disk_leaves_the_previous_file(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / name
    WRITERS[name](target)
    before = files_of(tmp_path)
    opened = os.fdopen

    def full(descriptor: int, mode: str) -> Any:
        file = opened(descriptor, mode, buffering=0)

        class Full:
            def write(self, data: bytes) -> int:
                file.write(data[: len(data) // 2])
                raise OSError(errno.ENOSPC, "No space left on device")

            def __getattr__(self, called: str) -> Any:
                return getattr(file, called)

            def __enter__(self) -> Full:
                return self

            def __exit__(self, *_error: object) -> None:
                file.close()

        return Full()

    monkeypatch.setattr(whole_files.os, "fdopen", full)
    with pytest.raises(VoleryError, match=r"(?i)no space"):
        WRITERS[name](target)
    assert files_of(tmp_path) == before


def test_a_report_neither_probes_nor_replaces(precious: Path, tmp_path: Path) -> None:
    report = tmp_path / "report"
    (tmp_path / ".volery-probe").symlink_to(precious)
    report.mkdir()
    (report / ".volery-probe").symlink_to(precious)
    (report / "index.html").symlink_to(precious)
    result = CliRunner().invoke(app, ["run", "hover", "--seconds", "1", "--report", str(report)])
    assert result.exit_code == 2
    assert "index.html exists; --overwrite replaces it" in result.stderr
    assert precious.read_text() == "precious"
    with pytest.raises(VoleryError, match="exists; --overwrite replaces it"):
        write_page("page", report, overwrite=False)


def test_the_lock_of_a_study_empties_no_other_file(precious: Path, tmp_path: Path) -> None:
    study = tmp_path / "study"
    study.mkdir()
    (study / "lock").symlink_to(precious)
    with pytest.raises(StudyError, match="cannot be locked"):
        FolderLock(study)
    assert precious.read_text() == "precious"


def test_a_ground_station_continues_its_log(tmp_path: Path) -> None:
    log = tmp_path / "gcs.log"
    for line in ("first", "second"):
        with open_to_append(log) as file:
            gcs._Desk(file)._print(line)
    assert [text.split(" ")[1] for text in log.read_text().splitlines()] == ["first", "second"]


def test_a_full_disk_ends_the_log_of_a_ground_station_only(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with open_to_append(Path("/dev/full")) as file:
        desk = gcs._Desk(file)
        desk._print("first")
        desk._print("second")
    output = capsys.readouterr()
    assert output.out == "first\nsecond\n"
    assert output.err == "warning: the log ends here: No space left on device\n"


def test_a_link_that_leads_nowhere_counts_as_a_file(tmp_path: Path) -> None:
    target = tmp_path / "flight.mcap"
    target.symlink_to(tmp_path / "elsewhere.mcap")
    with pytest.raises(VoleryError, match="exists already"):
        create_log(target)
    scenario = tmp_path / "scenario.toml"
    scenario.symlink_to(tmp_path / "elsewhere.toml")
    with pytest.raises(VoleryError, match="the file exists"):
        load_scenario("hover").save(scenario)
    example = tmp_path / "example.py"
    example.write_text("pass")
    (tmp_path / "copies").mkdir()
    (tmp_path / "copies" / "example.py").symlink_to(tmp_path / "elsewhere.py")
    with pytest.raises(VoleryError, match="exists already"):
        _copy(example, tmp_path / "copies")
    assert not (tmp_path / "elsewhere.py").exists()
    assert not (tmp_path / "elsewhere.mcap").exists()
    assert not (tmp_path / "elsewhere.toml").exists()


def test_a_file_that_appears_meanwhile_is_kept(tmp_path: Path) -> None:
    target = tmp_path / "index.html"

    def write() -> None:
        with whole_file(target, overwrite=False) as file:
            file.write(b"mine")
            target.write_text("of another process")

    with pytest.raises(FileExistsError):
        write()
    assert target.read_text() == "of another process"
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_permissions_stay(tmp_path: Path) -> None:
    target = tmp_path / "scenario.toml"
    write_whole(target, "first")
    target.chmod(0o600)
    assert write_whole(target, "ä") == 2
    assert target.stat().st_mode & 0o777 == 0o600
    assert target.read_text(encoding="utf-8") == "ä"


def test_a_pipe_is_written_and_stays(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    content: list[bytes] = []
    reader = threading.Thread(target=lambda: content.append(pipe.read_bytes()))
    reader.start()
    write_whole(pipe, "text")
    reader.join(60.0)
    assert content == [b"text"]
    assert pipe.is_fifo()
