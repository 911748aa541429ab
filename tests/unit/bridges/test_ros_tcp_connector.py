"""The ROS-TCP connector against our own endpoint on another graph, and against plain sockets."""

from __future__ import annotations

import asyncio
import json
import socket
import struct
import threading

import numpy as np
import pytest
from ros_tcp_client import Loop, cdr_string, frame, ros1_string, until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros_tcp.connector import RosTcpConnector, dial
from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
from volery.core.errors import BridgeError
from volery.graph.messages import String, Twist, Vector3, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TWIST = "geometry_msgs/msg/Twist"
TRIGGER = "std_srvs/srv/Trigger"
Response = message_type(f"{TRIGGER}_Response")
PATIENT = {"handshake_s": 60.0}
"""On a busy machine a handshake may come later than a connector waits for one by itself."""


@pytest.fixture
def here():
    """The simulation's graph, with its bridges."""
    loop = Loop()
    with BridgeHost(loop.gateway) as loop.bridges:
        yield loop
    loop.close()


@pytest.fixture
def there():
    """Somebody else's graph, with an endpoint."""
    loop = Loop()
    with BridgeHost(loop.gateway) as loop.bridges:
        yield loop
    loop.close()


@pytest.fixture
def port(hold_port):
    """A port that is the test's own, without a server yet."""
    return hold_port()


def join(here, there, generation="ros1", port=0, **options):
    endpoint = RosTcpEndpoint(port=port, generation=generation)
    there.bridges.open(endpoint)
    connector = RosTcpConnector(port=endpoint.port, **(PATIENT | options))
    here.bridges.open(connector)
    until(lambda: connector.state == generation)
    return endpoint, connector


def collect(loop, topic, msgtype=STRING):
    seen = []
    loop.do(lambda: loop.graph.subscribe(topic, seen.append, msgtype))
    return seen


def topics(loop):
    return {t.name: t for t in loop.graph.topics()}


@pytest.mark.parametrize("generation", ["ros1", "ros2"])
def test_topics_and_commands_cross(here, there, generation):
    out = here.graph.advertise("/uav1/status", STRING)
    commands = collect(here, "/uav1/cmd_vel", TWIST)
    join(here, there, generation)
    seen = collect(there, "/uav1/status")
    until(lambda: topics(there)["/uav1/status"].publishers == 1)
    here.publish(out, String("flies"))
    until(lambda: seen)
    assert seen[0].message.data == "flies"
    until(lambda: topics(there).get("/uav1/cmd_vel"))
    zero = Vector3(0.0, 0.0, 0.0)
    there.publish(there.graph.advertise("/uav1/cmd_vel", TWIST), Twist(Vector3(1.5, 0, 0), zero))
    until(lambda: commands)
    assert commands[0].message.linear.x == 1.5


def test_topics_that_begin_later_cross_too(here, there):
    join(here, there)
    seen = collect(there, "/late")
    out = here.graph.advertise("/late", STRING)
    until(lambda: topics(there)["/late"].publishers == 1)
    here.publish(out, String("x"))
    until(lambda: seen)


def test_nothing_comes_back(here, there):
    """Commands received are not sent, and what was sent is not received."""
    commands = collect(here, "/uav1/cmd_vel", TWIST)
    out = here.graph.advertise("/uav1/status", STRING)
    own = collect(here, "/uav1/status")
    join(here, there, subscribe=["/uav*/cmd_vel", "/uav*/status"])
    until(lambda: "/uav1/cmd_vel" in topics(there))
    echoes = collect(there, "/uav1/cmd_vel", TWIST)
    zero = Vector3(0.0, 0.0, 0.0)
    command = there.graph.advertise("/uav1/cmd_vel", TWIST)
    for _ in range(5):
        there.publish(command, Twist(zero, zero))
        here.publish(out, String("x"))
    until(lambda: len(commands) == 5)
    late, arrived = here.graph.advertise("/late", STRING), collect(there, "/late")
    until(lambda: topics(there)["/late"].publishers)  # all that is new here is registered by now
    there.publish(command, Twist(zero, zero))
    here.publish(out, String("x"))
    until(lambda: len(commands) == 6)
    here.publish(late, String("behind what would come back"))
    until(lambda: arrived)
    there.publish(command, Twist(zero, zero))
    until(lambda: len(commands) == 7)
    assert len(echoes) == 7
    assert len(commands) == 7
    assert len(own) == 6


