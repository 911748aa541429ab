"""MAVROS's topics and services: an offboard program as PX4's guide has it, over the graph alone."""

import pytest
from flying_bench import fly

from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Header, PoseStamped, TwistStamped, message_type, time_from_ns

STATE = "mavros_msgs/msg/State"


class Program:
    """Publishes and calls below a prefix, remembers what it receives."""

    def __init__(self, simulation, prefix):
        self.simulation, self.prefix = simulation, prefix
        self.graph = simulation.graph
        self.state = self.pose = self.fix = None
        for name, kind in (
            ("state", STATE),
            ("local_position/pose", "geometry_msgs/msg/PoseStamped"),
            ("global_position/global", "sensor_msgs/msg/NavSatFix"),
        ):
            self.graph.subscribe(f"{prefix}/{name}", self._receive, kind)
        self.positions = self.graph.advertise(f"{prefix}/setpoint_position/local", PoseStamped)
        self.speeds = self.graph.advertise(f"{prefix}/setpoint_velocity/cmd_vel", TwistStamped)

    def _receive(self, published):
        name = published.topic.rpartition("/")[2]
        setattr(self, {"global": "fix"}.get(name, name), published.message)

    def call(self, name, srvtype, **fields):
        request = zero_message(f"{srvtype}_Request")
        for key, value in fields.items():
            setattr(request, key, value)
        return self.graph.call(f"{self.prefix}/{name}", request)

    def stream(self, publisher, message, seconds):
        message.header = Header(time_from_ns(self.simulation.time_ns), "map")
        for _ in range(round(seconds / 0.05)):
            publisher.publish(message)
            self.simulation.run(0.05)


@pytest.mark.parametrize("prefix", ["/mavros", "/uav1/mavros"])
def test_an_offboard_program_takes_off_and_flies(prefix, caplog):
    simulation, _ = fly()
    with simulation:
        program = Program(simulation, prefix)
        simulation.run(1.1)
        assert program.state.connected
        assert (program.state.mode, program.state.armed) == ("AUTO.LOITER", False)
        setpoint = zero_message("geometry_msgs/msg/PoseStamped")
        setpoint.pose.position.x, setpoint.pose.position.z = 1.0, 2.0
        setpoint.pose.orientation.w = 1.0
        early = program.call("set_mode", "mavros_msgs/srv/SetMode", custom_mode="OFFBOARD")
        assert early.mode_sent
        refused = program.call("cmd/arming", "mavros_msgs/srv/CommandBool", value=True)
        assert (refused.success, refused.result) == (False, 1)
        assert f"{prefix}: arming True: no offboard signal" in caplog.messages
        program.stream(program.positions, setpoint, 1.0)
        for name in ("OFFBOARD",):
            sent = program.call("set_mode", "mavros_msgs/srv/SetMode", custom_mode=name)
            assert sent.mode_sent
        assert program.call("cmd/arming", "mavros_msgs/srv/CommandBool", value=True).success
        program.stream(program.positions, setpoint, 6.0)
        assert (program.state.mode, program.state.armed) == ("OFFBOARD", True)
        here = program.pose.pose.position
        assert (here.x, here.y, here.z) == pytest.approx((1.0, 0.0, 2.0), abs=0.3)
        assert program.fix.altitude == pytest.approx(490.1, abs=0.3)
        twist = zero_message("geometry_msgs/msg/TwistStamped")
        twist.twist.linear.y = 1.5
        program.stream(program.speeds, twist, 2.0)
        assert simulation.uavs["uav1"].velocity_map == pytest.approx([0.0, 1.5, 0.0], abs=0.2)
        assert program.call("cmd/land", "mavros_msgs/srv/CommandTOL").success
        simulation.run(9.0)
        assert (program.state.mode, program.state.armed) == ("AUTO.LOITER", False)


def test_its_commands_are_those_of_mavlink(caplog):
    simulation, _ = fly()
    with simulation:
        simulation.run(0.1)
        program = Program(simulation, "/mavros")
        long = "mavros_msgs/srv/CommandLong"
        assert program.call("cmd/command", long, command=400, param1=1.0).success
        assert program.call("cmd/command", long, command=9999).result == 3
        for interval in (510, 511):  # no link, no streams: FAILED
            assert program.call("cmd/command", long, command=interval, param1=30.0).result == 4
        assert not program.call("set_mode", "mavros_msgs/srv/SetMode", custom_mode="X").mode_sent
        raw = zero_message("mavros_msgs/msg/PositionTarget")
        raw.coordinate_frame, raw.type_mask = 1, 2552
        raw.position.x = float("nan")
        raw.position.y = raw.position.z = float("nan")
        topic = "/mavros/setpoint_raw/local"
        kind = message_type("mavros_msgs/msg/PositionTarget")
        simulation.graph.advertise(topic, kind).publish(raw)
        simulation.run(0.1)
        sent = program.call("set_mode", "mavros_msgs/srv/SetMode", custom_mode="OFFBOARD")
        assert not sent.mode_sent  # a setpoint of no numbers is none
        assert "/mavros: mode 'X': there is no such mode" in caplog.messages
        assert "/mavros: mode 'OFFBOARD': no offboard signal" in caplog.messages
