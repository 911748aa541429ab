"""From sensor samples and events to messages on the graph.

A message is built only where somebody receives it. Its arrays are read-only and its own.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.engine.events import Event
from volery.graph.graph import Graph, Publisher
from volery.graph.messages import (
    Clock,
    Imu,
    JointState,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Range,
    String,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
    time_from_ns,
)
from volery.sensors.mount import Mount
from volery.sensors.samples import (
    ImuReadings,
    JointAngles,
    LidarScans,
    OdometryReadings,
    RangeReadings,
    Samples,
    SensorId,
)

Array = NDArray[np.float64]

_NO_INTENSITIES = np.zeros(0, dtype=np.float32)
_NO_EFFORT = np.zeros(0)
_UNKNOWN_ORIENTATION = np.full(9, 0.0)
_UNKNOWN_ORIENTATION[0] = -1.0
for _shared in (_NO_INTENSITIES, _NO_EFFORT, _UNKNOWN_ORIENTATION):
    _shared.flags.writeable = False
_IDENTITY = Quaternion(0.0, 0.0, 0.0, 1.0)


def scan_topic(sensor: SensorId) -> str:
    """Topic of a LIDAR's scans."""
    return f"/{sensor.uav_name}/laser/{sensor.name}/scan"


def laser_frame(sensor: SensorId) -> str:
    """Frame of a LIDAR."""
    return f"{sensor.uav_name}/laser_{sensor.name}"


