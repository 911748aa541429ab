"""What comes over ROS-TCP and the sensor link."""

from __future__ import annotations

import contextlib
import json

import numpy as np
from filling import filled
from live_graph import HandGraph
from ros_tcp_client import cdr_string, frame, ros1_string

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.session import EndpointSession
from volery.bridges.ros_tcp.unity import Selection, UnitySession
from volery.bridges.sensor_link import wire as sensor_link
from volery.bridges.sensor_link.commands import SensorLinkCommands
from volery.bridges.sensor_link.payloads import (
    PAYLOADS,
    decode_notice,
    decode_payload,
    encode_payload,
)
from volery.core.errors import BridgeError
from volery.graph import messages as m
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.messages import String, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
Response = message_type(f"{TRIGGER}_Response")

_COMMANDS = (
    ("publish", {"topic": "/in", "message_name": "std_msgs/String", "queue_size": 10}),
    ("publish", {"topic": "/map", "message_name": "std_msgs/String", "latch": True}),
    ("publish", {"topic": "cmd", "message_name": "geometry_msgs/Twist", "queue_size": 0}),
    ("subscribe", {"topic": "/out", "message_name": "std_msgs/String"}),
    ("subscribe", {"topic": "/in", "message_name": "std_msgs/msg/String"}),
    ("ros_service", {"topic": "/do", "message_name": "std_srvs/Trigger"}),
    ("unity_service", {"topic": "/mine", "message_name": "std_srvs/Trigger"}),
    ("unity_service", {"topic": "/set", "message_name": "std_srvs/SetBool"}),
    ("request", {"srv_id": 1}),
    ("response", {"srv_id": 1001}),
    ("response", {"srv_id": 1002}),
    ("topic_list", {}),
    ("remove_publisher", {"topic": "/in"}),
    ("remove_subscriber", {"topic": "/out"}),
    ("remove_ros_service", {"topic": "/do"}),
    ("remove_unity_service", {"topic": "/mine"}),
    ("handshake", {"version": "v0.7.0", "metadata": '{"protocol": "ROS1"}'}),
    ("handshake", {"version": "v0.7.0", "metadata": '{"protocol": "ROS2"}'}),
    ("error", {"text": "Not registered to publish topic '/out'"}),
    ("warn", {"text": "x"}),
)
_BODIES = (
    *(("/in", string("x")) for string in (ros1_string, cdr_string)),
    *(("/uav1/cmd_vel", head + bytes(48)) for head in (b"", b"\0\1\0\0")),
    ("/do", b""),
    ("/do", b"\0\1\0\0\0"),
    ("/mine", b"\1" + ros1_string("done")),
    ("/mine", b"\0\1\0\0\1\0\0\0" + cdr_string("done")[4:]),
    ("/set", b"\1"),
)
_FRAMES = [frame(f"__{n}", json.dumps(f).encode()) for n, f in _COMMANDS]
_FRAMES += [frame(*body) for body in _BODIES]
_STREAMS = [b"".join(_FRAMES[a : a + 3]) + bytes(8) for a in range(len(_FRAMES))]


def ros_tcp_wire(mutator):
    """However the stream is damaged and cut: whole frames within the limits, or an error."""
    parser = ros_tcp.RosTcpFrameParser(max_payload=40_000, max_destination=200)
    stream = mutator.bytes(_STREAMS)
    if mutator.chance(0.05):
        stream += frame("/big", bytes(30_000))
    received = 0
    with contextlib.suppress(BridgeError):
        for piece in mutator.cut(stream):
            for destination, payload in parser.feed(piece):
                assert len(destination) <= 200
                assert len(payload) <= 40_000
                received += len(payload)
                with contextlib.suppress(BridgeError):
                    fields = ros_tcp.read_fields(payload)
                    ros_tcp.text_field(fields, "topic")
                    ros_tcp.number_field(fields, "srv_id")
                    ros_tcp.read_handshake(fields)
    assert received <= len(stream)
    return 1


class _Bench(HandGraph):
    """A graph in this thread, with something on it."""

    def __init__(self):
        super().__init__()
        self.publisher = self.graph.advertise("/out", STRING, latched=True)
        self.graph.subscribe("/uav1/cmd_vel", lambda _: None, "geometry_msgs/msg/Twist")
        self.graph.create_service("/do", TRIGGER, lambda _request: Response(True, "done"))
        self.before = self.counts()

    def counts(self):
        used = {t.name for t in self.graph.topics() if t.publishers or t.subscribers}
        return used, set(self.graph.services())


def _step(mutator):
    """A frame: a command with changed fields, a message, or a valid frame with changed bytes."""
    fate = mutator.random.random()
    if fate < 0.5:
        name, fields = mutator.pick(_COMMANDS)
        return f"__{name}", json.dumps(mutator.changed(fields), default=bytes.hex).encode()
    if fate < 0.75:
        name, body = mutator.pick(_BODIES)
        return name, mutator.bytes([body]) if mutator.chance(0.5) else body
    name, fields = mutator.pick(_COMMANDS)
    return f"__{name}", mutator.bytes([json.dumps(fields).encode()])


