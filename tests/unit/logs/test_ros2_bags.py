"""ROS 2 bags as recorders leave them: without metadata, in several files, cut off."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing

import pytest
import zstandard
from logged_messages import COUNT, write_log, write_ros2_bag, write_sqlite_bag
from typer.testing import CliRunner

from volery.bridges.logs.one_file import one_file
from volery.bridges.logs.playback import Playback
from volery.bridges.logs.ros2_bags import BagWalk
from volery.cli.app import app
from volery.core.errors import LogWarning, RecordingError
from volery.graph import messages as m
from volery.graph.graph import Graph
from volery.graph.typestore import typestore
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


SCHEMES = [
    ("bag", "bag_{}.db3"),
    ("bag_2026_01_31-09_30_00", "{}_bag_2026_01_31-09_3{}_00.db3"),
    ("rosbag2_2026_01_31-09_30_00", "rosbag2_2026_01_31-09_30_00_{}.db3"),
]
"""Folders and files of rosbag2's versions."""


@pytest.mark.parametrize(("folder", "name"), SCHEMES)
def test_several_files_without_metadata(tmp_path, folder, name):
    bag = write_sqlite_bag(tmp_path / folder)
    (bag / "metadata.yaml").unlink()
    first = _file(bag).rename(bag / name.format(0, 0))
    shutil.copy(first, bag / name.format(10, 2))
    (bag / name.format(2, 1)).write_bytes(b"")  # the last file may be empty
    (bag / f"._{first.name}").write_bytes(b"\0\5\x16\7")  # of macOS
    with pytest.warns(LogWarning, match=rf"{name.format(2, 1)}: the file is empty"):
        log = open_log(bag)
    assert "._" not in log.problem
    assert log.topics["/note"].messages == 2 * COUNT
    assert log["/note"]["data"].tolist() == 2 * [f"note {k}" for k in range(COUNT)]


INDEPENDENT = [
    ("flight1.mcap", "flight2.mcap"),
    ("flight_2026_01_01.mcap", "flight_2026_01_02.mcap"),
    ("flight_2026_01_01-10_00_10.mcap", "flight_2026_01_01-10_00_20.mcap"),
    ("north_0.mcap", "south_0.mcap"),
    ("north_0.mcap", "south_1.mcap"),
    ("bag.mcap", "bag_1.mcap"),
    ("bag_0.mcap", "bag_0.mcap.zst"),  # packed and unpacked
    ("bag_0.mcap", "bag_0.db3"),  # converted
]


@pytest.mark.parametrize("metadata", ["", "a: [", "{relative_file_paths: [gone.mcap]}"])
@pytest.mark.parametrize("names", INDEPENDENT)
def test_logs_that_are_no_parts_of_one_bag_are_not_joined(tmp_path, names, metadata):
    folder = tmp_path / "bag"
    folder.mkdir()
    if metadata:
        (folder / "metadata.yaml").write_text(f"rosbag2_bagfile_information: {metadata}\n")
    for name in names:
        write_log(folder / "log.mcap").rename(folder / name)
    with pytest.raises(RecordingError) as caught:
        open_log(folder)
    assert str(caught.value).endswith(f": {', '.join(sorted(names, key=len))}; name one of them")
    assert "not those of one bag (bag_0, bag_1)" in str(caught.value)
    for command in ("info", "play"):
        result = runner.invoke(app, [command, str(folder)])
        assert result.exit_code == 2
        assert "name one of them" in result.stderr
        assert result.stderr.count("\n") == 1
    with open_log(folder / "bag_0.mcap" if "bag_0.mcap" in names else folder / names[1]) as log:
        assert log.topics["/note"].messages == COUNT
    for name in names[1:]:
        (folder / name).unlink()
    if not metadata:
        with open_log(folder) as log:  # one log is read, whatever its name
            assert (log.problem, log.topics["/note"].messages) == ("", COUNT)


def test_numbered_logs_of_another_folder_are_joined_with_a_note(tmp_path):
    folder = tmp_path / "renamed"
    folder.mkdir()
    for k in (1, 2):
        write_log(folder / f"flight_{k}.mcap")
    with pytest.warns(LogWarning, match="missing; read as one bag: flight_1.mcap, flight_2.mcap"):
        log = open_log(folder)
    assert log.topics["/note"].messages == 2 * COUNT


