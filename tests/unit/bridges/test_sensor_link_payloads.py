"""Payloads of the sensor link: golden bytes, round trips, and refusals."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.bridges.sensor_link.payloads import (
    PAYLOADS,
    decode_notice,
    decode_payload,
    encode_notice,
    encode_payload,
)
from volery.bridges.sensor_link.wire import SensorLinkKind
from volery.core.errors import BridgeError
from volery.graph import messages as m
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.messages import message_type, stamp_of

Image = message_type("sensor_msgs/msg/Image")
STAMP_NS = 12_345_678_901
VECTOR = m.Vector3(0.1, -0.2, 9.81)
TURN = m.Quaternion(0.0, 0.0, 0.6, 0.8)


def header(frame="uav1/base_link"):
    return m.header(STAMP_NS, frame)


def scan():
    ranges = np.array([1.5, np.inf, -np.inf, np.nan], np.float32)
    numbers = [float(np.float32(x)) for x in (-2.35, 2.35, 0.0043, 1.7e-5, 0.025, 0.1, 30.0)]
    return m.LaserScan(header(), *numbers, ranges, np.arange(4, dtype=np.float32))


def odometry():
    pose = m.Pose(m.Point(1.0, 2.0, 3.0), TURN)
    return m.Odometry(
        header("map"),
        "uav1/base_link",
        m.PoseWithCovariance(pose, np.diag(np.arange(6.0)).reshape(36)),
        m.TwistWithCovariance(m.Twist(VECTOR, VECTOR), np.diag(np.arange(6.0)).reshape(36)),
    )


def imu():
    unknown = np.zeros(9)
    unknown[0] = -1.0
    nine = np.diag([0.1, 0.2, 0.3]).reshape(9)
    return m.Imu(header(), TURN, unknown, VECTOR, nine, VECTOR, 2.0 * nine)


def sonar():
    return m.Range(header(), 0, 0.5, 0.125, 8.0, float("inf"), 0.25)


def image():
    return Image(header(), 2, 3, "rgb8", 0, 9, np.arange(18, dtype=np.uint8))


def pose_stamped():
    return m.PoseStamped(header("map"), m.Pose(m.Point(1.0, 2.0, 3.0), TURN))


SENSORS = {
    SensorLinkKind.LASER_SCAN: scan,
    SensorLinkKind.POSE: odometry,
    SensorLinkKind.IMU: imu,
    SensorLinkKind.SONAR: sonar,
    SensorLinkKind.IMAGE: image,
}
ALL = {**SENSORS, SensorLinkKind.POSE_COMMAND: pose_stamped, SensorLinkKind.GOAL_POSE: pose_stamped}


@pytest.mark.parametrize("kind", ALL)
def test_messages_come_back_byte_for_byte(kind):
    message, name = ALL[kind](), "laser/horizontal/scan" if kind in SENSORS else ""
    payload = encode_payload(kind, message, name)
    found_name, found = decode_payload(kind, payload, stamp_of(message))
    msgtype = PAYLOADS[kind].msgtype
    assert found_name == name
    assert encode_cdr(found, msgtype) == encode_cdr(message, msgtype)


def golden(form, *values):
    return struct.pack(f"<{form}", *values)


def texts(*all_of_them):
    return b"".join(bytes([len(text)]) + text.encode() for text in all_of_them)


GOLDEN = {
    SensorLinkKind.LASER_SCAN: golden("7f", -2.35, 2.35, 0.0043, 1.7e-5, 0.025, 0.1, 30.0)
    + bytes.fromhex("04000000 04000000 0000c03f 0000807f 000080ff 0000c07f")
    + bytes.fromhex("00000000 0000803f 00000040 00004040")
    + texts("n", "uav1/base_link"),
    SensorLinkKind.POSE: golden("13d", 1, 2, 3, 0, 0, 0.6, 0.8, 0.1, -0.2, 9.81, 0.1, -0.2, 9.81)
    + golden("12d", 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5)
    + texts("n", "map", "uav1/base_link"),
    SensorLinkKind.IMU: golden("10d", 0, 0, 0.6, 0.8, 0.1, -0.2, 9.81, 0.1, -0.2, 9.81)
    + golden("9d", -1, 0, 0, 0.1, 0.2, 0.3, 0.2, 0.4, 0.6)
    + texts("n", "uav1/base_link"),
    SensorLinkKind.SONAR: bytes.fromhex("00 0000003f 0000003e 00000041 0000807f 0000803e")
    + texts("n", "uav1/base_link"),
    SensorLinkKind.IMAGE: bytes.fromhex("02000000 03000000 09000000 00 12000000")
    + bytes(range(18))
    + texts("rgb8", "n", "uav1/base_link"),
    SensorLinkKind.GOAL_POSE: golden("7d", 1, 2, 3, 0, 0, 0.6, 0.8) + texts("map"),
}


@pytest.mark.parametrize("kind", GOLDEN)
def test_golden_bytes(kind):
    assert encode_payload(kind, ALL[kind](), "n") == GOLDEN[kind]


@pytest.mark.parametrize("kind", ALL)
def test_every_cut_and_every_surplus_is_refused(kind):
    payload = encode_payload(kind, ALL[kind](), "name")
    for end in range(len(payload)):
        with pytest.raises(BridgeError):
            decode_payload(kind, payload[:end], 0)
    with pytest.raises(BridgeError, match="were given"):
        decode_payload(kind, payload + b"x", 0)


@given(st.integers(0, 255), st.binary(max_size=300), st.integers(-(2**63), 2**63 - 1))
def test_random_payloads_are_decoded_or_refused(kind, payload, stamp_ns):
    try:
        name, message = decode_payload(kind, payload, stamp_ns)
    except BridgeError:
        return
    assert isinstance(name, str)
    assert type(message) is type(ALL[SensorLinkKind(kind)]())


def test_arrays_are_read_only_and_aligned():
    payload = encode_payload(SensorLinkKind.LASER_SCAN, scan(), "x")
    _, found = decode_payload(SensorLinkKind.LASER_SCAN, payload, 0)
    assert found.ranges.flags.aligned
    assert not found.ranges.flags.writeable


@pytest.mark.parametrize(
    ("kind", "message", "name", "words"),
    [
        (SensorLinkKind.IMU, scan(), "x", "IMU"),
        (SensorLinkKind.SONAR, sonar(), "n" * 256, "255"),
        (SensorLinkKind.SONAR, m.Range(header(), 300, 0.5, 0.1, 8.0, 1.0, 0.0), "x", "SONAR"),
    ],
)
def test_what_has_no_payload(kind, message, name, words):
    with pytest.raises(BridgeError, match=words):
        encode_payload(kind, message, name)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_poses_must_be_finite(value):
    pose = m.PoseStamped(header("map"), m.Pose(m.Point(value, 0.0, 0.0), TURN))
    with pytest.raises(BridgeError, match="finite"):
        decode_payload(SensorLinkKind.GOAL_POSE, encode_payload(SensorLinkKind.GOAL_POSE, pose), 0)


def test_notices_are_text_whatever_they_are():
    assert decode_notice(encode_notice("no UAV — 9")) == "no UAV — 9"
    assert decode_notice(b"\xff") == "\ufffd"
