"""Messages as YAML: what is printed is read again, by tools that know YAML 1.1 as well."""

import math

import numpy as np
import pytest
from ruamel.yaml import YAML

from volery.cli.yaml_codec import read_message, to_yaml
from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Header, LaserScan, String, Time, message_type

LASER_SCAN = """\
header:
  stamp:
    sec: 3
    nanosec: 5
  frame_id: uav1/laser
angle_min: -1.0e-05
angle_max: 1.5
angle_increment: 0.0
time_increment: 0.0
scan_time: 0.0
range_min: 0.1
range_max: .inf
ranges: [1.0, .inf, -.inf, .nan]
intensities: []"""


def scan(ranges):
    numbers = (-1e-5, 1.5, 0.0, 0.0, 0.0, 0.1, math.inf)
    header = Header(Time(3, 5), "uav1/laser")
    return LaserScan(header, *numbers, np.array(ranges, np.float64), np.zeros(0, np.float32))


def read(text, version):
    yaml = YAML(typ="safe", pure=True)
    yaml.version = version
    return yaml.load(text)


def test_a_scan_is_a_block_with_its_ranges_in_one_line():
    assert to_yaml(scan([1.0, math.inf, -math.inf, math.nan])) == LASER_SCAN


def test_a_long_list_of_numbers_is_cut_unless_it_is_wanted_whole():
    long = scan(np.arange(1000))
    assert "126.0, 127.0, ... 872 more]\n" in to_yaml(long)
    assert read(to_yaml(long, whole=True), (1, 2))["ranges"] == list(range(1000))


@pytest.mark.parametrize("version", [(1, 1), (1, 2)])
def test_numbers_stay_numbers(version):
    values = [1e20, -1e-5, 1.5e-7, 0.1, -0.0]
    array = message_type("std_msgs/msg/Float64MultiArray")(data=np.array(values))
    array.layout = zero_message("std_msgs/msg/MultiArrayLayout")
    assert read(to_yaml(array), version)["data"] == values
    assert read_message(to_yaml(array), "std_msgs/msg/Float64MultiArray").data.tolist() == values


@pytest.mark.parametrize("version", [(1, 1), (1, 2)])
@pytest.mark.parametrize(
    "text",
    [
        "",
        "no",
        "Yes",
        "null",
        "1",
        "1e5",
        ".inf",
        "12:30",
        "a: b",
        "- a",
        "#",
        '"',
        "'",
        "two\nlines",
        "\x1b[2J",
        "é",
        "word " * 60,
    ],
)
def test_a_string_stays_one(text, version):
    printed = to_yaml(String(text))
    assert read(printed, version) == {"data": text}
    assert not set("\n\x1b") & set(printed)


def test_messages_in_a_list_are_items_of_a_block():
    transforms = [zero_message("geometry_msgs/msg/TransformStamped")] * 2
    lines = to_yaml(message_type("tf2_msgs/msg/TFMessage")(transforms)).splitlines()
    assert lines[:4] == ["transforms:", "- header:", "    stamp:", "      sec: 0"]
    assert lines.count("- header:") == 2
    assert "      y: 0.0" in lines


def test_a_message_without_fields_is_empty_text():
    assert to_yaml(zero_message("std_msgs/msg/Empty")) == ""


@pytest.mark.parametrize(
    ("msgtype", "text", "stamp_of"),
    [
        ("geometry_msgs/msg/PoseStamped", "{header: auto}", lambda m: m.header.stamp),
        ("geometry_msgs/msg/PoseStamped", "{header: {stamp: now}}", lambda m: m.header.stamp),
        ("nav_msgs/msg/Path", "{poses: [{header: auto}]}", lambda m: m.poses[0].header.stamp),
        ("builtin_interfaces/msg/Time", "now", lambda m: m),
    ],
)
def test_present_times(msgtype, text, stamp_of):
    stamp = stamp_of(read_message(text, msgtype, lambda: 3_000_000_005))
    assert (stamp.sec, stamp.nanosec) == (3, 5)


def test_words_that_are_no_times():
    assert read_message("{data: now}", "std_msgs/msg/String").data == "now"
    message = read_message("{header: {frame_id: auto}}", "geometry_msgs/msg/PoseStamped")
    assert message.header.frame_id == "auto"
    with pytest.raises(GraphError, match="an object"):
        read_message("{header: later}", "geometry_msgs/msg/PoseStamped")