@pytest.mark.filterwarnings("ignore::volery.core.errors.LogWarning")
def test_files_that_metadata_names_are_no_mixture(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    for name in ("north.mcap", "south.mcap", "left_over.mcap"):
        write_log(folder / name)
    text = "rosbag2_bagfile_information:\n  relative_file_paths: [{}]\n"
    (folder / "metadata.yaml").write_text(text.format("south.mcap, north.mcap"))
    with open_log(folder) as log:
        assert (log.problem, log.topics["/note"].messages) == ("", 2 * COUNT)
    (folder / "metadata.yaml").write_text(text.format("south.mcap, lost.mcap"))
    with open_log(folder) as log:
        assert log.problem.endswith("missing: lost.mcap; read without it: south.mcap")
        assert log.topics["/note"].messages == COUNT


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
def test_a_bag_compressed_by_zstd(tmp_path, storage, mode):
    """`ros2 bag record --compression-mode file` or `message`."""
    folder = write_ros2_bag(tmp_path / "bag", storage, mode)
    packed = list(folder.glob("*.zstd"))
    assert len(packed) == (mode == "FILE")
    for path in (folder, *packed):
        with open_log(path) as log:
            assert log.problem == ""
            assert log.topics["/uav1/odom"].messages == COUNT
            assert log["/note"]["data"].tolist() == [f"note {k}" for k in range(COUNT)]
        assert sum(record.topic.topic == "/note" for record in BagWalk(path)) == COUNT
        with one_file(path) as whole, closing(Playback(whole.path)) as playback:
            assert {t.name: t.messages for t in playback.topics}["/note"] == COUNT
        result = runner.invoke(app, ["info", str(path)])
        assert (result.exit_code, result.stderr) == (0, "")


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
@pytest.mark.filterwarnings("ignore::volery.core.errors.LogWarning")
def test_a_compressed_bag_without_metadata(tmp_path, storage):
    folder = write_ros2_bag(tmp_path / "bag", storage, "FILE")
    (folder / "metadata.yaml").unlink()
    with open_log(folder) as log:
        assert log["/note"]["data"].tolist() == [f"note {k}" for k in range(COUNT)]


def test_unpacked_files_are_removed(tmp_path, monkeypatch):
    folder = write_ros2_bag(tmp_path / "bag", "MCAP", "FILE")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    with open_log(folder) as log:
        assert log["/note"]["data"][0] == "note 0"
        assert len(list((tmp_path / "temporary").iterdir())) == 1
    assert not list((tmp_path / "temporary").iterdir())


def _renamed(folder):
    _file(folder).rename(folder / "other.db3")


def _newer(folder):
    path = folder / "metadata.yaml"
    path.write_text(path.read_text().replace("version: 9", "version: 99", 1))


def _without_definitions(folder):
    with closing(sqlite3.connect(_file(folder))) as base:
        base.execute("UPDATE message_definitions SET encoding='unknown', "
                     "encoded_message_definition=''")  # fmt: skip
        base.commit()


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (
            _renamed,
            "metadata.yaml names files that are missing: bag.db3; read without it: other.db3",
        ),
        (_newer, ""),
        (
            lambda folder: (folder / "metadata.yaml").write_text(""),
            "metadata.yaml cannot be read (",
        ),
        (lambda folder: (folder / "metadata.yaml").write_text("a: [\n"), "metadata.yaml cannot be"),
        (_without_definitions, ""),  # as recorders write that do not find them
    ],
)
@pytest.mark.filterwarnings("ignore::volery.core.errors.LogWarning")
def test_a_bag_that_others_refuse(tmp_path, change, problem):
    folder = write_sqlite_bag(tmp_path / "bag")
    change(folder)
    with open_log(folder) as log:
        assert log.problem.startswith(problem)
        assert bool(log.problem) == bool(problem)
        assert log["/note"]["data"].tolist() == [f"note {k}" for k in range(COUNT)]


def test_the_files_that_metadata_names_are_read_in_their_order(tmp_path):
    folder = write_sqlite_bag(tmp_path / "bag")
    _file(folder).rename(folder / "part.b")
    write_log(folder / "part.a.mcap")
    shutil.copy(folder / "part.b", folder / "left_over.db3")
    text = "rosbag2_bagfile_information:\n  relative_file_paths: [old/part.b]\n"
    (folder / "metadata.yaml").write_text(text)
    with open_log(folder) as log:
        assert (log.problem, log.topics["/note"].messages) == ("", COUNT)


@pytest.mark.parametrize("name", ["run #3 100% ok?", "b\u00e4g"])
def test_a_folder_of_any_name(tmp_path, name):
    with open_log(write_sqlite_bag(tmp_path / "bag").rename(tmp_path / name)) as log:
        assert len(log["/uav1/odom"]) == COUNT


@pytest.mark.parametrize("name", ["flight", "flight.db3.active", "flight.bag"])
def test_the_content_identifies_the_format(tmp_path, name):
    path = tmp_path / name
    shutil.copy(_file(write_sqlite_bag(tmp_path / "bag")), path)
    with open_log(path) as log:
        assert len(log["/note"]) == COUNT
    result = runner.invoke(app, ["info", str(path)])
    assert (result.exit_code, "format    ROS 2 bag" in result.stdout) == (0, True)


