"""A log of each format gives the recorded values as arrays and tables."""

from __future__ import annotations

import gc
import warnings

import numpy as np
import pytest
from logged_messages import COUNT, write_log, write_sqlite_bag

from volery.bridges.logs.decoding import LogDecoder
from volery.core.errors import LogWarning, RecordingError, VoleryError
from volery.logs import open_log
from volery.logs.sources import ChunkSource

TIMES_S = np.arange(COUNT) / 10.0


@pytest.fixture(scope="module", params=["flight.mcap", "flight.bag", "bag2", "bag2_of_mcap"])
def path(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    if request.param == "bag2":
        return write_sqlite_bag(folder / "bag2")
    if request.param == "bag2_of_mcap":
        write_log(folder / "part_0.mcap")
        return folder
    return write_log(folder / request.param)


@pytest.fixture
def log(path):
    with open_log(path) as opened:
        yield opened


@pytest.fixture
def mcap(tmp_path):
    return write_log(tmp_path / "flight.mcap")


def test_topics_times_and_uavs(log):
    assert log.topics["/uav1/odom"] == ("nav_msgs/msg/Odometry", COUNT)
    assert len(log) == len(set(log)) == 9
    assert "/uav2/odom" in log
    assert (log.start_s, log.end_s, log.duration_s) == (0.0, 1.9, 1.9)
    assert log.uavs == ("uav1", "uav2")
    assert log.problem == ""


def test_fields_are_columns(log):
    data = log["/uav1/odom"]
    assert len(data) == COUNT
    assert np.array_equal(data.times_s, TIMES_S)
    assert np.array_equal(data["pose.pose.position.x"], 0.1 * np.arange(COUNT))
    assert data["pose.pose.position"].shape == (COUNT, 3)
    assert data["pose.pose.position"][3].tolist() == [pytest.approx(0.3), 1.0, 2.0]
    assert np.array_equal(data["pose.covariance"], np.arange(36.0) + np.arange(COUNT)[:, None])
    assert data["header.frame_id"].tolist() == ["uav1/odom"] * COUNT
    assert data["header.stamp.sec"].dtype == np.int32
    assert np.array_equal(data.stamps_ns, np.arange(COUNT) * 100_000_000)
    assert data.stamps_ns.dtype == np.int64
    assert data.refused == 0


def test_several_columns_at_once(log):
    found = log["/uav2/odom"].columns("pose.pose.position.y", "header.frame_id")
    assert list(found) == ["pose.pose.position.y", "header.frame_id"]
    assert found["pose.pose.position.y"].tolist() == [2.0] * COUNT
    assert "pose.pose.position" in log["/uav2/odom"]
    assert "pose.height" not in log["/uav2/odom"]


def test_arrays_of_equal_and_of_different_lengths(log):
    ranges = log["/uav1/scan"]["ranges"]
    assert ranges.shape == (COUNT, 5)
    assert ranges.dtype == np.float32
    assert np.allclose(log["/uav1/scan"].angles_rad, [-1.0, -0.5, 0.0, 0.5, 1.0])
    gappy = log["/uav1/gappy_scan"]
    assert [len(values) for values in gappy["ranges"]] == [3, 4] * (COUNT // 2)
    padded = gappy.padded("ranges")
    assert padded.shape == (COUNT, 4)
    assert np.isnan(padded[0, 3])
    assert padded[1].tolist() == [1.0] * 4
    assert gappy.padded("ranges", fill=-1.0)[0].tolist() == [0.0, 0.0, 0.0, -1.0]


def test_images_and_clouds(log):
    images = list(log["/uav1/image"].images())
    assert len(images) == COUNT
    assert images[7].shape == (2, 3, 3)
    assert images[7][1, 2].tolist() == [200, 0, 7]
    clouds = list(log["/uav1/points"].clouds())
    assert clouds[3].dtype.names == ("x", "y", "ring")
    assert clouds[3]["x"].tolist() == [3.0, 4.0, 5.0, 6.0]
    assert clouds[3]["ring"].tolist() == [0, 1, 2, 3]


def test_time_ranges(log):
    part = log.between(0.5, 1.0)
    assert part["/uav1/odom"].times_s.tolist() == [0.5, 0.6, 0.7, 0.8, 0.9]
    assert (part.start_s, part.end_s) == (0.5, 1.0)
    assert log["/uav1/odom"].between(1.5).times_s.tolist() == [1.5, 1.6, 1.7, 1.8, 1.9]
    assert log["/note"].between(end_s=0.2)["data"].tolist() == ["note 0", "note 1"]
    assert len(part.between(0.8)["/note"]) == 2
    assert len(log.between(5.0)["/note"]) == 0


def test_messages_one_by_one(log):
    found = list(log.messages("/uav*/odom", "/note"))
    assert len(found) == 3 * COUNT
    assert {message.topic for message in found} == {"/uav1/odom", "/uav2/odom", "/note"}
    assert [message.time_ns for message in found] == sorted(message.time_ns for message in found)
    assert next(iter(log["/note"].messages())).message.data == "note 0"
    assert len(list(log.messages())) == 1 + 8 * COUNT


def test_a_table_of_one_topic(log):
    table = log["/uav1/odom"].to_pandas()
    assert table.index.name == "time_s"
    assert len(table) == COUNT
    assert table["pose.pose.position.x"].iloc[-1] == pytest.approx(1.9)
    assert table["pose.covariance"].iloc[1].tolist() == (np.arange(36.0) + 1.0).tolist()
    chosen = log.to_pandas("/uav1/odom", ["pose.pose.position"])
    assert list(chosen.columns) == [f"pose.pose.position.{axis}" for axis in "xyz"]


def test_a_table_of_several_uavs(log):
    table = log.to_pandas("/*/odom", ["pose.pose.position.y"])
    assert list(table.columns) == ["uav", "pose.pose.position.y"]
    assert len(table) == 2 * COUNT
    assert table.index.is_monotonic_increasing
    assert table.groupby("uav")["pose.pose.position.y"].mean().to_dict() == {
        "uav1": 1.0,
        "uav2": 2.0,
    }
    with pytest.raises(VoleryError, match="several types"):
        log.to_pandas("/uav1/*")


def test_transforms_are_interpolated_and_chained(log):
    tf = log.tf
    assert tf.frames == ("uav1/base_link", "uav1/laser", "uav1/odom")
    found = tf.lookup("uav1/odom", "uav1/laser", [0.0, 0.55, 1.9])
    assert np.allclose(found.position[:, 0], [0.2, 5.7, 19.2])
    back = tf.lookup("uav1/laser", "uav1/odom")
    assert len(back.times_s) == COUNT
    assert np.allclose(back.position[:, 0], -0.2 - np.arange(COUNT))
    assert np.isnan(tf.lookup("uav1/odom", "uav1/base_link", [5.0]).position).all()
    assert tf.lookup("uav1/base_link", "uav1/laser").position.tolist() == [[0.2, 0.0, 0.0]]
    with pytest.raises(VoleryError, match="there is no frame 'nowhere'"):
        tf.lookup("nowhere", "uav1/laser")


def test_trajectories(log):
    found = log.trajectory("uav2")
    assert (found.uav, found.topic) == ("uav2", "/uav2/odom")
    assert found.position.shape == (COUNT, 3)
    assert found.attitude[0].tolist() == [0.0, 0.0, 0.0, 1.0]
    with pytest.raises(VoleryError, match="there are no poses of 'uav3'; UAVs: uav1, uav2"):
        log.trajectory("uav3")


def test_plots(log):
    from matplotlib.figure import Figure

    axes = log.plot("/uav1/odom", "pose.pose.position.x", axes=Figure().add_subplot())
    (line,) = axes.lines
    assert np.array_equal(line.get_xdata(), TIMES_S)
    assert line.get_ydata()[-1] == pytest.approx(1.9)
    axes = log["/uav1/odom"].plot("pose.pose.position", axes=Figure().add_subplot())
    labels = [line.get_label() for line in axes.lines]
    assert labels == [f"/uav1/odom pose.pose.position.{axis}" for axis in "xyz"]
    paths = log.plot_paths(axes=Figure().add_subplot())
    assert [text.get_text() for text in paths.get_legend().get_texts()] == [
        "uav1 (/uav1/odom)",
        "uav2 (/uav2/odom)",
    ]
    with pytest.raises(VoleryError, match=r"'header\.frame_id' of /uav1/odom cannot be plotted"):
        log.plot("/uav1/odom", "header.frame_id", axes=Figure().add_subplot())
    with pytest.raises(VoleryError, match="name the fields of /note to plot: data"):
        log.plot("/note")


def test_a_notebook_shows_the_log(log):
    html = log._repr_html_()
    assert f"<td>/uav1/odom</td><td>nav_msgs/msg/Odometry</td><td>{COUNT}</td>" in html
    assert 'src="data:image/png;base64,' in html


def test_other_topics_are_not_decoded(mcap, monkeypatch):
    decoded = []
    decode = LogDecoder.decode

    def counted(self, record):
        decoded.append(record.topic.topic)
        return decode(self, record)

    monkeypatch.setattr(LogDecoder, "decode", counted)
    with open_log(mcap) as log:
        assert decoded == []
        log["/uav1/odom"]["pose.pose.position.x"]
        log["/uav1/odom"]["pose.pose.position.y"]  # kept since the first pass
    assert decoded == ["/uav1/odom"] * COUNT


def test_topics_of_several_uavs_are_read_in_one_pass(mcap, monkeypatch):
    passes = []
    records = ChunkSource.records

    def counted(self, topics, start_ns, end_ns):
        passes.append(set(topics))
        return records(self, topics, start_ns, end_ns)

    both = {"/uav1/odom", "/uav2/odom"}
    with open_log(mcap) as log:
        monkeypatch.setattr(ChunkSource, "records", counted)
        log.to_pandas("/*/odom", ["pose.pose.position"])
        assert passes.count(both) == 1
        assert len(passes) == 3  # with the types of both, each of one record
        passes.clear()
        trajectories = log.trajectories()
        assert list(trajectories) == ["uav1", "uav2"]
        assert trajectories["uav2"].position[3].tolist() == [pytest.approx(0.3), 2.0, 2.0]
        assert passes == []  # numbers are kept


def test_a_range_without_messages_has_empty_columns(log):
    data = log["/uav1/odom"].between(50.0)
    assert len(data) == 0
    assert data["pose.pose.position"].shape == (0, 3)
    assert data["pose.covariance"].shape == (0, 36)
    assert data["header.frame_id"].shape == data.stamps_ns.shape == (0,)
    assert data.to_pandas().empty
    later = log.between(50.0)
    assert later["/uav1/gappy_scan"].padded("ranges").shape == (0, 0)
    assert later.trajectory("uav1").position.shape == (0, 3)
    assert list(later["/uav1/image"].images()) == []


def test_a_topic_without_messages(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "empty.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        writer.register_channel("/note", "cdr", schema)
        writer.finish()
    with open_log(tmp_path / "empty.mcap") as log:
        assert log.topics["/note"] == ("std_msgs/msg/String", 0)
        assert len(log["/note"]) == 0
        assert log["/note"]["data"].shape == (0,)
        assert (log.start_s, log.end_s, log.uavs) == (0.0, 0.0, ())
        assert "<td>/note</td>" in log._repr_html_()
        with pytest.raises(VoleryError, match="there are no topics with poses to draw"):
            log.plot_paths()


def test_a_topic_of_another_encoding_is_one_error(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "foxglove.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.Pose", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/pose", "json", schema), 0, b"{}", 0)
        writer.finish()
    with open_log(tmp_path / "foxglove.mcap") as log:
        assert log.topics["/pose"] == ("foxglove.Pose", 1)
        with pytest.raises(
            RecordingError,
            match=r"^/pose cannot be read: messages encoded as 'json' are not decoded, only cdr",
        ):
            log["/pose"].fields  # noqa: B018


def test_messages_that_cannot_be_decoded_are_counted(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "short.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
        channel = writer.register_channel("/x", "cdr", schema)
        for k, data in enumerate([bytes(4) + bytes(8), bytes(4) + bytes(3), bytes(4) + bytes(8)]):
            writer.add_message(channel, k, b"\x00\x01" + data[2:], k)
        writer.finish()
    with open_log(tmp_path / "short.mcap") as log:
        assert log["/x"]["data"].tolist() == [0.0, 0.0]
        assert log["/x"].times_ns.tolist() == [0, 2]
        assert log["/x"].refused == 1


@pytest.mark.parametrize("suffix", [".mcap", ".bag"])
def test_a_damaged_chunk_is_left_out(tmp_path, suffix):
    path = write_log(tmp_path / f"whole{suffix}")
    data = bytearray(path.read_bytes())
    third = len(data) // 3
    data[third : third + 40] = bytes(40)
    path.write_bytes(data)
    with open_log(path) as log:
        assert len(log["/uav1/odom"]) == 0
        assert "1 damaged chunk left out" in log.problem


def test_one_file_of_a_ros2_bag(tmp_path):
    bag = write_sqlite_bag(tmp_path / "bag")
    with open_log(next(bag.glob("*.db3"))) as log:
        assert log.topics["/uav1/odom"].messages == len(log["/uav1/odom"]) == COUNT


@pytest.mark.parametrize("suffix", [".mcap", ".bag"])
def test_a_truncated_log_is_read_as_far_as_possible(tmp_path, suffix):
    from logged_messages import published

    from volery.bridges.logs import log_writer

    path = tmp_path / f"cut{suffix}"
    writer = log_writer.create_log(path, compression="none")
    for k, message in enumerate(published()):
        writer.write(message)
        if k % 20 == 19:
            writer.flush()
    writer.close()
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * 0.6)])
    with pytest.warns(LogWarning, match="cut off"):
        log = open_log(path)
    with log:
        assert "cut off" in log.problem
        times = log["/uav1/odom"].times_s
        assert 3 < len(times) < COUNT
        assert np.array_equal(times, TIMES_S[: len(times)])
        assert log.problem in log._repr_html_()


def test_errors_name_what_is_there(mcap):
    with open_log(mcap) as log:
        with pytest.raises(
            VoleryError, match="there is no topic '/uav1/odm'; similar ones: /uav1/odom"
        ):
            log["/uav1/odm"]
        with pytest.raises(VoleryError, match=r"there is no topic '/uav9/\*\*'"):
            list(log.messages("/uav9/**"))
        with pytest.raises(VoleryError, match="String has no field 'pose'; it has data"):
            log["/note"]["pose"]
        with pytest.raises(
            VoleryError, match=r"no field 'pose\.pose\.postion'; similar ones: pose\.pose\.position"
        ):
            log["/uav1/odom"]["pose.pose.postion"]
        with pytest.raises(VoleryError, match="/note holds no poses: its type is std_msgs"):
            log.trajectory("uav1", "/note")
        with pytest.raises(VoleryError, match=r"'header' of .* holds more than numbers"):
            log["/uav1/odom"]["header"]
        with pytest.raises(VoleryError, match="/note holds no images: its type is std_msgs"):
            next(log["/note"].images())
        with pytest.raises(VoleryError, match="a range of times needs two numbers"):
            log.between(float("nan"))
        data = log["/note"]
    with pytest.raises(RecordingError, match="the log is closed; open it again"):
        data["data"]


def test_a_missing_file_and_no_log(tmp_path):
    with pytest.raises(RecordingError, match="cannot read the log: No such file"):
        open_log(tmp_path / "none.mcap")
    all_formats = (
        r"neither an MCAP log, a ROS 1 bag \(version 2\.0\), a ROS 2 bag nor a ULog of PX4$"
    )
    for name in ("text.mcap", "field.toml"):
        (tmp_path / name).write_text("no log at all")
        with pytest.raises(RecordingError, match=all_formats):
            open_log(tmp_path / name)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"the folder holds no \.mcap and no \.db3"):
        open_log(tmp_path / "empty")


def test_a_log_without_users_is_closed(mcap):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        data = open_log(mcap)["/note"]
        gc.collect()
        assert data["data"][0] == "note 0"
        del data
        gc.collect()


def test_the_latest_field_of_a_jumping_clock_is_kept_in_order(tmp_path):
    from volery.bridges.logs import log_writer
    from volery.graph import messages as m

    path = tmp_path / "reset.mcap"
    writer = log_writer.create_log(path)
    for time_ns in (0, 10, 20, 5, 15):  # a reset
        writer.write(m.Published("/note", "std_msgs/msg/String", time_ns, m.String(str(time_ns))))
    writer.close()
    with open_log(path) as log:
        assert log["/note"].times_ns.tolist() == [0, 10, 20, 5, 15]
        assert log["/note"]["data"].tolist() == ["0", "10", "20", "5", "15"]


def test_numbers_are_no_fields(log):
    with pytest.raises(VoleryError, match=r"/uav1/odom: a field is a name such as .*, not 0; mess"):
        _ = log["/uav1/odom"][0]


def test_text_of_other_writers_is_read(tmp_path):
    """Latin-1 in a ROS 1 bag; in MCAP, and a string without a terminator, which Fast CDR reads."""
    from mcap.writer import Writer
    from rosbags.rosbag1 import Writer as BagWriter
    from rosbags.typesys import Stores, get_typestore

    bag = tmp_path / "latin.bag"
    with BagWriter(bag) as writer:
        store = get_typestore(Stores.ROS1_NOETIC)
        connection = writer.add_connection("/name", "std_msgs/msg/String", typestore=store)
        for number, text in enumerate((b"plain", b"H\xfctte", b"")):
            writer.write(connection, number, len(text).to_bytes(4, "little") + text)
    mcap = tmp_path / "latin.mcap"
    with open(mcap, "wb") as file:
        log = Writer(file)
        log.start("ros2")
        schema = log.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = log.register_channel("/name", "cdr", schema)
        for number, text in enumerate((b"plain\0", b"H\xfctte\0", b"")):
            data = b"\0\1\0\0" + len(text).to_bytes(4, "little") + text
            log.add_message(channel, number, data, number)
        log.finish()
    for path in (bag, mcap):
        with open_log(path) as found:
            texts = [each.message.data for each in found["/name"]]
            assert texts == ["plain", "H\ufffdtte", ""]
            assert list(found["/name"]["data"]) == ["plain", "H\ufffdtte", ""]
