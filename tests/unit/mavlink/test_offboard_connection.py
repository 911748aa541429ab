"""Nodes that fly an autopilot over MAVLink: conversions, odometry, setpoints, commands."""

import os
import threading
import time

import numpy as np
import pytest

from volery.core import rotations
from volery.core.errors import BridgeError, GraphError, UnreachableError
from volery.graph.codecs.zero import zero_message
from volery.graph.connection import call_and_wait
from volery.graph.messages import Quaternion, Twist, Vector3
from volery.mavlink.autopilot.modes.setpoints import attitude_setpoint as autopilot_attitude
from volery.mavlink.autopilot.modes.setpoints import local_setpoint
from volery.mavlink.codec import dialect
from volery.mavlink.offboard.connection import OffboardConnection
from volery.mavlink.offboard.conversions import attitude_setpoint, odometry, velocity_setpoint

mavutil = pytest.importorskip("pymavlink.mavutil")
PORT = 24640 + 2 * (os.getpid() % 3000)
"""Another one in each process that runs these tests."""
TARGET = "mavros_msgs/msg/AttitudeTarget"


def test_the_autopilot_reads_velocities_as_they_are_meant():
    twist = Twist(Vector3(1.0, 2.0, 0.5), Vector3(0.0, 0.0, 0.3))
    east = tuple(rotations.from_rpy(0.0, 0.0, 0.0).tolist())
    setpoint = local_setpoint(velocity_setpoint(twist, (1, 1), 0), (0.0, 0.0, 0.0), east)
    assert setpoint.velocity == pytest.approx((1.0, 2.0, 0.5))
    assert setpoint.yaw_rate == pytest.approx(0.3)
    assert np.isnan(setpoint.position).all()
    assert np.isnan(setpoint.acceleration).all()


def test_the_autopilot_reads_attitudes_and_rates_as_they_are_meant():
    target = zero_message(TARGET)
    q = rotations.from_rpy(0.2, -0.1, 1.3)
    target.orientation, target.thrust, target.type_mask = Quaternion(*q.tolist()), 0.4, 7
    setpoint = autopilot_attitude(attitude_setpoint(target, (1, 1), 0), (0.0, 0.0, 0.0))
    assert abs(np.dot(setpoint.attitude, q)) == pytest.approx(1.0)
    assert setpoint.thrust == pytest.approx(0.4)
    target.type_mask, target.body_rate = 128, Vector3(0.1, 0.2, 0.3)
    setpoint = autopilot_attitude(attitude_setpoint(target, (1, 1), 0), (0.0, 0.0, 0.0))
    assert setpoint.attitude is None
    assert setpoint.rates == pytest.approx((0.1, 0.2, 0.3))


def test_odometry_is_in_ros_frames():
    mavlink, q = dialect(), rotations.from_rpy(0.0, 0.0, np.pi / 2)  # towards north
    s = float(np.sqrt(0.5))
    attitude = mavlink.MAVLink_attitude_quaternion_message(0, 1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3)
    position = mavlink.MAVLink_local_position_ned_message(0, 1.0, 2.0, -3.0, 4.0, 5.0, -6.0)
    message = odometry(position, attitude, 7, "uav1/")
    point, turn = message.pose.pose.position, message.pose.pose.orientation
    assert (point.x, point.y, point.z) == (2.0, 1.0, 3.0)
    assert (turn.z, turn.w) == pytest.approx((s, s))
    assert abs(np.dot([turn.x, turn.y, turn.z, turn.w], q)) == pytest.approx(1.0)
    v, w = message.twist.twist.linear, message.twist.twist.angular
    assert (v.x, v.y, v.z) == pytest.approx((4.0, -5.0, 6.0))
    assert (w.x, w.y, w.z) == pytest.approx((0.1, -0.2, -0.3))
    assert message.header.frame_id == "uav1/odom"


def test_setpoints_that_are_not_finite_are_refused():
    with pytest.raises(GraphError, match="finite"):
        velocity_setpoint(Twist(Vector3(np.nan, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)), (1, 1), 0)


class Peer:
    """An autopilot that sends heartbeats, stands 3 m up and acknowledges commands."""

    def __init__(self):
        self.link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{PORT}", source_system=3, source_component=1, dialect="common"
        )
        self.received = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        mav = self.link.mav
        while not self._over.is_set():
            mav.heartbeat_send(2, 12, 129, 0, 4)
            mav.attitude_quaternion_send(0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            mav.local_position_ned_send(0, 1.0, 2.0, -3.0, 0.0, 0.0, 0.0)
            message = self.link.recv_match(blocking=True, timeout=0.02)
            if message is not None:
                self.received.append(message)
                if message.get_type() == "COMMAND_LONG" and message.command in (400, 22, 176):
                    mav.command_ack_send(message.command, 0 if message.command != 22 else 2)

    def count(self, kind, **fields):
        return sum(
            message.get_type() == kind
            and all(getattr(message, name) == value for name, value in fields.items())
            for message in tuple(self.received)
        )

    def close(self):
        self._over.set()
        self._thread.join()
        self.link.close()


@pytest.fixture
def peer():
    peer = Peer()
    yield peer
    peer.close()


def until(condition):
    for _ in range(3000):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError


def test_a_node_flies_an_autopilot(peer):
    connection = OffboardConnection(f"udpin:127.0.0.1:{PORT}", "pilot", engages=True, timeout_s=60)
    try:
        queue = connection.subscribe("/uav1/odom", "nav_msgs/msg/Odometry", wake=lambda: None)
        connection.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
        connection.publish("/uav1/cmd_vel", Twist(Vector3(1.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
        connection.publish("/uav1/policy/status", None)
        until(lambda: queue.info.waiting)
        assert queue.take(1)[0].message.pose.pose.position.z == 3.0
        until(lambda: peer.count("SET_POSITION_TARGET_LOCAL_NED", vx=1.0, target_system=3))
        until(lambda: peer.count("COMMAND_LONG", command=176, param2=6.0))  # it engages
        assert call_and_wait(connection, "/uav1/hold", None, 60.0).success
        refused = call_and_wait(connection, "/uav1/take_off", None, 60.0)
        assert not refused.success
        assert "MAV_RESULT_DENIED" in refused.message
        assert peer.count("COMMAND_LONG", command=400, param1=1.0) == 1
        with pytest.raises(GraphError, match="does not exist over MAVLink"):
            call_and_wait(connection, "/uav1/dance", None, 60.0)
        with pytest.raises(GraphError, match="no setpoint of rotor speeds"):
            connection.advertise("/uav1/rotor_speeds", "std_msgs/msg/Float32MultiArray")
    finally:
        connection.close()
    with pytest.raises(GraphError, match="closed"):
        connection.subscribe("/uav1/odom", wake=lambda: None)


def test_no_autopilot_is_unreachable():
    with pytest.raises(UnreachableError, match="no autopilot"):
        OffboardConnection(f"udpin:127.0.0.1:{PORT + 1}", "pilot", timeout_s=0.05)


def test_an_address_that_is_none_is_refused():
    with pytest.raises(BridgeError, match="cannot be opened"):
        OffboardConnection("/dev/no_such_line", "pilot", timeout_s=0.05)
    with pytest.raises(BridgeError, match="is no address"):
        OffboardConnection("udpin:127.0.0.1", "pilot", timeout_s=0.05)
