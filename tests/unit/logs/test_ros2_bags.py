"""ROS 2 bags as recorders leave them: without metadata, in several files, cut off."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing

import pytest
from logged_messages import COUNT, write_log, write_sqlite_bag
from typer.testing import CliRunner

from volery.bridges.logs.one_file import one_file
from volery.bridges.logs.playback import Playback
from volery.bridges.logs.ros2_bags import BagWalk
from volery.cli.app import app
from volery.core.errors import LogWarning, RecordingError
from volery.graph import messages as m
from volery.graph.graph import Graph
from volery.logs import open_log

runner = CliRunner()


@pytest.fixture
def bag(tmp_path):
    """A folder that a killed recorder leaves: SQLite files without metadata.yaml."""
    folder = write_sqlite_bag(tmp_path / "bag")
    (folder / "metadata.yaml").unlink()
    return folder


def _file(folder):
    return next(folder.glob("*.db3"))


def test_a_folder_without_metadata(bag):
    with pytest.warns(LogWarning, match="metadata.yaml is missing; read without it: bag.db3"):
        log = open_log(bag)
    with log:
        assert log["/uav1/odom"]["pose.pose.position.x"].tolist() == pytest.approx(
            [0.1 * k for k in range(COUNT)]
        )
        assert (log.start_s, log.end_s) == (0.0, pytest.approx((COUNT - 1) / 10.0))
    assert sum(record.topic.topic == "/note" for record in BagWalk(bag)) == COUNT


def test_several_files_without_metadata(bag):
    shutil.copy(_file(bag), bag / "bag_10.db3")
    (bag / "bag_2.db3").write_bytes(b"")  # the last file may be empty
    with pytest.warns(LogWarning, match=r"bag_2\.db3: the file is empty"):
        log = open_log(bag)
    assert log.topics["/note"].messages == 2 * COUNT
    assert log["/note"]["data"].tolist() == 2 * [f"note {k}" for k in range(COUNT)]


def test_messages_that_sqlite_has_not_moved_are_named(bag):
    (bag / f"{_file(bag).name}-wal").write_bytes(b"rows")
    with pytest.warns(LogWarning, match=r"bag\.db3-wal holds messages that are not read"):
        open_log(bag)


def test_a_folder_that_is_no_bag(tmp_path):
    with pytest.raises(RecordingError, match=r"holds no \.mcap and no \.db3 file"):
        open_log(tmp_path)


@pytest.mark.parametrize("kind", ["folder", "file", "mcap"])
def test_info_of_a_bag(tmp_path, kind):
    path = tmp_path / "bag"
    if kind == "mcap":
        path.mkdir()
        write_log(path / "bag_0.mcap")
    else:
        write_sqlite_bag(path)
    result = runner.invoke(app, ["info", str(_file(path) if kind == "file" else path)])
    assert (result.exit_code, result.stderr) == (0, "")
    assert "format    ROS 2 bag, " in result.stdout
    assert "duration  1.900 s" in result.stdout
    (row,) = (line for line in result.stdout.splitlines() if line.startswith("/uav1/odom "))
    assert row.split() == ["/uav1/odom", "nav_msgs/msg/Odometry", str(COUNT), "10.0", "Hz"]


@pytest.mark.parametrize("kind", ["folder", "file", "killed", "mcap", "two mcap", "log"])
def test_a_bag_is_played_from_any_time(tmp_path, kind):
    path, problem = tmp_path / "bag", ""
    if kind == "log":
        path = write_log(tmp_path / "flight.bag")
    elif "mcap" in kind:
        path.mkdir()
        write_log(path / "bag_0.mcap")
        if kind == "two mcap":
            shutil.copy(path / "bag_0.mcap", path / "bag_1.mcap")
    else:
        write_sqlite_bag(path)
        if kind == "killed":
            (path / "metadata.yaml").unlink()
            problem = "metadata.yaml is missing"
        path = _file(path) if kind == "file" else path
    heard = []
    with one_file(path) as whole, closing(Playback(whole.path)) as playback:
        assert problem in whole.problem
        assert bool(whole.problem) == bool(problem)
        counts = {topic.name: topic.messages for topic in playback.topics}
        assert counts["/note"] == COUNT * (2 if kind == "two mcap" else 1)
        graph = Graph(lambda: playback.now_ns)
        playback.open(graph)
        graph.subscribe("/note", lambda p: heard.append(p.message.data), m.String)
        for time_ns in (1_500_000_000, 300_000_000):
            playback.seek(time_ns)
            graph.deliver()
        copy = whole.path
    assert heard == ["note 15", "note 3"]
    assert copy.exists() == (kind in ("mcap", "log"))


def test_a_bag_without_messages_is_not_played(tmp_path):
    folder = write_sqlite_bag(tmp_path / "bag")
    with closing(sqlite3.connect(_file(folder))) as base:
        base.execute("DELETE FROM messages")
        base.commit()
    with pytest.raises(RecordingError, match="holds no readable message"), one_file(folder):
        pass
    with pytest.raises(RecordingError, match="holds no .mcap"), one_file(tmp_path):
        pass


def test_info_of_a_bag_without_metadata(bag):
    result = runner.invoke(app, ["info", str(bag)])
    assert result.exit_code == 1
    assert "/uav1/odom" in result.stdout
    assert result.stderr.startswith(f"error: {bag}: metadata.yaml is missing")
    assert "recover" not in result.stderr


def test_info_of_a_ulog(tmp_path):
    path = tmp_path / "flight.ULG"
    path.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8))
    result = runner.invoke(app, ["info", str(path)])
    assert (result.exit_code, result.stderr) == (0, "")
    assert "format    ULog, 0.00 MB" in result.stdout