@pytest.mark.parametrize("fraction", [0.6, 0.8])
def test_a_file_that_is_cut_off_is_read_up_to_there(tmp_path, fraction):
    """As a full disk leaves it; SQLite itself refuses it."""
    path = _file(write_sqlite_bag(tmp_path / "bag"))
    data = path.read_bytes()
    path.write_bytes(data[: int(fraction * len(data))])
    with pytest.warns(LogWarning, match=r"bag\.db3 is cut off or damaged, the rest is not read"):
        log = open_log(path)
    with log:
        found = log["/uav1/odom"]["pose.pose.position.x"].tolist()
        assert 2 < len(found) == log.topics["/uav1/odom"].messages < COUNT
        assert found == pytest.approx([0.1 * k for k in range(len(found))])


def test_damage_within_a_message_ends_the_reading_there(tmp_path):
    """The index counts the messages; reading one of them fails."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    folder = tmp_path / "bag"
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        channel = writer.add_connection("/note", "std_msgs/msg/String", typestore=typestore())
        for k in range(5):
            text = m.Published("/note", "std_msgs/msg/String", k, m.String(str(k) * 50_000))
            writer.write(channel, k, text.cdr)
    data = bytearray(_file(folder).read_bytes())
    page = (data.index(b"3" * 100) + 20_000) // 4096 * 4096
    data[page : page + 4] = b"\xff" * 4  # number of the next page of the text
    _file(folder).write_bytes(data)
    with open_log(folder) as log:
        assert log.topics["/note"].messages == 5
        assert 2 <= len(log["/note"]["data"]) <= 3
        assert "bag.db3 is cut off or damaged, the rest is not read" in log.problem
    walk = BagWalk(folder)
    assert 2 <= sum(1 for _ in walk) <= 3
    assert "bag.db3 is cut off or damaged" in walk.problem


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x1f\x8b\x08\0" + bytes(20), "it is compressed by gzip: `gunzip` unpacks it"),
        (b"PK\x03\x04" + bytes(20), "it is compressed by zip: `unzip`"),
        (b"#ROSBAG V1.2\n" + bytes(20), "a bag of an older version: `rosbag filter"),
        (b"ULogEnc\x01" + bytes(20), "it is an encrypted log of PX4"),
        (b"\xa3\x95\x80\x80" + bytes(20), "a dataflash log of ArduPilot"),
        (b"\x28\xb5\x2f\xfd" + bytes(20), "nothing can be unpacked"),
        (
            zstandard.compress(b"#ROSBAG V2.0\n" + bytes(40)),
            "`zstd -d flight.log` unpacks a log of",
        ),
    ],
)
def test_what_is_no_log_is_named_with_its_remedy(tmp_path, content, words):
    path = tmp_path / "flight.log"
    path.write_bytes(content)
    with pytest.raises(RecordingError) as caught:
        open_log(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "formats"),
    [
        (["info"], "a ROS 1 bag (version 2.0), a ROS 2 bag nor a ULog of PX4"),
        (["play"], "a ROS 1 bag (version 2.0) nor a ROS 2 bag"),
        (["slam"], "a ROS 1 bag (version 2.0) nor a ROS 2 bag; a scanner's text log needs"),
        (["recover"], "an MCAP log nor a ROS 1 bag (version 2.0)"),
    ],
)
def test_each_command_names_the_formats_that_it_reads(tmp_path, arguments, formats):
    path = tmp_path / "field.toml"
    path.write_text('name = "field"\n')
    result = runner.invoke(app, [*arguments, str(path)])
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert formats in result.stderr


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
    received = []
    with one_file(path) as whole, closing(Playback(whole.path)) as playback:
        assert problem in whole.problem
        assert bool(whole.problem) == bool(problem)
        counts = {topic.name: topic.messages for topic in playback.topics}
        assert counts["/note"] == COUNT * (2 if kind == "two mcap" else 1)
        graph = Graph(lambda: playback.now_ns)
        playback.open(graph)
        graph.subscribe("/note", lambda p: received.append(p.message.data), m.String)
        for time_ns in (1_500_000_000, 300_000_000):
            playback.seek(time_ns)
            graph.deliver()
        copy = whole.path
    assert received == ["note 15", "note 3"]
    assert copy.exists() == (kind in ("mcap", "log"))


def test_a_bag_without_messages_is_not_played(tmp_path):
    folder = write_sqlite_bag(tmp_path / "bag")
    with closing(sqlite3.connect(_file(folder))) as base:
        base.execute("DELETE FROM messages")
        base.commit()
    with pytest.raises(RecordingError, match="holds no readable message"), one_file(folder):
        pass
    with pytest.raises(RecordingError, match=r"holds no \.mcap"), one_file(tmp_path):
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