class GraphPublisher:
    """Publishes what the engine samples; one instance serves the whole fleet."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._publishers: dict[str, Publisher] = {}
        self._mounts: dict[SensorId, Mount] = {}
        self._clock = graph.advertise("/clock", Clock)
        self._tf = graph.advertise("/tf", TFMessage)
        self._tf_static = graph.advertise("/tf_static", TFMessage, latched=True)
        self._events = graph.advertise("/events", String)
        self._static_sent = False
        self._static: list[TransformStamped] = []
        self._by_kind: dict[type[Any], Callable[[Any], None]] = {
            LidarScans: self._scans,
            ImuReadings: self._imus,
            RangeReadings: self._ranges,
            OdometryReadings: self._odometry,
            JointAngles: self._joints,
        }

    def announce(self, sensor: SensorId, kind: type[Any], mount: Mount) -> None:
        """Advertise a sensor's topic and place its frame, before the run starts."""
        self._mounts[sensor] = mount
        base = f"{sensor.uav_name}/base_link"
        if kind is LidarScans:
            self._advertise(scan_topic(sensor), LaserScan)
            if not mount.nods:
                self._static.append(_mount_transform(base, laser_frame(sensor), mount))
        elif kind is JointAngles:
            self._advertise(f"/{sensor.uav_name}/joint_states", JointState)
        elif kind is OdometryReadings:
            self._advertise(_odometry_topic(sensor), Odometry)
            if sensor.name == "odom":
                self._static.append(_fixed_frame("map", f"{sensor.uav_name}/odom"))
        else:
            self._advertise(
                f"/{sensor.uav_name}/{sensor.name}", Imu if kind is ImuReadings else Range
            )
            self._static.append(_mount_transform(base, f"{sensor.uav_name}/{sensor.name}", mount))

    def publish(self, samples: Samples) -> None:
        """Queue the messages of one batch of samples; before the first, the fixed transforms."""
        if not self._static_sent:
            self._publish_static()
        self._by_kind[type(samples)](samples)

    def publish_event(self, event: Event) -> None:
        """Queue an event as JSON text on `/events`."""
        if self._events.wanted:
            self._events.publish(String(json.dumps(asdict(event))))

    def publish_clock(self, time_ns: int) -> None:
        """Queue `/clock`."""
        if self._clock.wanted:
            self._clock.publish(Clock(time_from_ns(time_ns)))

    def _publish_static(self) -> None:
        self._static_sent = True
        if self._static:
            self._tf_static.publish(TFMessage(list(self._static)))

    # ---------------------------------------------------------------------------------- by kind

    def _scans(self, scans: LidarScans) -> None:
        model = scans.model
        for i, sensor in enumerate(scans.sensors):
            publisher = self._publishers[scan_topic(sensor)]
            if not publisher.wanted:
                continue
            publisher.publish(
                LaserScan(
                    header(scans.stamp_ns, laser_frame(sensor)),
                    model.scan.angle_min_rad,
                    model.scan.angle_max_rad,
                    model.angle_increment_rad,
                    model.time_increment_s,
                    1.0 / model.scan.rate_hz,
                    model.range.min_m,
                    model.range.max_m,
                    scans.ranges[i],
                    _NO_INTENSITIES,
                )
            )

    def _imus(self, readings: ImuReadings) -> None:
        rate_covariance = _diagonal(readings.angular_velocity_variance)
        force_covariance = _diagonal(readings.specific_force_variance)
        for i, sensor in enumerate(readings.sensors):
            publisher = self._publishers[f"/{sensor.uav_name}/{sensor.name}"]
            if not publisher.wanted:
                continue
            publisher.publish(
                Imu(
                    header(readings.stamp_ns, f"{sensor.uav_name}/{sensor.name}"),
                    _IDENTITY,
                    _UNKNOWN_ORIENTATION,
                    Vector3(*readings.angular_velocity[i].tolist()),
                    rate_covariance,
                    Vector3(*readings.specific_force[i].tolist()),
                    force_covariance,
                )
            )

    def _ranges(self, readings: RangeReadings) -> None:
        for i, sensor in enumerate(readings.sensors):
            publisher = self._publishers[f"/{sensor.uav_name}/{sensor.name}"]
            if not publisher.wanted:
                continue
            publisher.publish(
                Range(
                    header(readings.stamp_ns, f"{sensor.uav_name}/{sensor.name}"),
                    Range.ULTRASOUND,
                    readings.field_of_view_rad,
                    readings.range_min_m,
                    readings.range_max_m,
                    float(readings.ranges[i]),
                    0.0,
                )
            )

    def _odometry(self, readings: OdometryReadings) -> None:
        transforms = []
        for i, sensor in enumerate(readings.sensors):
            position = readings.position_odom[i].tolist()
            attitude = Quaternion(*readings.attitude[i].tolist())
            base = f"{sensor.uav_name}/base_link"
            frame = "map" if readings.is_ground_truth else f"{sensor.uav_name}/odom"
            if not readings.is_ground_truth and self._tf.wanted:
                transforms.append(
                    TransformStamped(
                        header(readings.stamp_ns, frame),
                        base,
                        Transform(Vector3(*position), attitude),
                    )
                )
            publisher = self._publishers[_odometry_topic(sensor)]
            if not publisher.wanted:
                continue
            twist = Twist(
                Vector3(*readings.velocity_body[i].tolist()),
                Vector3(*readings.omega_body[i].tolist()),
            )
            publisher.publish(
                Odometry(
                    header(readings.stamp_ns, frame),
                    base,
                    PoseWithCovariance(
                        Pose(Point(*position), attitude), _matrix(readings.pose_variance[i])
                    ),
                    TwistWithCovariance(twist, _matrix(readings.twist_variance[i])),
                )
            )
        if transforms:
            self._tf.publish(TFMessage(transforms))

    def _joints(self, joints: JointAngles) -> None:
        transforms = []
        for i, sensor in enumerate(joints.sensors):
            mount = self._mounts[sensor]
            base = f"{sensor.uav_name}/base_link"
            angle = float(joints.angle[i])
            if self._tf.wanted:
                q = rotations.multiply(mount.attitude_body, rotations.from_rpy(0.0, angle, 0.0))
                transforms.append(
                    TransformStamped(
                        header(joints.stamp_ns, base),
                        laser_frame(sensor),
                        Transform(Vector3(*mount.position_body.tolist()), Quaternion(*q.tolist())),
                    )
                )
            publisher = self._publishers[f"/{sensor.uav_name}/joint_states"]
            if publisher.wanted:
                publisher.publish(
                    JointState(
                        header(joints.stamp_ns, ""),
                        [f"laser_{sensor.name}"],
                        _read_only(joints.angle[i : i + 1].copy()),
                        _read_only(joints.rate[i : i + 1].copy()),
                        _NO_EFFORT,
                    )
                )
        if transforms:
            self._tf.publish(TFMessage(transforms))

    def _advertise(self, topic: str, message_class: type[Any]) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._graph.advertise(topic, message_class)


def _odometry_topic(sensor: SensorId) -> str:
    suffix = "ground_truth/odom" if sensor.name == "ground_truth" else sensor.name
    return f"/{sensor.uav_name}/{suffix}"


def _mount_transform(parent: str, child: str, mount: Mount) -> TransformStamped:
    return TransformStamped(
        header(0, parent),
        child,
        Transform(
            Vector3(*mount.position_body.tolist()), Quaternion(*mount.attitude_body.tolist())
        ),
    )


def _fixed_frame(parent: str, child: str) -> TransformStamped:
    return TransformStamped(header(0, parent), child, Transform(Vector3(0.0, 0.0, 0.0), _IDENTITY))


def _diagonal(variance: float) -> Array:
    return _read_only(np.diag([variance] * 3).reshape(9))


def _matrix(diagonal: Array) -> Array:
    return _read_only(np.diag(diagonal).reshape(36))


def _read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array