def test_only_what_is_selected_crosses(here, there):
    for topic in ("/uav1/odom", "/uav1/camera/image", "/clock"):
        here.graph.advertise(topic, STRING)
    here.graph.create_service("/uav1/land", TRIGGER, lambda _request: Response(True, ""))
    join(here, there, publish=["/uav1/*"], services=[])
    until(lambda: "/uav1/camera/image" in topics(there))
    assert set(topics(there)) == {"/uav1/odom", "/uav1/camera/image"}
    assert not there.graph.services()


@pytest.mark.parametrize("generation", ["ros1", "ros2"])
def test_services_can_be_called_from_there(here, there, generation):
    here.graph.create_service("/uav1/land", TRIGGER, lambda _request: Response(True, "down"))
    join(here, there, generation)
    until(lambda: there.graph.has_service("/uav1/land"))
    answers, failures = [], []
    reply = ServiceReply(answers.append, failures.append)
    there.do(lambda: there.graph.call_async("/uav1/land", None, reply))
    until(lambda: answers)
    assert answers[0].message == "down"


def test_a_call_that_fails_here_fails_there(here, there):
    def broken(_request):
        raise ZeroDivisionError("oh")

    here.graph.create_service("/do", TRIGGER, broken)
    _, connector = join(here, there)
    until(lambda: there.graph.has_service("/do"))
    failures = []
    there.do(lambda: there.graph.call_async("/do", None, ServiceReply(print, failures.append)))
    until(lambda: failures)
    assert any("'/do' failed" in note for note in connector.notes)


def test_latched_messages_stay_latched(here, there):
    here.publish(here.graph.advertise("/map", STRING, latched=True), String("kept"))
    join(here, there)
    until(lambda: "/map" in topics(there) and topics(there)["/map"].messages)
    there.do(lambda: None)
    seen = collect(there, "/map")
    there.do(lambda: None)
    until(lambda: seen)
    assert seen[0].message.data == "kept"


def test_it_connects_again_and_registers_again(here, there, port):
    out = here.graph.advertise("/uav1/status", STRING)
    endpoint, connector = join(here, there, port=port)
    until(lambda: "/uav1/status" in topics(there))
    there.bridges.call(endpoint.stop())
    until(lambda: connector.state == "not connected")
    assert not here.gateway.sessions()
    there.bridges.open(RosTcpEndpoint(port=port))
    until(lambda: connector.state == "ros1")
    seen = collect(there, "/uav1/status")
    until(lambda: topics(there)["/uav1/status"].publishers == 1)
    here.publish(out, String("again"))
    until(lambda: seen)
    assert any("has disconnected" in note for note in connector.notes)


def test_it_may_start_before_the_endpoint(here, there, port):
    connector = RosTcpConnector(port=port, **PATIENT)
    here.bridges.open(connector)
    until(lambda: connector.notes)
    assert "cannot connect" in connector.notes[0]
    assert "not connected" in connector.name
    there.bridges.open(RosTcpEndpoint(port=port))
    until(lambda: connector.state == "ros1")


def test_connections_are_reported(here, there, port):
    reports = []
    connector = RosTcpConnector(port=port, report=reports.append, **PATIENT)
    here.bridges.open(connector)
    target = f"ROS-TCP to 127.0.0.1:{port}"
    until(lambda: len(reports) == 1)
    assert reports[0].startswith(f"{target}: cannot connect: ")
    assert reports[0].endswith("; retrying until an endpoint answers")
    endpoint = RosTcpEndpoint(port=port, generation="ros2")
    there.bridges.open(endpoint)
    until(lambda: len(reports) == 2)
    assert reports[1] == f"{target}: connected, messages of ROS 2"
    there.bridges.call(endpoint.stop())
    until(lambda: len(reports) >= 3)
    assert "the connection has ended" in reports[2]
    there.bridges.open(RosTcpEndpoint(port=port))
    until(lambda: reports[-1] == f"{target}: connected again, messages of ROS 1")


