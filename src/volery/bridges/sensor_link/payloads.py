"""Payloads of the sensor link: ROS messages as packed bytes, and back.

docs/sensor_link.md defines the fields. Numbers are little-endian, without padding.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.bridges.sensor_link.wire import SensorLinkKind
from volery.core.clock import NS_PER_S
from volery.core.errors import BridgeError
from volery.graph.messages import (
    Imu,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Range,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
    message_type,
)

Image = message_type("sensor_msgs/msg/Image")

_SCAN = struct.Struct("<7f2I")
_POSE = struct.Struct("<25d")
_IMU = struct.Struct("<19d")
_SONAR = struct.Struct("<B5f")
_IMAGE = struct.Struct("<3IBI")
_COMMAND = struct.Struct("<7d")
_LONGEST_TEXT_BYTES = 255
_STAMP_LIMIT_NS = (1 << 31) * NS_PER_S
"""Limit of ROS stamps, whose seconds have 31 bits."""

Encoder = Callable[[Any, str], bytes]
Decoder = Callable[["_Reader", int], tuple[str, Any]]


class Payload(NamedTuple):
    """Encoder and decoder of one type of payload."""

    msgtype: str
    encode: Encoder
    """Converts message and name to bytes."""
    decode: Decoder
    """Converts bytes and stamp in nanoseconds to name and message."""


class _Reader:
    """Reads fields from a payload. Raises `BridgeError` if there are not enough bytes."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._position = 0

    def unpack(self, fields: struct.Struct) -> tuple[Any, ...]:
        return fields.unpack(self.bytes(fields.size))

    def bytes(self, count: int) -> bytes:
        end = self._position + count
        if end > len(self._data):
            raise BridgeError(f"the payload ends after {len(self._data)} bytes, not {end}")
        taken = self._data[self._position : end]
        self._position = end
        return taken

    def floats(self, count: int) -> NDArray[np.float32]:
        return np.frombuffer(self.bytes(4 * count), "<f4")

    def text(self) -> str:
        (length,) = self.bytes(1)
        try:
            return self.bytes(length).decode()
        except UnicodeDecodeError:
            raise BridgeError("a text in the payload is not UTF-8") from None

    def end(self) -> None:
        if self._position != len(self._data):
            raise BridgeError(
                f"the payload has {self._position} bytes, {len(self._data)} were given"
            )


def encode_payload(kind: SensorLinkKind, message: Any, name: str = "") -> bytes:
    """Returns the payload of a ROS message; `name`: its topic below the UAV's, unused for commands.

    Raises
    ------
    BridgeError
        The message does not fit, or a text is longer than 255 bytes.

    """
    try:
        return PAYLOADS[kind].encode(message, name)
    except (struct.error, OverflowError, ValueError, TypeError, AttributeError) as error:
        raise BridgeError(f"no payload {kind.name} of this message: {error}") from None


def decode_payload(kind: int, payload: bytes, stamp_ns: int) -> tuple[str, Any]:
    """Returns name and ROS message of a payload; its arrays are read-only.

    Raises
    ------
    BridgeError
        The type is unknown, or the bytes are no payload of that type.

    """
    if kind not in PAYLOADS:
        raise BridgeError(f"payloads of type {kind} are not known")
    if not 0 <= stamp_ns < _STAMP_LIMIT_NS:
        raise BridgeError(f"a stamp of {stamp_ns} ns is out of range")
    reader = _Reader(payload)
    found = PAYLOADS[SensorLinkKind(kind)].decode(reader, stamp_ns)
    reader.end()
    return found


def encode_notice(text: str) -> bytes:
    """Returns the payload of a NOTICE."""
    return text.encode()


def decode_notice(payload: bytes) -> str:
    """Returns the text of a NOTICE; invalid bytes are replaced."""
    return payload.decode(errors="replace")


def _texts(*texts: str) -> bytes:
    parts = []
    for text in texts:
        data = text.encode()
        if len(data) > _LONGEST_TEXT_BYTES:
            raise BridgeError(f"'{text[:40]}...' is longer than {_LONGEST_TEXT_BYTES} bytes")
        parts.append(bytes((len(data),)) + data)
    return b"".join(parts)


def _encode_scan(scan: Any, name: str) -> bytes:
    ranges, intensities = scan.ranges, scan.intensities
    fixed = _SCAN.pack(
        scan.angle_min,
        scan.angle_max,
        scan.angle_increment,
        scan.time_increment,
        scan.scan_time,
        scan.range_min,
        scan.range_max,
        len(ranges),
        len(intensities),
    )
    texts = _texts(name, scan.header.frame_id)
    return b"".join((fixed, _floats(ranges), _floats(intensities), texts))


def _floats(values: Any) -> bytes:
    return np.asarray(values, "<f4").tobytes()


def _decode_scan(reader: _Reader, stamp_ns: int) -> tuple[str, Any]:
    n = reader.unpack(_SCAN)
    ranges, intensities = reader.floats(n[7]), reader.floats(n[8])
    name, frame = reader.text(), reader.text()
    fields = [*n[:7], ranges, intensities]
    return name, LaserScan(header(stamp_ns, frame), *fields)


