"""Plain text logs of scanners, as messages and as logs."""

import math
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.records import LogWalk
from volery.bridges.logs.text_layout import TextLayout
from volery.bridges.logs.text_scans import TextScans
from volery.cli.app import app
from volery.core.errors import RecordingError

LAYOUT = {
    "ranges": {
        "first_column": 4,
        "beams": 3,
        "angle_min_deg": -90.0,
        "angle_max_deg": 90.0,
        "range_max_m": 5.6,
        "range_min_m": 0.1,
        "sweep_s": 0.02,
    },
    "odometry": {"columns": [1, 2, 3]},
    "mount": {"position_m": [0.0, 0.0, 0.18], "rpy_deg": [0.0, 0.0, 90.0]},
}
LINES = """# time x y yaw ranges
1000000 0 0 0 1000 2000 3000

1100000, 500, -250, 90, 50, 0, 9999
"""
TOML = """
[ranges]
first_column = 1
beams = 4
angle_min_deg = 120.0
angle_max_deg = -120.0
range_max_m = 10.0
"""


def walk(tmp_path, text, layout=LAYOUT):
    path = tmp_path / "scans.txt"
    path.write_text(text)
    return TextScans(path, TextLayout.model_validate(layout))


def test_a_line_becomes_its_messages(tmp_path):
    scans = walk(tmp_path, LINES)
    placed, first_odometry, first, odometry, second = list(scans)
    assert [placed.topic, odometry.topic, second.topic] == [
        "/tf_static",
        "/uav1/odom",
        "/uav1/laser/horizontal/scan",
    ]
    assert first.time_ns == 1_000_000_000
    np.testing.assert_array_equal(first.message.ranges, np.float32([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(second.message.ranges, [-math.inf, math.inf, math.inf])
    assert first.message.angle_increment == pytest.approx(math.pi / 2.0)
    assert first.message.time_increment == pytest.approx(0.01)
    at = odometry.message.pose.pose
    assert (at.position.x, at.position.y) == (0.5, -0.25)
    assert 2.0 * math.atan2(at.orientation.z, at.orientation.w) == pytest.approx(math.pi / 2.0)
    mounting = placed.message.transforms[0]
    assert mounting.child_frame_id == first.message.header.frame_id == "uav1/laser_horizontal"
    assert mounting.transform.translation.z == 0.18
    assert mounting.transform.rotation.z == pytest.approx(math.sqrt(0.5))
    assert first_odometry.message.header.frame_id == "uav1/odom"
    assert (scans.scans, scans.left_out) == (2, 0)


def test_a_scanner_may_turn_clockwise(tmp_path):
    layout = {"ranges": {**LAYOUT["ranges"], "angle_min_deg": 90.0, "angle_max_deg": -90.0}}
    scan = list(walk(tmp_path, LINES, layout))[-1].message
    assert scan.angle_min == pytest.approx(math.pi / 2.0)
    assert scan.angle_increment == pytest.approx(-math.pi / 2.0)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("1200000 0 0 0 1000 2000", "line 5: 6 columns where the layout needs 7"),
        ("1200000 0 0 0 1000 2000 far", "line 5: a column has no number"),
        ("1000001 0 0 0 1000 2000 3000", "line 5: at 1.000001 s, not after the line before"),
        ("nan 0 0 0 1000 2000 3000", "line 5: nan s is out of range"),
        ("-5 0 0 0 1000 2000 3000", "line 5: -5e-06 s is out of range"),
        ("9e99 0 0 0 1000 2000 3000", "line 5: 9e[+]93 s is out of range"),
        ("\x00\xff", "line 5: 1 column where"),
    ],
)
def test_lines_that_cannot_be_read_are_left_out_and_reported(tmp_path, line, problem):
    scans = walk(tmp_path, f"{LINES}{line}\n1300000 0 0 0 1000 2000 3000\n")
    assert [one.time_ns for one in scans][-1] == 1_300_000_000
    assert (scans.scans, scans.left_out) == (3, 1)
    assert re.match(problem, scans.problem)


@pytest.mark.parametrize("text", ["", "# nothing\n", "one two three\n", "1 2 3\n"])
def test_a_file_without_scans_is_refused(tmp_path, text):
    with pytest.raises(RecordingError, match="has no scan of this layout"):
        list(walk(tmp_path, text))


def test_a_ray_that_is_no_number_stays_one(tmp_path):
    scan = list(walk(tmp_path, "1 0 0 0 nan inf 1000\n"))[-1].message
    np.testing.assert_array_equal(scan.ranges, [math.nan, math.inf, 1.0])


def convert(*words):
    return CliRunner().invoke(app, ["convert", *map(str, words)])


@pytest.mark.parametrize("kind", [".mcap", ".bag"])
def test_the_command_writes_a_log(tmp_path, kind):
    source, layout, out = tmp_path / "a.txt", tmp_path / "a.toml", tmp_path / f"out{kind}"
    source.write_text("".join(f"{k * 25_000} 100 200 300 0\n" for k in range(50)) + "broken\n")
    layout.write_text(TOML)
    result = convert(source, out, "--layout", layout)
    assert result.exit_code == 0, result.output
    assert "50 scans, 51 messages" in result.output
    assert "1 line left out; line 51: 1 column where" in result.output
    walked, decoder = LogWalk(out), LogDecoder()
    scans = [decoder.decode(one).message for one in walked if one.topic.topic.endswith("/scan")]
    assert len(scans) == 50
    np.testing.assert_allclose(scans[7].ranges, [0.1, 0.2, 0.3, math.inf])
    assert convert(source, out, "--layout", layout).exit_code == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.toml", "a.txt", f"out{kind}"]


def test_what_is_wrong_is_reported_in_a_line(tmp_path):
    source, layout = tmp_path / "a.txt", tmp_path / "a.toml"
    source.write_text("1 2 3\n")
    layout.write_text(TOML.replace("beams", "beam"))
    result = convert(source, tmp_path / "out.mcap", "--layout", layout)
    assert result.exit_code == 2
    assert "did you mean 'beams'" in result.output
    layout.write_text(TOML)
    result = convert(source, tmp_path / "out.mcap", "--layout", layout)
    assert result.exit_code == 2
    assert "3 columns where the layout needs 5" in result.output
    assert convert(source, tmp_path / "out.txt", "--layout", layout).exit_code == 2
    assert convert(tmp_path / "none", tmp_path / "out.mcap", "--layout", layout).exit_code == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.toml", "a.txt"]


def test_what_was_begun_and_failed_leaves_an_old_log_alone(tmp_path):
    source, layout, out = tmp_path / "a.txt", tmp_path / "a.toml", tmp_path / "out.mcap"
    source.write_text("1 2 3\n")
    layout.write_text(TOML)
    create_log(out).close()
    before = out.read_bytes()
    assert convert(source, out, "--layout", layout, "--overwrite").exit_code == 2
    assert out.read_bytes() == before


def test_wheels_make_a_pose(tmp_path):
    wheels = {"columns": [1, 2], "unit_m": 0.001, "apart_m": 0.5}
    layout = {key: value for key, value in LAYOUT.items() if key != "odometry"}
    quarter = 0.25 * math.pi * 1000.0  # about a point between the wheels, then a metre on
    rows = [(500.0, 200.0), (500.0 - 0.5 * quarter, 200.0 + 0.5 * quarter)]
    rows.append((rows[1][0] + 1000.0, rows[1][1] + 1000.0))
    text = "".join(f"{k + 1}00000 {a} {b} 0 1 2 3\n" for k, (a, b) in enumerate(rows))
    published = [p.message for p in walk(tmp_path, text, {**layout, "wheels": wheels})]
    poses = [m.pose.pose for m in published if type(m).__name__.endswith("Odometry")]
    assert len(poses) == 3
    found = [(p.position.x, p.position.y, 2 * math.atan2(p.orientation.z, p.orientation.w))
             for p in poses]  # fmt: skip
    assert found[0] == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert found[1] == pytest.approx((0.0, 0.0, 0.5 * math.pi), abs=1e-9)
    assert found[2] == pytest.approx((0.0, 1.0, 0.5 * math.pi), abs=1e-9)


def test_either_wheels_or_odometry_are_given():
    wheels = {"columns": [1, 2], "unit_m": 0.001, "apart_m": 0.5}
    with pytest.raises(ValueError, match="either odometry or wheels"):
        TextLayout.model_validate({**LAYOUT, "wheels": wheels})


def test_a_clock_set_back_is_followed_and_disorder_is_not(tmp_path):
    times = (9_000_000, 9_100_000, 9_050_000, 1_000_000, 1_100_000)
    scans = walk(tmp_path, "".join(f"{time} 0 0 0 1 2 3\n" for time in times))
    stamps = [one.time_ns for one in scans if one.topic.endswith("scan")]
    assert stamps == [time * 1000 for time in times if time != 9_050_000]
    assert (scans.left_out, scans.clock_set) == (1, 1)


def test_odometry_that_is_no_number_is_not_published(tmp_path):
    scans = walk(tmp_path, "1000000 nan 0 0 1 2 3\n")
    assert [one.topic for one in scans] == ["/tf_static", "/uav1/laser/horizontal/scan"]


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("ranges", "beams", "3"),
        ("ranges", "first_column", True),
        ("ranges", "range_max_m", "5.6"),
        ("ranges", "no_echo", ["0"]),
        ("odometry", "columns", [1, "2", 3]),
        ("mount", "position_m", ["0", 0.0, 0.18]),
        ("time", "unit_s", "1e-6"),
    ],
)
def test_a_text_is_no_number_of_a_layout(table, key, value):
    changed = {**LAYOUT, table: {**LAYOUT.get(table, {}), key: value}}
    with pytest.raises(ValueError, match="must be a number"):
        TextLayout.model_validate(changed)


@pytest.mark.parametrize(
    ("words", "unit_s", "time_ns"),
    [
        ("1700000019900000", 1e-6, 1_700_000_019_900_000_000),
        ("1700000019.9", 1.0, 1_700_000_019_900_000_000),
        ("1700000019900.25", 1e-3, 1_700_000_019_900_250_000),
        ("1700000019.123456789", 1.0, 1_700_000_019_123_456_789),
    ],
)
def test_stamps_are_those_of_the_log_to_the_nanosecond(words, unit_s, time_ns, tmp_path):
    layout = {**LAYOUT, "time": {"unit_s": unit_s}}
    assert {one.time_ns for one in walk(tmp_path, f"{words} 0 0 0 1 2 3\n", layout)} == {time_ns}


def test_a_time_of_too_many_digits_costs_its_line_alone(tmp_path):
    text = "1 0 0 0 1 2 3\n1e-9999999999999999999 0 0 0 1 2 3\n2 0 0 0 1 2 3\n"
    scans = walk(tmp_path, text)
    assert len(list(scans)) == 5
    assert scans.left_out == 1
    assert "line 2: 1e-99" in scans.problem