def test_opening_waits_for_an_endpoint_that_is_there(here, there, monkeypatch):
    monkeypatch.setattr("volery.bridges.ros_tcp.connector._FIRST_ATTEMPT_S", 60.0)
    endpoint = RosTcpEndpoint(port=0)
    there.bridges.open(endpoint)
    connector = RosTcpConnector(port=endpoint.port, **PATIENT)
    here.bridges.open(connector)
    assert connector.name == f"ROS-TCP to 127.0.0.1:{endpoint.port} (ros1)"


def test_large_messages_cross(here, there):
    from volery.graph.messages import header

    msgtype = "sensor_msgs/msg/Image"
    data = np.arange(8 << 20, dtype=np.uint8)
    image = message_type(msgtype)(header(5, "c"), 1, len(data), "mono8", 0, len(data), data)
    out = here.graph.advertise("/image", msgtype)
    join(here, there)
    seen = collect(there, "/image", msgtype)
    until(lambda: topics(there)["/image"].publishers == 1)
    here.publish(out, image)
    until(lambda: seen)
    assert np.array_equal(seen[0].message.data, data)


class PlainEndpoint:
    """An endpoint that sends what the test sends, and stores what it receives."""

    def __init__(self, *greeting):
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        self.frames = []
        self.sock = None
        self._greeting = b"".join(greeting)
        threading.Thread(target=self._run, daemon=True).start()

    def commands(self, name):
        return [
            json.loads(payload.rstrip(b"\0"))
            for destination, payload in tuple(self.frames)
            if destination == f"__{name}"
        ]

    def close(self):
        self.server.close()
        if self.sock is not None:
            self.sock.close()

    def _run(self):
        self.sock, _ = self.server.accept()
        self.sock.sendall(self._greeting)
        file = self.sock.makefile("rb")
        while True:
            parts = []
            for _ in range(2):
                length = file.read(4)
                if len(length) < 4:
                    return
                parts.append(file.read(struct.unpack("<I", length)[0]))
            self.frames.append((parts[0].decode(), parts[1]))


def handshake(metadata):
    return frame("__handshake", json.dumps({"version": "v0.7.0", "metadata": metadata}).encode())


@pytest.fixture
def meet(here):
    endpoints = []

    def meet(*greeting, **options):
        endpoint = PlainEndpoint(*greeting)
        endpoints.append(endpoint)
        connector = RosTcpConnector(port=endpoint.port, **(PATIENT | options))
        here.bridges.open(connector)
        return endpoint, connector

    yield meet
    for endpoint in endpoints:
        endpoint.close()


@pytest.mark.parametrize(("generation", "ending"), [("ROS1", b"}"), ("ROS2", b"\0")])
def test_it_speaks_as_unity_does(here, meet, generation, ending):
    here.graph.advertise("/out", STRING, latched=True)
    collect(here, "/uav1/cmd_vel", TWIST)
    here.graph.create_service("/do", TRIGGER, lambda _request: Response(True, ""))
    endpoint, _ = meet(handshake(json.dumps({"protocol": generation})))
    until(lambda: endpoint.commands("unity_service"))
    assert endpoint.frames[0] == ("", b"")
    assert endpoint.frames[1][1].endswith(ending)
    assert endpoint.commands("publish") == [
        {"topic": "/out", "message_name": "std_msgs/String", "queue_size": 10, "latch": True}
    ]
    assert endpoint.commands("subscribe") == [
        {"topic": "/uav1/cmd_vel", "message_name": "geometry_msgs/Twist"}
    ]
    assert endpoint.commands("unity_service") == [
        {"topic": "/do", "message_name": "std_srvs/Trigger"}
    ]


def test_an_old_endpoint_without_handshake_is_one_of_ros_1(here, meet):
    out = here.graph.advertise("/out", STRING)
    endpoint, connector = meet(handshake_s=0.2)
    until(lambda: endpoint.commands("publish"))
    here.publish(out, String("x"))
    until(lambda: ("/out", ros1_string("x")) in endpoint.frames)
    assert any("no handshake" in note for note in connector.notes)