def _play(mutator, bench, session):
    steps = mutator.random.randrange(1, 12)
    calls = []
    for _ in range(steps):
        session.take(ros_tcp.RosTcpFrame(*_step(mutator)))
        if mutator.chance(0.3):
            bench.publisher.publish(String("x"))
            bench.work_off()
        if mutator.chance(0.1):
            for service in bench.graph.services():
                calls.append(ServiceReply(lambda _: None, lambda _: None))
                bench.graph.call_async(service, None, calls[-1])
    return steps, calls


def _drain(session):
    parser, found = ros_tcp.RosTcpFrameParser(), []
    while parts := session.outbox.gather():
        for part in parts:
            found += parser.feed(part)
    return found


def ros_tcp_endpoint(mutator):
    """A client of ours: nothing it says raises, and nothing of it remains when it has left."""
    bench = _Bench()
    generation = mutator.pick(("ros1", "ros2"))
    session = EndpointSession(bench.gateway, "fuzz", generation, 10, lambda: None)
    steps, calls = _play(mutator, bench, session)
    bench.work_off()
    for destination, payload in _drain(session):
        if destination.startswith("__"):
            json.loads(bytes(payload))
    _leave(bench, session)
    assert all(call.done for call in calls)
    return steps


def ros_tcp_connector(mutator):
    """An endpoint that we connect to."""
    bench = _Bench()
    session = UnitySession(bench.gateway, "fuzz", Selection(), 10, lambda _: None, lambda: None)
    if mutator.chance(0.8):
        session.begin(mutator.pick(("ros1", "ros2")))
    steps = 0
    with contextlib.suppress(BridgeError):  # a handshake without sense ends the connection
        steps, _ = _play(mutator, bench, session)
        session.refresh()
    bench.work_off()
    _drain(session)
    _leave(bench, session)
    return max(steps, 1)


def _leave(bench, session):
    session.close()
    bench.work_off()
    assert bench.counts() == bench.before
    assert not bench.gateway.sessions()


def _link_seeds():
    rng = np.random.default_rng(3)
    found = []
    for kind, payload in PAYLOADS.items():
        for _ in range(3):
            message = filled(payload.msgtype, rng)
            found.append((int(kind), encode_payload(kind, message, "laser/horizontal/scan")))
    pose = m.Pose(m.Point(1.0, 2.0, 3.0), m.Quaternion(0.0, 0.0, 0.0, 1.0))
    for kind in (sensor_link.SensorLinkKind.POSE_COMMAND, sensor_link.SensorLinkKind.GOAL_POSE):
        stamped = m.PoseStamped(m.header(7, "map"), pose)
        found.append((int(kind), encode_payload(kind, stamped)))
    return found


_PAYLOADS = _link_seeds()
_LINK_FRAMES = [
    sensor_link.encode_frame(kind, uav, k, 1000 * k, payload)
    for k, (kind, payload) in enumerate(_PAYLOADS)
    for uav in (1, 2)
]
_LINK_STREAMS = [b"".join(_LINK_FRAMES[a : a + 3]) for a in range(len(_LINK_FRAMES))]


def sensor_link_wire(mutator):
    """Every byte is part of a frame, noise, or awaits the rest."""
    parser = sensor_link.SensorLinkParser(4096 if mutator.chance(0.5) else 1 << 20)
    stream = mutator.bytes(_LINK_STREAMS)
    size = 0
    frames = [one for piece in mutator.cut(stream) for one in parser.feed(piece)]
    frames += parser.finish()
    for one in frames:
        again = sensor_link.encode_frame(one.kind, one.uav, one.sequence, one.stamp_ns, one.payload)
        assert again in stream
        size += len(again)
    assert size + parser.noise_bytes == len(stream)
    assert parser.waiting_bytes == 0
    return 1


def sensor_link_payloads(mutator):
    """Payloads behind a right checksum: a message that fits CDR, or an error."""
    kind, seed = mutator.pick(_PAYLOADS)
    payload = mutator.bytes([seed])
    if mutator.chance(0.05):
        kind = mutator.random.randrange(256)
    stamp_ns = mutator.pick((0, 1, 10**18, -1, (1 << 63) - 1, -(1 << 63), 2**31 * 10**9))
    decode_notice(payload)
    try:
        _, message = decode_payload(kind, payload, stamp_ns)
    except BridgeError:
        return 1
    encode_cdr(message, PAYLOADS[sensor_link.SensorLinkKind(kind)].msgtype)
    return 1


class _Link:
    """A graph with a UAV, and a client that sends poses."""

    def __init__(self):
        self.hand = HandGraph()
        self.hand.graph.advertise("/uav1/odom", m.Odometry)
        self.session = self.hand.gateway.open("fuzz")
        self.commands = SensorLinkCommands(self.session)


def sensor_link_commands(mutator):
    """Frames to the environment: poses that are published, or an error for their sender."""
    link = _Link()
    steps = mutator.random.randrange(1, 6)
    for _ in range(steps):
        kind, seed = mutator.pick(_PAYLOADS)
        uav = mutator.pick((0, 1, 1, 1, 2, 65535))
        with contextlib.suppress(BridgeError):
            link.commands.take(
                sensor_link.SensorLinkFrame(kind, uav, 0, 5, mutator.bytes([seed]))
                if mutator.chance(0.5)
                else sensor_link.SensorLinkFrame(mutator.random.randrange(256), uav, 0, 5, seed)
            )
    link.hand.work_off()
    link.session.close()
    assert not link.hand.gateway.sessions()
    return steps