def _encode_pose(odometry: Any, name: str) -> bytes:
    pose, twist = odometry.pose, odometry.twist
    position, turn = pose.pose.position, pose.pose.orientation
    linear, angular = twist.twist.linear, twist.twist.angular
    fixed = _POSE.pack(
        *(position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w),
        *(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z),
        *pose.covariance[::7].tolist(),
        *twist.covariance[::7].tolist(),
    )
    return fixed + _texts(name, odometry.header.frame_id, odometry.child_frame_id)


def _decode_pose(reader: _Reader, stamp_ns: int) -> tuple[str, Any]:
    n = reader.unpack(_POSE)
    name, frame, child = reader.text(), reader.text(), reader.text()
    pose = Pose(Point(*n[:3]), Quaternion(*n[3:7]))
    twist = Twist(Vector3(*n[7:10]), Vector3(*n[10:13]))
    return name, Odometry(
        header(stamp_ns, frame),
        child,
        PoseWithCovariance(pose, _diagonal(n[13:19])),
        TwistWithCovariance(twist, _diagonal(n[19:25])),
    )


def _encode_imu(imu: Any, name: str) -> bytes:
    turn, rate, force = imu.orientation, imu.angular_velocity, imu.linear_acceleration
    fixed = _IMU.pack(
        *(turn.x, turn.y, turn.z, turn.w, rate.x, rate.y, rate.z, force.x, force.y, force.z),
        *imu.orientation_covariance[::4].tolist(),
        *imu.angular_velocity_covariance[::4].tolist(),
        *imu.linear_acceleration_covariance[::4].tolist(),
    )
    return fixed + _texts(name, imu.header.frame_id)


def _decode_imu(reader: _Reader, stamp_ns: int) -> tuple[str, Any]:
    n = reader.unpack(_IMU)
    name, frame = reader.text(), reader.text()
    return name, Imu(
        header(stamp_ns, frame),
        Quaternion(*n[:4]),
        _diagonal(n[10:13]),
        Vector3(*n[4:7]),
        _diagonal(n[13:16]),
        Vector3(*n[7:10]),
        _diagonal(n[16:19]),
    )


def _diagonal(variances: tuple[float, ...]) -> NDArray[np.float64]:
    count = len(variances)
    matrix = np.zeros(count * count)
    matrix[:: count + 1] = variances
    matrix.flags.writeable = False
    return matrix


def _encode_sonar(sonar: Any, name: str) -> bytes:
    fixed = _SONAR.pack(
        sonar.radiation_type,
        sonar.field_of_view,
        sonar.min_range,
        sonar.max_range,
        sonar.range,
        sonar.variance,
    )
    return fixed + _texts(name, sonar.header.frame_id)


def _decode_sonar(reader: _Reader, stamp_ns: int) -> tuple[str, Any]:
    numbers = reader.unpack(_SONAR)
    name, frame = reader.text(), reader.text()
    return name, Range(header(stamp_ns, frame), *numbers)


def _encode_image(image: Any, name: str) -> bytes:
    pixels = np.ascontiguousarray(image.data, np.uint8)
    fixed = _IMAGE.pack(image.height, image.width, image.step, image.is_bigendian, pixels.size)
    return b"".join((fixed, pixels.data, _texts(image.encoding, name, image.header.frame_id)))


def _decode_image(reader: _Reader, stamp_ns: int) -> tuple[str, Any]:
    height, width, step, big_endian, count = reader.unpack(_IMAGE)
    pixels = np.frombuffer(reader.bytes(count), np.uint8)
    encoding, name, frame = reader.text(), reader.text(), reader.text()
    stamped = header(stamp_ns, frame)
    return name, Image(stamped, height, width, encoding, big_endian, step, pixels)


def _encode_command(stamped: Any, _name: str) -> bytes:
    position, turn = stamped.pose.position, stamped.pose.orientation
    fixed = _COMMAND.pack(position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w)
    return fixed + _texts(stamped.header.frame_id)


def _decode_command(reader: _Reader, stamp_ns: int) -> tuple[str, Any]:
    n = reader.unpack(_COMMAND)
    if not all(map(math.isfinite, n)):
        raise BridgeError("a pose must be finite")
    frame = reader.text()
    return "", PoseStamped(header(stamp_ns, frame), Pose(Point(*n[:3]), Quaternion(*n[3:])))


PAYLOADS: dict[SensorLinkKind, Payload] = {
    SensorLinkKind.LASER_SCAN: Payload("sensor_msgs/msg/LaserScan", _encode_scan, _decode_scan),
    SensorLinkKind.POSE: Payload("nav_msgs/msg/Odometry", _encode_pose, _decode_pose),
    SensorLinkKind.IMU: Payload("sensor_msgs/msg/Imu", _encode_imu, _decode_imu),
    SensorLinkKind.SONAR: Payload("sensor_msgs/msg/Range", _encode_sonar, _decode_sonar),
    SensorLinkKind.IMAGE: Payload("sensor_msgs/msg/Image", _encode_image, _decode_image),
    SensorLinkKind.POSE_COMMAND: Payload(
        "geometry_msgs/msg/PoseStamped", _encode_command, _decode_command
    ),
    SensorLinkKind.GOAL_POSE: Payload(
        "geometry_msgs/msg/PoseStamped", _encode_command, _decode_command
    ),
}