def test_what_the_endpoint_cannot_take_is_sent_once(here, meet):
    out = here.graph.advertise("/out", STRING)
    endpoint, _ = meet(handshake('{"protocol": "ROS1"}'))
    until(lambda: endpoint.commands("publish"))
    here.publish(out, String("x"))
    until(lambda: ("/out", ros1_string("x")) in endpoint.frames)
    text = "Not registered to publish topic '/out'! Valid publish topics are: dict_keys([]) "
    endpoint.sock.sendall(frame("__error", json.dumps({"text": text}).encode()))
    until(lambda: not here.gateway.sessions()[0].queues)


def test_types_that_the_endpoint_does_not_know_are_named_once(here, meet):
    for name in ("/maps/one", "/maps/two"):
        here.graph.advertise(name, "octomap_msgs/msg/Octomap")
    here.graph.advertise("/out", STRING)
    reports = []
    endpoint, _ = meet(handshake('{"protocol": "ROS1"}'), report=reports.append)
    until(lambda: len(endpoint.commands("publish")) == 3)
    text = "SysCommand.publish - Unknown message class 'octomap_msgs/Octomap'"
    for _ in range(2):
        endpoint.sock.sendall(frame("__error", json.dumps({"text": text}).encode()))
    until(lambda: len(reports) == 2)
    assert reports[1].endswith(
        ": the endpoint lacks octomap_msgs/Octomap, which /maps/one, /maps/two need: not "
        "shared; install the package octomap_msgs where the endpoint runs"
    )
    assert {m.topic for m in here.gateway.sessions()[0].queues} == {"/out"}
    here.graph.advertise("/maps/three", "octomap_msgs/msg/Octomap")
    until(lambda: len(reports) == 3)
    assert "'/maps/three' is not shared" in reports[2]
    assert len(endpoint.commands("publish")) == 3


def test_keepalives_each_idle_second(here, meet):
    endpoint, _ = meet(handshake('{"protocol": "ROS1"}'))
    until(lambda: endpoint.frames.count(("", b"")) >= 3)


def test_the_endpoints_words_are_kept_and_nonsense_is_survived(here, meet):
    seen = collect(here, "/uav1/cmd_vel", TWIST)
    endpoint, connector = meet(
        handshake('{"protocol": "ROS2"}'),
        frame("__error", b'{"text": "Unknown message class"}'),
        frame("/nobody/asked", b"x"),
        frame("__request", b"{bad"),
        frame("__new_command", b"{}"),
    )
    until(lambda: endpoint.commands("subscribe"))
    endpoint.sock.sendall(frame("/uav1/cmd_vel", cdr_string("no twist")))
    endpoint.sock.sendall(frame("/uav1/cmd_vel", b"\0\1\0\0" + struct.pack("<6d", *range(6))))
    until(lambda: seen)
    assert seen[0].message.angular.z == 5.0
    text = "\n".join(connector.notes)
    for words in (
        "Unknown message class",
        "not subscribed",
        "invalid JSON",
        "geometry_msgs/msg/Twist",
    ):
        assert words in text


@pytest.mark.parametrize("metadata", ["{bad", '{"protocol": "ROS3"}', "[]", '{"protocol": 1}'])
def test_a_handshake_without_sense_ends_the_connection(meet, metadata):
    _, connector = meet(handshake(metadata))
    until(lambda: any("neither ROS1 nor ROS2" in note for note in connector.notes))
    until(lambda: connector.state == "not connected")


def test_a_port_must_be_one():
    with pytest.raises(BridgeError, match="port"):
        RosTcpConnector(port=0)


def test_whenever_it_is_stopped_a_connector_ends():
    """Also in the moment in which the connection comes about."""

    async def stop_after(turns, port):
        connecting = asyncio.create_task(dial("127.0.0.1", port))
        for _ in range(turns):
            await asyncio.sleep(0)
        stopped = connecting.cancel()
        (outcome,) = await asyncio.gather(connecting, return_exceptions=True)
        if isinstance(outcome, socket.socket):
            outcome.close()
        assert stopped == connecting.cancelled()
        return stopped

    async def stop_at_every_turn(port):
        turns = 0
        while await stop_after(turns, port):
            turns += 1
        return turns

    with socket.create_server(("127.0.0.1", 0), backlog=64) as listener:
        assert asyncio.run(stop_at_every_turn(listener.getsockname()[1])) > 2
